"""Diagnose several cases, one after another or side by side, and write their files."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from softnn.cards.read import is_card, read_card
from softnn.contracts import InputError
from softnn.database import Lock
from softnn.mismatch.api import inferred, load_model, to_case
from softnn.mismatch.case import Case
from softnn.mismatch.families import AUTO
from softnn.models.bases import BASES, check
from softnn.readers import ReadOptions
from softnn.readers.lacking import Lacking
from softnn.readers.options import name_of
from softnn.workers import workers

FAILED = "error.txt"  # in the folder of a case on which softnn failed
DONE = ".done"  # in the folder of a diagnosis once all its files are written


@dataclass(frozen=True)
class Job:
    """A case to diagnose: a folder or a list of files, and where its results go."""

    source: Path | tuple[Path, ...]
    out: Path
    model: str | None = None
    refit: bool = False  # whether the moduli of a card are fitted
    card_unit: str | None = None  # unit of stress of a card
    seed: int = 0
    tolerance: float = 0.02
    resume: bool = False
    options: ReadOptions = field(default_factory=ReadOptions)
    skip: tuple[str, ...] = ()  # patterns of files to ignore
    as_is: bool = False  # accept implausible numbers
    say: Callable[[str], None] | None = None  # shows the inferred settings first
    command: tuple[str, ...] = ("softnn", "diagnose")  # the command as it was typed


@dataclass(frozen=True)
class Outcome:
    """The outcome of a job: the sentence to print and the content of the result."""

    line: str
    result: dict[str, Any] | None = None


def jobs_of(
    sources: Sequence[str], out: Path, model: str | None, **common: Any
) -> list[Job]:
    """Return one job for each folder, one for all files. Raises `InputError`."""
    if model is not None:
        base(
            model, common.get("refit", False), common.get("card_unit")
        )  # refuse a wrong model once, before any case
    elif common.get("refit") or common.get("card_unit"):
        raise InputError(
            "--refit and --card-unit are for material cards; name one with --model "
            "CARD, or leave them out"
        )
    paths = [Path(s) for s in sources]
    files = tuple(p for p in paths if p.is_file())
    cases: list[Path | tuple[Path, ...]] = [p for p in paths if p not in files]
    cases += [files] if files else []
    names = _names(cases)
    jobs = [
        Job(case, out / name, model, **common)
        for case, name in zip(cases, names, strict=True)
    ]
    for job in jobs:
        writable(job.out)  # find a full or locked disk before hours of work
    return jobs


def _names(cases: Sequence[Path | tuple[Path, ...]]) -> list[str]:
    """Return a folder name for each case; equal names get the parent in front."""
    names = [_safe(case_name(c)) for c in cases]
    for above in (1, 2, 3):
        same = {n for n in names if names.count(n) > 1}
        names = [
            _safe("_".join(c.resolve().parts[-1 - above :]))
            if n in same and isinstance(c, Path)
            else n
            for n, c in zip(names, cases, strict=True)
        ]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(f"{cases[i]} is named twice; once is enough")
    return names


def case_name(source: Path | tuple[Path, ...]) -> str:
    """Return the name of the case of a folder, or of several files."""
    if isinstance(source, Path):
        return source.resolve().name
    if len(source) == 1:
        return name_of(source[0])
    return source[0].resolve().parent.name


def run(
    jobs: Sequence[Job], most: int, scheduler: str | None = None
) -> Iterator[tuple[int, Outcome]]:
    """Yield the index of a job and its outcome, as they finish; `most` run at a time.

    With a Dask `scheduler`, jobs run on its workers, which must see the same folders.
    """
    if min(most, len(jobs)) < 2 and scheduler is None:
        yield from ((i, diagnose_one(job)) for i, job in enumerate(jobs))
        return
    with workers(min(most, len(jobs)), scheduler) as pool:
        futures = {pool.submit(diagnose_one, job): i for i, job in enumerate(jobs)}
        for future in as_completed(futures):
            yield futures[future], future.result()


def diagnose_one(job: Job) -> Outcome:
    """Diagnose one case and write its files; if it fails, return the message."""
    try:
        return _diagnosed(job)
    except Lacking as error:
        return Outcome(str(error) + _to_type(job, error))
    except InputError as error:
        return Outcome(str(error))
    except OSError as error:  # a full disk, mostly
        what = error.strerror or str(error)
        return Outcome(
            f"{case_name(job.source)}: cannot be written to {job.out}: {what}; what "
            "was there before is as it was"
        )
    except Exception as error:  # a fault of softnn; the other cases go on
        told = job.out / FAILED
        with suppress(OSError):
            told.write_text(traceback.format_exc(), encoding="utf-8")
        what = f"{type(error).__name__}: {error}".splitlines()[0]
        return Outcome(
            f"{case_name(job.source)}: softnn failed on it, by no fault of the "
            f"recordings ({what}); please report it with {told}"
        )


def _to_type(job: Job, error: Lacking) -> str:
    """Return the command with the missing option, and the way for varying sizes."""
    said = f". Type: {shlex.join([*job.command, *error.options])}"
    if isinstance(job.source, Path) and error.sizes:
        said += (
            f". Sizes that differ: softnn diagnose {shlex.quote(str(job.source))} "
            "--template, and fill in the table that it writes"
        )
    return said


def _diagnosed(job: Job) -> Outcome:
    from softnn import __version__
    from softnn.mismatch.diagnosis import diagnose

    case = to_case(job.source, job.as_is, options=job.options, skip=job.skip)
    if job.say is not None:
        for line in [*inferred(case, job.model), *case.notes]:
            job.say(line)
    asked, mark = _asked(case, job), job.out / DONE
    if job.resume and mark.is_file() and mark.read_text() == asked:
        told = json.loads((job.out / "diagnosis.json").read_text("utf-8"))
        return Outcome(f"done before: {told['summary']}", told)
    (job.out / FAILED).unlink(missing_ok=True)
    model = None if job.model is None else base(job.model, job.refit, job.card_unit)
    found = diagnose(case, model, job.seed, job.tolerance)
    found.result["provenance"] = {
        "softnn": __version__,
        "seed": job.seed,
        "command": shlex.join(job.command),
    }
    mark.unlink(missing_ok=True)
    found.save(job.out)
    mark.write_text(asked)
    said = found.summary
    if "card" in found.result:
        said += f" {found.result['card']['summary']}"
    return Outcome(said, found.result)


def base(name: str, refit: bool = False, unit: str | None = None) -> Any:
    """Return the name of a base, a stored model or a card. Raises `InputError`.

    `refit` and `unit` (of stress) are of a card.
    """
    if is_card(name):
        return replace(read_card(name, unit), refit=refit)
    if refit or unit is not None:
        raise InputError(
            f"--refit and --card-unit are for material cards; --model is {name!r}"
        )
    if name in (*BASES, AUTO):
        return name
    if Path(name).suffix == ".json" or Path(name).exists():
        return load_model(name)
    check(name)
    return name


def _asked(case: Case, job: Job) -> str:
    """Return the SHA-256 (hex) of all inputs that a diagnosis depends on."""
    from softnn import __version__
    from softnn.recording import data_hash

    digest = hashlib.sha256(data_hash(case.recordings).encode())
    for values in case.simulated_MPa or ():
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    about = case.model, case.history, sorted(case.specimen.items()), job.model, job.seed
    more = job.refit, job.card_unit, job.tolerance
    digest.update(repr((*about, *more, __version__)).encode())
    file = Path((job.model or "").partition("#")[0])
    if job.model is not None and file.is_file():
        digest.update(file.read_bytes())
    return digest.hexdigest()


def writable(folder: Path) -> None:
    """Make a folder to write into. Raises `InputError` if it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        trial = folder / f".{os.getpid()}"
        trial.write_bytes(bytes(4096))  # fails on a full disk
        trial.unlink()
    except OSError as error:
        with suppress(OSError, UnboundLocalError):
            trial.unlink(missing_ok=True)
        raise InputError(
            f"cannot be written to ({error.strerror}); choose another --out",
            file=folder,
        ) from None


@contextmanager
def alone(out: Path) -> Iterator[None]:
    """Lock `out` for this process. Raises `InputError` in a second process."""
    writable(out)
    lock = Lock(out / ".softnn.lock", f"a command with --out {out}")
    try:
        yield
    finally:
        lock.release()


def file_name(name: str, taken: set[str]) -> str:
    """Return a safe file name (no path in it) that is not among those `taken`."""
    stem = base_ = _safe(name).strip(".-") or "recording"
    count = 1
    while stem.casefold() in taken:
        count += 1
        stem = f"{base_}-{count}"
    taken.add(stem.casefold())
    return stem


def _safe(name: str) -> str:
    return re.sub(r"[^\w.+-]", "_", name) or "case"
