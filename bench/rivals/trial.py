"""Does anything else name the physics left out as well? Rivals on the same cases.

Cases are forged and their key sealed; softnn (by its command) and every rival answer
all of them, and the hash of the answers goes into the record; then the key is opened
and one scorer reads them all. Seeds below 10000 are for development; a comparison with
a seed from 10000 on, of all effects, is written to studies/results/rivals.json with
--publish.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench import ledger, scoring
from bench.concealed import details, orders, sealing
from bench.concealed.trial import (
    books,
    check,
    diagnose_rest,
    forge_into,
    opening_of,
    write_record,
)
from bench.rivals import classifier, methods, table
from bench.rivals.extra import INSTALL
from bench.rivals.methods import METHODS, Method, method
from bench.rivals.problem import read
from bench.rivals.table import SOFTNN
from softnn import json_file
from softnn.contracts import InputError
from softnn.study.common import guarded, parser, results_folder, runs_folder
from softnn.workers import workers

QUICK = (SOFTNN, "bic", "pysindy", "omp", "abess", "gaussian_process")  # of --smoke


def make_parser() -> argparse.ArgumentParser:
    p = parser("rivals", __doc__)
    p.add_argument("--cases", type=int, default=10, help="of each effect (10)")
    p.add_argument("--nulls", type=int, help="ten times --cases")
    p.add_argument("--unlisted", type=int, help="three times --cases")
    p.add_argument("--only", nargs="+", default=[], metavar="EFFECT")
    p.add_argument("--strength", type=float, default=1.0, help="of the effects (1)")
    p.add_argument("--methods", nargs="+", default=[], metavar="NAME", help="(all)")
    p.add_argument(
        "--lessons", type=int, default=12, help="of each effect, for a classifier (12)"
    )
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    p.add_argument("--out", type=Path, help="where cases and answers go (mlruns/...)")
    p.add_argument("--resume", type=Path, metavar="DIR", help="answer the rest, score")
    p.add_argument("--tracking", help="MLflow address (mlruns/mlflow.db)")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.rivals`; returns the exit code."""
    arguments = make_parser().parse_args(argv)
    return guarded(lambda: run(arguments))


def run(a: argparse.Namespace) -> None:
    if a.jobs < 1:
        raise InputError(f"--jobs is {a.jobs}; at least 1 is needed")
    if a.resume:
        folder = a.resume
        if not (folder / "record.json").exists():
            raise InputError(f"{folder} holds no record.json; name a trial's folder")
        record = json.loads((folder / "record.json").read_text())
        chosen = a.methods or record["methods"]
    else:
        chosen = a.methods or (
            QUICK if a.smoke else (SOFTNN, *(m.name for m in METHODS))
        )
        folder, record = begin(a, plan_of(a))
    present, absent = available(chosen)
    for name, package in absent.items():
        print(f"{name}: skipped, {package} is not installed; {INSTALL} has it")
    if SOFTNN in chosen:
        diagnose_rest(folder, record, a.jobs, timed=0)
    lessons = None
    if any(m.lessons for m in present):
        home = runs_folder(record["smoke"])
        lessons = classifier.lessons(record["lessons"], a.jobs, home / "rivals")
    answer_all(folder, present, record["seed"], lessons, a.jobs)
    names = [n for n in (SOFTNN, *(m.name for m in METHODS)) if n in chosen]
    names = [n for n in names if n not in absent]
    record |= {
        "methods": names,
        "skipped": absent,
        "jobs": a.jobs,
        # All methods are done, and nothing can be changed once the key is open.
        "answers_sha256": seal_answers(folder),
    }
    write_record(folder, record)
    keys = sealing.open_key(folder)
    told = record | {"generator": "forge", "label": f"rivals, {record['label']}"}
    opening = opening_of(told, [details.truth_of(k) for k in keys], folder)
    record["published"] = record["published"] and a.publish
    where = results_folder(record["smoke"], record["published"])
    ledger.enter(opening, where, books(record["smoke"]))
    given = {n: read_answers(folder, n, keys) for n in names}
    good = accepted(given)
    rows = {
        n: table.scores(keys, given[n], good, n == SOFTNN or method(n).names)
        for n in names
    }
    for n in names:
        if n != SOFTNN and SOFTNN in given:
            rows[n]["paired"] = table.paired(keys, given[SOFTNN], given[n])
    what = {m.name: m.what for m in METHODS}
    body = {
        "accepted_cases": sum(good.values()),
        "settings": {m.name: plain_settings(m) for m in present},
    }
    table.report(folder, record, rows, what, body, a.tracking)


def plan_of(a: argparse.Namespace) -> list[orders.Order]:
    check(a.only, a.strength, a.cases, a.seed)
    each, few = (1, ["zero_offset"]) if a.smoke else (a.cases, a.only)
    nulls = 1 if a.smoke else 10 * each if a.nulls is None else a.nulls
    unlisted = 1 if a.smoke else 3 * each if a.unlisted is None else a.unlisted
    return orders.plan(
        a.seed,
        a.strength,
        each=each,
        nulls=nulls,
        pairs=0,
        unlisted=unlisted,
        only=few,
    )


def begin(
    a: argparse.Namespace, plan: Sequence[orders.Order]
) -> tuple[Path, dict[str, Any]]:
    """Forge the cases; the folder, and the record with the hash of the key."""
    for name in a.methods:
        if name != SOFTNN:
            method(name)  # refuse a wrong name before an hour of forging
    label = f"strength-{a.strength:g}"
    home = runs_folder(a.smoke)
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    folder = a.out or home / "rivals" / f"{label}-seed-{a.seed}-{stamp}"
    record = {
        "label": label,
        "strength": a.strength,
        "seed": a.seed,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "published": a.seed >= orders.FIRST_TRIAL_SEED
        and not (a.only or a.smoke or a.methods),
        "smoke": a.smoke,
        "cases": len(plan),
        "lessons": a.lessons,
        "methods": list(a.methods)
        or list(QUICK if a.smoke else (SOFTNN, *(m.name for m in METHODS))),
        "key_sha256": forge_into(plan, folder, a.jobs),
    }
    write_record(folder, record)  # the hash is on file before anybody answers
    print(f"{len(plan)} cases forged in {folder}; key SHA-256 {record['key_sha256']}")
    return folder, record


def available(names: Sequence[str]) -> tuple[list[Method], dict[str, str]]:
    """Rivals that can run here, and the packages that others lack, by rival."""
    asked = [method(n) for n in names if n != SOFTNN]
    absent = {m.name: str(m.package) for m in asked if m.missing}
    return [m for m in asked if not m.missing], absent


def answer_all(
    folder: Path,
    present: Sequence[Method],
    seed: int,
    lessons: Path | None,
    jobs: int,
) -> None:
    """Every rival on every case; answers that are there already are left alone."""
    from tqdm import tqdm

    work = []
    for case in sorted((folder / "cases").iterdir()):
        left = [
            m.name for m in present if not answer_file(folder, m.name, case).exists()
        ]
        if left:
            work.append((str(folder), str(case), left, seed, lessons))
    bar = tqdm(total=len(work), unit="case", desc="rivals", disable=not work)
    if jobs == 1:
        for job in work:
            answer_case(*job)
            bar.update()
    elif work:
        with workers(jobs) as pool:
            for done in as_completed([pool.submit(answer_case, *j) for j in work]):
                done.result()
                bar.update()
    bar.close()


def answer_file(folder: Path, name: str, case: Path) -> Path:
    return folder / "answers" / name / f"{case.name}.json"


def answer_case(
    folder: str, case: str, names: Sequence[str], seed: int, lessons: Path | None
) -> None:
    """Answers of some rivals to one case; it sees the folder of the case alone."""
    problem = read(case)
    for name in names:
        try:
            said = methods.answer(method(name), problem, seed, lessons)
        except (
            ArithmeticError,
            IndexError,
            RuntimeError,
            ValueError,
        ) as error:
            # A rival may fail in its own way; the case then counts as not answered.
            said = {**scoring.ABSENT, "case": problem.name, "error": repr(error)}
        path = answer_file(Path(folder), name, Path(case))
        path.parent.mkdir(parents=True, exist_ok=True)
        json_file.write(path, said)


def seal_answers(folder: Path) -> str:
    """SHA-256 over all answers, softnn's among them."""
    digest = hashlib.sha256()
    files = [
        *(folder / "answers").rglob("*.json"),
        *(folder / "diagnoses").rglob("diagnosis.json"),
    ]
    for file in sorted(files):
        digest.update(file.relative_to(folder).as_posix().encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def read_answers(
    folder: Path, name: str, keys: Sequence[Mapping[str, Any]]
) -> dict[str, dict[str, Any]]:
    if name == SOFTNN:
        return scoring.read_diagnoses((k["case"] for k in keys), folder / "diagnoses")
    return {
        k["case"]: json.loads(
            answer_file(folder, name, Path(k["case"])).read_text(encoding="utf-8")
        )
        for k in keys
    }


def accepted(given: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> dict[str, bool]:
    """Cases in which the refitted base looks good: one list for all methods."""
    out: dict[str, bool] = {}
    for answers in given.values():
        for case, said in answers.items():
            error = said.get("fit", {}).get("before", {}).get("nrmse")
            if error is not None:
                out.setdefault(case, error < table.ACCEPTED)
    return {c: out.get(c, False) for answers in given.values() for c in answers}


def plain_settings(one: Method) -> dict[str, Any]:
    options, rule = methods.settings(one)
    return {"options": options, "rule": vars(rule)}
