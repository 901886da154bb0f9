"""A forest on residual features that may refuse: pattern recognition without a model.

It learns from cases of the forge with development seeds, whose programmes are not all
those of a trial, and half of which are faint. What is on no list it never sees.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bench.concealed import orders, sealing
from bench.rivals.columns import STATE, WARM
from bench.rivals.naming import Found
from bench.rivals.problem import Problem, read
from softnn.contracts import Array
from softnn.effects import EFFECTS
from softnn.models.units import BASES
from softnn.study.common import fingerprint
from softnn.workers import workers

SEED = 5000  # of its cases; below `orders.FIRST_TRIAL_SEED`, unlike those tuned on
STRENGTHS = (1.0, 0.3)
NOTHING = "nothing"
TREES = 400


def residual_features(problem: Problem) -> Array:
    """What a case looks like (k,): which columns fit its residual, and where it is."""
    screen, book, engine = problem.screen, problem.dictionary, problem.engine
    y = screen.residual
    total = float(y @ y)
    x = screen.project(engine.whiten(book.values))
    size = np.linalg.norm(x, axis=0)
    gain = np.where(size > 1e-6, (x.T @ y) ** 2 / np.maximum(size, 1e-6) ** 2, 0.0)
    shares = []
    for effect in EFFECTS:
        mine = np.array([e == effect.id for e in book.effects], bool)
        best: dict[int, float] = {}
        for g, o in zip(gain[mine], book.own[mine], strict=True):
            best[int(o)] = max(best.get(int(o), 0.0), float(g))
        shares.append(sum(best.values()) / total if mine.any() else -1.0)
    by = [float(np.mean(y[engine.owner == r] ** 2)) for r in np.unique(engine.owner)]
    same = engine.owner[1:] == engine.owner[:-1]
    f = problem.features
    seen = {n: f.values[:, i] for i, n in enumerate(f.names)}
    left = problem.residual
    related = [
        _correlation(a, seen[n]) if n in seen else 0.0
        for n in (*STATE, WARM)
        for a in (left, np.abs(left))
    ]
    return np.array(
        [
            *shares,
            np.log10(total / len(y)),
            float(np.sum((y[1:] * y[:-1])[same])) / total,
            max(by) / (np.mean(by) + 1e-300),
            min(by) / (np.mean(by) + 1e-300),
            *related,
            *[float(problem.base.name == b) for b in (*BASES, "simulated")],
        ]
    )


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0 else 0.0


def lessons(each: int, jobs: int, home: Path, seed: int = SEED) -> Path:
    """Forge cases, look at them, and keep what was seen; the file, made once."""
    plans = [
        orders.plan(seed + i, strength, each=each, nulls=3 * each, pairs=0, unlisted=0)
        for i, strength in enumerate(STRENGTHS)
    ]
    # A text of the code beside what was ordered: other features are other lessons.
    files = [Path(__file__), Path(__file__).with_name("columns.py")]
    name = fingerprint([[repr(o) for o in plan] for plan in plans], files=files)
    path = home / f"lessons-{name}.json"
    if path.exists():
        return path
    rows: list[dict[str, Any]] = []
    with TemporaryDirectory() as scratch:
        for plan in plans:
            where = Path(scratch) / str(plan[0].seed)
            sealing.write_cases(plan, where, jobs)
            folders = [where / "cases" / o.name for o in plan]
            truth = [o.effects[0] if o.effects else NOTHING for o in plan]
            rows += [
                {"truth": t, "seen": s.tolist()}
                for t, s in zip(truth, look(folders, jobs), strict=True)
            ]
    home.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(rows) + "\n", encoding="utf-8")
    return path


def look(folders: Sequence[Path], jobs: int) -> list[Array]:
    from tqdm import tqdm

    about = {"total": len(folders), "unit": "lesson", "desc": "classifier"}
    if jobs == 1:
        return [_look(f) for f in tqdm(folders, **about)]
    with workers(jobs) as pool:
        return list(tqdm(pool.map(_look, folders), **about))


def _look(folder: Path) -> Array:
    return residual_features(read(folder))


_forests: dict[Path, Any] = {}


def forest(path: Path, seed: int = 0) -> Any:
    """The forest grown on the lessons of a file; kept for the cases that follow."""
    from sklearn.ensemble import ExtraTreesClassifier

    if path not in _forests:
        rows = json.loads(path.read_text(encoding="utf-8"))
        _forests[path] = ExtraTreesClassifier(
            TREES, min_samples_leaf=2, class_weight="balanced", random_state=seed
        ).fit([r["seen"] for r in rows], [r["truth"] for r in rows])
    return _forests[path]


def classifier(problem: Problem, rng: np.random.Generator, lessons: Path) -> Found:
    """The likeliest effect, how likely, and how likely anything is missing at all."""
    grown = forest(lessons)
    chance = dict(
        zip(
            grown.classes_,
            grown.predict_proba([residual_features(problem)])[0],
            strict=True,
        )
    )
    something = 1 - float(chance.pop(NOTHING, 0.0))
    top = max(chance, key=lambda n: chance[n])
    return Found(
        {str(top): 1.0},
        something,
        float(chance[top]) / max(something, 1e-9),
        None,
        ", ".join(
            f"{n} {p:.2f}" for n, p in sorted(chance.items(), key=lambda i: -i[1])[:3]
        ),
    )
