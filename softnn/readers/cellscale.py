"""CellScale UniVert: `SetName,Cycle,Time_S,Size_mm,Displacement_mm,Force_N`.

Cycles are named `1-Compress`, `1-Hold`, `1-Recover` or `1-Stretch`: in compression,
displacement and force count positive, so both change sign. `Size` is the distance of
the grips, its first value the specimen's length. A file may hold several sets.
"""

from __future__ import annotations

from dataclasses import replace

from softnn.contracts import InputError
from softnn.readers.assemble import recordings
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.readers.table import Table, find_tables
from softnn.recording import Recording

NAME = "CellScale UniVert"


def recognises(source: Source) -> bool:
    return source.is_text and {"set name", "cycle", "size mm"} <= source.names


def read(source: Source, options: ReadOptions) -> list[Recording]:
    tables = find_tables(source.sheets[0].grid, source.path)
    parts = [part for table in tables for part in _sets(table)]
    found: list[Recording] = []
    for part in parts:
        cycle = next(i for i, c in enumerate(part.columns) if c.plain == "cycle")
        cycles = " ".join({str(c).casefold() for c in part.cells(cycle)})
        compressed, stretched = "compress" in cycles, "stretch" in cycles
        if compressed and stretched:
            raise InputError(
                "compresses and stretches in one set, so the sign of its force is "
                "open; split it",
                file=source.path,
            )
        rules = Rules(NAME, compression=compressed, geometry=_size(part))
        found += recordings([part], rules, options, source.path)
    return found


def _sets(table: Table) -> list[Table]:
    names = [c.plain for c in table.columns]
    if not {"set name", "cycle"} <= set(names):
        return [table]
    sets = table.cells(names.index("set name"))
    parts = []
    for name in dict.fromkeys(sets):  # in the order they come
        keep = [k for k, s in enumerate(sets) if s == name]
        rows = [table.rows[k] for k in keep]
        place = {k: i for i, k in enumerate(keep)}
        short = tuple((place[k], n) for k, n in table.short if k in place)
        parts.append(
            replace(
                table, rows=rows, lines=table.lines[keep], label=str(name), short=short
            )
        )
    return parts


def _size(table: Table) -> dict[str, float]:
    for i, column in enumerate(table.columns):
        if column.plain == "size" and column.unit == "mm":
            try:
                length = float(table.cells(i)[0])
            except ValueError:
                return {}
            return {"length_mm": length} if length > 0 else {}
    return {}
