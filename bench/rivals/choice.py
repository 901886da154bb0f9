"""Options of a rival by the inner folds, then its fit to all fitted recordings."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.rivals.problem import Predict, Problem, nrmse, without


@dataclass(frozen=True)
class Method:
    """One rival: how it is fitted, and the options to choose from.

    `fit` takes data, a random generator and one of `options`; in the inner folds
    `quick` as well, which saves time. `law` marks a published law; the table
    also has the one of them that the inner folds pick. `package` may be missing.
    """

    name: str
    what: str
    fit: Callable[..., Predict]
    options: tuple[Mapping[str, Any], ...] = ({},)
    quick: Mapping[str, Any] = field(default_factory=dict)
    law: bool = False
    package: str | None = None


def judged(method: Method, problem: Problem, seed: int) -> dict[str, Any]:
    """What a rival makes of a split: errors as NRMSE, the options it chose, seconds.

    `inner_nrmse` is over the inner folds and decides on options; `nrmse` is on the
    recordings to predict. A rival that fails has an `error` and no NRMSE.
    """
    begun = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # at bounds, of overflow: errors tell
            told = _judged(method, problem, seed)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        told = {"nrmse": None, "inner_nrmse": None, "error": f"{error}"[:200]}
    return {"method": method.name, **told, "seconds": time.perf_counter() - begun}


def _judged(method: Method, problem: Problem, seed: int) -> dict[str, Any]:
    def rng() -> np.random.Generator:
        return np.random.default_rng([seed, sum(map(ord, method.name))])

    inner = []
    for options in method.options:
        sums = np.zeros(2)
        for fold in problem.folds:
            others = without(problem.known, fold)
            predict = method.fit(others, rng(), **options, **method.quick)
            sums += problem.error(predict, problem.known, fold)
        inner.append(nrmse(sums))
    best = int(np.argmin(inner))
    predict = method.fit(problem.known, rng(), **method.options[best])
    return {
        "nrmse": _finite(nrmse(problem.error(predict, problem.unseen))),
        "inner_nrmse": _finite(inner[best]),
        "options": dict(method.options[best]),
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def least(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> Mapping[str, Any]:
    """The row, of rivals `names`, that the inner folds would pick."""
    mine = [r for r in rows if r["method"] in names and r["nrmse"] is not None]
    mine = [r for r in mine if r["inner_nrmse"] is not None]
    if not mine:
        return {"nrmse": None, "inner_nrmse": None}
    return min(mine, key=lambda r: r["inner_nrmse"])
