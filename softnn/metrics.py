r"""How good a prediction is: one definition each.

Pairs in which either value is NaN are left out; with no pair left the result is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from softnn.contracts import Array, InputError
from softnn.state import turns

BAND = 0.01  # of the range of strain; a smaller reversal is noise, not motion
STRETCH = 2e-4  # of the path, over which speed is taken: 1/50 of the shortest hold seen
HELD = 0.01  # of the usual speed; slower strain counts as held
DECADES = 2.0  # of the time of a hold that its weight is spread over


def weights(time_s: ArrayLike, strain: ArrayLike) -> Array:
    """Return the weight (n,) of each sample in an error; their mean is 1.

    Samples count by what they show, not by how many there are. While the strain moves,
    equal paths of strain weigh alike. While it is held, equal steps of the logarithm of
    time do, over the last `DECADES` decades of the hold. If the strain is held for the
    share h of the time, all holds together have the share h / (1 + h) of the weight: at
    most half.

    >>> ramp_and_hold = np.minimum(0.1 * np.arange(101.0), 1.0)
    >>> weights(np.arange(101.0), ramp_and_hold)[:11].sum().round(1).item()
    57.0
    """
    time, x = np.asarray(time_s, float), np.asarray(strain, float)
    if len(x) < 3:
        return np.ones(len(x))
    path, step = np.zeros(len(x) - 1), np.maximum(np.diff(time), 0.0)
    ends = turns(x, BAND * float(np.ptp(x)))
    for first, last in pairwise(ends):
        gone = np.maximum.accumulate(np.abs(x[first : last + 1] - x[first]))
        path[first:last] = np.diff(gone)
    whole = path.sum()
    if not whole > 0:
        return np.ones(len(x))
    by = path / whole
    # Noise and the steps of a counter are no motion: speeds are of stretches of path.
    begun = np.concatenate([[0.0], np.cumsum(by[:-1])])
    _, cell = np.unique(np.floor(begun / STRETCH), return_inverse=True)
    lasts, gone = np.bincount(cell, step), np.bincount(cell, by)
    speed = gone / np.maximum(lasts, 1e-300)
    still = (speed < HELD * float(gone @ speed))[cell]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]])))
    held = np.zeros(len(step))
    for first, last in edges.reshape(-1, 2):
        since = np.concatenate([[0.0], np.cumsum(step[first:last])])
        if since[-1] > 0:
            held[first:last] = np.diff(np.log(since + since[-1] / 10**DECADES))
    if held.sum() > 0:
        share = step[still].sum() / step.sum()
        by = (by + share * held / held.sum()) / (1 + share)
    each = np.concatenate([by, [0.0]]) + np.concatenate([[0.0], by])
    return np.asarray(each * len(x) / each.sum())


def _pairs(predicted: ArrayLike, measured: ArrayLike) -> tuple[Array, Array]:
    p, m = np.asarray(predicted, float), np.asarray(measured, float)
    if p.shape != m.shape:
        raise InputError(f"predicted has shape {p.shape}, measured {m.shape}")
    keep = ~(np.isnan(p) | np.isnan(m))
    return p[keep], m[keep]


def nrmse(predicted: ArrayLike, measured: ArrayLike) -> float:
    r"""Normalised root mean square error, a fraction (thesis eq. 5.10).

    .. math:: \sqrt{\langle (\sigma^{pred}-\sigma^{exp})^2 \rangle
                    / \langle (\sigma^{exp})^2 \rangle}

    >>> round(nrmse([1.0, 2.0], [1.0, 1.0]), 6)
    0.707107
    """
    p, m = _pairs(predicted, measured)
    scale = np.sum(m**2)
    return float(np.sqrt(np.sum((p - m) ** 2) / scale)) if scale > 0 else float("nan")


def r2(predicted: ArrayLike, measured: ArrayLike) -> float:
    """Coefficient of determination, 1 - SSE / SST; below 0 is worse than the mean."""
    p, m = _pairs(predicted, measured)
    total = np.sum((m - m.mean()) ** 2) if m.size else 0.0
    return float(1 - np.sum((p - m) ** 2) / total) if total > 0 else float("nan")


def generalisation_error(nrmses: Sequence[float]) -> float:
    """Mean NRMSE over training sessions (thesis eq. 6.7) or strain rates (eq. 5.13)."""
    if not len(nrmses):
        raise InputError("generalisation error of no NRMSE; at least one is needed")
    return float(np.mean(nrmses))


def delta_accuracy(nrmse_wiechert: float, nrmse_sls: float) -> float:
    """Improvement of PL-Wiechert on PL-SLS in per cent (thesis eq. 5.11)."""
    return 100 * (1 - nrmse_wiechert / nrmse_sls)


def delta_complexity(segments_wiechert: int, segments_sls: int) -> float:
    """Extra strain segments of PL-Wiechert in per cent (thesis eq. 5.12)."""
    return 100 * (segments_wiechert / segments_sls - 1)
