"""Which constants make the posterior mean what it says? Fitted to development cases.

Folders of cases with their truths (`cases/`, `truth/`), of development families only,
are searched as `softnn diagnose` does, and again without the form of the law that suits
the truth best; the constants of `softnn.mismatch.posterior` are those under which names
are likeliest where they are true, and unlikeliest where they are not. They are pulled
towards those before, which other lessons taught; how much, cross-validation over cases
says, and where it says that these lessons teach nothing that holds beyond them, those
before stay. Written to calibration.json, from where they are copied
into the code by hand.

A probability holds for a mixture of cases. How many of each kind (`bench.scoring`) were
forged says nothing of what people bring, so each kind counts alike.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from bench.hands.forging import forge
from softnn.contracts import Array, InputError
from softnn.database import Store
from softnn.effects import EFFECTS
from softnn.mismatch.accounts import Search, search, value
from softnn.mismatch.base import start
from softnn.mismatch.case import read_case
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

CLIP = 1e-4  # a name surer than that, and wrong, is no greater lesson
PULLS = (0.003, 0.03, 0.3)  # towards the constants before, in logarithms
FAR = 3.0  # of a logarithm, that no constant goes
FOLDS = 5
STEPS = (1e-4, 1e-3, 1e-4)  # of derivatives: slopes break where a tail begins
JUDGING = ("posterior.py", "decision.py")  # after a search: they change no lesson


def lesson(case: Path, truth: Path) -> list[dict[str, Any]]:
    """Features of all hypotheses of a case, and which of them is true.

    Twice where something was concealed that has several forms: as it is, and without
    the form that suits it best, as a law that nobody here wrote would be met.
    """
    told = json.loads(truth.read_text(encoding="utf-8"))
    true = frozenset(told["effects"])
    with threadpool_limits(limits=1, user_api="blas"):
        found = search(start(read_case(case)), evident=np.inf)
        out = [taught(case.name, told, found)]
        unknown = suiting(found, true)
        if unknown:
            found = search(start(read_case(case)), unknown, np.inf)
            out.append(taught(case.name, told, found) | {"unknown": sorted(unknown)})
    return out


def taught(case: str, told: dict[str, Any], found: Search) -> dict[str, Any]:
    """What one search teaches."""
    return {
        "case": case,
        "cls": told["cls"],
        "effects": told["effects"],
        "sets": [sorted(a.effects) for a in found.accounts],
        "figures": [a.figures.tolist() for a in found.accounts],
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


def searching() -> tuple[Path, ...]:
    """The files that a search runs: no constant of the posterior changes a lesson."""
    return tuple(f for f in package_files() if f.name not in JUDGING)


def kept(folder: Path) -> Path:
    """Where the lessons of a folder are: two may have one name."""
    place = folder.resolve()
    which = hashlib.sha256(str(place).encode()).hexdigest()[:8]
    return RUNS / "calibrate" / f"{place.name}-{which}.sqlite"


def lessons(folder: Path, jobs: int, fresh: bool) -> list[dict[str, Any]]:
    """The lessons of a folder; those that this code has learned before are kept."""
    with (
        Store(kept(folder), code_of(searching()), fresh) as store,
        workers(jobs) as pool,
    ):
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


@dataclass(frozen=True)
class Lessons:
    """Rows of all lessons, padded with rows of no evidence.

    `every` (lessons, hypotheses, 7) as `probabilities` takes it; `holds` (lessons,
    hypotheses, names) where a hypothesis holds an effect, or is that nothing is missing
    (the last); `true` (lessons, names); `kind` (lessons,) of case.
    """

    every: Array
    holds: Array
    true: Array
    kind: NDArray[np.str_]

    def some(self, which: NDArray[np.bool_]) -> Lessons:
        return Lessons(*(getattr(self, f.name)[which] for f in fields(self)))


def stacked(known: Sequence[dict[str, Any]]) -> Lessons:
    places = {law.id: k for k, law in enumerate(EFFECTS)}
    tables, kept = [], []
    true = np.zeros((len(known), len(places) + 1))
    for one, told in zip(known, true, strict=True):
        sets = [frozenset(s) for s in one["sets"]]
        found, rows = table(sets, np.array(one["figures"]))
        rows[:, :3] -= rows[0, 1]  # a likelihood has no origin
        tables.append(rows)
        kept.append([(sets[i], other) for i, other in found])
        told[[places[name] for name in one["effects"]]] = 1.0
        told[-1] = one["cls"] == "null"
    size = max(map(len, tables))
    every = np.zeros((len(tables), size, tables[0].shape[1]))
    every[..., 1:3] = -np.inf
    holds = np.zeros((*every.shape[:2], true.shape[1]))
    for k, (rows, sets_) in enumerate(zip(tables, kept, strict=True)):
        every[k, : len(rows)] = rows
        for h, (names, other) in enumerate(sets_):
            holds[k, h, [places[name] for name in names]] = 1.0
            holds[k, h, -1] = not names and not other
    return Lessons(every, holds, true, np.array([one["cls"] for one in known]))


def log_score(lessons: Lessons, constants: Constants) -> Array:
    """Of each lesson, over all names: log P of what is there, log 1 - P of the rest."""
    p = probabilities(lessons.every, constants)
    name = np.clip(np.einsum("lh,lhe->le", p, lessons.holds), CLIP, 1 - CLIP)
    return np.asarray(np.log(np.where(lessons.true > 0, name, 1 - name)).sum(axis=-1))


def weights(kind: NDArray[np.str_]) -> Array:
    """How much each lesson counts, one in the mean: each kind as much as any other."""
    kinds, at, count = np.unique(kind, return_inverse=True, return_counts=True)
    return np.asarray(len(kind) / len(kinds) / count[at])


def mean_score(lessons: Lessons, constants: Constants) -> float:
    """The mean log score, each kind of case counting alike."""
    return float(np.mean(weights(lessons.kind) * log_score(lessons, constants)))


def fitted(lessons: Lessons, before: Constants, pull: float = PULLS[0]) -> Constants:
    """Constants of the greatest penalised log score; all are positive."""
    start_ = np.log(astuple(before))

    def at(z: Array) -> Constants:
        return Constants(*np.exp(np.clip(z, start_ - FAR, start_ + FAR)).tolist())

    def loss(z: Array) -> float:
        return pull * float(np.sum((z - start_) ** 2)) - mean_score(lessons, at(z))

    z = start_
    for step in STEPS:
        z = minimize(loss, z, method="L-BFGS-B", options={"eps": step}).x
    return at(z)


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
    every = stacked(known)
    before = mean_score(every, CONSTANTS)
    unseen = {}
    for pull in PULLS:
        scores = np.empty(len(known))
        for k in range(folds):
            at = fitted(every.some(fold != k), CONSTANTS, pull)
            scores[fold == k] = log_score(every.some(fold == k), at)
        unseen[pull] = float(np.mean(weights(every.kind) * scores))
    best = max(unseen, key=lambda pull: unseen[pull])
    better = unseen[best] > before
    final = fitted(every, CONSTANTS, best) if better else CONSTANTS
    names = [f.name for f in fields(Constants)]
    return {
        "headline": {
            "cases": len(cases),
            "lessons_without_the_form": sum("unknown" in one for one in known),
            "log_score_before": before,
            "log_score_unseen": unseen[best],
            "fitted_anew": int(better),
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
            folder=results_folder(a.smoke, a.publish),
        )

    return guarded(go)
