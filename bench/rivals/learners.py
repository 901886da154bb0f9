"""Rivals that learn the stress from the history of strain, and know no law."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from bench.rivals.features import SETS, Features, rows
from bench.rivals.problem import Predict
from softnn.contracts import Array, Chunk
from softnn.fit import Data

TREES = 200
PROCESS_ROWS = 300, 1000  # samples: for the length scales, and to predict from
PROCESS_STEPS = 40  # of the search for them
NETWORK_ROWS = 800  # samples that a network learns from
RIDGE = 1e-4  # of the samples: weight of the squared coefficients of a line
REGRESSED = 5000  # samples that PySINDy regresses on


class Regressor(Protocol):
    """What scikit-learn's regressors have in common."""

    def predict(self, x: Array) -> Array: ...


def trees(
    data: Data, rng: np.random.Generator, leaves: int, on_line: bool
) -> Predict:
    """Gradient-boosted trees; `on_line`: of what a linear regression leaves.

    scikit-learn's histogram gradient boosting. Trees alone do not go beyond what they
    have seen; the line does.
    """
    from sklearn.ensemble import HistGradientBoostingRegressor

    found = Features.of(data, SETS["state"])
    x, y, _ = rows(found, data)
    size = _size(y)
    line = _line(x, y / size) if on_line else np.zeros(x.shape[1] + 1)
    model = HistGradientBoostingRegressor(
        max_iter=TREES,
        max_leaf_nodes=leaves,
        early_stopping=False,
        random_state=int(rng.integers(2**31)),
    ).fit(x, y / size - _on(line, x))
    return _predictor(found, lambda z: size * (model.predict(z) + _on(line, z)))


def gaussian_process(data: Data, rng: np.random.Generator, inputs: str) -> Predict:
    """A line and a smooth process, a length scale for each feature.

    The length scales are those of the largest likelihood on a few hundred samples.
    """
    from scipy.optimize import minimize
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import (
        RBF,
        ConstantKernel,
        DotProduct,
        WhiteKernel,
    )

    found = Features.of(data, SETS[inputs])
    x, y, _ = rows(found, data)
    size = _size(y)
    kernel = (
        ConstantKernel(0.1, (1e-4, 1e3)) * DotProduct(1.0, (1e-2, 1e2))
        + ConstantKernel(1.0, (1e-4, 1e3)) * RBF(np.ones(x.shape[1]), (0.1, 1e3))
        + WhiteKernel(1e-3, (1e-7, 1.0))
    )
    mixed = rng.permutation(len(x))
    few, many = (mixed[:n] for n in PROCESS_ROWS)

    def best(cost: Any, start: Array, bounds: Array) -> tuple[Array, float]:
        options = {"maxiter": PROCESS_STEPS}
        made = minimize(
            cost, start, method="L-BFGS-B", jac=True, bounds=bounds, options=options
        )
        return made.x, float(made.fun)

    first = GaussianProcessRegressor(kernel, optimizer=best).fit(x[few], y[few] / size)
    model = GaussianProcessRegressor(first.kernel_, optimizer=None)
    model.fit(x[many], y[many] / size)
    return _predictor(found, lambda z: size * model.predict(z))


def network(
    data: Data, rng: np.random.Generator, inputs: str, neurons: int, starts: int = 3
) -> Predict:
    """softnn's network with Bayesian regularisation; the mean of several starts."""
    from softnn.neural import train

    found = Features.of(data, SETS[inputs])
    x, y, _ = rows(found, data)
    few = np.sort(rng.permutation(len(x))[:NETWORK_ROWS])
    made = train(
        x[few],
        y[few],
        neurons=[neurons] * starts,
        train_mask=np.ones((starts, len(few)), bool),
        seeds=[int(s) for s in rng.integers(0, 2**31, starts)],
        threads=1,
    )

    def predict(z: Array) -> Array:
        stress: Array = np.mean([one.network.predict(z) for one in made], axis=0)
        return stress

    return _predictor(found, predict)


def pysindy(
    data: Data, rng: np.random.Generator, inputs: str, degree: int, threshold: float
) -> Predict:
    """A sparse polynomial of features, of degree 1 or 2, by PySINDy's STLSQ.

    The equation is for the stress itself: its derivative in time, of which SINDy finds
    equations elsewhere, is lost in the noise of a load cell.
    """
    library = import_module("pysindy").PolynomialLibrary(degree=degree)
    sparse = import_module("pysindy.optimizers")
    found = Features.of(data, SETS[inputs])
    x, y, _ = rows(found, data)
    few = np.sort(rng.permutation(len(x))[:REGRESSED])
    size = _size(y)
    library.fit(x)

    def terms(z: Array) -> Array:
        return np.asarray(library.transform(z), float)

    many = terms(x[few])
    scale = np.sqrt(np.mean(many**2, axis=0)) + 1e-12
    model = sparse.STLSQ(threshold=threshold, alpha=RIDGE * len(few), max_iter=50)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a threshold leaves no term
        model.fit(many / scale, y[few, None] / size)
    weights = np.ravel(model.coef_) / scale
    return _predictor(found, lambda z: size * (terms(z) @ weights))


def _predictor(found: Features, at: Any) -> Predict:
    def predict(chunks: Sequence[Chunk]) -> list[Array]:
        return [np.asarray(at(found.at(c)), float) for c in chunks]

    return predict


def _size(y: Array) -> float:
    return float(np.sqrt(np.mean(y**2))) or 1.0


def _line(x: Array, y: Array) -> Array:
    """Coefficients of a ridge regression, the constant last."""
    a = np.column_stack([x, np.ones(len(x))])
    gram = a.T @ a + RIDGE * len(x) * np.eye(a.shape[1])
    return np.linalg.solve(gram, a.T @ y)


def _on(line: Array, x: Array) -> Array:
    return x @ line[:-1] + line[-1]
