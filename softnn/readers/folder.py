"""A folder as a lab has it -> recordings, and notes on all that was passed over.

Subfolders are read too. A file that holds no test (notes, lock files, pictures, tables
of results) and a copy of a recording already read are passed over and named. A
recording that cannot be read is an error; all such errors are said at once.

Sizes of single specimens come from `specimens.csv` in the folder (`sizes.py`); a blank
cell leaves the size to the file and to the options.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from softnn import progress
from softnn.contracts import InputError, nearest
from softnn.json_file import write_text
from softnn.readers.lacking import Lacking, NoRecording, together
from softnn.readers.options import NO_FORCE, NO_TRAVEL, ReadOptions, is_called
from softnn.readers.sizes import (
    NAMES,
    SECTION,
    TABLE,
    called,
    row_of,
    specimens,
    table_of,
)
from softnn.readers.vocabulary import WHOSE, plain
from softnn.recording import Recording

SUFFIXES = (
    ".csv", ".txt", ".dat", ".tra", ".tab", ".tsv", ".asc", ".lvm", ".xls", ".xlsx",
    ".xlsm", ".gz",
)  # fmt: skip
# Beside recordings, and known to be none: about a case, or made by softnn.
ABOUT = ("case.toml", "index.csv", "README.md", "SOURCE.md")
PLOTS = (".png",)  # made by `softnn read`, beside the recording of that name
ARCHIVES = (".zip", ".7z", ".rar", ".tar", ".tgz", ".bz2", ".xz")
FEWEST, MOST_OF = 16, 0.9  # samples, and share of the time, of a thinned copy
SAME = 2e-4  # of the range, within which two recordings are copies: four digits

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
            elif (
                name[:1] == "."
                or name in ABOUT
                or name.casefold() in NAMES
                or (path.suffix.lower() in PLOTS and _beside(path, names))
            ):
                continue
            elif path.suffix.lower() in ARCHIVES:
                notes.append(f"{shown}: an archive, not read; unpack it in the folder")
            elif path.suffix.lower() not in SUFFIXES:
                notes.append(f"{shown}: not a kind of file read")
            elif path.is_file():
                files.append(path)
            elif path.is_symlink():
                notes.append(f"{shown}: a link to nothing, not read")
            else:
                notes.append(f"{shown}: not a plain file, not read")
    return files, notes


def _beside(plot: Path, names: Sequence[str]) -> bool:
    return plot.with_suffix(".csv").name in names


def skipped(name: str, skip: Sequence[str]) -> bool:
    """Whether a file, by its place in the folder, is one of those to leave out."""
    return any(fnmatch(name, p) or fnmatch(Path(name).name, p) for p in skip)


def skips_in_vain(folder: Path, skip: Sequence[str]) -> list[str]:
    """A note on each pattern that leaves no file of the folder out."""
    names = [
        (Path(place) / name).relative_to(folder).as_posix()
        for place, _, inner in os.walk(folder)
        for name in inner
    ]
    return [
        f"--skip {shlex.quote(p)} leaves nothing out: no file here is called so"
        f"{nearest(p, names)}"
        for p in skip
        if not any(skipped(n, [p]) for n in names)
    ]


def sizes_in_vain(options: ReadOptions, recordings: Sequence[Recording]) -> list[str]:
    """A note on sizes that were given, where no recording is made with them."""
    told = [" ".join(r.log[0].arguments.get("notes", ())) for r in recordings if r.log]
    given = [
        f"--{name.partition('_')[0]}"
        for name in ("length_mm", *SECTION)
        if getattr(options, name) is not None
    ]
    vain = [
        option
        for option in given
        if all((NO_TRAVEL if option == "--length" else NO_FORCE) in t for t in told)
    ]
    if not told or not vain:
        return []
    what = "strain" if vain == ["--length"] else "stress"
    what = "strain and stress" if "--length" in vain and len(vain) > 1 else what
    return [f"{', '.join(vain)} not used: the files have {what} itself"]


def read_files(
    folder: Path | None,
    files: Sequence[Path],
    options: ReadOptions,
    read: Reader,
    passed: Sequence[str] = (),
) -> Found:
    """Recordings of the files; those of `folder` may be no test, others must be one.

    `passed`: notes on files of the folder that are not among them.
    Raises one `InputError` for all files that cannot be read, `Lacking` where nothing
    but sizes and units is missing.
    """
    sizes = {} if folder is None else specimens(folder)
    found = Found(notes=list(passed))
    lacking, wrong = dict[str, Lacking](), dict[str, InputError]()
    copies = _copies(files)
    progress.stage("reading", len(files))
    for file in files:
        shown = _shown(file, folder)
        if file in copies and not set(called(shown)) & set(sizes):
            original = _shown(copies[file], folder)
            found.notes.append(f"{shown}: a copy of {original}, left out")
            continue
        row = row_of(sizes, shown)
        progress.step(shown)
        progress.piece()
        try:
            recordings = read(file, replace(options, **row))
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
    if folder is not None:
        check_rows(sizes, folder, files)
    _refuse(wrong, lacking, len(files), folder, bool(found.recordings))
    if not found.recordings:
        raise InputError(_none(found.notes), file=folder)
    check_given(options, found.recordings, files)
    found.notes += sizes_in_vain(options, found.recordings)
    _uncopied(found)
    _unlabelled(found)
    _named(found)
    return found


def check_rows(sizes: Mapping[str, Any], folder: Path, files: Sequence[Path]) -> None:
    """Raise `InputError` for a row of the table of sizes that is of no file."""
    names = [_shown(f, folder) for f in files]
    unused = sorted(set(sizes) - {c for n in names for c in called(n)})
    if unused:
        raise InputError(
            f"names {unused[0]!r}{nearest(unused[0], names)}, which is no file here",
            file=table_of(folder),
            column="file",
        )


def check_given(
    options: ReadOptions, recordings: Sequence[Recording], files: Sequence[Path]
) -> None:
    """Raise `InputError` for a unit or a sign that was given and acts on nothing."""
    read = [r.log[0].arguments if r.log else {} for r in recordings]
    names = [f.name for f in files]
    for what, key in (*(("unit", k) for k in options.units), ("flip", options.flip)):
        file, mark, _ = key.partition(":")
        meant = [f for f in files if is_called(f, file)]
        if mark and not meant and (what == "flip" or all(_vain(key, a) for a in read)):
            raise InputError(
                f"--{what} {shlex.quote(key)}: no file {file!r} here"
                f"{nearest(file, names)}"
            )
        if what == "unit" and read and all(_vain(key, a) for a in read):
            used = read[0].get("columns", {})
            told = ", ".join(f"{role} is from {c!r}" for role, c in used.items())
            raise InputError(
                f"--unit {shlex.quote(f'{key}={options.units[key]}')} acts on nothing: "
                f"no column is called so, and {told}"
            )


def _vain(key: str, read: Mapping[str, Any]) -> bool:
    return key in read.get("in_vain", ())


def _copies(files: Sequence[Path]) -> dict[Path, Path]:
    """The file that each copy, byte by byte, is one of: that of the shortest name."""
    by: dict[bytes, list[Path]] = {}
    for file in files:
        by.setdefault(_content(file), []).append(file)
    out: dict[Path, Path] = {}
    for alike in by.values():
        original = min(alike, key=lambda f: (len(f.name), str(f)))
        out |= {f: original for f in alike if f != original}
    return out


def _content(file: Path) -> bytes:
    try:
        return hashlib.sha256(file.read_bytes()).digest()
    except (OSError, ValueError):
        return str(file).encode()  # the reader says why


def _shown(file: Path, folder: Path | None) -> str:
    return file.name if folder is None else file.relative_to(folder).as_posix()


def _reason(error: InputError) -> str:
    """The message without the file and without advice to mend it."""
    text = str(error)
    if error.file is not None:
        text = text.removeprefix(str(error.file)).lstrip(":, ")
    for advice in ("; export", "; expected", "; name them", "; save"):
        text = text.partition(advice)[0]
    return text


def _refuse(
    wrong: dict[str, InputError],
    lacking: dict[str, Lacking],
    count: int,
    folder: Path | None,
    others: bool,
) -> None:
    if not wrong and not lacking:
        return
    if len(wrong) + len(lacking) == 1 and (wrong or not others):
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
    raise all_lacking(lacking, count, others, folder)


def all_lacking(
    lacking: Mapping[str, Lacking],
    count: int,
    others: bool,
    folder: Path | None = None,
) -> Lacking:
    """One request for what files lack, by name; `others`: whether more lack nothing."""
    if len(lacking) == 1 and not others:
        return next(iter(lacking.values()))
    whole = together(lacking, others)
    alike = all(
        one.sizes == whole.sizes and one.units == whole.units
        for one in lacking.values()
    )
    names = _some(list(lacking))
    each = "" if alike else f" ({'; '.join(map(_short, lacking.items()))})"
    return Lacking(
        whole.sizes,
        whole.units,
        unknown=whole.unknown,
        likely=whole.likely,
        values=whole.values,
        have=whole.have,
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
    kinds = f"files of these kinds are read: {', '.join(SUFFIXES)}"
    if not notes:
        return f"no recordings; {kinds}"
    more = f" and {len(notes) - 5} more" if len(notes) > 5 else ""
    return f"no recordings; passed over: {'; '.join(notes[:5])}{more}; {kinds}"


def copy_of(one: Recording, others: Sequence[Recording]) -> Recording | None:
    """The first of the others that holds the same samples, or more, or some of them."""
    return next((o for o in others if _copies_of(one, o)), None)


def _copies_of(one: Recording, other: Recording) -> bool:
    if not one.axes.like(other.axes):
        return False
    few, many = sorted((one, other), key=len)
    times = [r.time_s - r.time_s[0] for r in (few, many)]
    if len(few) == len(many):
        at = np.arange(len(many))
    elif len(few) < FEWEST or times[0][-1] < MOST_OF * times[1][-1]:
        return False
    else:  # every tenth sample, say
        at = np.searchsorted(times[1], times[0] - SAME * times[1][-1])
        at = at.clip(0, len(many) - 1)
    pairs = (
        (times[0], times[1][at]),
        (few.strain, many.strain[at]),
        (few.stress_MPa, many.stress_MPa[at]),
    )
    return all(_same(a, b) for a, b in pairs)


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    if not np.array_equal(np.isfinite(a), np.isfinite(b)):
        return False
    good = np.isfinite(a)
    span = float(np.ptp(a[good])) if good.any() else 0.0
    return bool(np.all(np.abs(a[good] - b[good]) <= SAME * span))


def _better(one: Recording, other: Recording) -> bool:
    """Whether one of two copies is the one to keep: more samples, a shorter name."""
    names = [Path(r.source).name or r.name for r in (one, other)]
    return (len(one), -len(names[0])) > (len(other), -len(names[1]))


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
        if one.specimen and other.specimen and one.specimen != other.specimen:
            kept.append(one)
            notes.append(
                f"{_place(one, other)}: holds the same samples as "
                f"{_place(other, one)}, and yet is said to be of another specimen"
            )
            continue
        if _better(one, other):
            kept = [one if k is other else k for k in kept]
            one, other = other, one
        more = "" if len(one) == len(other) else ", with fewer samples"
        notes.append(
            f"{_place(one, other)}: a copy of {_place(other, one)}{more}, left out"
        )
    return kept, notes


def _place(one: Recording, other: Recording) -> str:
    """Where a recording is from, with the folder where the names are the same."""
    here, there = (Path(r.source).name or r.name for r in (one, other))
    return one.source if here == there and one.source else here


def _unlabelled(found: Found) -> None:
    """No specimen of a line that stands alone above the names in all of the files.

    It is a title. One that says that it names a specimen stays.
    """
    labels = [
        r.log[0].arguments.get("label") if r.log else None for r in found.recordings
    ]
    sources = {r.source for r in found.recordings}
    if len(sources) < 2 or len(set(labels)) > 1 or not labels[0]:
        return
    if WHOSE.search(plain(labels[0]).partition(" ")[0]):
        return
    found.recordings = [replace(r, specimen="") for r in found.recordings]
    found.notes.append(
        f"{labels[0][:40]!r} above the columns of all files is taken as a title, not "
        "as the name of one specimen"
    )


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


def write_template(
    folder: Path, files: Sequence[Path], options: ReadOptions, read: Reader
) -> Path:
    """Write specimens.csv with a row a recording; rows that are there stay as they are.

    Files that hold no test and copies get no row.
    """
    path = folder / "specimens.csv"
    before = specimens(folder)
    rows = [
        {"file": n} | {k: v if k == "specimen" else f"{v:g}" for k, v in r.items() if v}
        for n, r in before.items()
    ]
    copies = _copies(files)
    for file in files:
        name = file.relative_to(folder).as_posix()
        specimen = ""
        try:
            specimen = read(file, options)[0].specimen
        except NoRecording:
            continue
        except InputError:  # it lacks its sizes, as a rule
            pass
        if not set(called(name)) & set(before) and file not in copies:
            rows.append({"file": name, "specimen": specimen})
    out = io.StringIO(newline="")
    writer = csv.DictWriter(out, TABLE, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    try:
        write_text(path, out.getvalue())
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=path) from None
    return path
