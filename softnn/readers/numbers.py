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

    Raises `InputError`, with the row, for a cell that is no number; with `skip_bad`,
    only where more than a twentieth are none: those would be no gaps but the data.
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
