"""What is missing from simulations of real recordings, and does the literature agree?

Sets lie in the folder SOFTNN_DATA; each group of recordings is fitted by bases that
leave physics out, diagnosed, and held against specimens, rates or amplitudes that were
not used. With --faults, faults are put into copies and must be found.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.recordings import faults, oracle, slip
from bench.recordings.faults import CONTROL, FAULTS, faulty, one_less
from bench.recordings.groups import Group, discover, first_loading, first_turn
from bench.recordings.predict import misses, summary, usable
from bench.recordings.promise import promised
from bench.recordings.reporting import report
from bench.recordings.rows import MAIN, Row
from bench.recordings.virtual import made_up
from softnn.contracts import InputError
from softnn.database import Store
from softnn.mismatch.case import to_data
from softnn.mismatch.diagnosis import Diagnosis, diagnose
from softnn.models.bases import BASES
from softnn.readers.tidy import data_folder
from softnn.recording import data_hash
from softnn.study.common import (
    fingerprint,
    guarded,
    package_files,
    parser,
    provenance,
    runs_folder,
)
from softnn.workers import workers

DEFAULT_BASES = ("hooke", "sls", "pl-wiechert")


@dataclass(frozen=True)
class Task:
    """One diagnosis to be made, and what it is for."""

    group: Group
    kind: str  # "all", "split", "monotonic", "fault" or "oracle"
    base: str
    samples: int
    seed: int
    split: int = -1
    fault: str = ""
    size: float = 1.0
    model: dict[str, Any] = field(default_factory=dict)  # of the original


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.recordings`; returns the exit code."""
    p = parser("recordings", __doc__)
    p.add_argument("--sets", nargs="+", default=[], metavar="SET", help="not all")
    p.add_argument("--groups", nargs="+", default=[], metavar="NAME", help="not all")
    p.add_argument("--data", type=Path, metavar="DIR", help="in place of SOFTNN_DATA")
    p.add_argument("--bases", nargs="+", default=list(DEFAULT_BASES), metavar="BASE")
    p.add_argument("--samples", type=int, default=6000, help="a recording, most (6000)")
    p.add_argument("--faults", action="store_true", help="made faults too")
    p.add_argument("--only-faults", action="store_true", help="made faults alone")
    p.add_argument("--size", type=float, default=1.0, help="of the faults (1)")
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--out", type=Path, metavar="DIR", help="for the result")
    p.add_argument("--fresh", action="store_true", help="forget finished diagnoses")
    p.add_argument("--tracking", help="MLflow address (mlruns/mlflow.db)")
    return guarded(lambda: run(p.parse_args(argv)))


def run(a: argparse.Namespace) -> None:
    check(a)
    folder = a.data or data_folder()
    left_out: dict[str, str] = {}
    if a.smoke:
        groups = made_up(a.seed)
        bases, samples = ["hooke"], 120
    else:
        if not any(folder.glob("*/index.csv")):
            print(
                f"no sets of recordings in {folder}; set SOFTNN_DATA to their folder. "
                "Nothing done"
            )
            return
        groups, left_out = discover(folder, a.sets)
        groups = [g for g in groups if not a.groups or g.name in a.groups]
        bases, samples = list(a.bases), a.samples
    for name, why in left_out.items():
        print(f"left out: {name}: {why}")
    if not groups:
        raise InputError(f"no group called {', '.join(a.groups)} in these sets")
    tasks = [
        t for g in groups for t in planned(g, bases, samples, a.seed, a.only_faults)
    ]
    if a.faults or a.only_faults or a.smoke:
        only = ["offset"] if a.smoke else list(FAULTS)
        base = bases[-1] if MAIN not in bases else MAIN
        for g in groups:
            tasks += broken(g, base, samples, a.seed, a.size, only)
    home = runs_folder(a.smoke)
    file = home / "recordings" / "rows.sqlite"
    with Store(file, fresh=a.fresh or a.smoke) as store:
        rows = carried_out(tasks, a.jobs, store)
        rows = with_oracle(tasks, rows, a.jobs, store)
    digest = data_hash([r for g in groups for r in g.recordings])
    report(rows, groups, left_out, a, digest, MAIN if MAIN in bases else bases[-1])


def check(a: argparse.Namespace) -> None:
    unknown = set(a.bases) - set(BASES)
    if unknown:
        raise InputError(
            f"no base {sorted(unknown)[0]!r}; allowed are {', '.join(BASES)}"
        )
    if a.samples < 100:
        raise InputError(f"--samples is {a.samples}; at least 100 are needed")
    if a.jobs < 1 or not a.size > 0:
        raise InputError("--jobs must be 1 or more, --size above 0")


def planned(
    group: Group, bases: Sequence[str], samples: int, seed: int, faults_only: bool
) -> list[Task]:
    """Diagnoses of untouched recordings."""
    out = []
    for base in bases:
        if faults_only:
            continue
        out.append(Task(group, "all", base, samples, seed))
        out += [
            Task(group, "split", base, samples, seed, split=i)
            for i in range(len(group.splits))
        ]
        if all(first_turn(r) < len(r) for r in group.recordings):
            out.append(Task(group, "monotonic", base, samples, seed))
    return out


def broken(
    group: Group,
    base: str,
    samples: int,
    seed: int,
    size: float,
    names: Sequence[str],
) -> list[Task]:
    """Diagnoses of faulty copies, and of copies without a fault."""
    names = [n for n in names if FAULTS[n].shows(group.recordings, group.specimens)]
    if len(group.recordings) > 2:
        names = [CONTROL, *names]
    return [
        Task(group, "fault", base, samples, seed, fault=name, size=size)
        for name in ("", *names)
    ]


def carried_out(tasks: Sequence[Task], jobs: int, store: Store) -> list[Row]:
    """A row a task, in order; finished ones are taken from the store."""
    keys = [key_of(t) for t in tasks]
    every = dict(zip(keys, tasks, strict=True))  # one key, one diagnosis
    known = {k: Row.of(row) for k, row in store.rows().items()}
    todo = {k: t for k, t in every.items() if k not in known}
    print(f"{len(every)} diagnoses, {len(every) - len(todo)} of them at hand")
    about = provenance()
    with workers(jobs) if jobs > 1 else nullcontext() as pool:
        done = (pool.map if pool else map)(work, todo.values())
        for i, (key, row) in enumerate(zip(todo, done, strict=True), start=1):
            row.made, row.softnn = about["made"], about["softnn"]
            row.commit = about.get("commit", "")
            store.add(key, asdict(row))
            known[key] = row
            print(f"[{i}/{len(todo)}] {row.line()}", flush=True)
    rows = [known[k] for k in keys]
    return [replace(r, kind=t.kind) for r, t in zip(rows, tasks, strict=True)]


def with_oracle(
    tasks: Sequence[Task], rows: Sequence[Row], jobs: int, store: Store
) -> list[Row]:
    """The rows, those of made faults with what a fit gains that knows the fault."""
    models = {
        (r.set, r.group): r.model for r in rows if r.kind == "fault" and not r.fault
    }
    put: dict[int, Task] = {}
    for i, (task, row) in enumerate(zip(tasks, rows, strict=True)):
        model = models.get((row.set, row.group))
        if row.expected and model:
            put[i] = replace(task, kind="oracle", model=model)
    found = carried_out(list(put.values()), jobs, store) if put else []
    out = list(rows)
    for i, row in zip(put, found, strict=True):
        out[i] = replace(out[i], oracle=row.oracle)
    return out


def key_of(task: Task) -> str:
    """What a row depends on: the task, the recordings, and the code that diagnoses.

    A copy without a fault is the group as it is, and is diagnosed once.
    """
    g = task.group
    way = [] if task.split < 0 else [g.splits[task.split]]
    made = (task.fault, task.size) if task.fault else ("", 0.0)
    kind = "all" if task.kind == "fault" and not task.fault else task.kind
    about = [kind, task.base, task.samples, task.seed, *made, task.model]
    mine = [Path(m.__file__ or "") for m in (faults, slip, oracle)]
    return fingerprint(
        [g.label, g.specimens, data_hash(g.recordings), about, *map(asdict, way)],
        files=[*package_files(), *(mine if task.fault else [])],
    )


def work(task: Task) -> Row:
    """One task; a case that cannot be diagnosed says why."""
    clock = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            row = KINDS[task.kind](task)
        except InputError as error:
            row = new_row(task)
            row.error = str(error)
            if task.split >= 0:
                row.label = task.group.splits[task.split].label
    row.seconds = time.perf_counter() - clock
    return row


def new_row(task: Task, found: Diagnosis | None = None) -> Row:
    row = Row(task.group.set, task.group.name, task.kind, task.base, fault=task.fault)
    if found is not None:
        row.take(found.result)
        row.model = found.model_json
    return row


def rng_of(task: Task) -> np.random.Generator:
    return np.random.default_rng([task.seed, sum(map(ord, task.group.label))])


def whole(task: Task) -> Row:
    case = usable(task.group.case(), task.samples)
    return new_row(task, diagnose(case, task.base, task.seed))


def split(task: Task) -> Row:
    """Diagnosis of some recordings, held against the others."""
    group, way = task.group, task.group.splits[task.split]
    case = usable(group.case(way.fit), task.samples)
    found = diagnose(case, task.base, task.seed)
    row = new_row(task, found)
    row.split, row.label, row.outside = way.by, way.label, way.outside
    unseen = usable(group.case(way.unseen), task.samples)
    row.promise = promised(found, unseen)
    models = {"before": found.base_json, "after": found.model_json}
    row.unseen = summary(misses(models, unseen, group.specimens), rng_of(task))
    return row


def monotonic(task: Task) -> Row:
    """Diagnosis of the first loading alone, held against what comes after it."""
    case = usable(task.group.case(), task.samples)
    cut = first_loading(case)
    found = diagnose(cut, task.base, task.seed)
    row = new_row(task, found)
    later = [
        np.arange(len(c.time_s)) >= first_turn(r)
        for c, r in zip(to_data(case).chunks, case.recordings, strict=True)
    ]
    models = {"before": found.base_json, "after": found.model_json}
    # Scales of single recordings are in the models by name, as fitted.
    row.unseen = summary(misses(models, case, False, later), rng_of(task))
    row.split, row.label = "cycles", "fitted to first loading alone"
    return row


def fault(task: Task) -> Row:
    whole = case = usable(task.group.case(), task.samples)
    made = FAULTS.get(task.fault)
    if made:
        case = faulty(case, made, task.size, rng_of(task)).case
    elif task.fault == CONTROL:
        case = one_less(case, rng_of(task))
    found = diagnose(case, task.base, task.seed)
    row = new_row(task, found)
    row.expected = made.effect if made else ""
    if task.fault == CONTROL:
        names = {r.name for r in case.recordings}
        left = tuple(r for r in whole.recordings if r.name not in names)
        row.promise = promised(found, replace(whole, recordings=left))
    return row


def gain(task: Task) -> Row:
    """What a fit gains that knows the fault of a copy."""
    case = usable(task.group.case(), task.samples)
    made = faulty(case, FAULTS[task.fault], task.size, rng_of(task))
    row = new_row(task)
    row.oracle = oracle.asked(made, FAULTS[task.fault], task.base, task.model)
    return row


KINDS: dict[str, Callable[[Task], Row]] = {
    "all": whole,
    "split": split,
    "monotonic": monotonic,
    "fault": fault,
    "oracle": gain,
}
