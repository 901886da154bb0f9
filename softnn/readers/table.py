"""Find the tables in a grid of cells: header lines, names, units, rows of numbers."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from softnn.contracts import Array, InputError
from softnn.readers.source import NUMBER, Cell, Grid
from softnn.readers.units import parse_unit, unit_text
from softnn.readers.vocabulary import plain, rank

_BRACKETS = re.compile(r"^(.*?)\s*[\[(]([^\[\]()]*)[\])]\s*\.?$", re.DOTALL)
_LOOSE = re.compile(r"^(.*\S)(?:\s*/\s*|\s+in\s+|\s*,\s*|_)(\S+)$")


@dataclass(frozen=True)
class Column:
    """A column's name and its unit as written, "" where none is."""

    name: str
    unit: str

    @property
    def plain(self) -> str:
        return plain(self.name)

    def __str__(self) -> str:
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@dataclass(frozen=True)
class Entry:
    """One line of a header: `Specimen width; 6; mm`."""

    key: str
    value: str
    unit: str = ""


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


def is_number(cell: Cell) -> bool:
    """Whether a cell holds a number, in either decimal mark.

    >>> is_number(1.0), is_number("1,5e-05"), is_number("(N)"), is_number("")
    (True, True, False, False)
    """
    return not isinstance(cell, str) or NUMBER.fullmatch(cell) is not None


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


def split_name(text: str) -> Column:
    """A name with its unit: `Force (kN)`, `C_1_Temps[s]`, `Force_N`, `Kraft in N`.

    Loose forms count only when the last word is a unit; brackets always do.

    >>> split_name("Force (kN)"), split_name("Size_mm")
    (Column(name='Force', unit='kN'), Column(name='Size', unit='mm'))
    """
    text = text.strip()
    match = _BRACKETS.match(text)
    if match and match[1].strip():
        return Column(match[1].strip(), match[2].strip() or "-")
    match = _LOOSE.match(text)
    # `Strain_1` is a name with a number, not a strain in units of one.
    if match and parse_unit(match[2]) and not match[2].isdigit():
        return Column(match[1].strip(), match[2])
    return Column(text, "")


def _columns(names: Sequence[Cell], units: Sequence[Cell] | None) -> tuple[Column, ...]:
    if units is None:
        return tuple(split_name(str(n)) for n in names)
    pairs = []
    for i, name in enumerate(names):
        unit = str(units[i]) if i < len(units) else ""
        pairs.append(Column(str(name), unit_text(unit) if unit else ""))
    return tuple(pairs)


def entries(rows: Sequence[Sequence[Cell]]) -> tuple[Entry, ...]:
    """Header lines as key, value, unit, whichever way they are written."""
    found = []
    for row in rows:
        cells = [str(c) for c in row]
        filled = [c for c in cells if c]
        if not filled:
            continue
        key, rest = filled[0], filled[1:]
        if not rest or (
            ":" in key
            and not key.rstrip().endswith(":")
            and len(rest) == 1
            and parse_unit(rest[0])
        ):
            # `Thickness (1): 0.1 mm` in one cell
            if ":" not in key:
                continue
            key, value = key.split(":", 1)
            rest = [value.strip(), *rest]
        key = key.rstrip(": ")
        key = key.rsplit(" : ", 1)[-1]  # Bluehill: `Specimen properties : Width`
        named = split_name(key)
        value, unit = rest[0], rest[1] if len(rest) > 1 else ""
        match = re.fullmatch(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([^\d\s.,].*)", value)
        if match and parse_unit(match[2]):
            value, unit = match[1], match[2]
        if not unit and parse_unit(named.unit):
            key, unit = named.name, named.unit
        found.append(Entry(key, value, unit))
    return tuple(found)


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


def numbers(
    table: Table, index: int, decimal: str, skip_bad: bool = False
) -> tuple[Array, int]:
    """A column as floats, blank as NaN, and how many bad cells were skipped.

    Raises `InputError`, with the row, for a cell that is no number, unless `skip_bad`.
    """
    cells = table.cells(index)
    if not any(isinstance(c, str) for c in cells):
        return np.array(cells, dtype=float), 0
    texts = [c if isinstance(c, str) else repr(c) for c in cells]
    joined = "".join(texts)
    if decimal == "." and not any(mark in joined for mark in ",_"):
        try:
            return np.array([t or "nan" for t in texts], dtype=float), 0
        except ValueError:
            pass
    grouped_have_point = decimal in joined
    values = np.empty(len(texts))
    bad = 0
    for k, text in enumerate(texts):
        number = _number(text, decimal, grouped_have_point)
        if number is None:
            bad += 1
            number = np.nan
            if not skip_bad:
                mark = "comma" if decimal == "," else "point"
                raise InputError(
                    f"{text[:40]!r} is not a number with a decimal {mark}; repair it, "
                    "or read such cells as missing with --skip-bad-cells",
                    file=table.where,
                    row=int(table.lines[k]),
                    column=table.columns[index].name,
                )
        values[k] = number
    return values, bad


def _number(text: str, decimal: str, needs_mark: bool) -> float | None:
    if text == "" or text.casefold() in ("nan", "-", "--", "---", "n/a", "#n/a"):
        return np.nan
    if not NUMBER.fullmatch(text):
        return None
    group = "." if decimal == "," else ","
    if group in text:
        head, mark, tail = text.partition(decimal)
        grouped = re.fullmatch(rf"[-+]?[1-9]\d{{0,2}}(\{group}\d{{3}})+", head)
        # 1,234 where its neighbours have decimals is a damaged 1.234, not 1234.
        if not grouped or (needs_mark and not mark):
            return None
        text = head.replace(group, "") + mark + tail
    try:
        return float(text.replace(decimal, "."))
    except ValueError:
        return None


def decimal_mark(tables: Sequence[Table], file: Path) -> str:
    """The decimal mark of a file: the one its numbers show; both at once is refused."""
    comma = point = grouped = 0
    for table in tables:
        for row in table.rows[:500] + table.rows[-100:]:
            for cell in row:
                if not isinstance(cell, str) or not NUMBER.fullmatch(cell):
                    continue
                if "," in cell and "." in cell:
                    last = max(cell.rfind(","), cell.rfind("."))
                    point += cell[last] == "."
                    comma += cell[last] == ","
                elif cell.count(",") == 1:
                    # 1,234 may be either; 0,123 and 1,23 are not.
                    if re.fullmatch(r"[-+]?[1-9]\d{0,2},\d{3}", cell):
                        grouped += 1
                    else:
                        comma += 1
                elif cell.count(".") == 1:
                    point += 1
    if comma and point:
        # One mark in a handful of cells among thousands: damage, found when read.
        if min(comma, point) * 20 > max(comma, point):
            raise InputError(
                "decimal points and decimal commas are mixed; "
                "say which one holds with --decimal",
                file=file,
            )
        return "," if comma > point else "."
    if comma or point:
        return "," if comma else "."
    if grouped:
        raise InputError(
            "numbers such as 1,234 may have a decimal comma or thousands commas; "
            "say which mark is the decimal one with --decimal",
            file=file,
        )
    return "."


def has_role(table: Table, role: str) -> bool:
    """Whether any column may play a role (`vocabulary.ROLES`), units aside."""
    return any(rank(role, c.plain) is not None for c in table.columns)
