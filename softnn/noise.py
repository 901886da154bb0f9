r"""Level and colour of the noise of a recording, estimated from the data alone.

A window of samples is taken as a cubic in time plus noise whose correlation falls off
as AR(1). Its level and its correlation are those of greatest restricted likelihood
(Patterson and Thompson 1971, doi:10.1093/biomet/58.3.545), which allows for the noise
that the cubic itself takes up. Memory that is long beside a window is looked for in
longer ones too, and the shortest found counts: what a simulation misses only ever adds
correlation. Windows in which something else happens (a reversal, a slip) are rougher
than the rest and are left out. Level may grow with the stress; a channel with few
distinct values is quantised, and its step adds step / sqrt(12).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array

WINDOW = 48
LONGER = (192, 768)  # for noise whose memory is more than a window shows
MEMORY = 0.1  # of a window, up to which it shows it
DEGREE = 3
DISAGREE = 8.0  # of log-likelihood, beyond which recordings are not of one colour
CORRELATIONS = np.concatenate([[0.0], 1 - np.geomspace(0.95, 0.008, 26)])


@dataclass(frozen=True)
class Noise:
    """Noise of one recording: sigma^2 = floor^2 + (share x stress)^2 + step^2 / 12.

    `correlation` is that of neighbouring samples, `correlation_s` the time in which it
    falls to 1/e; 0 is white.
    """

    floor_MPa: float
    share: float
    step_MPa: float
    correlation: float
    correlation_s: float
    windows: int

    def sigma(self, stress_MPa: Array) -> Array:
        """Standard deviation at each stress, MPa."""
        s = np.nan_to_num(np.asarray(stress_MPa, float))
        return np.sqrt(
            self.floor_MPa**2 + (self.share * s) ** 2 + self.step_MPa**2 / 12
        )


@dataclass(frozen=True)
class Windows:
    """Stretches of equally many samples, and what each says of the noise."""

    like: Array  # (correlations, windows), restricted log-likelihood
    variance: Array  # the same shape
    size: Array  # (windows,), root mean square of the stress
    whose: NDArray[np.integer]  # (windows,), the recording


def quantum(values: Array) -> float:
    """Step of a quantised channel; 0 where values are as good as continuous.

    >>> quantum(np.round(np.linspace(0, 1, 200), 1)).__round__(6)
    0.1
    """
    known = np.unique(values[np.isfinite(values)])
    if len(known) < 3:
        return 0.0
    gaps = np.diff(known)
    step = float(np.median(gaps))
    multiples = gaps / step
    regular = np.abs(multiples - np.round(multiples)) < 0.02
    repeated = len(known) < 0.5 * np.isfinite(values).sum()
    return step if repeated and regular.mean() > 0.95 else 0.0


def _windows(x: Array, length: int) -> Array:
    count = len(x) // length
    return x[: count * length].reshape(count, length)


def _likelihood(windows: Array) -> tuple[Array, Array]:
    """Restricted log-likelihood and variance, each (correlations, windows)."""
    length = windows.shape[1]
    t = np.linspace(-1, 1, length)
    trend = np.linalg.qr(np.vander(t, min(DEGREE, length // 4) + 1))[0]
    degrees = length - trend.shape[1]
    like, variance = [], []
    for phi in CORRELATIONS:
        first = np.sqrt(1 - phi**2)

        def whiten(x: Array, phi: float = phi, first: float = first) -> Array:
            return np.concatenate([first * x[:1], x[1:] - phi * x[:-1]])

        p, y = whiten(trend), whiten(windows.T)
        q, r = np.linalg.qr(p)
        left = np.maximum((y**2).sum(axis=0) - ((q.T @ y) ** 2).sum(axis=0), 1e-300)
        like.append(
            -0.5 * degrees * np.log(left)
            - np.log(np.abs(np.diag(r))).sum()
            + 0.5 * np.log(1 - phi**2)
        )
        variance.append(left / degrees / (1 - phi**2))
    return np.array(like), np.array(variance)


def estimate(
    residuals: Sequence[Array],
    stresses: Sequence[Array],
    times: Sequence[Array],
) -> list[Noise]:
    """Noise of each recording, from residuals of any smooth simulation, or stress.

    residuals, stresses and times are (n,) each; NaN marks what is missing. Recordings
    of one machine share level and colour; where some contradict the memory that all
    have together by having less, theirs counts.
    """
    windows = _pooled(residuals, stresses, WINDOW)
    steps = [quantum(s) for s in stresses]
    if windows is None:  # too few samples of each to be pooled
        return [
            _short(x, s, t, q)
            for x, s, t, q in zip(residuals, stresses, times, steps, strict=True)
        ]
    variance, size, whose = windows.variance, windows.size, windows.whose
    typical = np.max(size) + 1e-300
    interval = np.array([float(np.median(np.diff(t))) for t in times])
    seconds = _shared_time(windows, interval)
    for length, longer in pairwise((WINDOW, *LONGER)):
        if seconds < MEMORY * length * np.median(interval[whose]):
            break
        # The cubic taken out of a window takes memory as long as that out with it.
        if calmer := _pooled(residuals, stresses, longer):
            seconds = min(seconds, _shared_time(calmer, interval))
    # The variance of each window at the correlation its own clock gives it.
    phi = np.exp(-interval[whose] / max(seconds, 1e-12))
    upper, w = _bracket(phi)
    column = np.arange(len(whose))
    own_variance = (1 - w) * variance[upper - 1, column] + w * variance[upper, column]
    floor2, share2, kept = _level(own_variance, size, typical)
    out = []
    for r, step in enumerate(steps):
        own = kept & (whose == r)
        phi = float(np.exp(-interval[r] / max(seconds, 1e-12)))
        count = int(own.sum())
        phi = phi if phi > 0.03 else 0.0
        grain = step**2 / 12
        out.append(
            Noise(
                float(np.sqrt(max(floor2 - grain, 0.1 * floor2))),
                float(np.sqrt(share2)),
                step,
                phi,
                seconds if phi > 0 else 0.0,
                count,
            )
        )
    return out


def _pooled(
    residuals: Sequence[Array], stresses: Sequence[Array], length: int
) -> Windows | None:
    """Windows of `length` samples of all recordings; None where none is as long."""
    rows, level, owner = [], [], []
    for r, (residual, stress) in enumerate(zip(residuals, stresses, strict=True)):
        keep = np.isfinite(residual) & np.isfinite(stress)
        if keep.sum() < length:
            continue
        w = _windows(residual[keep], length)
        rows.append(w)
        level.append(np.sqrt((_windows(stress[keep], length) ** 2).mean(axis=1)))
        owner.append(np.full(len(w), r))
    if not rows:
        return None
    like, variance = _likelihood(np.concatenate(rows))
    return Windows(like, variance, np.concatenate(level), np.concatenate(owner))


def _bracket(phi: Array) -> tuple[NDArray[np.integer], Array]:
    """Where each correlation lies in the table: the entry above, its weight."""
    upper = np.clip(np.searchsorted(CORRELATIONS, phi), 1, len(CORRELATIONS) - 1)
    low, high = CORRELATIONS[upper - 1], CORRELATIONS[upper]
    return upper, np.clip((phi - low) / (high - low), 0, 1)


def _pooled_time(
    like: Array, interval: Array
) -> tuple[float, Callable[[float], float]]:
    """Correlation time, s, of greatest likelihood for windows of different clocks.

    And the log-likelihood at any time.
    """
    shortest, longest = 0.1 * interval.min(), 60 * interval.max()
    times = np.concatenate([[1e-12], np.geomspace(shortest, longest, 60)])

    def at(tau: float) -> float:
        phi = np.exp(-interval / tau)
        upper, w = _bracket(phi)
        column = np.arange(like.shape[1])
        return float(
            np.sum((1 - w) * like[upper - 1, column] + w * like[upper, column])
        )

    return float(max(times, key=at)), at


def _shared_time(windows: Windows, interval: Array) -> float:
    """Correlation time, s, that the recordings share.

    What a simulation misses only ever adds correlation. So where the half of the
    recordings with the least of it contradicts the time of all, it knows best.
    """
    like, variance, whose = windows.like, windows.variance, windows.whose
    # Rough windows hold a reversal; judged by what is new from sample to sample, which
    # says little about the colour itself.
    rough = variance[-2]
    own: dict[int, tuple[float, NDArray[np.bool]]] = {}
    everything = np.zeros(len(whose), bool)
    for r in np.unique(whose):
        mine = whose == r
        calm = mine & (rough <= np.quantile(rough[mine], 0.8))
        everything |= calm
        if calm.sum() >= 4:
            own[int(r)] = (_pooled_time(like[:, calm], interval[whose[calm]])[0], calm)
    clock = interval[whose]
    together, _ = _pooled_time(like[:, everything], clock[everything])
    if len(own) < 2:
        return together
    half = np.zeros(len(whose), bool)
    for _, calm in sorted(own.values(), key=lambda pair: pair[0]):
        half |= calm
        if half.sum() >= 0.4 * everything.sum():
            break
    least, at = _pooled_time(like[:, half], clock[half])
    chance = at(least) - at(together)
    apart = chance > DISAGREE and least < 0.6 * together
    return least if apart else together


def _level(variance: Array, size: Array, typical: float) -> tuple[float, float, Array]:
    """floor^2, share^2 and the windows that are noise and nothing else."""
    relative = (size / typical) ** 2
    floor2 = float(np.quantile(variance, 0.4))
    share2 = 0.0
    kept = np.ones(len(variance), bool)
    for _ in range(8):
        expected = floor2 + share2 * relative
        ratio = variance / expected
        kept = ratio < 2.5
        if kept.sum() < 4:
            kept = ratio <= np.sort(ratio)[min(3, len(ratio) - 1)]
        # Gamma likelihood by reweighting, both terms not negative.
        w = 1 / expected[kept]
        a = np.stack([w, relative[kept] * w], axis=1)
        y = variance[kept] * w
        flat = float(y @ w / (w @ w))
        floor2, share2 = flat, 0.0
        if kept.sum() >= 12 and np.ptp(relative[kept]) > 0.2:
            g = np.linalg.lstsq(a, y, rcond=None)[0]
            if g[0] > 0.02 * flat and g[1] > 0.5 * g[0]:
                floor2, share2 = float(g[0]), float(g[1])
        floor2 = max(floor2, 1e-24)
    return floor2, share2 / typical**2, kept


def _short(residual: Array, stress: Array, time: Array, step: float) -> Noise:
    """A few samples: third differences, taken as white."""
    x = residual[np.isfinite(residual)]
    if len(x) >= 5:
        rough = np.median(np.abs(np.diff(x, 3))) / 0.6745 / np.sqrt(20)
    else:
        rough = 0.01 * float(np.nanmax(np.abs(stress)))
    floor = max(float(rough), 1e-12)
    return Noise(floor, 0.0, step, 0.0, 0.0, 0)
