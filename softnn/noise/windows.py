"""Noise memory from windows of samples: restricted likelihood, cubics removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular, toeplitz

from softnn.contracts import Array

WINDOW = 48  # samples
DEGREE = 3
DISAGREE = 8.0  # nats beyond which recordings do not share one memory
CALM = 0.8  # share of the windows of a recording; the others may hold a reversal
USUAL = 1.5  # times the median roughness; a rougher window may hold a reversal
PHI = np.concatenate([[0.0], 1 - np.geomspace(0.95, 0.008, 26)])
TAUS = np.concatenate([[0.05], -1 / np.log(PHI[1:])])  # samples: times of PHI


@cache
def _whiteners(length: int) -> tuple[list[Array], Array]:
    """Whitening matrices (length - 4, length), one per memory, and log determinants.

    Each matrix removes cubics and makes the rest white. The log determinants enter the
    restricted likelihood.
    """
    t = np.linspace(-1, 1, length)
    trend = np.linalg.qr(np.vander(t, min(DEGREE, length // 4) + 1))[0]
    lag = np.arange(length)
    out, extra = [], []
    covariances = [p**lag if p else (lag == 0).astype(float) for p in PHI]
    for covariance in covariances:
        low = cholesky(toeplitz(covariance), lower=True)
        q, r = np.linalg.qr(solve_triangular(low, trend, lower=True))
        inverse = solve_triangular(low, np.eye(length), lower=True)
        out.append(inverse - q @ (q.T @ inverse))
        extra.append(-np.log(np.diag(low)).sum() - np.log(np.abs(np.diag(r))).sum())
    return out, np.array(extra)


@dataclass(frozen=True)
class Windows:
    """Windows of equally many samples, with the likelihood of each memory in each.

    Roughness is the variance of the new part of each sample.
    """

    like: Array  # (memories, windows), restricted log-likelihood
    variance: Array  # the same shape
    size: Array  # (windows,), root mean square of the stress
    whose: NDArray[np.integer]  # (windows,), the recording
    degrees: int

    def of(self, recording: int) -> NDArray[np.bool]:
        """Mask (windows,) of the calm windows of a recording.

        A calm window is about as rough as most of its recording.
        """
        mine = self.whose == recording
        if not mine.any():
            return mine
        rough = self.variance[len(PHI) - 2]
        usual = max(np.quantile(rough[mine], CALM), USUAL * np.median(rough[mine]))
        return mine & (rough <= usual)


def windowed(residuals: Sequence[Array], stresses: Sequence[Array]) -> Windows | None:
    """Divide residuals into windows; None where no recording fills one.

    `residuals` and `stresses` are (n,) [MPa] for each recording; NaN samples are
    dropped.
    """
    length = WINDOW
    rows, level, owner = [], [], []
    for r, (residual, stress) in enumerate(zip(residuals, stresses, strict=True)):
        keep = np.isfinite(residual) & np.isfinite(stress)
        count = int(keep.sum()) // length
        if not count:
            continue
        rows.append(residual[keep][: count * length].reshape(count, length))
        by = stress[keep][: count * length].reshape(count, length)
        level.append(np.sqrt((by**2).mean(axis=1)))
        owner.append(np.full(count, r))
    if not rows:
        return None
    y = np.concatenate(rows).T
    whiteners, extra = _whiteners(length)
    degrees = length - min(DEGREE, length // 4) - 1
    left = np.array([((w @ y) ** 2).sum(axis=0) for w in whiteners])
    left = np.maximum(left, 1e-300)
    like = -0.5 * degrees * np.log(left) + extra[:, None]
    return Windows(
        like, left / degrees, np.concatenate(level), np.concatenate(owner), degrees
    )


def _by_recording(windows: Windows, recordings: int) -> Array:
    """Log-likelihood (memories, recordings) of the calm windows of each."""
    out = np.zeros((windows.like.shape[0], recordings))
    for r in range(recordings):
        out[:, r] = windows.like[:, windows.of(r)].sum(axis=1)
    return out


def _in_seconds(like: Array, taus: Array, interval: Array) -> tuple[Array, Array]:
    """Times [s] and the log-likelihood (times, recordings) of such memories.

    `like` (taus, recordings) is the log-likelihood of memories in samples.
    """
    low, high = taus[0] * interval.max(), taus[-1] * interval.max()
    times = np.geomspace(min(low, taus[0] * interval.min()), high, 60)
    out = np.empty((len(times), len(interval)))
    for r, step in enumerate(interval):
        out[:, r] = np.interp(np.log(times / step), np.log(taus), like[:, r])
    return times, out


def _shared(table: Array) -> tuple[int, float]:
    """Index of the row (rows, recordings) of greatest joint likelihood, and its value.

    Model error only ever adds memory. So where the half of the recordings with the
    shortest memory contradicts the whole, the half decides.
    """
    best = int(np.argmax(table.sum(axis=1)))
    own = np.argmax(table, axis=0)
    half = np.argsort(own, kind="stable")[: (table.shape[1] + 1) // 2]
    least = int(np.argmax(table[:, half].sum(axis=1)))
    apart = table[least, half].sum() - table[best, half].sum()
    chosen = least if least < best and apart > DISAGREE else best
    return chosen, float(table[chosen].sum())


def memory(
    windows: Windows, interval: Array
) -> tuple[Array, list[tuple[tuple[float, float], ...]]]:
    """Table row of the memory (recordings,), a float, and its first-order part.

    `interval` (recordings,) is the sampling interval [s]. The part is empty for white
    noise, else a share of 1 and a time in s.
    """
    tau = _either(_by_recording(windows, len(interval)), TAUS, interval)
    phi = np.exp(-1 / tau)
    phi = np.where(phi > 0.03, phi, 0.0)
    rows = np.interp(phi, PHI, np.arange(len(PHI)))
    return rows, [
        ((1.0, float(t * step)),) if p > 0 else ()
        for p, t, step in zip(phi, tau, interval, strict=True)
    ]


def _either(like: Array, taus: Array, interval: Array) -> Array:
    """Memory (recordings,) in samples: equal in samples or in seconds, the likelier."""
    samples, at_samples = _shared(like)
    times, table = _in_seconds(like, taus, interval)
    second, at_second = _shared(table)
    if at_second >= at_samples:
        return times[second] / interval
    return np.full(len(interval), taus[samples])
