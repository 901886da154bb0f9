"""Which physics was left out? Concealed cases by other hands, diagnosed, then scored.

`python -m bench.hands` makes the cases, or --cases-in takes those of a folder
(cases/NAME and truth/NAME/truth.json). Their truths are sealed (the hash goes into the
record first); then the command `softnn diagnose` is run on the cases alone; only when
all diagnoses are written are the truths opened, which the ledger keeps. Seeds below
10000 are for development; a trial with a seed from 10000 on, or a --label, is written
to studies/results/hands.json with --publish.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench import ledger, scoring
from bench.hands.families import EFFECTS
from bench.trials import acting, noise_check, sealing
from bench.trials.held import held_errors
from bench.trials.located import located
from bench.trials.reporting import report
from softnn.contracts import InputError
from softnn.study.common import (
    RESULTS,
    guarded,
    parser,
    provenance,
    results_folder,
    runs_folder,
)

SOFTNN = [sys.executable, "-m", "softnn.cli"]
HANDS = [sys.executable, "-m", "bench.hands"]
SIDES = ("development", "held-out")
COUNTS = {
    "nulls": 50,
    "singles": 100,
    "pairs": 40,
    "aliens": 30,
    "mixed": 20,
    "bent": 20,
}
FEW = dict.fromkeys(COUNTS, 0) | {"nulls": 1, "singles": 1, "aliens": 1}
TIMED_CASES = 3  # diagnosed once more, one at a time, for the time a user waits


def make_parser() -> argparse.ArgumentParser:
    p = parser("concealed", __doc__)
    for name, count in COUNTS.items():
        p.add_argument(f"--{name}", type=int, help=f"how many ({count})")
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    p.add_argument("--scheduler", metavar="tcp://...", help="of a Dask cluster")
    p.add_argument("--out", type=Path, help="where cases and diagnoses go (mlruns/...)")
    p.add_argument("--label", help="what the trial is called in results")
    p.add_argument("--tracking", help="MLflow address (mlruns/mlflow.db)")
    p.add_argument(
        "--noise-check", action="store_true", help="whiten what truths leave, too"
    )
    whose = p.add_mutually_exclusive_group()
    whose.add_argument("--hands", choices=SIDES, default=SIDES[0], help="which side")
    whose.add_argument("--cases-in", type=Path, metavar="FOLDER", help="these cases")
    only = p.add_mutually_exclusive_group()
    only.add_argument("--resume", type=Path, metavar="DIR", help="diagnose the rest")
    only.add_argument(
        "--score-only", type=Path, metavar="DIR", help="of an earlier run"
    )
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.concealed`; returns the exit code."""
    arguments = make_parser().parse_args(argv)
    return guarded(lambda: run(arguments))


def run(a: argparse.Namespace) -> None:
    folder, record = taken_up(a) if a.score_only or a.resume else begun(a)
    if not a.score_only:
        diagnose_rest(folder, record, a.jobs, scheduler=a.scheduler)
    score(folder, record, a)


def begun(a: argparse.Namespace) -> tuple[Path, dict[str, Any]]:
    """A new trial: its folder, and its record with the hash of the key."""
    sealed = a.seed >= sealing.FIRST_TRIAL_SEED and not a.smoke
    if a.cases_in:
        label, sealed = a.cases_in.resolve().name, False
        record: dict[str, Any] = {"generator": "cases", "seed": None}
        record["cases_in"] = str(a.cases_in.resolve())
    else:
        label = a.hands
        asked = {k: getattr(a, k) for k in COUNTS}
        usual = FEW if a.smoke else COUNTS
        counts = {k: usual[k] if v is None else v for k, v in asked.items()}
        if min(*counts.values(), a.seed) < 0:
            raise InputError("counts of cases and --seed must be 0 or more")
        record = {"generator": "hands", "seed": a.seed, "side": a.hands}
        record["counts"] = counts
    record |= {
        "label": a.label or label,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "published": not a.smoke and (sealed or bool(a.label)),
        "smoke": a.smoke,
    }
    home = runs_folder(a.smoke)
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    name = f"{record['label']}-seed-{a.seed}-{stamp}"
    folder = a.out or home / "concealed" / name
    if (folder / "record.json").exists():
        raise InputError(f"{folder} holds a trial; --resume it, or name another")
    seal(folder, record, a.jobs)
    print(f"{record['cases']} cases in {folder}; key SHA-256 {record['key_sha256']}")
    return folder, record


def taken_up(a: argparse.Namespace) -> tuple[Path, dict[str, Any]]:
    """An earlier trial, its cases made to the end where it was killed before."""
    folder = a.score_only or a.resume
    if not (folder / "record.json").exists():
        raise InputError(f"{folder} holds no record.json; name a trial's folder")
    record = json.loads((folder / "record.json").read_text())
    if a.cases_in:
        record["cases_in"] = str(a.cases_in.resolve())  # they may have been moved
    if "key_sha256" not in record:
        seal(folder, record, a.jobs)
    return folder, record


def source(folder: Path, record: Mapping[str, Any]) -> Path:
    """Where a trial's cases/ and truth/ lie."""
    if "cases_in" in record:
        return Path(record["cases_in"])
    return folder / "forged"


def seal(folder: Path, record: dict[str, Any], jobs: int) -> None:
    """Have the cases made, where they are not, and seal their truths."""
    folder.mkdir(parents=True, exist_ok=True)
    write_record(folder, record)
    if record["generator"] == "hands" and not (folder / "forged").exists():
        half = folder / "forging"  # what was killed here is made anew
        shutil.rmtree(half, ignore_errors=True)
        numbers = {"seed": record["seed"], **record["counts"], "jobs": jobs}
        options = [x for k, v in numbers.items() for x in (f"--{k}", str(v))]
        command = [*HANDS, "--side", record["side"], *options, "--out", str(half)]
        if subprocess.run(command, check=False).returncode:
            raise InputError("the cases could not be made; see above")
        half.rename(folder / "forged")
    truths = read_sealed(lambda: sealing.truths_in(source(folder, record)))
    record |= {"cases": len(truths), "key_sha256": sealing.seal_of(truths)}
    write_record(folder, record)


def read_sealed(read: Callable[[], Any]) -> Any:
    try:
        return read()
    except (OSError, ValueError) as error:
        raise InputError(str(error)) from None


def diagnose_rest(
    folder: Path,
    record: dict[str, Any],
    jobs: int,
    timed: int = TIMED_CASES,
    scheduler: str | None = None,
) -> None:
    """Diagnose what is not diagnosed; the record says by which commit, and how fast."""
    cases = source(folder, record) / "cases"
    if undiagnosed(folder, cases):
        before, now = record.get("commit", ""), provenance()
        record |= now
        if before and before != now.get("commit"):  # taken up again, with other code
            record["commit"] = f"{before}, {now.get('commit', 'unknown')}"
        write_record(folder, record)
    timed = 0 if record["smoke"] else timed
    record |= diagnose(folder, jobs, record["seed"] or 0, timed, cases, scheduler)
    write_record(folder, record)


def score(folder: Path, record: dict[str, Any], a: argparse.Namespace) -> None:
    """Open the key, enter that into the ledger, score and report."""
    place = source(folder, record)
    record["published"] = record["published"] and a.publish
    where = results_folder(record["smoke"], record["published"])
    truths = read_sealed(lambda: sealing.open_truths(place, record["key_sha256"]))
    opening = opening_of(record, truths, place)
    aside = books(record["smoke"])
    record["opened_before"] = ledger.enter(opening, where, aside)["opened_before"]
    diagnoses = scoring.read_diagnoses((t.case for t in truths), folder / "diagnoses")
    rows = [
        scoring.row(t, diagnoses[t.case])
        | where_and_gain(t.case, place, folder / "diagnoses", diagnoses[t.case])
        for t in truths
    ]
    scores = scoring.summary(rows) | located(rows)
    if a.noise_check:
        scores["noise_check"] = noise_check.check(place, truths)
    (folder / "rows.json").write_text(json.dumps(rows, indent=1) + "\n")
    report(folder, record, scores, a.tracking)
    naming = scores["all"]["naming"]
    right = {c: f"{n['right']} of {n['of']}" for c, n in naming.items()}
    lacking = len(undiagnosed(folder, place / "cases"))  # and so counted as wrong
    ledger.enter(opening | {"right": right, "undiagnosed": lacking}, where, aside)


def where_and_gain(
    case: str, place: Path, diagnosed: Path, diagnosis: Mapping[str, Any]
) -> dict[str, Any]:
    """F1 of the regions of a case, and errors on its held recordings."""
    told = place / "truth" / case
    truth = json.loads((told / "truth.json").read_text(encoding="utf-8"))
    return {
        "f1": acting.f1(truth, diagnosis, place / "cases" / case),
        "held": held_errors(told, diagnosed / case),
    }


def books(smoke: bool) -> list[Path]:
    """Where openings are entered: that of the project, and that of unpublished runs."""
    return [] if smoke else [RESULTS, results_folder()]


def opening_of(
    record: Mapping[str, Any], truths: Sequence[scoring.Truth], place: Path
) -> ledger.Row:
    """What the ledger keeps; what is right comes later."""
    key = record["key_sha256"]
    opening = {
        "trial": f"{record['started']} {key[:16]}",
        "opened": datetime.now(UTC).strftime("%Y-%m-%d"),
        **{k: record.get(k) for k in ("generator", "side", "seed")},
        "what": record["label"],
        "counts": dict(Counter(t.cls for t in truths)),
        "right": {},
        "commit": record.get("commit"),
        "key_sha256": key,
    }
    if record["generator"] == "cases":  # no seed tells which these are
        data = sealing.truths_in(place).values()
        opening["truths"] = [hashlib.sha256(d).hexdigest()[:12] for d in data]
    return opening


def check_names(names: Sequence[str]) -> None:
    """Raise InputError for a name that no effect has."""
    unknown = sorted(set(names) - set(EFFECTS))
    if unknown:
        raise InputError(
            f"no effect is called {unknown[0]!r}; allowed are {', '.join(EFFECTS)}"
        )


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    (folder / "record.json").write_text(json.dumps(record, indent=1) + "\n")


def undiagnosed(folder: Path, cases: Path) -> list[str]:
    """Cases that have no diagnosis yet."""
    return [
        str(case.absolute())
        for case in sorted(cases.iterdir())
        if not (folder / "diagnoses" / case.name / "diagnosis.json").exists()
    ]


def diagnose(
    folder: Path,
    jobs: int,
    seed: int,
    timed: int,
    where: Path,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Run the command on the cases, as a user would; how long it took.

    It is told the folders of the cases (in `where`) and nothing else. Cases that have
    a diagnosis from an interrupted run are left out.
    """
    cases = undiagnosed(folder, where)
    if not cases:
        return {}
    command = [*SOFTNN, "diagnose", "--seed", str(seed), "--jobs"]
    begun = time.perf_counter()
    out = str((folder / "diagnoses").resolve())
    on = [] if scheduler is None else ["--scheduler", scheduler]
    many = [*command, str(jobs), *on, "--out", out, *cases]
    done = subprocess.run(many, check=False)
    wall = time.perf_counter() - begun
    single = []
    for case in cases[:timed]:
        begun = time.perf_counter()
        out = str((folder / "timed").resolve())
        subprocess.run(
            [*command, "2", "--out", out, case],
            check=False,
            stdout=subprocess.DEVNULL,
        )
        single.append(time.perf_counter() - begun)
    return {
        "diagnose_exit": done.returncode,
        "wall_s": wall,
        "jobs": jobs,
        "seconds_a_case": wall / len(cases),
        "seconds_alone": sorted(single)[len(single) // 2] if single else None,
    }
