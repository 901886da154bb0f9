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
from softnn.readers.source import MAX_COLUMNS, Cell, Grid, quantity
from softnn.readers.units import parse_unit, unit_text
from softnn.readers.vocabulary import WHICH, WHOSE, plain, rank


@dataclass(frozen=True)
class Table:
    """One block of numbers. `lines[i]` is the file's line of row i, from 1.

    `bad` says why lines fit no column. `short` holds rows that lack cells at their end,
    with the number of cells they have; the chosen columns decide whether that matters.
    """

    file: Path
    columns: tuple[Column, ...]
    rows: list[list[Cell]] = field(repr=False)
    lines: Array = field(repr=False)
    header: tuple[Entry, ...] = ()
    label: str = ""
    sheet: str = ""
    notes: tuple[str, ...] = ()
    bad: tuple[tuple[int, str], ...] = ()
    short: tuple[tuple[int, int], ...] = ()

    @property
    def nameless(self) -> bool:
        """Whether its columns have units in place of names."""
        return 3 * sum(bool(bare_unit(c.name)) for c in self.columns) >= max(
            2 * len(self.columns), 6
        )

    @property
    def where(self) -> str:
        return f"{self.file}, sheet {self.sheet!r}" if self.sheet else str(self.file)

    def cells(self, index: int) -> list[Cell]:
        return [row[index] if index < len(row) else "" for row in self.rows]

    def filled(self, index: int) -> bool:
        """Whether a column holds anything."""
        return any(not is_missing(c) for c in self.cells(index))

    def constants(self) -> list[Entry]:
        """Columns of one number throughout, as lines of a header: a width, an area."""
        found = []
        first, last = (self.rows[0], self.rows[-1]) if self.rows else ([], [])
        for i, column in enumerate(self.columns[: len(first)]):
            if not column.name or (i < len(last) and last[i] not in (first[i], "")):
                continue  # it moves; so do most
            cells = {c for c in self.cells(i) if c != ""}
            if len(cells) == 1 and is_number(one := cells.pop()):
                found.append(Entry(column.name, str(one), column.unit))
        return found


COMMAS = (
    ", or, if commas are the decimal marks, export with semicolons between the columns"
)
MISSING = ("nan", "-", "--", "---", "n/a", "na", "#n/a", "#n/v", "null", "none")


def is_missing(cell: Cell) -> bool:
    """Whether a cell stands for a value that is not there.

    >>> is_missing(""), is_missing("N/A"), is_missing("0"), is_missing(float("nan"))
    (True, True, False, True)
    """
    if isinstance(cell, str):
        return cell == "" or cell.casefold() in MISSING or not cell.strip("-")
    return cell != cell


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
    # `Interval and data points: 1 451` counts rows and is none.
    told = isinstance(filled[0], str) and filled[0].endswith(":") if filled else False
    return numbers >= 2 and 2 * numbers >= len(filled) and not told


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
        if len(names) > 2 and all(parse_unit(str(n)) for n in names):
            names = [f"[{n}]" for n in names]
        only = [bare_unit(str(n)) for n in names]
        if len(only) > 2 and 3 * sum(map(bool, only)) >= 2 * len(only):
            return tuple(Column(str(n), u) for n, u in zip(names, only, strict=True))
        return tuple(split_name(str(n)) for n in names)
    pairs = []
    for i, name in enumerate(names):
        unit = str(units[i]) if i < len(units) else ""
        pairs.append(Column(str(name), unit_text(unit) if unit else ""))
    return tuple(pairs)


def bare_unit(text: str) -> str:
    """The unit in a name that is nothing else, "" for any other name.

    >>> bare_unit("[N/mm**2]"), bare_unit("[%-ext]"), bare_unit("Force"), bare_unit("s")
    ('N/mm2', '%', '', '')
    """
    text = text.strip()
    if not text or (text[0] + text[-1] not in ("[]", "()") and text[-1] not in "])"):
        return ""
    unit = re.sub(r"^%[-_ ]?[A-Za-z]+$", "%", unit_text(text.strip("[]() ")))
    return unit if parse_unit(unit) else ""


def _usual_width(grid: Grid, i: int) -> int:
    """How many cells the rows from i on have, most of them."""
    widths = [len(_strip_end(row)) for row in grid[i : i + 7] if row and _is_data(row)]
    return max(set(widths), key=lambda w: (widths.count(w), w))


def _fitted(cells: Sequence[Cell], width: int, unitless: bool) -> list[Cell]:
    """Names or units cut into as many cells as the rows have, where they can be.

    Where two delimiters stand between them, more than one space, or the delimiter is
    within a name (`Force, N, Time, s`).
    """
    cells = _strip_end(cells)
    filled = _filled(cells)
    if len(cells) == width or not filled or not any(
        isinstance(c, str) for c in filled
    ):  # fmt: skip
        return cells
    if len(filled) == width:
        return filled
    apart = [part for c in filled for part in re.split(r"\s{2,}|\t", str(c)) if part]
    if len(apart) == width:
        return list(apart)
    merged: list[Cell] = []
    for cell in cells if unitless else []:
        unit = parse_unit(str(cell)) is not None and not is_number(cell)
        if unit and merged and not split_name(str(merged[-1])).unit:
            merged[-1] = f"{merged[-1]} [{unit_text(str(cell))}]"
        else:
            merged.append(cell)
    return merged if len(merged) == width else cells


_MARKER = re.compile(
    r"^\s*([<\[{(].*[>\]})]|[\W_]*|[\W_]*((begin|start|end) )?(of )?"
    r"((raw|test|measured|measurement|experimental|export(ed)?|channel|sensor) )*"
    r"(data|values?|table|results?|recordings?|samples?|points|readings?|curves?|"
    r"messwerte|daten|donnees|datos|dati|dane)[\W_]*)\s*$",
    re.I,
)


def find_tables(grid: Grid, file: Path, sheet: str = "") -> list[Table]:
    """Every block of numbers in the grid, each with the lines above it as header.

    Rows with too many or too few cells are told in the table (`bad`, `short`).
    """
    ragged = bool(sheet)  # worksheets end rows at the last filled cell
    grid, cell_units = without_units(grid, file, sheet)
    where = f"{file}, sheet {sheet!r}" if sheet else file
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
            known = tables and len(_filled(row)) != len(tables[-1].columns)
            if bare == 5 and not known:
                raise InputError(
                    "numbers without column names above them; add a header such as "
                    "time_s,strain,stress_MPa, or mend the row before them",
                    file=where,
                    row=i - 3,
                )
            if _filled(row):
                head.append(i)
            i += 1
            continue
        bare = 0
        usual = _usual_width(grid, i)
        units = grid[units_at] if units_at is not None else None
        names = _fitted(grid[names_at], usual, units is None)
        if usual < len(names) and names[usual] == "":
            names = names[:usual]  # beside an empty column stand results
        raw = len(grid[names_at])  # with the empty cells of trailing delimiters
        if len(names) != len(_strip_end(grid[names_at])):
            raw = len(names)
            units = None if units is None else _fitted(units, usual, False)
        if len(_strip_end(row)) > len(names) and usual <= len(names):
            following = grid[i + 1] if i + 1 < len(grid) else []
            if not _is_data(following):
                head.append(i)  # a line that counts or sums up
                i += 1
                continue
        if usual > len(names):
            if not _is_data(grid[i + 1] if i + 1 < len(grid) else []):
                head.append(i)
                i += 1
                continue
            raise InputError(
                f"{usual} values under {len(names)} column names "
                f"({', '.join(str(n) for n in names)[:80]}); name every column there"
                + COMMAS
                * (usual == 2 * len(names)),
                file=file,
                row=names_at + 1,
            )
        if units is not None and (
            len(_strip_end(units)) > len(names) or (not sheet and len(units) != raw)
        ):
            raise InputError(
                f"{len(units)} units under {raw} column names; repair the header",
                file=file,
                row=names_at + 1,
            )
        block = _block(grid, i, names, ragged)
        rows, lines = block.rows, block.lines
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
            # A line of the header, or a marker of the format, names no specimen.
            label = "" if re.search("[:=]", label) or _MARKER.search(label) else label
        columns, told = _with_units(_columns(names, units), cell_units)
        table = Table(
            file,
            columns,
            rows,
            np.array(lines),
            entries([grid[k] for k in above]),
            label,
            sheet,
            (*told, *block.notes),
            tuple(block.bad),
            tuple(block.short),
        )
        title = grid[above[-1]] if above and above[-1] == names_at - 1 else []
        tables += _side_by_side(table, title)
        head = []
        i = block.end
    if tables and head:
        text = " ".join(map(str, _filled(grid[head[0]])))[:40]
        note = (
            f"{len(head)} lines after the data, from row {head[0] + 1} on ({text!r}), "
            "are left out"
        )
        tables[-1] = replace(tables[-1], notes=(*tables[-1].notes, note))
    return tables


MOST_HAVE = 0.8  # of the filled cells below the first with a unit, in a column of such


def without_units(
    grid: Grid, file: Path, sheet: str = ""
) -> tuple[Grid, dict[int, str]]:
    """The grid with plain numbers for `12.3 N`, and the unit of each such column.

    Raises `InputError` where the unit changes down a column.
    """
    hits: dict[int, int] = {}
    for row in grid[:400]:
        for j, cell in enumerate(row):
            if quantity(cell) is not None:
                hits[j] = hits.get(j, 0) + 1
    units: dict[int, str] = {}
    for j in [j for j, count in hits.items() if count >= 3]:
        found = [
            (i, q)
            for i, row in enumerate(grid)
            if j < len(row) and (q := quantity(row[j])) is not None
        ]
        # Header lines with sizes, and a line that sums up, are no column.
        runs = [k for k in range(len(found) - 2) if found[k + 2][0] == found[k][0] + 2]
        if not runs:
            continue
        found = [(i, q) for i, q in found if i >= found[runs[0]][0]]
        filled = [
            i
            for i in range(found[0][0], len(grid))
            if j < len(grid[i]) and grid[i][j] != ""
        ]
        data = [i for i in filled if len(_filled(grid[i])) > 1]
        if len(found) < MOST_HAVE * len(data) or not _table_like(grid, found[0][0]):
            continue
        unit = found[0][1][1]
        for i, (_, other) in found:
            if unit_text(other) != unit_text(unit):
                raise InputError(
                    f"{str(grid[i][j])[:40]!r} is in {other}, the cells above it in "
                    f"{unit}; write the whole column in one unit",
                    file=f"{file}, sheet {sheet!r}" if sheet else file,
                    row=i + 1,
                    column=_above(grid, found[0][0], j),
                )
        if not units:
            grid = list(grid)
        units[j] = unit
        for i, (number, _) in found:
            grid[i] = [*grid[i][:j], number, *grid[i][j + 1 :]]
    return grid, units


def _table_like(grid: Grid, i: int) -> bool:
    """Whether row i has at least two cells with numbers, with units or without."""
    return sum(is_number(c) or quantity(c) is not None for c in grid[i] if c != "") >= 2


def _above(grid: Grid, i: int, j: int) -> str:
    """The name in column j above row i, or the number of the column."""
    name = str(grid[i - 1][j]) if i and j < len(grid[i - 1]) else ""
    return name or str(j + 1)


def _with_units(
    columns: tuple[Column, ...], units: dict[int, str]
) -> tuple[tuple[Column, ...], list[str]]:
    """The columns with the units of their cells, and notes on those of both."""
    out, notes = list(columns), []
    for j, unit in units.items():
        if j >= len(out):
            continue
        named = parse_unit(out[j].unit)
        if named is not None and named != parse_unit(unit):
            notes.append(
                f"{str(out[j])!r} has cells in {unit}: the unit of the cells counts"
            )
        out[j] = replace(out[j], unit=unit)
    return tuple(out), notes


def upright(grid: Grid) -> Grid | None:
    """The grid with a channel a column, where it has one a row; None where it has not.

    A row of a channel is a name, perhaps a unit, and numbers; the lines above stay.

    >>> upright([["Time (s)", *range(7)], ["Force (N)", *range(7)]])[1:3]
    [[0, 0], [1, 1]]
    """
    if len(grid) > MAX_COLUMNS:
        return None
    kept: list[tuple[Cell, Cell, list[Cell]]] = []
    head: Grid = []
    for row in grid:
        cells = _strip_end(row)
        unit = len(cells) > 1 and isinstance(cells[1], str) and not is_number(cells[1])
        values = cells[1 + unit :]
        if (
            len(_filled(values)) < 5
            or is_number(cells[0])
            or not all(map(is_number, _filled(values)))
        ):
            if not kept:
                head.append(row)
            continue
        kept.append((cells[0], cells[1] if unit else "", values))
    names = [plain(split_name(str(name)).name) for name, *_ in kept]
    if len(names) < 2 or not any(rank("time", name) is not None for name in names):
        return None
    out = [*head, [name for name, *_ in kept]]
    if any(unit for _, unit, _ in kept):
        out.append([unit for _, unit, _ in kept])
    longest = max(len(values) for *_, values in kept)
    return out + [
        [values[k] if k < len(values) else "" for *_, values in kept]
        for k in range(longest)
    ]


def _names_above(grid: Grid, head: list[int]) -> tuple[int | None, int | None]:
    """Rows of names and of units above a block; None where there is none.

    Units may stand in several rows; the row with the most of them counts.
    """
    # Only the last lines: a file without names would be gone through for every row.
    left = [k for k in head[-12:] if not _is_ruler(grid[k])]
    if not left:
        return None, None
    below = left[-1]
    units = []
    while len(left) > 1 and _is_units(grid[left[-1]]):
        units.append(left.pop())
    if units and _is_names(grid[left[-1]]):
        return left[-1], max(units, key=lambda k: _known(grid[k]))
    return (below, None) if _is_names(grid[below]) else (None, None)


def _is_ruler(row: Sequence[Cell]) -> bool:
    """A line drawn of dashes or the like."""
    return all(
        isinstance(c, str) and not re.search(r"[^\W_]|%", c) and len(c) > 1
        for c in _filled(row)
    )


def _known(row: Sequence[Cell]) -> int:
    return sum(parse_unit(str(c)) is not None for c in _filled(row))


def _is_names(row: Sequence[Cell]) -> bool:
    filled = _filled(row)
    words = [c for c in filled if isinstance(c, str) and not is_number(c)]
    return len(words) >= 2 and 2 * len(words) > len(filled)


@dataclass
class _Block:
    """Rows of one table as they are collected."""

    end: int
    rows: list[list[Cell]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    bad: list[tuple[int, str]] = field(default_factory=list)
    short: list[tuple[int, int]] = field(default_factory=list)


def _block(grid: Grid, start: int, names: list[Cell], ragged: bool) -> _Block:
    """The rows from `start` on, up to a blank stretch, a footer or the next header."""
    block = _Block(start)
    rows, lines = block.rows, block.lines
    probe = next(k for k, c in enumerate(grid[start]) if c != "" and is_number(c))
    last = _last_data(grid, probe)
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
                following = _next_filled(grid, i)
                if following is not None and _is_data(grid[following]):
                    i = following
                    continue
                break
            if _is_names(row) or (
                ":" in str(filled[0]) and i + 1 < len(grid) and not _is_data(row)
            ):
                break
            if not any(map(is_number, filled)):
                following = _next_filled(grid, i + 1)
                if following is None or not (
                    _is_data(grid[following])
                    and len(_strip_end(grid[following])) == len(_strip_end(rows[-1]))
                ):
                    break
                text = " ".join(map(str, filled))[:40]
                block.notes.append(f"row {i + 1}, {text!r}, is no data: passed over")
                i = following
                continue
            if i > last and rows:  # sums and means below the data
                text = " ".join(map(str, filled))[:40]
                block.notes.append(
                    f"from row {i + 1} on, {text!r}, no data follow: left out"
                )
                break
        rows.append(row)
        lines.append(i + 1)
        i += 1
    block.end = i
    _check_widths(block, names, ragged)
    _without_sums(block)
    if i == len(grid) and len(rows) > 1 and _cut_off(rows):
        block.rows, block.lines = rows[:-1], lines[:-1]
        block.short = [s for s in block.short if s[0] < len(block.rows)]
        block.notes.append(f"row {i}, the last, may be cut off and is left out")
    return block


_SUMS = re.compile(
    r"^\W*(mean|average|avg|median|std|stdev|std dev|standard deviation|sd|cov|min|max|"
    r"minimum|maximum|sum|total|range|count|mittelwert|standardabweichung|summe|moyenne|"
    r"ecart type|media|promedio|\u5e73\u5747\u503c?)\W*$",
    re.I,
)


def _without_sums(block: _Block) -> None:
    """Leave out last rows that a cell beside the numbers calls a mean or the like."""
    rows, count = block.rows, 0
    while count < min(10, len(rows) - 1) and any(
        isinstance(c, str) and _SUMS.match(c) for c in rows[-1 - count]
    ):
        count += 1
    if count:
        first = block.lines[-count]
        text = " ".join(map(str, _filled(rows[-count])))[:40]
        block.notes.append(f"from row {first} on, {text!r}, no data follow: left out")
        gone = len(rows) - count
        block.rows, block.lines = rows[:gone], block.lines[:gone]
        block.short = [s for s in block.short if s[0] < gone]


def _next_filled(grid: Grid, i: int) -> int | None:
    return next((k for k in range(i, min(i + 4, len(grid))) if _filled(grid[k])), None)


def _last_data(grid: Grid, probe: int) -> int:
    """The last row of the grid with a number where the rows of a block have one."""
    for k in range(len(grid) - 1, -1, -1):
        row = grid[k]
        if probe < len(row) and row[probe] != "" and is_number(row[probe]):
            if _is_data(row):
                return k
    return -1


def _check_widths(block: _Block, names: list[Cell], ragged: bool) -> None:
    """Take out rows that have too many cells; mark those that have too few."""
    usual, width = len(block.rows[0]), len(names)
    clocks = _clocks([plain(str(name)) for name in names])
    rows, lines, short = [], [], []
    for k, row in enumerate(block.rows):
        line = block.lines[k]
        if len(row) == usual == width:
            rows.append(row)
            lines.append(line)
            continue
        count = len(_strip_end(row))
        if not ragged and len(row) < usual and row and row[-1] == "":
            # One cell less, made up for by the delimiter every row ends with.
            told = f"{len(row)} cells, the last empty, where other rows have {usual}"
            block.bad.append((line, told))
        elif count > width:
            block.bad.append((line, f"{count} values under {width} column names"))
        elif len(row) < width and not (ragged or len(row) in clocks[1:]):
            if k and k == len(block.rows) - 1 and len(row) < usual:
                block.notes.append(f"row {line}, the last, is cut off and left out")
                continue
            short.append((len(rows), len(row)))
            rows.append(row)
            lines.append(line)
        else:
            rows.append(row)
            lines.append(line)
    block.rows[:], block.lines[:], block.short = rows, lines, short


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
                short=tuple(
                    (new, len(table.rows[k]) - left)
                    for new, k in enumerate(keep)
                    if left < len(table.rows[k]) < right
                ),
                bad=table.bad if left == 0 else (),
                header=() if title and label else table.header,
            )
        )
    return [p for p in parts if p.rows]


def without_twins(table: Table) -> Table:
    """The table without rows that repeat the row before them, its time included.

    Where rows share a time and differ, the clock is coarse, and all of them stay.
    """
    clock = next((i for i, c in enumerate(table.columns)
                  if rank("time", c.plain) == 0), None)  # fmt: skip
    if clock is None or table.short:
        return table
    times = table.cells(clock)
    same = [k for k in range(1, len(times)) if times[k] == times[k - 1] != ""]
    if not same or any(table.rows[k] != table.rows[k - 1] for k in same):
        return table
    gone = set(same)
    keep = [k for k in range(len(table.rows)) if k not in gone]
    note = f"{len(gone)} rows repeat the row before them and are left out"
    return replace(
        table,
        rows=[table.rows[k] for k in keep],
        lines=table.lines[keep],
        notes=(*table.notes, note),
    )


def without_reserve(table: Table) -> Table:
    """The table without rows of zeros at its end, which a logger had reserved."""
    clock = next((i for i, c in enumerate(table.columns)
                  if rank("time", c.plain) == 0), None)  # fmt: skip
    if clock is None or table.short:
        return table
    keep = len(table.rows)
    while keep > 2 and all(
        _float(c) == 0 for c in table.rows[keep - 1] if is_number(c) and c != ""
    ):
        keep -= 1
    before = _float(table.cells(clock)[keep - 1])
    if keep == len(table.rows) or not before or before <= 0:
        return table
    note = (
        f"{len(table.rows) - keep} rows of zeros at the end, from row "
        f"{int(table.lines[keep])} on, as of reserved space: left out"
    )
    return replace(
        table,
        rows=table.rows[:keep],
        lines=table.lines[:keep],
        notes=(*table.notes, note),
    )


def named_apart(table: Table) -> Table:
    """The table with `Load (2)` for a second column `Load`, so that each has a name."""
    names = [str(c) for c in table.columns]
    if len(set(names)) == len(names):
        return table
    out, count = [], dict[str, int]()
    for name, column in zip(names, table.columns, strict=True):
        count[name] = count.get(name, 0) + 1
        again = count[name] > 1 and column.name
        out.append(
            replace(column, name=f"{column.name} ({count[name]})") if again else column
        )
    return replace(table, columns=tuple(out))


def by_specimen(table: Table) -> list[Table]:
    """Tables of single specimens, where a column says whose each row is.

    A column of tests counts where the clock starts again at each of them.
    """
    for i, column in enumerate(table.columns):
        whose = WHOSE.search(column.plain) is not None
        if not whose and not WHICH.search(column.plain):
            continue
        cells = table.cells(i)
        names = list(dict.fromkeys(c for c in cells if c != ""))
        if not 1 < len(names) <= len(cells) // 5 or (
            not whose and not _starts_again(table, cells)
        ):
            continue
        parts = []
        for name in names:
            keep = [k for k, c in enumerate(cells) if c == name]
            at = {k: new for new, k in enumerate(keep)}
            label = f"{name:g}" if isinstance(name, float) else name
            note = f"rows of {column.name!r} {label} of {len(names)}"
            parts.append(
                replace(
                    table,
                    rows=[table.rows[k] for k in keep],
                    lines=table.lines[keep],
                    label=label,
                    notes=(*table.notes, note),
                    short=tuple((at[k], n) for k, n in table.short if k in at),
                )
            )
        return parts
    return [table]


def _starts_again(table: Table, cells: Sequence[Cell]) -> bool:
    """Whether the clock goes back wherever the cells change."""
    clock = next((i for i, c in enumerate(table.columns)
                  if rank("time", c.plain) is not None), None)  # fmt: skip
    if clock is None:
        return False
    times = table.cells(clock)
    changes = [k for k in range(1, len(cells)) if cells[k] != cells[k - 1]]
    pairs = [(_float(times[k - 1]), _float(times[k])) for k in changes]
    return all(a is not None and b is not None and b < a for a, b in pairs)


def _float(cell: Cell) -> float | None:
    try:
        return float(cell if not isinstance(cell, str) else cell.replace(",", "."))
    except ValueError:
        return None


def has_role(table: Table, role: str) -> bool:
    """Whether any column may play a role (`vocabulary.ROLES`), units aside."""
    return any(rank(role, c.plain) is not None for c in table.columns)
