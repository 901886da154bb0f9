"""Zwick testXpert: .TRA and .TXT exports, and .XLSX workbooks, in any language.

Text: quoted keys with a value and a quoted unit, then quoted names and quoted units
over bare numbers; comma, semicolon or tab. Workbook: a `Results` sheet with a row a
specimen (a0 thickness, b0 width, S0 section), and a `Values` sheet a specimen.
Standard travel is what belongs to the gauge length of the header; the absolute
crosshead is taken only when nothing else is there. Time begins where recording does.
"""

from __future__ import annotations

import re
from dataclasses import replace

from softnn.readers.assemble import recordings
from softnn.readers.header import Entry, header_geometry
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Grid, Source
from softnn.readers.table import Table, find_tables
from softnn.readers.units import repair
from softnn.readers.vocabulary import SPECIMEN, plain
from softnn.recording import Recording

NAME = "Zwick testXpert"
_NAMES = re.compile(
    r"^(standard ?(force|travel|kraft|weg)|(force|course) standard|prufzeit|"
    r"crosshead absolute|traverse absolue|traversenweg absolut|test time|"
    r"(fuerza|recorrido) estandar|(forza|corsa) standard)$"
)
_KEY = re.compile(r'^"[^"\n]+"[,;\t](".*?"|[-+\d.,eE]*)[,;\t]?("[^"\n]*")?\s*$', re.M)


def recognises(source: Source) -> bool:
    named = sum(_NAMES.match(n) is not None for n in source.names)
    if source.is_text:
        return named >= 1 and len(_KEY.findall(repair(source.head[:6000]))) >= 2
    return named >= 1


def read(source: Source, options: ReadOptions) -> list[Recording]:
    tables: list[Table] = []
    results: list[tuple[str, tuple[Entry, ...]]] = []
    for sheet in source.sheets:
        name = sheet.name if not source.is_text else ""
        results += _results(sheet.grid)
        tables += find_tables(sheet.grid, source.path, name)
    if source.is_text:
        return recordings(tables, Rules(NAME), options, source.path)
    return recordings(
        [_with_results(t, results) for t in tables], Rules(NAME), options, source.path
    )


def _results(grid: Grid) -> list[tuple[str, tuple[Entry, ...]]]:
    """Header entries by specimen, from a results sheet: names, units, a row each."""
    for i, row in enumerate(grid[:20]):
        at = next(
            (k for k, c in enumerate(row) if SPECIMEN.search(plain(str(c)))), None
        )
        if at is None or i + 2 >= len(grid):
            continue
        units = grid[i + 1]
        found = []
        for values in grid[i + 2 :]:
            if at >= len(values) or values[at] == "":
                continue
            header = tuple(
                Entry(str(key), str(value), str(units[k]) if k < len(units) else "")
                for k, (key, value) in enumerate(zip(row, values, strict=False))
                if key != ""
            )
            found.append((str(values[at]), header))
        return found
    return []


def _with_results(table: Table, results: list[tuple[str, tuple[Entry, ...]]]) -> Table:
    for specimen, header in results:
        if re.search(rf"(^|\s){re.escape(specimen)}$", table.sheet) or (
            table.label == specimen
        ):
            label = header_geometry(header).specimen or specimen
            return replace(table, header=table.header + header, label=label)
    return table
