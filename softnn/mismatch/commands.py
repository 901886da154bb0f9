"""`softnn diagnose` and `softnn simulate`."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import sys
from collections.abc import Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import Chunk, InputError
from softnn.json_file import write
from softnn.models.units import BASES
from softnn.workers import workers

__all__ = ["add_diagnose", "add_simulate", "write"]

SLACK = 0.01  # of the range of strain, by which one may lie beside it
DONE = ".done"  # in the folder of a diagnosis, once all of it is written


def add_diagnose(commands: Any) -> None:
    parser = commands.add_parser(
        "diagnose",
        help="where a simulation and recordings differ, and which physics was left out",
        description="Locate, explain, model and verify the mismatch of each case: a "
        "folder with recordings/*.csv and, if wanted, case.toml.",
    )
    parser.add_argument("cases", nargs="+", metavar="CASE")
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument(
        "--model",
        metavar="|".join(BASES) + "|FILE",
        help="the base (default: as the case says, else its simulated_MPa, "
        "else pl-wiechert), or a model.json",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="leave cases alone that --out has a diagnosis of, from the same data, "
        "case.toml, model and seed",
    )
    parser.add_argument(
        "--tracking", metavar="URI", help="log each diagnosis to this MLflow address"
    )
    parser.set_defaults(run=diagnose)


def add_simulate(commands: Any) -> None:
    parser = commands.add_parser(
        "simulate",
        help="stress of a model.json over the strain of recordings",
        description="Write time_s, strain, simulated_MPa (and stress_MPa where the "
        "recording has it) for each recording; the stress is never used. A network "
        "gets a column outside: 1 strain, 2 rate, 4 direction never shown to it, added "
        "up.",
    )
    parser.add_argument("model", metavar="MODEL.json")
    parser.add_argument("recordings", nargs="+", metavar="RECORDING.csv")
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.set_defaults(run=simulate)


# -- diagnose --------------------------------------------------------------------------


def diagnose(arguments: argparse.Namespace) -> int:
    from tqdm import tqdm

    if arguments.jobs < 1:
        raise InputError(f"--jobs is {arguments.jobs}; at least 1 is needed")
    if arguments.seed < 0:
        raise InputError(f"--seed is {arguments.seed}; allowed is 0 and above")
    if arguments.model is not None:
        _model(arguments.model)  # refuse it once, before any case
    out = Path(arguments.out)
    folders = [Path(c).resolve() for c in arguments.cases]
    names = [_safe(f.name) for f in folders]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(
                f"two cases are called {name!r}; give each a folder of its own name"
            )
    for name in names:
        writable(out / name)  # before hours of work
    jobs = [
        (str(f), str(out / n), arguments.model, arguments.seed, arguments.resume)
        for f, n in zip(folders, names, strict=True)
    ]
    most = min(arguments.jobs, len(jobs))
    failed = 0
    bar = tqdm(total=len(jobs), unit="case", disable=len(jobs) < 2, file=sys.stderr)
    for i, (line, good) in _each(jobs, most):
        bar.update()
        with bar.external_write_mode(file=sys.stdout):
            if good:
                print(f"{names[i]}: {line}", flush=True)
        if not good:
            failed += 1
            with bar.external_write_mode(file=sys.stderr):
                print(f"softnn: {line}", file=sys.stderr, flush=True)
    bar.close()
    if arguments.tracking:
        from softnn.mismatch.record import log

        log(arguments.tracking, [out / n for n in names], arguments.seed)
    return 2 if failed else 0


def _each(jobs: Sequence[tuple], most: int) -> Any:
    """Results as they come, with the place of the job."""
    if most == 1:
        for i, job in enumerate(jobs):
            yield i, diagnose_one(*job)
        return
    with workers(most) as pool:
        futures = {pool.submit(diagnose_one, *job): i for i, job in enumerate(jobs)}
        for future in as_completed(futures):
            yield futures[future], future.result()


def diagnose_one(
    folder: str, out: str, model: str | None, seed: int, resume: bool = False
) -> tuple[str, bool]:
    """Diagnose one case, write its files; the sentence to print, and whether well."""
    from softnn.mismatch import diagnose as diagnose_case
    from softnn.mismatch import read_case

    try:
        case = read_case(folder)
        asked, mark = _asked(case, model, seed), Path(out) / DONE
        if resume and mark.is_file() and mark.read_text() == asked:
            told = json.loads((Path(out) / "diagnosis.json").read_text("utf-8"))
            return f"done before: {told['summary']}", True
        mark.unlink(missing_ok=True)
        found = diagnose_case(case, None if model is None else _model(model), seed)
    except InputError as error:
        return str(error), False
    found.save(out)
    mark.write_text(asked)
    return found.summary, True


def _asked(case: Any, model: str | None, seed: int) -> str:
    """SHA-256 (hex) of all that a diagnosis depends on."""
    from softnn import __version__
    from softnn.recording import data_hash

    digest = hashlib.sha256(data_hash(case.recordings).encode())
    for values in case.simulated_MPa or ():
        digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    about = case.model, case.history, sorted(case.specimen.items()), model, seed
    digest.update(repr((*about, __version__)).encode())
    if model is not None and Path(model).is_file():
        digest.update(Path(model).read_bytes())
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


def _model(name: str) -> Any:
    """A base by name, or a stored model."""
    from softnn.mismatch.case import check_model
    from softnn.mismatch.model_file import read_model

    if name in BASES:
        return name
    if Path(name).suffix == ".json" or Path(name).exists():
        return read_model(name)
    check_model(name)
    return name


def _safe(name: str) -> str:
    return re.sub(r"[^\w.+-]", "_", name) or "case"


# -- simulate --------------------------------------------------------------------------


def simulate(arguments: argparse.Namespace) -> int:
    import pandas as pd

    from softnn.mismatch.model_file import read_model

    model = read_model(arguments.model)
    files = [Path(f) for f in arguments.recordings]
    stems = [f.stem for f in files]
    for i, stem in enumerate(stems):
        if stem in stems[:i]:
            raise InputError(f"two recordings are called {stem!r}; rename one")
    out = Path(arguments.out)
    writable(out)
    chunks, given, measured = [], [], []
    for file in files:
        frame = _history(file)
        time = frame["time_s"].to_numpy(float)
        strain = _bridged(frame["strain"].to_numpy(float), time)
        warm = frame.get("temperature_C")
        chunks.append(
            Chunk(time, strain, None if warm is None else warm.to_numpy(float))
        )
        simulated = frame.get("simulated_MPa")
        given.append(
            None
            if simulated is None or not model.needs_simulated
            else _bridged(simulated.to_numpy(float), time)
        )
        measured.append(frame.get("stress_MPa"))
    stress = model.stress(stems, chunks, given)
    for line in _beyond(model, stems, chunks):
        print(f"softnn: {line}", file=sys.stderr)
    for file, chunk, s, m in zip(files, chunks, stress, measured, strict=True):
        table: dict[str, Any] = {
            "time_s": chunk.time_s,
            "strain": chunk.strain,
            "simulated_MPa": s,
        }
        if m is not None:
            table["stress_MPa"] = m.to_numpy(float)
        told = f"{file.stem}: {len(s)} samples"
        if hasattr(model, "outside"):
            table["outside"] = model.outside(chunk)
            told += _outside(table["outside"])
        pd.DataFrame(table).to_csv(
            out / f"{file.stem}.csv", index=False, float_format="%.9g"
        )
        print(told)
    return 0


def _outside(flags: Any) -> str:
    """How many samples a network was asked beyond its training."""
    from softnn.neural import counted

    count = dict(counted(flags))
    del count["samples"]
    total = count.pop("outside")
    by = ", ".join(f"{word} {n}" for word, n in count.items() if n)
    return f", {total} outside the training" + (f" ({by})" if total else "")


def _beyond(model: Any, names: Sequence[str], chunks: Sequence[Chunk]) -> list[str]:
    """What a corrected model does not know of these recordings, in a line each."""
    from softnn.mismatch.model_file import Stored

    if not isinstance(model, Stored):
        return []
    lines = []
    low, high = model.units.knots[0], model.units.knots[-1]
    slack = SLACK * (high - low)
    far = [
        name
        for name, chunk in zip(names, chunks, strict=True)
        if chunk.strain.min() < low - slack or chunk.strain.max() > high + slack
    ]
    if far:
        lines.append(
            f"{_some(far)}: strain beyond {low:.4g} to {high:.4g}, which the model "
            "was made from"
        )
    own: set[str] = set()
    inner: Any = model
    while isinstance(inner, Stored):
        own |= {n for piece in inner.own for values in piece.values() for n in values}
        inner = inner.simulation
    new = [name for name in names if name not in own]
    if own and new:
        lines.append(
            f"{_some(new)}: unknown to the model by name; own values of that recording "
            f"are off (it knows {_some(sorted(own))})"
        )
    return lines


def _some(names: Sequence[str], most: int = 3) -> str:
    """Names in a line: the first few, and how many more."""
    shown = ", ".join(" ".join(n.split())[:60] for n in names[:most])
    more = len(names) - most
    return f"{shown} and {more} more" if more > 0 else shown


def _history(file: Path) -> Any:
    """Columns of a recording, stress not needed."""
    import io

    import pandas as pd

    from softnn.readers.tidy import read_text

    try:
        frame = pd.read_csv(io.StringIO(read_text(file)))
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise InputError(f"not a CSV table: {error}", file=file) from None
    frame.columns = [str(c).strip() for c in frame.columns]
    for column in ("time_s", "strain"):
        if column not in frame.columns:
            raise InputError("no such column", file=file, row=1, column=column)
    for column in frame.columns:
        if column not in (
            "time_s",
            "strain",
            "stress_MPa",
            "temperature_C",
            "simulated_MPa",
        ):
            continue
        values = pd.to_numeric(frame[column], errors="coerce")
        text = values.isna() & frame[column].notna()
        if text.any():
            i = int(text.to_numpy().argmax())
            raise InputError(
                f"{str(frame[column].iloc[i])[:40]!r} is not a number",
                file=file,
                row=i + 2,
                column=column,
            )
        frame[column] = values.astype(float)
    if len(frame) < 1:
        raise InputError("no rows", file=file)
    time = frame["time_s"].to_numpy(float)
    if np.isnan(time).any():
        i = int(np.isnan(time).argmax())
        raise InputError("no time", file=file, row=i + 2, column="time_s")
    back = np.diff(time) < 0
    if back.any():
        raise InputError(
            "time goes backwards",
            file=file,
            row=int(back.argmax()) + 3,
            column="time_s",
        )
    return frame


def _bridged(values: Any, time: Any) -> Any:
    bad = ~np.isfinite(values)
    if bad.all():
        raise InputError("a column of strain or simulation holds no number at all")
    values = np.array(values)
    values[bad] = np.interp(time[bad], time[~bad], values[~bad])
    return values
