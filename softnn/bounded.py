"""The compiled parts of least squares: bounds on normal equations, whitened rows."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def bounded(gram, right, low, high, start):
    """x within [low, high] that minimises x.gram.x / 2 - right.x (Stark and Parker).

    An active-set method (Stark and Parker 1995, Computational Statistics 10, 129),
    started from the bounds that `start` touches; gram must be positive definite.
    """
    n = len(right)
    x = np.minimum(np.maximum(start, low), high)
    free = (x > low) & (x < high)
    scale = np.sqrt(np.diag(gram)) + 1e-300
    tolerance = 1e-9 * (np.max(np.abs(right) / scale) + 1e-300)
    banned = -1
    for _ in range(6 * n + 20):
        for _ in range(2 * n + 5):
            index = np.flatnonzero(free)
            if len(index) == 0:
                break
            fixed = np.where(free, 0.0, x)
            rest = right - gram @ fixed
            g = np.empty((len(index), len(index)))
            for a in range(len(index)):
                for b in range(len(index)):
                    g[a, b] = gram[index[a], index[b]]
            z = np.linalg.solve(g, rest[index])
            step = 1.0
            hit = -1
            for a in range(len(index)):
                i = index[a]
                if z[a] < low[i] or z[a] > high[i]:
                    limit = low[i] if z[a] < low[i] else high[i]
                    d = z[a] - x[i]
                    s = (limit - x[i]) / d if d != 0 else 0.0
                    if s < step:
                        step, hit = max(s, 0.0), i
            for a in range(len(index)):
                i = index[a]
                x[i] += step * (z[a] - x[i])
            if hit < 0:
                break
            for a in range(len(index)):
                i = index[a]
                if x[i] <= low[i] + 1e-14 * (1 + abs(low[i])) or (
                    i == hit and z[a] < low[i]
                ):
                    x[i] = low[i]
                    free[i] = False
                elif x[i] >= high[i] - 1e-14 * (1 + abs(high[i])) or i == hit:
                    x[i] = high[i]
                    free[i] = False
            if step == 0.0 and hit == banned:
                break
        gradient = (right - gram @ x) / scale
        best, pick = tolerance, -1
        for i in range(n):
            if free[i] or low[i] >= high[i] or i == banned:
                continue
            if x[i] <= low[i] and gradient[i] > best:
                best, pick = gradient[i], i
            elif x[i] >= high[i] and -gradient[i] > best:
                best, pick = -gradient[i], i
        if pick < 0:
            break
        free[pick] = True
        # Freed by the gradient yet sent straight back: rounding, not progress.
        before = x[pick]
        banned = pick if before == x[pick] else -1
        banned = pick
    return x


@numba.njit(cache=True)
def innovations(decay, share, white, first):
    """Return Kalman gains (n, parts) and 1 / sqrt of the innovation variance (n,).

    The noise has unit variance. `decay` (n, parts) is the decay since the sample
    before, `share` (n, parts) the variance of the first-order parts, `white` (n,) the
    rest. `first` (n,) marks the first sample of each recording.
    """
    n, k = decay.shape
    gain = np.zeros((n, k))
    scale = np.empty(n)
    p = np.zeros((k, k))
    for i in range(n):
        for a in range(k):
            for b in range(k):
                if first[i]:
                    p[a, b] = share[i, a] if a == b else 0.0
                else:
                    p[a, b] *= decay[i, a] * decay[i, b]
            if not first[i]:
                p[a, a] += share[i, a] * (1 - decay[i, a] ** 2)
        total = white[i]
        for a in range(k):
            for b in range(k):
                gain[i, a] += p[a, b]
            total += gain[i, a]
        scale[i] = 1 / np.sqrt(total)
        for a in range(k):
            gain[i, a] /= total
        for a in range(k):
            for b in range(k):
                p[a, b] -= gain[i, a] * gain[i, b] * total
    return gain, scale


@numba.njit(cache=True)
def whitened(x, sigma, decay, gain, scale, first):
    """Rows (n, k) as innovations of variance 1; see `innovations`."""
    n, k = x.shape
    parts = decay.shape[1]
    out = np.empty((n, k))
    state = np.zeros((parts, k))
    for i in range(n):  # inner loops run along a row: several numbers at a time
        if first[i]:
            state[:] = 0.0
        new = out[i]
        for j in range(k):
            new[j] = x[i, j] / sigma[i]
        for a in range(parts):
            for j in range(k):
                state[a, j] *= decay[i, a]
                new[j] -= state[a, j]
        for a in range(parts):
            for j in range(k):
                state[a, j] += gain[i, a] * new[j]
        for j in range(k):
            new[j] *= scale[i]
    return out
