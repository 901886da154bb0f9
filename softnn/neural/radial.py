"""Networks of Gaussian units: centres where the samples are, weights in closed form."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence

import numpy as np

from softnn.contracts import Array, InputError
from softnn.neural.network import RadialNetwork, Scaling
from softnn.neural.training import Regularisation, Trained

WIDTH = 1.5  # of a unit, in spacings of as many centres spread over the inputs
UPDATES = 100  # of the evidence, at most; it settles in a few
EIGENVALUE = 1e-12  # of the largest: below it two units are one


def train_radial(
    inputs: Array,
    target: Array,
    *,
    neurons: Sequence[int],
    train_mask: np.ndarray,
    seeds: Sequence[int],
    regularisation: Regularisation,
) -> list[Trained]:
    """As `softnn.neural.train`, for Gaussian units; raises `InputError`.

    Centres are the k-means of the training inputs, output weights least squares with
    a weight penalty by MacKay's evidence (1992, doi:10.1162/neco.1992.4.3.415), or
    one that is given. Early stopping has nothing to stop here.
    """
    if regularisation.kind == "early-stopping":
        raise InputError(
            "regularisation is early-stopping; Gaussian units are not trained step by "
            "step, so allowed is bayesian or l2=WEIGHT"
        )
    known = zip(neurons, train_mask, seeds, strict=True)
    return [
        _one(inputs[mask], target[mask], count, seed, regularisation)
        for count, mask, seed in known
    ]


def _one(
    inputs: Array, target: Array, count: int, seed: int, how: Regularisation
) -> Trained:
    from sklearn.cluster import KMeans

    began = time.perf_counter()
    x_scale, y_scale = Scaling.of(inputs), Scaling.of(target)
    x, y = x_scale.apply(inputs), y_scale.apply(target)
    with warnings.catch_warnings():  # fewer different inputs than units is no fault
        warnings.simplefilter("ignore")
        means = KMeans(min(count, len(x)), n_init=1, random_state=seed).fit(x)
    centres = means.cluster_centers_
    spacing = 2 / count ** (1 / x.shape[1])  # inputs fill [-1, 1]
    hidden = np.column_stack([centres, np.full(len(centres), WIDTH * spacing)])
    bare = RadialNetwork(hidden, np.zeros(len(centres) + 1), x_scale, y_scale)
    layer = np.column_stack([bare.layer(inputs), np.ones(len(x))])
    weights, gamma, alpha, beta, steps = _weights(layer, y, how)
    return Trained(
        RadialNetwork(hidden, weights, x_scale, y_scale),
        count,
        hidden[:, :-1].size + 1 + len(weights),
        gamma,
        alpha,
        beta,
        steps,
        "closed form",
        time.perf_counter() - began,
    )


def _weights(
    layer: Array, y: Array, how: Regularisation
) -> tuple[Array, float, float, float, int]:
    """Output weights, effective parameters, alpha, beta, number of updates."""
    count, size = layer.shape
    values, vectors = np.linalg.eigh(layer.T @ layer)
    values = np.maximum(values, EIGENVALUE * values[-1])
    turned = vectors.T @ (layer.T @ y)

    def at(decay: float) -> tuple[Array, float, float]:
        weights = vectors @ (turned / (values + decay))
        sse = float(np.sum((layer @ weights - y) ** 2))
        return weights, sse, float(np.sum(values / (values + decay)))

    if how.kind == "l2":
        weights, sse, _ = at(how.weight * count)
        return weights, float(size), how.weight * count, 1.0, 1
    alpha, beta, step = 1e-3, 1.0, 0
    weights, sse, gamma = at(alpha / beta)
    while step < UPDATES:
        step += 1
        before = alpha / beta
        alpha = gamma / max(float(weights @ weights), 1e-300)
        beta = max(count - gamma, 1e-9) / max(sse, 1e-300)
        weights, sse, gamma = at(alpha / beta)
        if abs(alpha / beta - before) <= 1e-6 * before:
            break
    return weights, gamma, alpha, beta, step
