"""A file as text cells or workbook sheets, whatever its encoding and delimiter.

Nothing is known here about machines. Sizes are limited before anything is unpacked,
so that a small hostile file cannot become a large one.
"""

from __future__ import annotations

import csv
import gzip
import io
import itertools
import os
import re
import zipfile
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from softnn.contracts import InputError
from softnn.readers.lacking import NoRecording
from softnn.readers.units import WEIGHTS, parse_unit
from softnn.readers.vocabulary import ROLES, plain

MAX_BYTES = 100_000_000  # 2 million rows of text; one test is rarely a tenth of it
THIN = "keep every tenth row, as with awk 'NR < 60 || NR % 10 == 0' FILE > smaller.csv"
MAX_WORKBOOK_BYTES = 40_000_000  # unpacked XML, 400,000 rows of 4 columns
MAX_COLUMNS = 1000
MAX_CELLS = 4_000_000  # of one worksheet, gaps counted
MAX_ROWS = 1_048_576  # what Excel allows

Cell = str | float
Grid = list[list[Cell]]

NUMBER = re.compile(r"[-+]?(\d[\d.,]*|[.,]\d+)([eE][-+]?\d{1,4})?")
# `12.3 N`, `10 %`: a number with a unit behind it.
QUANTITY = re.compile(
    r"([-+]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][-+]?\d{1,4})?)\s*([^\W\d_].*|[%\u2030\u00b0].*)"
)
_CANDIDATES: tuple[str, ...] = ("\t", ";", "|", ",", "  ", " ")
_BINARY = re.compile(rb"[\x00-\x08\x0e-\x1f]")


@dataclass(frozen=True)
class Sheet:
    """A worksheet, or the whole of a text file (name "")."""

    name: str
    grid: Grid
    hidden: bool = False


@dataclass(frozen=True)
class Source:
    """The bytes of one file (unpacked if gzip), read on demand."""

    path: Path
    raw: bytes

    @cached_property
    def is_xls(self) -> bool:
        return self.raw.startswith(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")

    @cached_property
    def is_xlsx(self) -> bool:
        return self.raw.startswith(b"PK\x03\x04")

    @property
    def is_text(self) -> bool:
        return not (self.is_xls or self.is_xlsx)

    @cached_property
    def text(self) -> str:
        """The text of a text file; raises `InputError` for a binary one."""
        return typed(decode(self.raw, self.path))

    @cached_property
    def head(self) -> str:
        """The first lines, for recognition; "" for a workbook."""
        return self.text[:20_000] if self.is_text else ""

    @cached_property
    def lines(self) -> list[str]:
        # Only the line ends a file can have: splitlines() also cuts at a form feed.
        return self.text.replace("\r\n", "\n").replace("\r", "\n").split("\n")

    @cached_property
    def delimiter(self) -> str:
        return sniff_delimiter(self.lines, self.path)

    @cached_property
    def sheets(self) -> list[Sheet]:
        if self.is_xls:
            return _xls_sheets(self.raw, self.path)
        if self.is_xlsx:
            return _xlsx_sheets(self.raw, self.path)
        return [Sheet("", split_lines(self.lines, self.delimiter, self.path))]

    @cached_property
    def top(self) -> Grid:
        """The first 60 rows of the first sheet."""
        if self.is_text:
            return split_lines(self.lines[:60], self.delimiter, self.path, strict=False)
        return self.sheets[0].grid[:60] if self.sheets else []

    @cached_property
    def names(self) -> set[str]:
        """Every text cell of the first rows of all sheets, as plain names."""
        grids = [self.top] if self.is_text else [s.grid[:60] for s in self.sheets]
        return {
            plain(re.sub(r"[\[(][^\[\]()]*[\])]\s*$", "", cell))
            for cell in itertools.chain.from_iterable(itertools.chain(*grids))
            if isinstance(cell, str)
        }


def open_source(path: Path) -> Source:
    """The file's bytes, or one clear line: absent, a folder, too large, damaged."""
    try:
        if path.is_dir():
            raise InputError("is a folder; name the files in it", file=path)
        if not path.is_file() and path.exists():
            raise InputError("is not a plain file", file=path)
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            raw = stream.read(MAX_BYTES + 1)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError("no such file", file=path) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", file=path) from None
    if size > MAX_BYTES or len(raw) > MAX_BYTES:
        raise InputError(f"over {MAX_BYTES // 10**6} MB; {THIN}", file=path)
    if raw.startswith(b"\x1f\x8b"):
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(raw)) as packed:
                raw = packed.read(MAX_BYTES + 1)
        except (OSError, EOFError, zlib.error):
            raise InputError("damaged gzip file; copy it again", file=path) from None
        if len(raw) > MAX_BYTES:
            raise InputError(
                f"unpacks to over {MAX_BYTES // 10**6} MB; {THIN}", file=path
            )
    if not raw.strip(b"\x00 \t\r\n"):
        raise NoRecording("no rows; the file is empty", file=path)
    return Source(path, raw)


# Minus signs and dashes of word processors in front of a number, and what parts its
# thousands where neither a point nor a comma does.
_DASH = re.compile(r"[\u2010-\u2015\u2212\ufe58\ufe63\uff0d](?=[\d.,])")
_FORTRAN = re.compile(r"(?<=\d\.\d)D(?=[-+]\d)|(?<=\d{3})D(?=[-+]\d)")
_THOUSANDS = re.compile(r"(?<=\d)['\u2019\u00a0\u202f\u2009](?=\d{3}(?!\d))")


def typed(text: str) -> str:
    """The text with numbers as a keyboard has them.

    >>> typed("\u22121.5;1\u202f234,5;12'000")
    '-1.5;1234,5;12000'
    """
    if "D+" in text or "D-" in text:
        text = _FORTRAN.sub("E", text)
    if text.isascii() and "'" not in text:
        return text
    return _THOUSANDS.sub("", _DASH.sub("-", text))


def _without_nul(raw: bytes, path: Path) -> bytes:
    """The bytes without NULs at the ends of texts; those between numbers are damage."""
    raw = raw.rstrip(b"\x00")  # a logger that had reserved the space
    if b"\x00" not in raw:
        return raw
    for number, line in enumerate(raw.split(b"\n"), start=1):
        if b"\x00" not in line:
            continue
        cells = re.split(rb"[,;\t\s\x00]+", line)
        if sum(re.fullmatch(rb"[-+]?\d[\d.,eE+-]*", c) is not None for c in cells) > 1:
            raise InputError(
                "has NUL bytes between its numbers: damaged; copy the file again from "
                "the machine",
                file=path,
                row=number,
            )
    return raw.replace(b"\x00", b"")


def decode(raw: bytes, path: Path) -> str:
    """Text of the encoding the bytes show: UTF-16, UTF-8, GB18030 or a code page.

    A byte that is no character of it becomes U+FFFD, which no number and no unit
    holds; so it can spoil a name, never a value.
    """
    if raw[:4] in (b"\xff\xfe\x00\x00", b"\x00\x00\xfe\xff"):
        return raw.decode("utf-32", "replace")
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", "replace")
    start = raw[:4000]
    if start[:64].count(b"\x00") > 16 and len(raw) % 2 == 0:
        little = start[1:64:2].count(b"\x00") > start[:64:2].count(b"\x00")
        text = raw.decode("utf-16-le" if little else "utf-16-be", "replace")
        if "\x00" not in text and sum(c > "\u2fff" for c in text[:64]) < 16:
            return text
    if len(_BINARY.findall(start)) > len(start) // 100 + 4:
        raise NoRecording(
            "is not text and no Excel workbook; export it as CSV or text", file=path
        )
    raw = _without_nul(raw, path)
    if start.lstrip()[:5].lower() in (
        b"<html",
        b"<?xml",
        b"<!doc",
        b"<head",
        b"<body",
        b"<meta",
        b"<tabl",
    ) or start[:4] in (
        b"%PDF",
        b"{\\rt",
    ):
        raise NoRecording(
            "is a web page, XML, PDF or RTF document, whatever its name says; "
            "export it as CSV or text",
            file=path,
        )
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        pass
    # Chinese or Japanese when the header then has words of a tensile test; the two-byte
    # codes would otherwise also swallow accented letters of Windows-1252.
    for encoding in ("gb18030", "cp932"):
        words = re.findall(
            "[\u3040-\u30ff\u4e00-\u9fff]+", raw[:8000].decode(encoding, "replace")
        )
        if any(p.search(w) for w in words for ps in ROLES.values() for p in ps):
            return raw.decode(encoding, "replace")
    # UTF-8 with a few damaged bytes stays UTF-8.
    utf8 = raw.decode("utf-8-sig", "replace")
    multibyte = len(re.findall("[\u0080-\ufffc]", utf8))
    if multibyte and utf8.count("\ufffd") <= multibyte:
        return utf8
    return raw.decode(_one_byte(raw), "replace")


# Windows and DOS code pages of Europe and Turkey, ISO 8859-2. The first stands where
# its words tell no more than those of another.
_ONE_BYTE = ("cp1252", "cp1250", "cp1251", "cp1254", "iso8859-2", "cp850", "cp852",
             "cp866", "koi8-r")  # fmt: skip


def _one_byte(raw: bytes) -> str:
    """The code page in which the header has most words of a tensile test."""
    head = raw[:8000]

    def words(encoding: str) -> int:
        cells = re.split(r"[\n\r\t;,|\"\[\](){}]+", head.decode(encoding, "replace"))
        names = {plain(c) for c in cells if any(map(str.isalpha, c))}
        one_word = [n for n in names if len(n) > 1 and "\ufffd" not in n]
        return sum(
            any(p.search(n) for n in one_word for p in ps) for ps in ROLES.values()
        )

    return max(_ONE_BYTE, key=words)


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return line.split()
    if delimiter == "  ":
        return re.split(r"\s{2,}|\t", line.strip())
    if '"' in line:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return line.split(delimiter)


def quantity(cell: Cell) -> tuple[str, str] | None:
    """The number and the unit of a cell that holds both, or None.

    >>> quantity("12.3 N"), quantity("10%"), quantity("12.3"), quantity("3 points")
    (('12.3', 'N'), ('10', '%'), None, None)
    """
    match = QUANTITY.fullmatch(cell) if isinstance(cell, str) else None
    if match is None or not (parse_unit(match[2]) or match[2] in WEIGHTS):
        return None
    return match[1], match[2]


def sniff_delimiter(lines: list[str], path: Path) -> str:
    """The delimiter under which most lines are rows of numbers."""
    filled = [line for line in lines[:400] if line.strip()]
    middle = len(lines) // 2
    filled += [line for line in lines[middle : middle + 200] if line.strip()]
    best, chosen = 0.0, ""
    for delimiter in _CANDIDATES:
        score = 0.0
        for line in filled:
            if delimiter not in line or len(line) > 20_000:
                continue
            try:
                cells = [c.strip().strip('"') for c in _split(line, delimiter)]
            except csv.Error:
                continue
            cells = [c for c in cells if c]
            numbers = sum(NUMBER.fullmatch(c) is not None for c in cells)
            if numbers < len(cells) and numbers < 2:
                numbers += sum(quantity(c) is not None for c in cells)
            if numbers >= 2:
                score += numbers / len(cells)
        if score > best + 1e-9:
            best, chosen = score, delimiter
    if not chosen:
        raise NoRecording(
            "no table of numbers in it; expected are columns of time, force or stress, "
            "and displacement or strain",
            file=path,
        )
    return chosen


def split_lines(
    lines: list[str], delimiter: str, path: Path, strict: bool = True
) -> Grid:
    """Rows of cells; row i of the result is line i + 1 of the file."""
    if delimiter in (" ", "  "):
        blank: Grid = [[] for _ in lines]
        for i, line in enumerate(lines):
            if line.strip():
                blank[i] = list(_split(line.lstrip("# "), delimiter))
        return blank
    if any(line[:1] == "#" for line in lines[:200]):
        lines = [line.lstrip("# ") for line in lines]  # comment signs before names
    try:
        split = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        raise InputError(f"not a table of cells: {error}", file=path) from None
    if len(split) != len(lines):  # a quoted cell ran on over a line end
        if strict:
            odd = (i for i, x in enumerate(lines, start=1) if x.count('"') % 2)
            number = next(odd, None)
            raise InputError(
                "a quotation mark without its pair; repair the row",
                file=path,
                row=number,
            )
        lines = [line.replace('"', "") for line in lines]
        split = [line.split(delimiter) for line in lines]
    grid: Grid = []
    for number, (line, row) in enumerate(zip(lines, split, strict=True), start=1):
        if len(row) > MAX_COLUMNS:
            raise InputError(
                f"{len(row)} columns; allowed are {MAX_COLUMNS}; if each row is a "
                "channel, save it with each channel in a column (Paste Special, "
                "Transpose, in a spreadsheet program)",
                file=path,
                row=number,
            )
        grid.append([c.strip() for c in row] if " " in line else list(row))
    return grid


def _cell(value: object) -> Cell:
    if value is None:
        return ""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return typed(str(value).strip())
    return float(value)


def _damaged(path: Path) -> InputError:
    return InputError(
        "damaged, or not an Excel workbook; open it in Excel and save the sheet as CSV",
        file=path,
    )


def _dated(value: object, kind: int, mode: int) -> object:
    """A cell of an .xls file that is a date or a time of day, as one."""
    import xlrd

    if kind != xlrd.XL_CELL_DATE or not isinstance(value, float):
        return value
    try:
        when = xlrd.xldate_as_datetime(value, mode)
    except (ValueError, xlrd.XLDateError):
        return value
    return when.time() if value < 1 else when


def _xls_sheets(raw: bytes, path: Path) -> list[Sheet]:
    import xlrd

    if "EncryptedPackage".encode("utf-16-le") in raw:
        raise InputError(
            "is locked with a password; open it in Excel and save it without one",
            file=path,
        )
    try:
        book = xlrd.open_workbook(
            file_contents=raw, logfile=io.StringIO(), ragged_rows=True
        )
        sheets = []
        for sheet in book.sheets():
            rows = [
                [
                    _cell(_dated(c, kind, book.datemode))
                    for c, kind in zip(
                        sheet.row_values(i)[:MAX_COLUMNS],
                        sheet.row_types(i),
                        strict=False,
                    )
                ]
                for i in range(sheet.nrows)
            ]
            sheets.append(Sheet(str(sheet.name), rows, sheet.visibility != 0))
        return sheets
    # xlrd meets a damaged file with whatever its parser trips over.
    except Exception:
        raise _damaged(path) from None


def _xlsx_sheets(raw: bytes, path: Path) -> list[Sheet]:
    import openpyxl

    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            members = archive.infolist()
            if any(m.filename == "content.xml" for m in members):
                raise NoRecording(
                    "is an OpenDocument spreadsheet; save it as .xlsx or CSV", file=path
                )
            if not any(m.filename.lower() == "xl/workbook.xml" for m in members):
                raise NoRecording(
                    "is a zip archive and no Excel workbook; unpack it first", file=path
                )
            if sum(m.file_size for m in members) > MAX_WORKBOOK_BYTES:
                raise InputError(
                    f"unpacks to over {MAX_WORKBOOK_BYTES // 10**6} MB; "
                    "save its sheets as CSV",
                    file=path,
                )
            for member in members:
                # file_size is what the archive claims; zipfile stops reading there.
                if member.filename.lower().endswith((".xml", ".rels")):
                    with archive.open(member) as stream:
                        if b"<!DOCTYPE" in stream.read(4096).upper():
                            raise _damaged(path)
        book = openpyxl.load_workbook(
            io.BytesIO(raw), read_only=True, data_only=True, keep_links=False
        )
        sheets = []
        for sheet in book.worksheets:
            sheet.reset_dimensions()  # what a file claims; cells may lie anywhere
            rows: Grid = []
            budget, count = MAX_CELLS, 0
            for row in sheet.iter_rows(values_only=True):
                budget, count = budget - len(row), count + 1
                if budget < 0 or count > MAX_ROWS:
                    raise InputError(
                        f"sheet {sheet.title!r} has over {MAX_CELLS:,} cells or "
                        f"{MAX_ROWS:,} rows; save it as CSV",
                        file=path,
                    )
                cells = [_cell(value) for value in row]
                while cells and cells[-1] == "":
                    cells.pop()
                rows.append(cells)
            while rows and not rows[-1]:
                rows.pop()
            hidden = sheet.sheet_state != "visible"
            sheets.append(Sheet(str(sheet.title), rows, hidden))
        return sheets
    except InputError:
        raise
    # As with xlrd: zipfile, expat and openpyxl raise a dozen kinds of error.
    except Exception:
        raise _damaged(path) from None
