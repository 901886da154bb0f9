"""Equations for the residual, from state features: PySINDy and symbolic regression.

A term names an effect by the features in it (`columns.RULES`); what the rules do not
know counts as unlisted.
"""

from __future__ import annotations

import warnings

import numpy as np

from bench.rivals import columns, folds
from bench.rivals.extra import load
from bench.rivals.naming import UNMAPPED, Found
from bench.rivals.problem import Problem
from bench.rivals.sparse import account, explained
from softnn.contracts import Array

MODELS = 10  # of an ensemble
ROWS = 1500  # samples that a model of the ensemble is fitted to
EVALUATIONS = 50_000  # of the symbolic search
SEARCHED = 2000  # samples that the symbolic search sees
MOST_TERMS = 12
RIDGE = (
    1e-3  # of the diagonal: terms are alike, and the smallest coefficient goes first
)


def optimiser_name() -> str:
    """The sparse optimiser that the installed PySINDy has for this."""
    known = hasattr(load("pysindy.optimizers"), "EvidenceGreedy")
    return "EvidenceGreedy" if known else "SSR"


def pysindy(
    problem: Problem, rng: np.random.Generator, inclusion: float = 0.6
) -> Found:
    """Sparse regression on a quadratic library, in an ensemble of bootstrap samples.

    EvidenceGreedy where PySINDy has it. Releases up to 2.1 do not: there the backward
    path of its stepwise sparse regression is walked, and the model on it with the
    largest evidence (Schwarz's approximation) taken. A term stays that is in a share
    `inclusion` of the models. PySINDy's own EnsembleOptimizer draws from the global
    generator, so the samples are drawn here.
    """
    names, terms = library(problem)
    residual = problem.residual
    scale = float(np.std(residual)) or 1.0
    size = np.sqrt(np.mean(terms**2, axis=0))
    terms, names = (
        terms[:, size > 1e-9],
        [n for n, s in zip(names, size, strict=True) if s > 1e-9],
    )
    size = size[size > 1e-9]
    rows = min(ROWS, len(residual))
    sigma = float(np.sqrt(problem.noise_power / len(residual))) / scale
    counts = np.zeros(len(names))
    for _ in range(MODELS):
        pick = rng.integers(0, len(residual), rows)
        counts += support(terms[pick] / size, residual[pick] / scale, sigma)
    live = np.flatnonzero(counts >= inclusion * MODELS)
    live = live[np.argsort(-counts[live], kind="stable")][:MOST_TERMS]
    pool = [e.id for e in problem.pool]
    book = columns.Dictionary(
        terms[:, live] * scale,
        tuple(columns.meaning(factors(names[i]), pool) for i in live),
        np.full(len(live), folds.SHARED),
    )
    found = account(problem, book)
    return Found(
        found.shares,
        found.gain,
        found.explained,
        found.heldout_nrmse,
        f"{optimiser_name()}: " + " + ".join(names[i] for i in live),
    )


def library(problem: Problem) -> tuple[list[str], Array]:
    """PySINDy's library of products of up to two features: names, values."""
    f = problem.features
    made = load("pysindy").PolynomialLibrary(degree=2, include_bias=True).fit(f.values)
    names = made.get_feature_names(list(f.names))
    # Spikes at the corners of the programme, times anything, are one spike ten times.
    kept = [
        i
        for i, n in enumerate(names)
        if "acceleration" not in factors(n) or len(factors(n)) == 1
    ]
    values = np.asarray(made.transform(f.values), float)
    return [names[i] for i in kept], values[:, kept]


def factors(term: str) -> list[str]:
    """Features in a term of the library, as in "strain direction" or "rate^2".

    >>> factors("rate^2"), factors("1")
    (['rate', 'rate'], [])
    """
    out = []
    for word in term.split():
        name, _, power = word.partition("^")
        if name != "1":
            out += [name] * int(power or 1)
    return out


def support(terms: Array, target: Array, sigma: float) -> Array:
    """Which terms (m,) are in the best model, as 0 and 1."""
    optimizers = load("pysindy.optimizers")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of ridge penalties near zero
        if optimiser_name() == "EvidenceGreedy":
            model = optimizers.EvidenceGreedy(alpha=1.0, _sigma2=max(sigma, 1e-6) ** 2)
            return (model.fit(terms, target[:, None]).coef_[0] != 0).astype(float)
        model = optimizers.SSR(
            alpha=RIDGE * len(terms), max_iter=terms.shape[1] + 1, unbias=False
        )
        model.fit(terms, target[:, None])
    best, chosen = schwarz(target, 0), np.zeros(terms.shape[1])
    for coefficients in model.history_:
        kept = np.ravel(coefficients) != 0
        left = target - terms @ np.ravel(coefficients)
        value = schwarz(left, int(kept.sum()))
        if value < best:
            best, chosen = value, kept.astype(float)
    return chosen


def schwarz(left: Array, terms: int) -> float:
    n = len(left)
    return n * float(np.log(np.mean(left**2) + 1e-300)) + terms * float(np.log(n))


def symbolic(problem: Problem, rng: np.random.Generator, length: int = 15) -> Found:
    """An equation by genetic programming (pyoperon), chosen by description length.

    In the folds the equation stays, its scale is fitted anew. A feature is in it where
    the error rises by a tenth of what the equation explains when the feature is mixed.
    """
    f, residual = problem.features, problem.residual
    scale = float(np.std(residual)) or 1.0
    rows = rng.permutation(len(residual))[:SEARCHED]
    sigma = float(np.sqrt(problem.noise_power / len(residual))) / scale
    model = load("pyoperon.sklearn").SymbolicRegressor(
        allowed_symbols="add,sub,mul,aq,exp,tanh,constant,variable",
        objectives=["rmse", "length"],
        max_length=length,
        population_size=400,
        generations=200,
        max_evaluations=EVALUATIONS,
        optimizer_iterations=3,
        uncertainty=[max(sigma, 1e-3)],
        n_threads=1,
        random_state=int(rng.integers(2**31)),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(f.values[rows], residual[rows] / scale)
    column = np.nan_to_num(np.asarray(model.predict(f.values), float))
    size = float(np.sqrt(np.mean(column**2)))
    before = folds.squares(problem.engine, problem.folds)
    if not size > 1e-9:
        return Found(heldout_nrmse=folds.nrmse(problem.engine, before))
    moved = 1 - np.mean((residual / scale - column) ** 2) / np.mean(
        (residual / scale) ** 2
    )
    used = []
    for j, name in enumerate(f.names):
        mixed = f.values.copy()
        mixed[:, j] = rng.permutation(mixed[:, j])
        change = np.nan_to_num(np.asarray(model.predict(mixed), float)) - column
        if np.mean(change**2) > 0.1 * max(moved, 0.01) * np.mean(
            (residual / scale) ** 2
        ):
            used.append(name)
    made = folds.of(
        problem.engine,
        problem.base.fit,
        (column / size * scale)[:, None],
        np.array([folds.SHARED]),
    )
    after = folds.squares(problem.engine, made)
    name = columns.meaning(used, [e.id for e in problem.pool]) if used else UNMAPPED
    total = float(residual @ residual)
    return Found(
        {name: 1.0},
        1 - after / max(before, 1e-300),
        explained(total, (1 - float(moved)) * total, problem.noise_power),
        folds.nrmse(problem.engine, after),
        model.get_model_string(model.model_, 3, list(f.names)),
    )
