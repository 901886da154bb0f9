"""Find the tables in a grid of cells: header lines, names, units, rows of numbers."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from softnn.contracts import Array, InputError
from softnn.readers.columns import Column, is_number, split_name
from softnn.readers.header import Entry, entries
from softnn.readers.source import Cell, Grid
from softnn.readers.units import parse_unit, unit_text
from softnn.readers.vocabulary import plain, rank


@dataclass(frozen=True)
class Table:
    """One block of numbers. `lines[i]` is the file's line of row i, from 1."""

    file: Path
    columns: tuple[Column, ...]
    rows: list[list[Cell]] = field(repr=False)
    lines: Array = field(repr=False)
    header: tuple[Entry, ...] = ()
    label: str = ""
    sheet: str = ""
    notes: tuple[str, ...] = ()

    @property
    def where(self) -> str:
        return f"{self.file}, sheet {self.sheet!r}" if self.sheet else str(self.file)

    def cells(self, index: int) -> list[Cell]:
        return [row[index] if index < len(row) else "" for row in self.rows]


def _filled(row: Sequence[Cell]) -> list[Cell]:
    return [c for c in row if c != ""]


def _strip_end(row: Sequence[Cell]) -> list[Cell]:
    cells = list(row)
    while cells and cells[-1] == "":
        cells.pop()
    return cells


def _is_data(row: Sequence[Cell]) -> bool:
    filled = _filled(row)
    numbers = sum(map(is_number, filled))
    return numbers >= 2 and 2 * numbers >= len(filled)


def _is_units(row: Sequence[Cell]) -> bool:
    """A row below the names: units, bare or in brackets, mostly known ones."""
    filled = [c for c in _filled(row) if isinstance(c, str)]
    if not filled or len(filled) != len(_filled(row)):
        return False
    known = sum(parse_unit(c) is not None for c in filled)
    framed = sum(c[0] + c[-1] in ("()", "[]") for c in filled if c)
    return 2 * known >= len(filled) or framed == len(filled)


def _columns(names: Sequence[Cell], units: Sequence[Cell] | None) -> tuple[Column, ...]:
    if units is None:
        return tuple(split_name(str(n)) for n in names)
    pairs = []
    for i, name in enumerate(names):
        unit = str(units[i]) if i < len(units) else ""
        pairs.append(Column(str(name), unit_text(unit) if unit else ""))
    return tuple(pairs)


def find_tables(grid: Grid, file: Path, sheet: str = "") -> list[Table]:
    """Every block of numbers in the grid, each with the lines above it as header.

    In a text file (`sheet` is ""), a row with too few cells is an error, since the
    missing one could be any; but specimens side by side may end one by one.
    """
    ragged = bool(sheet)  # worksheets end rows at the last filled cell
    tables: list[Table] = []
    head: list[int] = []  # filled rows since the last table
    bare = 0  # rows of numbers in a run, without names above them
    i = 0
    while i < len(grid):
        row = grid[i]
        names_at, units_at = (None, None)
        if _is_data(row):
            names_at, units_at = _names_above(grid, head)
        if names_at is None:
            bare = bare + 1 if _is_data(row) and len(_filled(row)) > 1 else 0
            if bare == 5:
                raise InputError(
                    "numbers without column names above them; add a header such as "
                    "time_s,strain,stress_MPa, or mend the row before them",
                    file=file,
                    row=i - 3,
                )
            if _filled(row):
                head.append(i)
            i += 1
            continue
        bare = 0
        names = _strip_end(grid[names_at])
        units = grid[units_at] if units_at is not None else None
        raw = len(grid[names_at])  # with the empty cells of trailing delimiters
        if units is not None and (
            len(_strip_end(units)) > len(names) or (not sheet and len(units) != raw)
        ):
            raise InputError(
                f"{len(units)} units under {raw} column names; repair the header",
                file=file,
                row=names_at + 1,
            )
        end, rows, lines, notes = _block(grid, i, names, file, ragged)
        if not ragged and all(len(r) < raw and r[-1] == "" for r in rows):
            raise InputError(
                f"a column is missing in the rows: {raw} cells in the header, "
                f"{len(rows[0])} in the rows, the last one empty",
                file=file,
                row=i + 1,
            )
        above = [k for k in head if k < names_at]
        label = ""
        if above and above[-1] == names_at - 1 and len(_filled(grid[above[-1]])) == 1:
            label = str(_filled(grid[above[-1]])[0]).strip("# ")
            label = "" if re.search("[:=]", label) else label  # a line of the header
        table = Table(
            file,
            _columns(names, units),
            rows,
            np.array(lines),
            entries([grid[k] for k in above]),
            label,
            sheet,
            notes,
        )
        title = grid[above[-1]] if above and above[-1] == names_at - 1 else []
        tables += _side_by_side(table, title)
        head = []
        i = end
    return tables


def _names_above(grid: Grid, head: list[int]) -> tuple[int | None, int | None]:
    """Rows of names and of units above a block; None where there is none."""
    below = head[-1] if head else None
    if below is None:
        return None, None
    if len(head) > 1 and _is_units(grid[below]) and _is_names(grid[head[-2]]):
        return head[-2], below
    return (below, None) if _is_names(grid[below]) else (None, None)


def _is_names(row: Sequence[Cell]) -> bool:
    filled = _filled(row)
    words = [c for c in filled if isinstance(c, str) and not is_number(c)]
    return len(words) >= 2 and 2 * len(words) > len(filled)


def _block(
    grid: Grid, start: int, names: list[Cell], file: Path, ragged: bool
) -> tuple[int, list[list[Cell]], list[int], tuple[str, ...]]:
    """The rows from `start` on, up to a blank stretch, a footer or the next header."""
    rows: list[list[Cell]] = []
    lines: list[int] = []
    notes: tuple[str, ...] = ()
    probe = next(k for k, c in enumerate(grid[start]) if c != "" and is_number(c))
    i = start
    while i < len(grid):
        row = grid[i]
        # A fast test of one cell; whether all are numbers is asked when they are used.
        if probe < len(row):
            cell = row[probe]
            good = not isinstance(cell, str) or cell[:1] in "-+.,0123456789"
        else:
            good = False
        if not good or (isinstance(row[probe], str) and not row[probe]):
            filled = _filled(row)
            if not filled:
                # Blank rows between rows of the same table: a doubled line end.
                following = next(
                    (k for k in range(i, min(i + 4, len(grid))) if _filled(grid[k])),
                    None,
                )
                if following is not None and _is_data(grid[following]):
                    i = following
                    continue
                break
            if not any(map(is_number, filled)):
                break
            if _is_names(row) or (
                ":" in str(filled[0]) and i + 1 < len(grid) and not _is_data(row)
            ):
                break
        rows.append(row)
        lines.append(i + 1)
        i += 1
    usual, width = len(rows[0]), len(names)
    clocks = _clocks([plain(str(name)) for name in names])
    for k, row in enumerate(rows):
        if len(row) == usual == width:
            continue
        if not ragged and len(row) < usual and row and row[-1] == "":
            # One cell less, made up for by the delimiter every row ends with.
            raise InputError(
                f"{len(row)} cells, the last empty, where other rows have {usual}; "
                "repair the row",
                file=file,
                row=lines[k],
            )
        count = len(_strip_end(row))
        if count > width:
            raise InputError(
                f"{count} values under {width} column names; repair the row",
                file=file,
                row=lines[k],
            )
        if len(row) < width and not (ragged or len(row) in clocks[1:]):
            if k and k == len(rows) - 1:
                rows, lines = rows[:-1], lines[:-1]
                notes = (f"row {i}, the last, is cut off and left out",)
                break
            raise InputError(
                f"{len(row)} values under {width} column names; repair the row",
                file=file,
                row=lines[k],
            )
    if i == len(grid) and len(rows) > 1 and _cut_off(rows):
        rows, lines = rows[:-1], lines[:-1]
        notes = (*notes, f"row {i}, the last, may be cut off and is left out")
    return i, rows, lines, notes


def _cut_off(rows: list[list[Cell]]) -> bool:
    """A last line without a line end whose last value has lost digits."""
    last, *others = (len(str(r[-1])) if r else 0 for r in (rows[-1], *rows[-3:-1]))
    return isinstance(rows[-1][-1], str) and all(last < other for other in others)


def _clocks(names: list[str]) -> list[int]:
    """The columns with the name of the first column of time, that one included."""
    clock = next((n for n in names if rank("time", n) == 0), None)
    return [i for i, n in enumerate(names) if n == clock] if clock else []


def _side_by_side(table: Table, title: Sequence[Cell]) -> list[Table]:
    """Several specimens in one block: cut where the column of time comes again."""
    names = [c.plain for c in table.columns]
    starts = _clocks(names)
    if len(starts) < 2:
        return [table]
    # The group begins as far left of its time as the first one does.
    shift = starts[0] if all(s >= starts[0] for s in starts) else 0
    edges = [s - shift for s in starts] + [len(names)]
    parts = []
    for left, right in itertools.pairwise(edges):
        rows = [row[left:right] for row in table.rows]
        keep = [k for k, row in enumerate(rows) if any(c != "" for c in row)]
        label = next((str(c) for c in title[left:right] if c != ""), "")
        parts.append(
            replace(
                table,
                columns=table.columns[left:right],
                rows=[rows[k] for k in keep],
                lines=table.lines[keep],
                label=label,
                header=() if title and label else table.header,
            )
        )
    return [p for p in parts if p.rows]


def has_role(table: Table, role: str) -> bool:
    """Whether any column may play a role (`vocabulary.ROLES`), units aside."""
    return any(rank(role, c.plain) is not None for c in table.columns)
