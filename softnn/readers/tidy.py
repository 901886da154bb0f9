"""Tidy CSV: `time_s,strain,stress_MPa[,temperature_C,force_N,elongation_mm]`.

A component of unknown geometry has `time_s,elongation_mm,force_N` alone, or
`time_s,deflection_deg,torque_Nm`; results are in these units (`softnn.axes`).

A folder of them may hold an `index.csv` with a row a recording (`file`, and any of
`material`, `test`, `rate_per_s`, `specimen`).
"""

from __future__ import annotations

import csv
import gzip
import io
import math
import os
import re
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from softnn.contracts import InputError
from softnn.json_file import write_text
from softnn.readers.options import name_of
from softnn.recording import Recording, check_columns, columns_of

MAX_BYTES = 500_000_000  # 10 million samples; anything larger is not one test


def data_folder() -> Path:
    """Where sets of recordings lie: `SOFTNN_DATA`, else a cache folder of the user."""
    named = os.environ.get("SOFTNN_DATA")
    if named:
        return Path(named)
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "softnn" / "data"


def load(source: str | Path) -> list[Recording]:
    """Recordings of a tidy CSV, a folder of them, or a set under `data_folder()`."""
    path = Path(source)
    if path.is_file():
        return [read_tidy(path)]
    if path.is_dir():
        return read_folder(path)
    return read_set(str(source))


def read_set(name: str) -> list[Recording]:
    """Recordings of the set `name`, a folder under `data_folder()`."""
    root = data_folder()
    known = sorted(p.parent.name for p in root.glob("*/index.csv"))
    if name not in known:
        where = f"SOFTNN_DATA is {root}" if "SOFTNN_DATA" in os.environ else str(root)
        have = ", ".join(known) if known else "none; set SOFTNN_DATA to their folder"
        raise InputError(
            f"{name!r} is no file, no folder and no set of recordings ({where}); "
            f"sets there: {have}"
        )
    return read_folder(root / name)


def read_folder(
    folder: str | Path, unusable: dict[str, str] | None = None
) -> list[Recording]:
    """Recordings of a folder: as its `index.csv` lists them, else every CSV, by name.

    Of a case those in its `recordings`.

    Raises `InputError` for the first file that cannot be read; where `unusable` is
    given such files of an index are passed over, and it says why, by name there.
    """
    folder = Path(folder)
    index = folder / "index.csv"
    if not index.is_file():
        inner = folder / "recordings"
        inner = inner if inner.is_dir() else folder
        files = sorted(f for f in inner.iterdir() if f.suffix.lower() == ".csv")
        if not files:
            raise InputError("no index.csv and no CSV file in it", file=folder)
        return [read_tidy(file) for file in files]
    rows = _cells(index)
    header = rows[0][1]
    if "file" not in header:
        raise InputError(
            f"no column 'file'; it has {header}", file=index, row=1, column="file"
        )
    recordings = []
    for line, cells in rows[1:]:
        row = dict(zip(header, cells, strict=False))
        file = (folder / row["file"]).resolve()
        if not file.is_relative_to(folder.resolve()):
            raise InputError(
                f"{row['file']!r} lies outside the folder",
                file=index,
                row=line,
                column="file",
            )
        rate = _rate(row.get("rate_per_s", ""), index, line)
        try:
            recording = read_tidy(
                file,
                specimen=row.get("specimen", ""),
                material=row.get("material", ""),
                test=row.get("test", ""),
                rate_per_s=rate,
            )
        except InputError as error:
            if unusable is None:
                raise
            unusable[row["file"]] = str(error)
            continue
        recordings.append(recording)
    if not recordings and not unusable:
        raise InputError("no rows; it lists no recording", file=index)
    return recordings


def write_index(folder: Path, recordings: Mapping[str, Recording]) -> None:
    """Say in `folder`/index.csv of what each file is; rows of other files stay.

    `recordings` by file name there.
    """
    index = folder / "index.csv"
    rows: dict[str, dict[str, str]] = {}
    if index.is_file():
        header, *cells = [c for _, c in _cells(index)]
        found = [dict(zip(header, c, strict=False)) for c in cells]
        rows = {r["file"]: r for r in found if "file" in r}
    for name, one in recordings.items():
        rate = "" if one.rate_per_s is None else f"{one.rate_per_s:.9g}"
        about = {k: getattr(one, k) for k in ("specimen", "material", "test")}
        rows[name] = {"file": name, **about, "rate_per_s": rate}
    columns = list(dict.fromkeys(c for r in rows.values() for c in r))
    out = io.StringIO(newline="")
    writer = csv.DictWriter(out, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows.values())
    write_text(index, out.getvalue())


def spare(path: Path, sources: Collection[Path]) -> None:
    """Raise `InputError` where writing `path` would destroy one of `sources`."""
    if path.resolve() in sources:
        raise InputError(
            "is itself one of the files to read, and would be lost; name another --out",
            file=path,
        )


def write_table(path: Path, columns: Mapping[str, Any]) -> None:
    """Write columns as CSV: time reads back exactly, the rest has 9 digits.

    The file is complete or absent. Raises `InputError` if it cannot be written.
    """
    frame = pd.DataFrame(columns)
    # Nine digits are below the noise of any machine, but not of a clock: seconds since
    # 1970 have ten before the point.
    frame["time_s"] = [repr(float(t)).removesuffix(".0") for t in frame["time_s"]]
    text = frame.to_csv(index=False, float_format="%.9g", lineterminator="\n")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink():  # a link in the folder may lead out of it
            raise InputError("is a link; remove it or name another --out", file=path)
        write_text(path, text)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"cannot be written: {reason}", file=path) from None


def read_tidy(path: str | Path, **about: object) -> Recording:
    """One tidy CSV; `about` fills in fields of `Recording` (specimen, material ...).

    An empty cell is a missing value. Raises `InputError`, with file, row and column,
    for a missing column, text in a number, time going backwards, no rows, a file that
    is not UTF-8, or a channel without any number.
    """
    path = Path(path)
    frame = table(path)
    axes, found = columns_of(list(frame.columns), path, 1)
    columns: dict[str, Any] = {
        channel: numbers(frame[c], path) for channel, c in found.items()
    }
    named = {found[channel]: values for channel, values in columns.items()}
    check_columns(named, str(path), first_row=2)
    fields: dict[str, Any] = {"name": name_of(path), "source": str(path), "axes": axes}
    fields |= about
    return Recording(**columns, **fields)


def table(path: Path) -> pd.DataFrame:
    """The cells of a CSV file as pandas reads them. Raises `InputError`."""
    text = read_text(path)
    try:
        frame = pd.read_csv(io.StringIO(text), skip_blank_lines=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError) as error:
        raise _unreadable(path, text, error) from None
    if not isinstance(frame.index, pd.RangeIndex):  # more cells than names
        count = len(frame.columns) + frame.index.nlevels
        raise InputError(
            f"{count} values under {len(frame.columns)} column names; with a decimal "
            "comma, export it with another delimiter, such as a semicolon",
            file=path,
            row=2,
        )
    frame.columns = [str(c).strip() for c in frame.columns]
    # Trailing blank lines are how some editors end a file, not samples.
    while len(frame) and frame.iloc[-1].isna().all():
        frame = frame.iloc[:-1]
    return frame


def read_text(path: Path) -> str:
    """The file as UTF-8 text, or one clear line."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"over {MAX_BYTES // 10**6} MB; split it", file=path)
        raw = path.read_bytes()
        if raw.startswith(b"\x1f\x8b"):
            with gzip.GzipFile(fileobj=io.BytesIO(raw)) as packed:
                raw = packed.read(MAX_BYTES + 1)
            if len(raw) > MAX_BYTES:
                raise InputError(
                    f"unpacks to over {MAX_BYTES // 10**6} MB; split it", file=path
                )
    except (gzip.BadGzipFile, EOFError, zlib.error):
        raise InputError("damaged gzip file; copy it again", file=path) from None
    except FileNotFoundError:
        raise InputError("no such file", file=path) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", file=path) from None
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = raw[: error.start].count(b"\n") + 1
        raise InputError(
            f"byte 0x{raw[error.start]:02x} is not UTF-8; "
            "for a testing machine's own file use `softnn read`",
            file=path,
            row=row,
        ) from None


def numbers(column: pd.Series, path: Path) -> np.ndarray:
    """A column (n,) of a table, NaN where a cell is empty. `InputError` for text."""
    values = pd.to_numeric(column, errors="coerce").to_numpy(float)
    text = np.isnan(values) & column.notna().to_numpy()
    if text.any():
        i = int(text.argmax())
        cell = str(column.iloc[i])[:40]
        hint = (
            "; a decimal comma? use a decimal point"
            if re.fullmatch(r"-?\d+,\d+", cell)
            else ""
        )
        raise InputError(
            f"{cell!r} is not a number{hint}; repair it, or read such cells as missing "
            "with --skip-bad-cells",
            file=path,
            row=i + 2,
            column=str(column.name),
        )
    return values


def _unreadable(path: Path, text: str, error: Exception) -> InputError:
    if not text.strip():
        return InputError("no rows; the file is empty", file=path)
    header = next(csv.reader(io.StringIO(text)))
    for line, cells in enumerate(csv.reader(io.StringIO(text)), start=1):
        if len(cells) > len(header):
            return InputError(
                f"{len(cells)} values under {len(header)} column names",
                file=path,
                row=line,
            )
    return InputError(f"not a CSV table: {error}", file=path)


def _cells(path: Path) -> list[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(read_text(path)))
    rows = [(reader.line_num, cells) for cells in reader if cells]
    if not rows:
        raise InputError("no rows; the file is empty", file=path)
    return rows


def _rate(cell: str, index: Path, line: int) -> float | None:
    if not cell.strip():
        return None
    try:
        rate = float(cell)
    except ValueError:
        rate = math.nan
    if not math.isfinite(rate):
        raise InputError(
            f"{cell[:40]!r} is not a number", file=index, row=line, column="rate_per_s"
        )
    return rate
