"""Rivals that only predict: a Gaussian process on the residual, and a black box.

The Gaussian process is the discrepancy of Kennedy and O'Hagan (2001,
doi:10.1111/1467-9868.00294) on state features. The black box is softnn's own network
from strain, state and fading memories of the strain straight to stress: what there is
to predict, if nobody asks why.
"""

from __future__ import annotations

import warnings

import numpy as np

from bench.rivals import folds
from bench.rivals.naming import Found
from bench.rivals.problem import Problem
from softnn.contracts import Array

ROWS = 350  # samples that the Gaussian process learns from
LEARNT = 1000  # samples that the network learns from


def gaussian_process(problem: Problem, rng: np.random.Generator) -> Found:
    """Length scales from all recordings, then what the others say of each."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    engine, f = problem.engine, problem.features
    x = f.values / np.maximum(f.values.std(axis=0), 1e-9)
    scale = float(np.std(problem.residual)) or 1.0
    kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(
        np.ones(x.shape[1]), (0.1, 1e3)
    ) + WhiteKernel(0.1, (1e-5, 10.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        rows = rng.permutation(len(x))[:ROWS]
        whole = GaussianProcessRegressor(kernel).fit(
            x[rows], problem.residual[rows] / scale
        )
        error = 0.0
        for fold in problem.folds:
            train = np.flatnonzero(~fold.test)
            rows = rng.permutation(train)[:ROWS]
            left = (engine.target[rows] - fold.stress[rows]) / scale
            one = GaussianProcessRegressor(whole.kernel_, optimizer=None).fit(
                x[rows], left
            )
            said = fold.stress[fold.test] + scale * one.predict(x[fold.test])
            error += float(np.sum((engine.target[fold.test] - said) ** 2))
    return Found(heldout_nrmse=folds.nrmse(engine, error))


def black_box(
    problem: Problem,
    rng: np.random.Generator,
    inputs: str = "strain",
    neurons: int = 4,
    on_base: bool = False,
) -> Found:
    """A Bayesian-regularised network, trained without each recording in turn.

    `on_base`: it learns what the base, refitted without the recording, leaves.
    """
    from softnn.neural import train

    engine, x = problem.engine, history(problem, inputs)
    few = np.arange(0, len(x), max(len(x) // LEARNT, 1))
    seeds = [int(s) for s in rng.integers(0, 2**31, len(problem.folds))]
    error = 0.0
    for fold, seed in zip(problem.folds, seeds, strict=True):
        start = fold.stress if on_base else np.zeros(len(x))
        (one,) = train(
            x[few],
            (engine.target - start)[few],
            neurons=[neurons],
            train_mask=~fold.test[None, few],
            seeds=[seed],
        )
        said = start[fold.test] + one.network.predict(x[fold.test])
        error += float(np.sum((engine.target[fold.test] - said) ** 2))
    return Found(heldout_nrmse=folds.nrmse(engine, error))


def grey_box(
    problem: Problem,
    rng: np.random.Generator,
    inputs: str = "strain",
    neurons: int = 4,
) -> Found:
    """The same network on top of the base: it need not learn what is known."""
    return black_box(problem, rng, inputs, neurons, on_base=True)


INPUTS = {
    "strain": ("strain",),
    "state": ("strain", "largest_strain", "direction"),
}


def history(problem: Problem, inputs: str) -> Array:
    """Features and memories (valid, k); nothing that the base has said."""
    f = problem.features
    own = [f.names.index(n) for n in INPUTS[inputs]]
    return np.concatenate([f.values[:, own], f.memories[:, 1::2]], axis=1)
