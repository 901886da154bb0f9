r"""How good a prediction is: one definition each.

Pairs in which either value is NaN are left out; with no pair left the result is NaN.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from softnn.contracts import Array, InputError


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
