"""Sparse regression on columns of the effects: LARS, OMP, best subsets (abess).

All three see the residual and the columns less what the base can absorb of them, which
is the same as fitting the base and the columns together. Cross-validation leaves whole
recordings out.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bench.rivals import columns, folds
from bench.rivals.extra import load
from bench.rivals.naming import Found
from bench.rivals.problem import Problem
from softnn.contracts import Array
from softnn.fit import Engine
from softnn.mismatch.verify import parts

MOST = 12  # columns
Splits = list[tuple[NDArray[np.integer], NDArray[np.integer]]]
Select = Callable[[Array, Array, Splits], Array]  # x, y -> coefficients


def splits(engine: Engine) -> Splits:
    part = parts(engine)
    return [
        (np.flatnonzero(part != g), np.flatnonzero(part == g)) for g in np.unique(part)
    ]


def selected(problem: Problem, whitened: bool, select: Select) -> Found:
    """Columns chosen by `select`, refitted with the base, and what they carry."""
    engine, _ = (problem.engine, problem.base.fit) if whitened else problem.plain
    screen = problem.screen if whitened else problem.plain_screen
    book = problem.dictionary
    x = screen.project(engine.whiten(book.values))
    size = np.linalg.norm(x, axis=0)
    # What the base absorbs altogether is only rounding, and fits anything.
    raw = np.linalg.norm(engine.whiten(book.values), axis=0)
    kept = np.flatnonzero(size > 1e-3 * raw)
    y = screen.residual
    scale = float(np.std(y)) or 1.0
    chosen = select(
        x[:, kept] / size[kept] * np.sqrt(len(y)), y / scale, splits(engine)
    )
    live = np.flatnonzero(chosen)
    return account(problem, book.take(kept[live]))


def account(problem: Problem, book: columns.Dictionary) -> Found:
    """What these columns carry together with the base, and predict when left out."""
    engine, screen = problem.engine, problem.screen
    before = folds.squares(engine, problem.folds)
    if not len(book.effects):
        return Found(heldout_nrmse=folds.nrmse(engine, before))
    x = screen.project(engine.whiten(book.values))
    weights, *_ = np.linalg.lstsq(x, screen.residual, rcond=1e-8)
    made = folds.of(engine, problem.base.fit, book.values, book.own)
    after = folds.squares(engine, made)
    left = screen.residual - x @ weights
    return Found(
        columns.shares(x, screen.residual, book.effects),
        1 - after / max(before, 1e-300),
        explained(
            float(screen.residual @ screen.residual), float(left @ left), len(left)
        ),
        folds.nrmse(engine, after),
        ", ".join(sorted(set(book.effects))),
    )


def explained(before: float, after: float, noise: float) -> float:
    """Share of the excess over the noise (in the same units) that is gone, 0 to 1."""
    excess = max(before - noise, 0.02 * before, 1e-300)
    return float(np.clip((before - after) / excess, 0.0, 1.0))


def lars(
    problem: Problem, rng: np.random.Generator, whitened: bool, thrift: float = 1.0
) -> Found:
    """LARS with the lasso's changes; the penalty by cross-validation.

    `thrift` is the number of standard errors that a simpler model may be worse by.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.linear_model import LassoLars, LassoLarsCV

    def select(x: Array, y: Array, folded: Splits) -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            path = LassoLarsCV(cv=folded, fit_intercept=False, max_iter=60).fit(x, y)
            mean = path.mse_path_.mean(axis=1)
            error = path.mse_path_.std(axis=1) / np.sqrt(len(folded))
            best = int(np.argmin(mean))
            good = np.flatnonzero(mean <= mean[best] + thrift * error[best])
            alpha = float(path.cv_alphas_[good].max())
            return LassoLars(alpha=alpha, fit_intercept=False).fit(x, y).coef_

    return selected(problem, whitened, select)


def omp(problem: Problem, rng: np.random.Generator, whitened: bool) -> Found:
    """Orthogonal matching pursuit, the number of columns by cross-validation."""
    from sklearn.linear_model import OrthogonalMatchingPursuitCV

    def select(x: Array, y: Array, folded: Splits) -> Array:
        most = min(MOST, x.shape[1])
        if most < 1:
            return np.zeros(x.shape[1])
        with warnings.catch_warnings():
            # Stops early where columns depend on each other, and says so.
            warnings.simplefilter("ignore", RuntimeWarning)
            found = OrthogonalMatchingPursuitCV(
                cv=folded, fit_intercept=False, max_iter=most
            ).fit(x, y)
        return found.coef_

    return selected(problem, whitened, select)


def abess(
    problem: Problem, rng: np.random.Generator, whitened: bool, criterion: str = "gic"
) -> Found:
    """Best subset by splicing, its size by an information criterion."""

    def select(x: Array, y: Array, folded: Splits) -> Array:
        sizes = list(range(min(MOST, x.shape[1]) + 1))
        found = (
            load("abess")
            .LinearRegression(
                support_size=sizes, ic_type=criterion, fit_intercept=False, thread=1
            )
            .fit(x, y)
        )
        return np.asarray(found.coef_, float)

    return selected(problem, whitened, select)
