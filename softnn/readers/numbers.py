"""Cells -> floats: decimal marks, thousands, missing values; never a guess."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from softnn.contracts import Array, InputError
from softnn.readers.source import NUMBER
from softnn.readers.table import Table, is_missing

FEW, MANY = 3, 0.05  # cells that may be passed over, and share of them


def numbers(
    table: Table, index: int, decimal: str, skip_bad: bool = False
) -> tuple[Array, int]:
    """A column as floats, blank as NaN, and how many bad cells were skipped.

    `decimal` "" is the mark that the column itself has.
    Raises `InputError`, with the row, for a cell that is no number; with `skip_bad`,
    only where more than a twentieth are none: those would be no gaps but the data.
    """
    cells = table.cells(index)
    if not any(isinstance(c, str) for c in cells):
        return np.array(cells, dtype=float), 0
    texts = [c if isinstance(c, str) else repr(c) for c in cells]
    decimal = decimal or _own_mark(texts)
    joined = "".join(texts)
    if decimal == "." and not any(mark in joined for mark in ",_"):
        try:
            values = np.array([t or "nan" for t in texts], dtype=float)
        except ValueError:
            pass
        else:
            if not np.isinf(values).any():
                return values, 0
    grouped_have_point = decimal in joined
    values = np.empty(len(texts))
    bad: list[int] = []
    for k, text in enumerate(texts):
        number = _number(text, decimal, grouped_have_point)
        if number is None:
            bad.append(k)
            number = np.nan
        values[k] = number
    many = len(bad) > max(FEW, MANY * len(texts))
    if bad and (many or not skip_bad):
        mark = "comma" if decimal == "," else "point"
        first = bad[0]
        told = f"{texts[first][:40]!r} is not a number with a decimal {mark}"
        if many:
            told += (
                f", nor are {len(bad) - 1} more of {len(texts)} cells, too many to "
                "pass over; export the column as numbers, or name another column"
            )
        else:
            told += "; repair it, or read such cells as missing with --skip-bad-cells"
        raise InputError(
            told,
            file=table.where,
            row=int(table.lines[first]),
            column=table.columns[index].name,
        )
    return values, len(bad)


def _number(text: str, decimal: str, needs_mark: bool) -> float | None:
    if is_missing(text):
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
        number = float(text.replace(decimal, "."))
    except ValueError:
        return None
    return number


def _own_mark(texts: Sequence[str]) -> str:
    """The decimal mark of one column, in a file that has both."""
    return "," if any("," in t and "." not in t for t in texts) else "."


def _by_column(tables: Sequence[Table]) -> bool:
    """Whether each column has one mark: a part of them was pasted from elsewhere."""
    lone = re.compile(r"[-+]?\d*([.,])\d+([eE][-+]?\d+)?")
    for table in tables:
        for i in range(len(table.columns)):
            texts = [c for c in table.cells(i) if isinstance(c, str) and c]
            marks = {m[1] for t in texts if (m := lone.fullmatch(t))}
            if len(marks) > 1 or any("," in t and "." in t for t in texts):
                return False
            # Commas alone, always before three digits, may part thousands.
            if marks == {","} and all(
                re.fullmatch(r"[-+]?[1-9]\d{0,2},\d{3}|[-+]?\d+", t) for t in texts
            ):
                return False
    return True


def _change(tables: Sequence[Table]) -> str:
    """Where a column with one mark has the first cell with the other."""
    lone = re.compile(r"[-+]?\d*([.,])\d+([eE][-+]?\d+)?")
    for table in tables:
        for i, column in enumerate(table.columns):
            first = ""
            for k, cell in enumerate(table.cells(i)):
                match = lone.fullmatch(cell) if isinstance(cell, str) else None
                if match is None:
                    continue
                first = first or match[1]
                if match[1] != first:
                    return (
                        f", in column {column.name!r} from row {int(table.lines[k])} "
                        f"({str(cell)[:20]!r}) on; write all of it with one mark there"
                    )
    return ""


_GROUPED = {m: re.compile(rf"[-+]?[1-9]\d{{0,2}}(\{m}\d{{3}})+") for m in ",."}


def _thousands(table: Table, index: int, mark: str) -> str:
    """A cell in which a mark can only part thousands, "" where there is none.

    It stands in a column of whole numbers of three digits and more, where no other
    cell has that mark.
    """
    other = "." if mark == "," else ","
    first, large = "", False
    for text in table.cells(index):
        if not isinstance(text, str):
            continue
        head = text.partition(other)[0]
        if mark in text:
            if not _GROUPED[mark].fullmatch(head):
                return ""
            first = first or text
        elif len(head.strip("+-")) == 3 and NUMBER.fullmatch(text):
            large = True
    return first if large else ""


def decimal_mark(tables: Sequence[Table], file: Path) -> str:
    """The decimal mark of a file: the one its numbers show.

    "" where each column has its own. Both in one column are refused, and so are marks
    that may part thousands where no other column tells.
    """
    parts = {
        mark: [t for table in tables for i in range(len(table.columns))
               if (t := _thousands(table, i, mark))]
        for mark in ",."
    }  # fmt: skip
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
    for mark, decimal, count in ((".", ",", comma), (",", ".", point)):
        if parts[mark] and count:
            return decimal
    if parts["."]:
        raise InputError(
            f"{parts['.'][0]!r} stands among whole numbers of three digits: do points "
            "part thousands there? Say which mark is the decimal one with --decimal , "
            "or --decimal .",
            file=file,
        )
    if comma and point:
        # One mark in a handful of cells among thousands: damage, found when read.
        if min(comma, point) * 20 > max(comma, point):
            if _by_column(tables):
                return ""
            raise InputError(
                f"decimal points and decimal commas are mixed{_change(tables)}; if one "
                "of them parts thousands, say which is the decimal mark with "
                "--decimal . or --decimal ,",
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
