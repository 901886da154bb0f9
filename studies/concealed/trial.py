"""Which physics was left out? Concealed cases, forged, diagnosed, then scored.

Cases are forged and their key sealed (its hash goes into the record first); then the
command `softnn diagnose` is run on the cases alone; only when all diagnoses are
written is the key opened. Seeds below 10000 are for development; a trial with a seed
from 10000 on, of all effects, is written to studies/results/concealed.json.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from softnn.contracts import InputError
from studies.common import RUNS, guarded, parser
from studies.concealed import orders, rivals, scoring, sealing
from studies.concealed.reporting import report

SOFTNN = [sys.executable, "-m", "softnn.cli"]
TIMED_CASES = 3  # diagnosed once more, one at a time, for the time a user waits


def make_parser() -> argparse.ArgumentParser:
    p = parser("concealed", __doc__)
    p.add_argument("--cases", type=int, default=20, help="of each effect (20)")
    p.add_argument("--nulls", type=int, help="ten times --cases")
    p.add_argument("--pairs", type=int, help="three times --cases")
    p.add_argument("--unlisted", type=int, help="three times --cases")
    p.add_argument("--only", nargs="+", default=[], metavar="EFFECT")
    p.add_argument("--strength", type=float, default=1.0, help="of the effects (1)")
    p.add_argument("--dirty", type=float, default=0.15, help="share of cases (0.15)")
    p.add_argument("--simulated", type=float, default=0.1, help="share of cases (0.1)")
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    p.add_argument("--out", type=Path, help="where cases and diagnoses go (mlruns/...)")
    p.add_argument("--tracking", help="MLflow address (mlruns/mlflow.db)")
    only = p.add_mutually_exclusive_group()
    only.add_argument("--forge-only", type=Path, metavar="DIR", help="forge, no more")
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
    wanted = orders_of(a)
    label = f"strength-{a.strength:g}"
    if a.forge_only:
        digest = forge_into(wanted, a.forge_only, a.jobs)
        print(f"{len(wanted)} cases in {a.forge_only / 'cases'}; key SHA-256 {digest}")
        return
    if a.score_only or a.resume:
        folder = a.score_only or a.resume
        if not (folder / "record.json").exists():
            raise InputError(f"{folder} holds no record.json; name a trial's folder")
        record = json.loads((folder / "record.json").read_text())
    else:
        home = RUNS / "smoke" if a.smoke else RUNS
        stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
        folder = a.out or home / "concealed" / f"{label}-seed-{a.seed}-{stamp}"
        record = {
            "label": label,
            "strength": a.strength,
            "seed": a.seed,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "published": a.seed >= orders.FIRST_TRIAL_SEED and not (a.only or a.smoke),
            "smoke": a.smoke,
            "cases": len(wanted),
            "key_sha256": forge_into(wanted, folder, a.jobs),
        }
        write_record(folder, record)  # the hash is on file before anything is diagnosed
        print(f"{len(wanted)} cases forged; key SHA-256 {record['key_sha256']}")
    if not a.score_only:
        timed = 0 if record["smoke"] else TIMED_CASES
        record |= diagnose(folder, a.jobs, record["seed"], timed)
        write_record(folder, record)
    answers = sealing.open_key(folder)
    diagnoses = scoring.read_diagnoses(answers, folder / "diagnoses")
    times = {c["case"]: scoring.read_times(c, folder / "cases") for c in answers}
    simulated = simulate_unseen(folder, answers)
    scores = scoring.score(answers, diagnoses, times, simulated)
    explain_misses(scores["misses"], answers)
    report(folder, record, scores, a.tracking)


def check_names(names: Sequence[str]) -> None:
    """Raise InputError for a name that no effect has."""
    unknown = sorted(set(names) - set(orders.NAMES))
    if unknown:
        raise InputError(
            f"no effect is called {unknown[0]!r}; allowed are {', '.join(orders.NAMES)}"
        )


def check(names: Sequence[str], strength: float, cases: int, seed: int) -> None:
    """Raise InputError for what no trial can be planned of."""
    check_names(names)
    if not strength > 0:
        raise InputError(f"strength is {strength:g}; it must be above 0")
    if cases < 0 or seed < 0:
        raise InputError("--cases and --seed must be 0 or more")


def orders_of(a: argparse.Namespace) -> list[orders.Order]:
    """The cases asked for; --smoke asks for three."""
    check(a.only, a.strength, a.cases, a.seed)
    if a.smoke:
        few = ["zero_offset"]
        return orders.plan(
            a.seed, a.strength, each=1, nulls=1, pairs=0, unlisted=1, only=few
        )
    return orders.plan(
        a.seed,
        a.strength,
        each=a.cases,
        nulls=10 * a.cases if a.nulls is None else a.nulls,
        pairs=3 * a.cases if a.pairs is None else a.pairs,
        unlisted=3 * a.cases if a.unlisted is None else a.unlisted,
        only=a.only,
        dirty=a.dirty,
        simulated=a.simulated,
    )


def forge_into(wanted: Sequence[orders.Order], folder: Path, jobs: int) -> str:
    try:
        return sealing.write_cases(wanted, folder, jobs)
    except FileExistsError as error:
        raise InputError(str(error)) from None


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    (folder / "record.json").write_text(json.dumps(record, indent=1) + "\n")


def explain_misses(
    misses: Sequence[dict[str, Any]], answers: Sequence[dict[str, Any]]
) -> None:
    """Add to wrongly named cases whether anybody could have told the two apart."""
    by_name = {a["case"]: a for a in answers}
    for miss in misses:
        if miss["group"] not in ("single", "pair") or not miss["selected"]:
            continue
        answer = by_name[miss["case"]]
        power = rivals.distinct_power(orders.order_of(answer), answer)
        miss["nearest_rivals"] = dict(list(power.items())[:3])
        wrong = set(miss["selected"]) - set(answer["effects"])
        if any(power.get(w, 1.0) < 0.8 for w in wrong):
            miss["cause"] = "cannot be told from what was named, says the oracle"


def diagnose(folder: Path, jobs: int, seed: int, timed: int) -> dict[str, Any]:
    """Run the command on the cases, as a user would; how long it took.

    It is told the folders of the cases and nothing else. Cases that have a diagnosis
    from an interrupted run are left out.
    """
    cases = [
        str(case.resolve())
        for case in sorted((folder / "cases").iterdir())
        if not (folder / "diagnoses" / case.name / "diagnosis.json").exists()
    ]
    if not cases:
        return {}
    command = [*SOFTNN, "diagnose", "--seed", str(seed), "--jobs"]
    begun = time.perf_counter()
    out = str((folder / "diagnoses").resolve())
    done = subprocess.run([*command, str(jobs), "--out", out, *cases], check=False)
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


def simulate_unseen(
    folder: Path, answers: Sequence[Mapping[str, Any]]
) -> dict[str, np.ndarray]:
    """Stress of the corrected models for programmes that stayed in the key, by case.

    `softnn simulate` as a user calls it, but in this process. A model that cannot be
    simulated is left out, and said.
    """
    from softnn.cli import main as softnn

    inputs, found = folder / "unseen", {}
    inputs.mkdir(exist_ok=True)
    for answer in answers:
        name = answer["case"]
        model = folder / "diagnoses" / name / "model.json"
        if answer["unseen"] is None or not model.exists():
            continue
        file = inputs / f"{name}.csv"
        columns = {k: v for k, v in answer["unseen"].items() if k != "clean_MPa"}
        pd.DataFrame(columns).to_csv(file, index=False)
        command = ["simulate", str(model), str(file), "--out", str(inputs / "out")]
        with redirect_stdout(io.StringIO()):
            code = softnn(command)
        if code == 0:
            table = pd.read_csv(inputs / "out" / file.name)
            found[name] = table["simulated_MPa"].to_numpy()
        else:
            print(f"{name}: softnn simulate ended with {code}", file=sys.stderr)
    return found
