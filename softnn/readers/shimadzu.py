"""Shimadzu Trapezium: raw data as CSV, one specimen or several side by side.

A row of specimen names, each over its first column, a row of quoted names (`Time`,
`Force`, `Stroke`, in the language of the computer), a row of bare units (`sec`, `N`,
`mm`). Side by side, the shorter specimens end in empty cells.
"""

from __future__ import annotations

from softnn.readers.assemble import read_source
from softnn.readers.columns import is_number
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Grid, Source
from softnn.readers.units import parse_unit
from softnn.readers.vocabulary import plain, rank
from softnn.recording import Recording

NAME = "Shimadzu Trapezium"


def recognises(source: Source) -> bool:
    if not source.is_text:
        return False
    # a file may begin with the names, without a row of specimens above
    rows = [[], *(row for row in source.top if any(row))]
    return any(_is_header(rows[i : i + 4]) for i in range(min(len(rows) - 3, 12)))


def _is_header(rows: Grid) -> bool:
    title, names, units, values = ([str(c) for c in row] for row in rows)
    plain_names = [plain(c) for c in names if c]
    stroke = any(
        n.split()[0] in ("stroke", "disp", "\u30b9\u30c8\u30ed\u30fc\u30af")
        for n in plain_names
        if n
    )
    clocks = [k for k, n in enumerate(names) if n and rank("time", plain(n)) == 0]
    return bool(
        stroke
        and clocks
        and len(names) == len([c for c in units if c])
        and all(parse_unit(c) for c in units)
        and not any("(" in c for c in units)
        # the titles stand over the first columns of their specimens, nowhere else
        and {k for k, c in enumerate(title) if c} <= set(clocks)
        and is_number(values[clocks[0]] if clocks[0] < len(values) else "")
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    return read_source(source, Rules(NAME), options)
