"""What training begins with: rows, normalised, made fewer, stacked; first weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softnn.contracts import Array
from softnn.neural.network import Scaling

CELLS = 512  # a range of inputs; samples in one cell are alike
PACK = 64  # rows, of which a set is padded to a multiple
SUBSET = 2000  # samples, where few are alike; enough to fix 81 parameters


@dataclass(frozen=True)
class Rows:
    """Normalised rows: inputs x (m, d), target y (m,), weight (m,); see `training`."""

    x: Array
    y: Array
    weight: Array
    within: float = 0.0


def normalised(
    inputs: Array, target: Array, rows: np.ndarray, x: Scaling, y: Scaling
) -> Rows:
    return Rows(x.apply(inputs[rows]), y.apply(target[rows]), np.ones(len(rows)))


def summary(whole: Rows, rng: np.random.Generator) -> Rows:
    """Far fewer rows that a network can be fitted to almost as well; or `whole`.

    Samples of equal inputs, up to 1 / `CELLS` of their range, become one row: their
    mean, counted as often. What they differ by among themselves no network can fit, so
    the cost keeps its value, up to the square of a cell. Where inputs are too scattered
    for that, `SUBSET` samples are drawn at random.
    """
    cells = np.floor((whole.x + 1) * (CELLS / 2)).astype(np.int64)
    _, of, count = np.unique(
        cells @ (2 * CELLS) ** np.arange(cells.shape[1]),
        return_inverse=True,
        return_counts=True,
    )
    if 2 * len(count) <= len(of):

        def mean(values: Array) -> Array:
            return np.bincount(of, values) / count

        y = mean(whole.y)
        return Rows(
            np.column_stack([mean(column) for column in whole.x.T]),
            y,
            count.astype(float),
            float(np.sum((whole.y - y[of]) ** 2)),
        )
    if len(of) <= 2 * SUBSET:
        return whole
    rows = np.sort(rng.choice(len(of), SUBSET, replace=False))
    return Rows(whole.x[rows], whole.y[rows], whole.weight[rows])


def stacked(sets: list[Rows]) -> tuple[Array, Array, Array, Array]:
    """x (B, m, d + 1), y and weight (B, m), within (B,); padding has weight 0."""
    most = max(-(-len(one.y) // PACK) * PACK for one in sets)
    x = np.zeros((len(sets), most, sets[0].x.shape[1] + 1))
    x[:, :, -1] = 1
    y, weight = np.zeros((len(sets), most)), np.zeros((len(sets), most))
    for i, one in enumerate(sets):
        rows = slice(len(one.y))
        x[i, rows, :-1], y[i, rows], weight[i, rows] = one.x, one.y, one.weight
    return x, y, weight, np.array([one.within for one in sets])


def nguyen_widrow(rng: np.random.Generator, count: int, d: int, width: int) -> Array:
    """A start (P,) that spreads the active regions of the neurons over [-1, 1]^d.

    Nguyen and Widrow (1990, doi:10.1109/IJCNN.1990.137819).
    """
    direction = rng.uniform(-1, 1, (count, d))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    size = 0.7 * count ** (1 / d)
    offset = np.linspace(-1, 1, count) if count > 1 else np.zeros(1)
    hidden = np.zeros((d + 1, width))
    hidden[:d, :count] = size * direction.T
    hidden[d, :count] = size * offset * np.sign(direction[:, 0])
    output = np.zeros(width + 1)
    output[:count] = rng.uniform(-1, 1, count)
    output[-1] = rng.uniform(-1, 1)
    return np.concatenate([hidden.ravel(), output])
