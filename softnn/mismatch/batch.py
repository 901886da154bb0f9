"""Cases diagnosed one after another or side by side, each with its files."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import sys
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.database import Lock
from softnn.mismatch.api import inferred, load_model, to_case
from softnn.mismatch.case import Case, check_model
from softnn.models.units import BASES
from softnn.readers import ReadOptions
from softnn.workers import workers

FAILED = "error.txt"  # in that folder, where softnn failed
DONE = ".done"  # in the folder of a diagnosis, once all of it is written


@dataclass(frozen=True)
class Job:
    """A case to diagnose: a folder or a list of files, and where its files go."""

    source: Path | tuple[Path, ...]
    out: Path
    model: str | None = None
    seed: int = 0
    resume: bool = False
    options: ReadOptions = field(default_factory=ReadOptions)
    skip: tuple[str, ...] = ()  # patterns of files to leave alone
    as_is: bool = False  # take implausible numbers as they stand
    aloud: bool = False  # whether to say what was inferred before it starts
    command: str = ""


@dataclass(frozen=True)
class Outcome:
    """What came of a job: the sentence to print, and what diagnosis.json holds."""

    line: str
    result: dict[str, Any] | None = None


def jobs_of(
    sources: Sequence[str], out: Path, model: str | None, **common: Any
) -> list[Job]:
    """A job a folder; files are one case together. Raises `InputError`."""
    if model is not None:
        base(model)  # refuse it once, before any case
    paths = [Path(s) for s in sources]
    files = tuple(p for p in paths if p.is_file())
    cases: list[Path | tuple[Path, ...]] = [p for p in paths if p not in files]
    cases += [files] if files else []
    names = [_safe(case_name(c)) for c in cases]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(
                f"two cases are called {name!r}; give each a folder of its own name"
            )
    common["command"] = shlex.join(["softnn", *sys.argv[1:]])
    jobs = [
        Job(case, out / name, model, **common)
        for case, name in zip(cases, names, strict=True)
    ]
    for job in jobs:
        writable(job.out)  # before hours of work
    return jobs


def case_name(source: Path | tuple[Path, ...]) -> str:
    """The name of the case of a folder, or of files."""
    if isinstance(source, Path):
        return source.resolve().name
    return source[0].stem if len(source) == 1 else source[0].resolve().parent.name


def run(
    jobs: Sequence[Job], most: int, scheduler: str | None = None
) -> Iterator[tuple[int, Outcome]]:
    """Outcomes as they come, with the place of the job; `most` at a time.

    Or on the workers of a Dask `scheduler`, which see the same folders.
    """
    if min(most, len(jobs)) < 2 and scheduler is None:
        yield from ((i, diagnose_one(job)) for i, job in enumerate(jobs))
        return
    with workers(min(most, len(jobs)), scheduler) as pool:
        futures = {pool.submit(diagnose_one, job): i for i, job in enumerate(jobs)}
        for future in as_completed(futures):
            yield futures[future], future.result()


def diagnose_one(job: Job) -> Outcome:
    """Diagnose one case and write its files; where it fails, say so."""
    try:
        return _diagnosed(job)
    except InputError as error:
        return Outcome(str(error))
    except Exception as error:  # a fault of softnn: the other cases go on
        told = job.out / FAILED
        told.write_text(traceback.format_exc(), encoding="utf-8")
        what = f"{type(error).__name__}: {error}".splitlines()[0]
        return Outcome(
            f"{case_name(job.source)}: softnn failed on it, by no fault of the "
            f"recordings ({what}); please report it with {told}"
        )


def _diagnosed(job: Job) -> Outcome:
    from softnn import __version__
    from softnn.mismatch.diagnosis import diagnose

    case = to_case(job.source, job.as_is, options=job.options, skip=job.skip)
    if job.aloud:
        # What was understood is for who looks on; what is odd is for everybody.
        said = inferred(case, job.model) if sys.stderr.isatty() else []
        for line in [*said, *case.notes]:
            print(line, file=sys.stderr, flush=True)
    asked, mark = _asked(case, job), job.out / DONE
    if job.resume and mark.is_file() and mark.read_text() == asked:
        told = json.loads((job.out / "diagnosis.json").read_text("utf-8"))
        return Outcome(f"done before: {told['summary']}", told)
    for before in (mark, job.out / FAILED):
        before.unlink(missing_ok=True)
    found = diagnose(case, None if job.model is None else base(job.model), job.seed)
    found.result["provenance"] = {
        "softnn": __version__,
        "seed": job.seed,
        "command": job.command,
    }
    found.save(job.out)
    mark.write_text(asked)
    return Outcome(found.summary, found.result)


def base(name: str) -> Any:
    """A base by name, or a stored model. Raises `InputError`."""
    if name in BASES:
        return name
    if Path(name).suffix == ".json" or Path(name).exists():
        return load_model(name)
    check_model(name)
    return name


def _asked(case: Case, job: Job) -> str:
    """SHA-256 (hex) of all that a diagnosis depends on."""
    from softnn import __version__
    from softnn.recording import data_hash

    digest = hashlib.sha256(data_hash(case.recordings).encode())
    for values in case.simulated_MPa or ():
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    about = case.model, case.history, sorted(case.specimen.items()), job.model, job.seed
    digest.update(repr((*about, __version__)).encode())
    if job.model is not None and Path(job.model).is_file():
        digest.update(Path(job.model).read_bytes())
    return digest.hexdigest()


def writable(folder: Path) -> None:
    """Make a folder to write into. Raises `InputError` where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        trial = folder / f".{os.getpid()}"
        trial.touch()
        trial.unlink()
    except OSError as error:
        raise InputError(
            f"cannot be written to ({error.strerror}); choose another --out",
            file=folder,
        ) from None


@contextmanager
def alone(out: Path) -> Iterator[None]:
    """Only one process writes into `out`. Raises `InputError` for the second."""
    writable(out)
    lock = Lock(out / ".softnn.lock", f"a command with --out {out}")
    try:
        yield
    finally:
        lock.release()


def _safe(name: str) -> str:
    return re.sub(r"[^\w.+-]", "_", name) or "case"
