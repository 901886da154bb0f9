"""Which constants make the posterior mean what it says? Fitted to development cases.

Folders of cases with their truths (`cases/`, `truth/`), of development families only,
are searched as `softnn diagnose` does, and again without the form of the law that suits
the truth best; the constants of `softnn.mismatch.posterior` are those under which the
truths are likeliest. Cross-validated over cases; written to
studies/results/calibration.json, from where they are copied into the code by hand.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from bench.hands.forging import forge
from softnn.contracts import InputError
from softnn.database import Store
from softnn.effects import EFFECTS
from softnn.mismatch import read_case
from softnn.mismatch.accounts import Search, search, value
from softnn.mismatch.diagnosis import start
from softnn.mismatch.posterior import CONSTANTS, Constants, probabilities, table
from softnn.study.common import (
    RUNS,
    code_of,
    guarded,
    package_files,
    parser,
    results_folder,
    write_result,
)
from softnn.workers import workers

LEAST = -10.0  # log probability: a truth less likely than this is no lesson
PULL = 0.01  # towards the constants before, in logarithms
FOLDS = 5


def lesson(case: Path, truth: Path) -> list[dict[str, Any]]:
    """Features of all hypotheses of a case, and which of them is true.

    Twice where something was concealed that has several forms: as it is, and without
    the form that suits it best, as a law that nobody here wrote would be met.
    """
    told = json.loads(truth.read_text(encoding="utf-8"))
    true = frozenset(told["effects"])
    with threadpool_limits(limits=1, user_api="blas"):
        found = search(start(read_case(case)))
        out = [taught(case.name, told, found)]
        unknown = suiting(found, true)
        if unknown:
            found = search(start(read_case(case)), unknown)
            out.append(taught(case.name, told, found) | {"unknown": sorted(unknown)})
    return out


def taught(case: str, told: dict[str, Any], found: Search) -> dict[str, Any]:
    """What one search teaches."""
    rows = table(found.accounts)
    true = frozenset(told["effects"]), told["cls"] == "alien"
    return {
        "case": case,
        "cls": told["cls"],
        "effects": told["effects"],
        "energy": told.get("energy_after_refit"),
        "noise": told["noise"]["kind"],
        "sets": [[sorted(h.effects), h.other] for h, _ in rows],
        "features": [row.tolist() for _, row in rows],
        "true": [(h.effects, h.other) == true for h, _ in rows],
    }


def suiting(found: Search, true: frozenset[str]) -> frozenset[str]:
    """The forms of the true effects that suited best, of those that have others."""
    mine = [a for a in found.accounts if true and a.effects == true]
    if not mine:
        return frozenset()
    best = max(mine, key=value)
    laws = [p.effect for p in best.fit.guess.pieces if not p.nuisance]
    several = {law.id for law in EFFECTS if len(law.forms) > 1}
    return frozenset(law.form for law in laws if law.id in several)


def lessons(folder: Path, jobs: int, fresh: bool) -> list[dict[str, Any]]:
    """The lessons of a folder; those that this code has learned before are kept."""
    file = RUNS / "calibrate" / f"{folder.resolve().name}.sqlite"
    with Store(file, code_of(package_files()), fresh) as store, workers(jobs) as pool:
        known = store.rows()
        futures = {
            pool.submit(lesson, c, folder / "truth" / c.name / "truth.json"): c.name
            for c in sorted((folder / "cases").iterdir())
            if c.name not in known
        }
        for future in tqdm(as_completed(futures), total=len(futures), unit="case"):
            store.add(futures[future], {"lessons": future.result()})
        rows = sorted(store.rows().items())
    return [one for _, row in rows for one in row["lessons"]]


def log_probability(one: dict[str, Any], constants: Constants) -> float:
    """Of the truth of a lesson; -inf where the search did not come to it."""
    true = np.array(one["true"])
    if not true.any():
        return -np.inf
    return float(np.log(probabilities(np.array(one["features"]), constants)[true][0]))


def fitted(known: Sequence[dict[str, Any]], before: Constants) -> Constants:
    """Constants of greatest penalised likelihood; all are positive."""
    start_ = np.log(astuple(before))

    def loss(z: np.ndarray) -> float:
        at = Constants(*np.exp(z))
        values = [log_probability(k, at) for k in known if any(k["true"])]
        pull = PULL * np.sum((z - start_) ** 2)
        return float(pull - np.mean(np.logaddexp(values, LEAST)))

    best = minimize(loss, start_, method="L-BFGS-B")
    return Constants(*(float(x) for x in np.exp(best.x)))


def run(
    folders: Sequence[Path], jobs: int, rng: np.random.Generator, fresh: bool
) -> dict[str, Any]:
    known = [
        one | {"folder": k}
        for k, folder in enumerate(folders)
        for one in lessons(folder, jobs, fresh)
    ]
    if len(known) < 2:
        raise InputError(f"{len(known)} cases in these folders; at least 2 are needed")
    cases = sorted({(one["folder"], one["case"]) for one in known})
    folds = min(FOLDS, len(cases))
    of = dict(zip(cases, rng.permutation(len(cases)) % folds, strict=True))
    fold = np.array([of[one["folder"], one["case"]] for one in known])
    unseen = np.full(len(known), np.nan)
    for k in range(folds):
        at = fitted([o for o, f in zip(known, fold, strict=True) if f != k], CONSTANTS)
        for i in np.flatnonzero(fold == k):
            unseen[i] = log_probability(known[i], at)
    final = fitted(known, CONSTANTS)
    names = [f.name for f in fields(Constants)]
    return {
        "headline": {
            "cases": len(cases),
            "lessons_without_the_form": sum("unknown" in one for one in known),
            "truth_tried": sum(any(one["true"]) for one in known),
            "log_score_unseen": float(np.mean(np.maximum(unseen, LEAST))),
        },
        "constants": dict(zip(names, astuple(final), strict=True)),
    }


def main(argv: Sequence[str] | None = None) -> int:
    p = parser("calibrate", __doc__)
    p.add_argument("folders", nargs="*", type=Path, metavar="FOLDER")
    p.add_argument("--jobs", type=int, default=2)
    a = p.parse_args(argv)

    def go() -> None:
        folders = a.folders
        if a.smoke:
            folders = [RUNS / "smoke" / "lessons"]
            shutil.rmtree(folders[0], ignore_errors=True)
            few = {"nulls": 1, "singles": 1, "pairs": 0, "aliens": 0}
            forge(folders[0], seed=a.seed, side="development", **few)
        jobs, rng = 1 if a.smoke else a.jobs, np.random.default_rng(a.seed)
        result = run(folders, jobs, rng, a.smoke)
        print(json.dumps(result, indent=1))
        write_result(
            "calibration",
            result["headline"],
            {"constants": result["constants"]},
            seed=a.seed,
            folder=results_folder(a.smoke),
        )

    return guarded(go)
