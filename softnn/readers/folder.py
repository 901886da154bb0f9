"""A folder as a lab has it -> recordings, and notes on all that was passed over.

Subfolders are read too. A file that holds no test (notes, lock files, pictures, tables
of results) and a copy of a recording already read are passed over and named. What is a
recording and cannot be read is an error, and all such errors are said at once.

Sizes of single specimens come from `specimens.csv` in the folder: `file`, `specimen`,
`length_mm`, `width_mm`, `thickness_mm`, `area_mm2`, `diameter_mm`; a blank cell leaves
the size to the file and to the options.
"""

from __future__ import annotations

import csv
import io
import os
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from softnn import progress
from softnn.contracts import InputError, nearest
from softnn.readers.lacking import Lacking, NoRecording
from softnn.readers.options import ReadOptions
from softnn.readers.tidy import read_text
from softnn.recording import Recording

SUFFIXES = (
    ".csv", ".txt", ".dat", ".tra", ".tab", ".tsv", ".asc", ".xls", ".xlsx", ".xlsm",
    ".gz",
)  # fmt: skip
# Beside recordings, and known to be none: about a case, or made by softnn.
ABOUT = ("case.toml", "index.csv", "specimens.csv", "README.md", "SOURCE.md")
PLOTS = (".png",)  # made by `softnn read`
SIZES = ("length_mm", "width_mm", "thickness_mm", "area_mm2", "diameter_mm")
TABLE = ("file", "specimen", *SIZES)
SAME = 1e-6  # of the range, within which two recordings are copies

Reader = Callable[[Path, ReadOptions], list[Recording]]


@dataclass
class Found:
    """Recordings with names of their own, and a line on each file passed over."""

    recordings: list[Recording] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def files_of(folder: Path, skip: Sequence[str] = ()) -> tuple[list[Path], list[str]]:
    """Files to try, sorted, subfolders included; notes on those of other kinds."""
    files, notes = [], []
    for place, inner, names in os.walk(folder):
        inner[:] = sorted(d for d in inner if d[:1] != "." and d != "__MACOSX")
        for name in sorted(names):
            path = Path(place) / name
            shown = path.relative_to(folder).as_posix()
            if skipped(shown, skip):
                notes.append(f"{shown}: left out by --skip")
            elif name.startswith(("._", "~$", ".~lock")):
                notes.append(f"{shown}: a lock or side file, not read")
            elif name[:1] == "." or name in ABOUT or path.suffix.lower() in PLOTS:
                continue
            elif path.suffix.lower() not in SUFFIXES:
                notes.append(f"{shown}: not a kind of file read")
            elif path.is_file():
                files.append(path)
    return files, notes


def skipped(name: str, skip: Sequence[str]) -> bool:
    """Whether a file, by its place in the folder, is one of those to leave out."""
    return any(fnmatch(name, p) or fnmatch(Path(name).name, p) for p in skip)


def read_files(
    folder: Path | None,
    files: Sequence[Path],
    options: ReadOptions,
    read: Reader,
) -> Found:
    """Recordings of the files; those of `folder` may be no test, others must be one.

    Raises one `InputError` for all files that cannot be read, `Lacking` where nothing
    but sizes and units is missing.
    """
    sizes = {} if folder is None else specimens(folder)
    found, lacking, wrong = Found(), dict[str, Lacking](), dict[str, InputError]()
    used: set[str] = set()
    for file in files:
        shown = _shown(file, folder)
        row = sizes.get(shown) or sizes.get(file.name) or {}
        used |= {shown, file.name} & set(sizes)
        progress.step()
        try:
            recordings = read(file, _with(options, row))
        except NoRecording as error:
            if folder is None:
                wrong[shown] = error
            else:
                found.notes.append(f"{shown}: not read, {_reason(error)}")
        except Lacking as error:
            lacking[shown] = error
        except InputError as error:
            wrong[shown] = error
        else:
            found.recordings += recordings
    unused = sorted(set(sizes) - used)
    if folder is not None and unused:
        names = [_shown(f, folder) for f in files]
        raise InputError(
            f"names {unused[0]!r}{nearest(unused[0], names)}, which is no file read here",
            file=folder / "specimens.csv",
            column="file",
        )
    _refuse(wrong, lacking, len(files), folder)
    if not found.recordings:
        raise InputError(_none(found.notes), file=folder)
    _uncopied(found)
    _named(found)
    return found


def _shown(file: Path, folder: Path | None) -> str:
    return file.name if folder is None else file.relative_to(folder).as_posix()


def _reason(error: InputError) -> str:
    """The message without the place and without the advice to mend what is no test."""
    text = str(error)
    if error.file is not None:
        text = text.removeprefix(str(error.file)).lstrip(":, ")
    return text.partition("; export")[0].partition("; expected")[0]


def _with(options: ReadOptions, row: dict[str, Any]) -> ReadOptions:
    """The options with what the table says of this file, which counts for more."""
    given = {k: v for k, v in row.items() if v}
    if {"area_mm2", "width_mm", "thickness_mm", "diameter_mm"} & set(given):
        # A section of its own replaces the whole of the one for all files.
        blank = dict.fromkeys(("area_mm2", "width_mm", "thickness_mm", "diameter_mm"))
        given = {k: v for k, v in blank.items() if k not in given} | given
    return replace(options, **given)


def _refuse(
    wrong: dict[str, InputError],
    lacking: dict[str, Lacking],
    count: int,
    folder: Path | None,
) -> None:
    if not wrong and not lacking:
        return
    if len(wrong) + len(lacking) == 1:
        raise next(iter((*wrong.values(), *lacking.values())))
    if wrong:
        told = "; ".join(str(e) for e in list(wrong.values())[:5])
        more = f"; and {len(wrong) - 5} more" if len(wrong) > 5 else ""
        how = " ".join(f"--skip {shlex.quote(n)}" for n in wrong)
        also = f". {len(lacking)} more lack sizes or units" if lacking else ""
        leave = "" if len(wrong) == count else f". To leave them out: {how}"
        raise InputError(
            f"{len(wrong)} of {count} files cannot be read: {told}{more}{also}{leave}",
            file=folder,
        )
    whole = next(iter(lacking.values()))
    for one in lacking.values():
        whole = whole.and_also(one)
    alike = all(
        one.sizes == whole.sizes and one.units == whole.units
        for one in lacking.values()
    )
    names = _some(list(lacking))
    each = "" if alike else f" ({'; '.join(map(_short, lacking.items()))})"
    raise Lacking(
        whole.sizes,
        whole.units,
        unknown=whole.unknown,
        said=f"{len(lacking)} of {count} files lack facts: {names}{each}. {whole}",
        file=folder,
    )


def _short(item: tuple[str, Lacking]) -> str:
    name, one = item
    lacks = [*one.sizes, *(f"unit of {c!r}" for c in one.units)]
    return f"{name}: {', '.join(lacks)}"


def _some(names: Sequence[str], most: int = 5) -> str:
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def _none(notes: Sequence[str]) -> str:
    what = f"; passed over: {'; '.join(notes[:5])}" if notes else ""
    return f"no recordings; files of these kinds are read: {', '.join(SUFFIXES)}{what}"


def copy_of(one: Recording, others: Sequence[Recording]) -> Recording | None:
    """The first of the others that holds the same samples, whatever it is called."""
    for other in others:
        if len(one) != len(other) or not one.axes.like(other.axes):
            continue
        pairs = (
            (one.time_s - one.time_s[0], other.time_s - other.time_s[0]),
            (one.strain, other.strain),
            (one.stress_MPa, other.stress_MPa),
        )
        if all(_same(a, b) for a, b in pairs):
            return other
    return None


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    if not np.array_equal(np.isfinite(a), np.isfinite(b)):
        return False
    good = np.isfinite(a)
    span = float(np.ptp(a[good])) if good.any() else 0.0
    return bool(np.all(np.abs(a[good] - b[good]) <= SAME * span))


def without_copies(
    recordings: Sequence[Recording],
) -> tuple[list[Recording], list[str]]:
    """Each recording once, and a note on every copy: it is no second specimen."""
    kept: list[Recording] = []
    notes = []
    for one in recordings:
        other = copy_of(one, kept)
        if other is None:
            kept.append(one)
            continue
        here, there = (Path(r.source).name or r.name for r in (one, other))
        if here == there:
            here, there = one.source, other.source
        if one.specimen and other.specimen and one.specimen != other.specimen:
            kept.append(one)
            notes.append(
                f"{here}: holds the same samples as {there}, and yet is said to be of "
                "another specimen"
            )
        else:
            notes.append(f"{here}: a copy of {there}, left out")
    return kept, notes


def _uncopied(found: Found) -> None:
    found.recordings, notes = without_copies(found.recordings)
    found.notes += notes


def _named(found: Found) -> None:
    """Recordings of one name get their folder, else their ending, else a number."""
    every = found.recordings
    for rename in (_with_folder, _with_ending, _with_number):
        names = [r.name for r in every]
        same = {n for n in names if names.count(n) > 1}
        every[:] = [
            replace(r, name=rename(i, every)) if r.name in same else r
            for i, r in enumerate(every)
        ]


def _with_folder(i: int, every: Sequence[Recording]) -> str:
    one = every[i]
    alike = [Path(r.source).resolve().parent for r in every if r.name == one.name]
    return (
        one.name
        if len(set(alike)) < 2
        else f"{Path(one.source).resolve().parent.name}-{one.name}"
    )


def _with_ending(i: int, every: Sequence[Recording]) -> str:
    one = every[i]
    alike = [Path(r.source).suffix for r in every if r.name == one.name]
    return one.name if len(set(alike)) < 2 else one.name + Path(one.source).suffix


def _with_number(i: int, every: Sequence[Recording]) -> str:
    before = sum(r.name == every[i].name for r in every[:i])
    return f"{every[i].name}-{before + 1}"


# -- sizes of single specimens ---------------------------------------------------------


def specimens(folder: Path) -> dict[str, dict[str, Any]]:
    """What specimens.csv says, by file; nothing where there is none."""
    path = folder / "specimens.csv"
    if not path.is_file():
        return {}
    text = read_text(path)
    # Spreadsheets of some countries write semicolons, and then decimal commas.
    mark = max(",;\t", key=text.partition("\n")[0].count)
    rows = list(csv.reader(io.StringIO(text), delimiter=mark))
    header = [c.strip() for c in rows[0]] if rows else []
    if "file" not in header:
        raise InputError(
            f"no column 'file'; it has {header}. Columns: {','.join(TABLE)}",
            file=path,
            row=1,
        )
    for name in header:
        if name and name not in TABLE:
            raise InputError(
                f"no such column{nearest(name, TABLE)}; allowed: {','.join(TABLE)}",
                file=path,
                row=1,
                column=name,
            )
    found: dict[str, dict[str, Any]] = {}
    for number, cells in enumerate(rows[1:], start=2):
        row = {k: c.strip() for k, c in zip(header, cells, strict=False) if k}
        name = row.pop("file", "").replace("\\", "/")
        if not any(row.values()) and not name:
            continue
        if name in found:
            raise InputError(f"{name!r} is there twice", file=path, row=number)
        found[name] = {
            k: v if k == "specimen" else _size(v, path, number, k)
            for k, v in row.items()
        }
    return found


def _size(text: str, path: Path, row: int, column: str) -> float | None:
    if not text:
        return None
    try:
        value = float(text.replace(",", "."))
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


def write_template(folder: Path, files: Sequence[Path]) -> Path:
    """Write specimens.csv with a row a file; rows that are there stay as they are."""
    path = folder / "specimens.csv"
    before = specimens(folder)
    names = [f.relative_to(folder).as_posix() for f in files]
    rows = [{"file": n, **{k: v for k, v in r.items() if v}} for n, r in before.items()]
    rows += [{"file": n} for n in names if n not in before]
    out = io.StringIO(newline="")
    writer = csv.DictWriter(out, TABLE, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    try:
        aside = path.with_name(f".{path.name}.{os.getpid()}")
        aside.write_text(out.getvalue(), encoding="utf-8")
        aside.replace(path)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=path) from None
    return path
