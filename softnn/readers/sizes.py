"""Sizes of single specimens: a table with a row a file, as a lab keeps one.

`specimens.csv` (or .xlsx, .xls) has the columns `file`, `specimen`, `length_mm`,
`width_mm`, `thickness_mm`, `area_mm2`, `diameter_mm`; `Width [cm]` and names in the
languages of the readers will do as well.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from softnn.contracts import InputError, nearest
from softnn.readers.columns import split_name
from softnn.readers.source import open_source
from softnn.readers.units import Unit, parse_unit
from softnn.readers.vocabulary import GEOMETRY, LENGTHS, REMARK, SPECIMEN, WHOSE
from softnn.recording import Geometry

SIZES = ("length_mm", "width_mm", "thickness_mm", "area_mm2", "diameter_mm")
SECTION = ("area_mm2", "width_mm", "thickness_mm", "diameter_mm")
TABLE = ("file", "specimen", *SIZES)
NAMES = ("specimens.csv", "specimens.xlsx", "specimens.xls")
FILE = ("file", "filename", "file name", "recording", "datei", "dateiname", "fichier")


def table_of(folder: Path) -> Path | None:
    """The table of sizes in a folder, in any case of letters; None where none is."""
    if not folder.is_dir():
        return None
    by = {p.name.casefold(): p for p in folder.iterdir() if p.is_file()}
    return next((by[name] for name in NAMES if name in by), None)


def specimens(folder: Path) -> dict[str, dict[str, Any]]:
    """What the table of a folder says, by file; nothing where there is none."""
    path = table_of(folder)
    return {} if path is None else read_sizes(path)


def read_sizes(path: Path) -> dict[str, dict[str, Any]]:
    """Specimen and sizes [mm, mm2] by file. Raises `InputError` naming row, column."""
    rows = _rows(path)
    first = rows[0] if rows else []
    if not any(split_name(c).plain in FILE for c in first):
        raise InputError(
            f"no column 'file'; it has {', '.join(first)}. Columns: {','.join(TABLE)}",
            file=path,
            row=1,
        )
    header = [_column(c, path) for c in first]
    names = [name for name, _ in header]
    twice = next((n for n in names if n and names.count(n) > 1), None)
    if twice:
        raise InputError(f"{twice!r} is there twice", file=path, row=1)
    found: dict[str, dict[str, Any]] = {}
    for number, cells in enumerate(rows[1:], start=2):
        row = {
            name: (text.strip(), unit)
            for (name, unit), text in zip(header, cells, strict=False)
            if name
        }
        name = row.pop("file", ("", None))[0].replace("\\", "/")
        if not any(text for text, _ in row.values()) and not name:
            continue
        if name in found:
            raise InputError(f"{name!r} is there twice", file=path, row=number)
        one = found[name] = {
            k: text if unit is None else _size(text, unit, path, number, k)
            for k, (text, unit) in row.items()
        }
        try:
            Geometry(**{k: one.get(k) for k in SIZES}).check("of this row")
        except InputError as error:
            raise InputError(str(error), file=path, row=number) from None
    return found


def called(shown: str) -> list[str]:
    """What a table may call a file: with its folder and its ending, or without.

    >>> called("day 1/a.csv")
    ['day 1/a.csv', 'a.csv', 'day 1/a', 'a']
    """
    path = PurePosixPath(shown)
    return [shown, path.name, path.with_suffix("").as_posix(), path.stem]


def row_of(table: Mapping[str, dict[str, Any]], shown: str) -> dict[str, Any]:
    """What a table says of a file, without the blanks; {} where it does not name it.

    A section of its own replaces the whole of one that was given for all: the other
    ways to say it are None.
    """
    name = next((n for n in called(shown) if n in table), None)
    row = {} if name is None else {k: v for k, v in table[name].items() if v}
    if set(SECTION) & set(row):
        row = dict.fromkeys(SECTION) | row
    return row


def _rows(path: Path) -> list[list[str]]:
    source = open_source(path)
    if source.is_text:
        text = source.text.lstrip("\ufeff")
        # Spreadsheets of some countries write semicolons, and then decimal commas.
        mark = max(",;\t", key=text.partition("\n")[0].count)
        return list(csv.reader(io.StringIO(text), delimiter=mark))
    grid = source.sheets[0].grid if source.sheets else []
    return [[c if isinstance(c, str) else f"{c:g}" for c in row] for row in grid]


def _column(text: str, path: Path) -> tuple[str, Unit | None]:
    """The field that a heading names, and its unit; "" for a remark or a blank."""
    text = text.strip()
    column = split_name(text)
    name = column.plain
    if not name or REMARK.search(name):
        return "", None
    if name in FILE:
        return "file", None
    if WHOSE.search(name) or SPECIMEN.search(name):
        return "specimen", None
    field = next((f for f, p in GEOMETRY.items() if p.search(name)), "")
    if not field and any(p.search(name) for p in LENGTHS):
        field = "length_mm"
    if not field:
        raise InputError(
            f"no such column{nearest(text, TABLE)}; allowed: {','.join(TABLE)}",
            file=path,
            row=1,
            column=text,
        )
    unit = parse_unit(column.unit)
    if unit is None or unit.dimension != ("area" if field == "area_mm2" else "length"):
        raise InputError(
            f"{column.unit!r} is no unit of it; write it as {field}"
            if column.unit
            else f"has no unit; write it as {field}",
            file=path,
            row=1,
            column=text,
        )
    return field, unit


def _size(text: str, unit: Unit, path: Path, row: int, column: str) -> float | None:
    if not text:
        return None
    try:
        value = float(text.replace(",", ".")) * unit.factor
    except ValueError:
        value = 0.0
    if not 1e-9 < value < 1e9:
        raise InputError(
            f"{text[:40]!r} is no size; allowed is a number above 0, in "
            f"{column.rpartition('_')[2]}",
            file=path,
            row=row,
            column=column,
        )
    return value
