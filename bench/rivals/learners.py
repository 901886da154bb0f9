"""Rivals that learn the stress from the history of strain, and know no law.

Each may learn what a piecewise-linear fit leaves (`on_base`) in place of the stress:
the discrepancy of Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294. What has been
learned then only bends a simulation that goes beyond the recordings by itself.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from bench.rivals.features import SETS, Features, rows
from bench.rivals.laws import piecewise
from bench.rivals.problem import Predict
from softnn.contracts import Array, Chunk
from softnn.fit import Data

TREES = 200
PROCESS_ROWS = 200, 1000  # samples: for the length scales, and to predict from
PROCESS_STEPS = 30  # of the search for them
NETWORK_ROWS = 800  # samples that a network learns from
RIDGE = 1e-4  # of the samples: weight of the squared coefficients
REGRESSED = 2000  # samples that PySINDy regresses on


@dataclass(frozen=True)
class Lesson:
    """Features x (n, k) and target y (n,), of root mean square `size` [MPa] before."""

    features: Features
    x: Array
    y: Array
    size: float
    base: Predict | None

    @classmethod
    def of(cls, data: Data, inputs: str, on_base: bool) -> Lesson:
        """From the samples with a stress; `on_base`: of what the base leaves."""
        base = None
        if on_base:
            base = piecewise(data, np.random.default_rng(0), "pl-wiechert", 16, 3)
            pairs = zip(data.stress_MPa, base(data.chunks), strict=True)
            left = tuple(stress - made for stress, made in pairs)
            data = Data(data.names, data.chunks, left)
        found = Features.of(data, SETS[inputs])
        x, y = rows(found, data)
        size = float(np.sqrt(np.mean(y**2))) or 1.0
        return cls(found, x, y / size, size, base)

    def predictor(self, at: Callable[[Array], Any]) -> Predict:
        """Stress of histories from `at`, which gives the target of features (n, k)."""

        def predict(chunks: Sequence[Chunk]) -> list[Array]:
            made = [self.size * np.asarray(at(self.features.at(c))) for c in chunks]
            if self.base is None:
                return made
            return [m + b for m, b in zip(made, self.base(chunks), strict=True)]

        return predict


def trees(data: Data, rng: np.random.Generator, leaves: int, on_base: bool) -> Predict:
    """Gradient-boosted trees, by scikit-learn's histograms."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    lesson = Lesson.of(data, "state", on_base)
    model = HistGradientBoostingRegressor(
        max_iter=TREES,
        max_leaf_nodes=leaves,
        early_stopping=False,
        random_state=int(rng.integers(2**31)),
    ).fit(lesson.x, lesson.y)
    return lesson.predictor(model.predict)


def gaussian_process(
    data: Data, rng: np.random.Generator, inputs: str, on_base: bool
) -> Predict:
    """A line and a smooth process, a length scale for each feature.

    The length scales are those of the largest likelihood on a few hundred samples.
    """
    from scipy.optimize import minimize
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import (
        RBF,
        ConstantKernel,
        DotProduct,
        WhiteKernel,
    )

    lesson = Lesson.of(data, inputs, on_base)
    x, y, count = lesson.x, lesson.y, lesson.x.shape[1]
    scales = np.full(count, np.sqrt(count))  # as far apart as samples are
    kernel = (
        ConstantKernel(0.1, (1e-4, 1e3)) * DotProduct(1.0, (1e-2, 1e2))
        + ConstantKernel(1.0, (1e-4, 1e3)) * RBF(scales, (0.1, 1e3))
        + WhiteKernel(1e-3, (1e-7, 1.0))
    )

    def best(cost: Any, start: Array, bounds: Array) -> tuple[Array, float]:
        options = {"maxiter": PROCESS_STEPS}
        made = minimize(
            cost, start, method="L-BFGS-B", jac=True, bounds=bounds, options=options
        )
        return made.x, float(made.fun)

    mixed = rng.permutation(len(x))
    few, many = (mixed[:n] for n in PROCESS_ROWS)
    with warnings.catch_warnings():
        # A feature that says nothing has the longest scale.
        warnings.simplefilter("ignore", ConvergenceWarning)
        first = GaussianProcessRegressor(kernel, optimizer=best).fit(x[few], y[few])
        model = GaussianProcessRegressor(first.kernel_, optimizer=None)
        model.fit(x[many], y[many])
    return lesson.predictor(model.predict)


def network(
    data: Data,
    rng: np.random.Generator,
    inputs: str,
    neurons: int,
    on_base: bool,
    starts: int = 3,
) -> Predict:
    """softnn's network with Bayesian regularisation; the mean of several starts."""
    from softnn.neural import train

    lesson = Lesson.of(data, inputs, on_base)
    few = np.sort(rng.permutation(len(lesson.x))[:NETWORK_ROWS])
    made = train(
        lesson.x[few],
        lesson.y[few],
        neurons=[neurons] * starts,
        train_mask=np.ones((starts, len(few)), bool),
        seeds=[int(s) for s in rng.integers(0, 2**31, starts)],
        threads=1,
    )
    return lesson.predictor(
        lambda z: np.mean([one.network.predict(z) for one in made], axis=0)
    )


def pysindy(
    data: Data,
    rng: np.random.Generator,
    inputs: str,
    degree: int,
    threshold: float,
    on_base: bool,
) -> Predict:
    """A sparse polynomial of features, of degree 1 or 2, by PySINDy's STLSQ.

    The equation is for the stress itself. SINDy elsewhere finds equations for a time
    derivative; here that would differentiate the noise of a load cell.
    """
    library = import_module("pysindy").PolynomialLibrary(degree=degree)
    sparse = import_module("pysindy.optimizers")
    lesson = Lesson.of(data, inputs, on_base)
    few = np.sort(rng.permutation(len(lesson.x))[:REGRESSED])
    library.fit(lesson.x)

    def terms(z: Array) -> Array:
        return np.asarray(library.transform(z), float)

    many = terms(lesson.x[few])
    scale = np.sqrt(np.mean(many**2, axis=0)) + 1e-12
    model = sparse.STLSQ(threshold=threshold, alpha=RIDGE * len(few), max_iter=50)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a threshold leaves no term
        model.fit(many / scale, lesson.y[few, None])
    weights = np.ravel(model.coef_) / scale
    return lesson.predictor(lambda z: terms(z) @ weights)
