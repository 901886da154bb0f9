"""All rivals, in the order of the table."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bench.rivals import classifier, criteria, equations, folds, prediction, sparse
from bench.rivals.extra import present
from bench.rivals.naming import Found, Rule, diagnosis
from bench.rivals.problem import Problem
from softnn.contracts import InputError

TUNED = Path(__file__).with_name("tuned.json")
FIXED = Rule(share=0.0, least=0.0, enough=0.0)  # the criterion alone decides


@dataclass(frozen=True)
class Method:
    """One rival. `options` are settings to choose from on development seeds."""

    name: str
    what: str
    run: Callable[..., Found]
    uses: tuple[str, ...] = ()  # parts of a problem, for the seconds
    package: str | None = None
    names: bool = True
    tuned: bool = True  # whether there is anything to be chosen
    lessons: bool = False  # whether it must be taught first
    options: tuple[Mapping[str, Any], ...] = ({},)

    @property
    def missing(self) -> bool:
        return self.package is not None and not present(self.package)


NETWORKS = tuple({"inputs": i, "neurons": n} for i in prediction.INPUTS for n in (4, 8))
EITHER = ({"whitened": False}, {"whitened": True})

METHODS: tuple[Method, ...] = (
    Method("aic", "AIC over softnn's effects", criteria.aic, ("plain",), tuned=False),
    Method("bic", "BIC over softnn's effects", criteria.bic, ("plain",), tuned=False),
    Method(
        "pysindy",
        "PySINDy, ensemble",
        equations.pysindy,
        ("features", "folds"),
        "pysindy",
        options=({"inclusion": 0.6}, {"inclusion": 0.9}),
    ),
    Method(
        "symbolic",
        "symbolic regression (pyoperon)",
        equations.symbolic,
        ("features", "folds"),
        "pyoperon",
        options=({"length": 15},),
    ),
    Method(
        "lars",
        "LARS, cross-validated",
        sparse.lars,
        ("dictionary", "folds", "plain"),
        options=tuple(e | {"thrift": t} for e in EITHER for t in (0.0, 1.0)),
    ),
    Method(
        "omp",
        "OMP, cross-validated",
        sparse.omp,
        ("dictionary", "folds", "plain"),
        options=EITHER,
    ),
    Method(
        "abess",
        "best subset (abess)",
        sparse.abess,
        ("dictionary", "folds", "plain"),
        "abess",
        options=tuple(e | {"criterion": c} for e in EITHER for c in ("gic", "ebic")),
    ),
    Method(
        "gaussian_process",
        "Gaussian-process discrepancy",
        prediction.gaussian_process,
        ("features", "folds"),
        names=False,
        tuned=False,
    ),
    Method(
        "classifier",
        "forest with a reject option",
        classifier.classifier,
        ("features", "dictionary"),
        lessons=True,
    ),
    Method(
        "black_box",
        "black-box network of history",
        prediction.black_box,
        ("features", "folds"),
        names=False,
        options=NETWORKS,
    ),
    Method(
        "grey_box",
        "the same network on the base",
        prediction.grey_box,
        ("features", "folds"),
        names=False,
        options=NETWORKS,
    ),
)


def method(name: str) -> Method:
    for one in METHODS:
        if one.name == name:
            return one
    raise InputError(
        f"no rival is called {name!r}; allowed are softnn, "
        + ", ".join(m.name for m in METHODS)
    )


@cache
def tuned() -> dict[str, Any]:
    """What was chosen on development seeds, by method."""
    if not TUNED.exists():
        return {}
    return json.loads(TUNED.read_text(encoding="utf-8"))["methods"]


def settings(one: Method) -> tuple[dict[str, Any], Rule]:
    """Options and rule of a method, as tuned."""
    if not one.tuned:
        return dict(one.options[0]), FIXED
    chosen = tuned().get(one.name)
    if chosen is None:
        return dict(one.options[0]), Rule()
    return dict(chosen["options"]), Rule(**chosen.get("rule", {}))


def look(
    one: Method,
    problem: Problem,
    seed: int,
    options: Mapping[str, Any],
    lessons: Path | None = None,
) -> tuple[Found, float]:
    """What a method finds in a case, and the seconds, those of shared parts too."""
    for part in one.uses:
        getattr(problem, part)
    begun = time.perf_counter()
    given = dict(options) | ({"lessons": lessons} if one.lessons else {})
    found = one.run(problem, np.random.default_rng([seed, len(one.name)]), **given)
    spent = time.perf_counter() - begun
    return found, spent + sum(problem.seconds.get(p, 0.0) for p in ("base", *one.uses))


def answer(
    one: Method, problem: Problem, seed: int, lessons: Path | None = None
) -> dict[str, Any]:
    """The answer of a method to a case, in the form of diagnosis.json."""
    options, rule = settings(one)
    found, seconds = look(one, problem, seed, options, lessons)
    before = folds.nrmse(problem.engine, folds.squares(problem.engine, problem.folds))
    made = diagnosis(found, rule, before, seconds, one.names)
    made["fit"]["before"]["nrmse"] = folds.nrmse(
        problem.engine, float(problem.residual @ problem.residual)
    )
    return {"case": problem.name, "method": one.name, **made}
