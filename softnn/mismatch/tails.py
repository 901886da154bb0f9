"""Outlying samples: rare, and seldom alone.

Whitened noise is normal of unit width; in an outlier (probability `RARE`) it is `WIDE`
times as wide. After an outlier the next sample is one with probability `STAY`, because
errors at a corner last for some samples. A chain of two states (Baum et al. 1970,
doi:10.1214/aoms/1177697196).
"""

from __future__ import annotations

import numba
import numpy as np

from softnn.contracts import Array

RARE, WIDE, STAY = 0.01, 10.0, 0.7


def shares(half_squares: Array, begins: np.ndarray) -> tuple[Array, float]:
    """Return the probability (n,) that each sample is an outlier, and the log odds.

    The log odds (nats) are against no outlier at all. `half_squares` (n,) are those of
    whitened samples, -inf for a sample that cannot be an outlier; `begins` (n,) marks
    the first sample of each recording.
    """
    ratio = half_squares * (1 - WIDE**-2) - np.log(WIDE)
    enter = RARE * (1 - STAY) / (1 - RARE)
    share, odds = _chain(ratio, begins, RARE, enter, STAY)
    return share, float(odds)


@numba.njit(cache=True)
def _chain(ratio, begins, first, enter, stay):
    n = len(ratio)
    ahead = np.empty(n)  # log odds of an outlier, given all samples up to there
    total = 0.0
    for i in range(n):
        if begins[i]:
            off, none = first, 1 - first
        else:
            p = 1 / (1 + np.exp(-ahead[i - 1]))
            off, none = p * stay + (1 - p) * enter, 1 - enter
        ahead[i] = np.log(off) - np.log1p(-off) + ratio[i]
        total += np.log1p(-off) + np.logaddexp(0.0, ahead[i]) - np.log(none)
    share = np.empty(n)
    behind = 0.0  # log odds by all samples that follow
    for i in range(n - 1, -1, -1):
        share[i] = 1 / (1 + np.exp(-ahead[i] - behind))
        if begins[i]:
            behind = 0.0
        else:
            next_ = ratio[i] + behind
            behind = np.logaddexp(np.log(stay) + next_, np.log(1 - stay))
            behind -= np.logaddexp(np.log(enter) + next_, np.log(1 - enter))
    return share, total
