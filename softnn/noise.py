r"""Level, memory and grain of the noise of each recording, estimated from the data.

A window of samples is taken as a cubic in time plus noise of some memory. Level and
memory are those of greatest restricted likelihood (Patterson and Thompson 1971,
doi:10.1093/biomet/58.3.545), which allows for the noise that the cubic takes up. The
memory is one of a table: first-order (of so many samples, or of so many seconds), the
same beside white noise, or 1/f-like, a sum of first-order parts with times a factor
apart (Bernamont 1937). The
recordings share it as far as none contradicts it; each has a level of its own, shrunk
towards that of all by how well its windows know it (James and Stein 1961). Windows in
which something else happens (a reversal, a slip) are rougher than the rest and are left
out. Level may grow with the stress; a quantised channel adds step^2 / 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular, toeplitz

from softnn.contracts import Array

WINDOWS = (48, 192, 384)  # samples; long memory shows in the longer ones alone
DEGREE = 3
DISAGREE = 8.0  # of log-likelihood, beyond which recordings are not of one memory
CALM = 0.8  # of the windows of a recording: the others may hold a reversal
USUAL = 1.5  # times the median roughness, which no reversal need explain
PREFERRED = 3.0  # of log-likelihood, by which noise of several parts must be better
COARSE = 0.5  # of the variance, from which rounding is most of it
ROUGH = 2.5  # times the expected variance: no window of noise has as much
PHI = np.concatenate([[0.0], 1 - np.geomspace(0.95, 0.008, 26)])
PINK = (0.6, 0.8, 1.0, 1.2, 1.4)  # powers of 1/f
SLOW = np.geomspace(8, 400, 8)  # samples: times of a first-order part beside white
BESIDE = (0.15, 0.3, 0.5, 0.7, 0.85)  # its share of the variance
PARTS = np.geomspace(0.7, 5000, 10)  # samples: times of the parts of 1/f noise
LONGEST = 0.3  # of a recording, the longest part of 1/f noise that it has
TAUS = np.concatenate([[0.05], -1 / np.log(PHI[1:])])  # samples: times of PHI
GROWTH = np.concatenate([[0.0], np.geomspace(0.03, 300, 18)])  # of variance, at peak


@dataclass(frozen=True)
class Noise:
    """Noise of one recording: sigma^2 = floor^2 + (share x stress)^2 + step^2 / 12.

    `memory` holds the first-order parts, (share of the variance, time in s) each; the
    rest is white.
    """

    floor_MPa: float
    share: float
    step_MPa: float
    memory: tuple[tuple[float, float], ...] = ()
    windows: int = 0

    def sigma(self, stress_MPa: Array) -> Array:
        """Standard deviation at each stress, MPa."""
        s = np.nan_to_num(np.asarray(stress_MPa, float))
        return np.sqrt(
            self.floor_MPa**2 + (self.share * s) ** 2 + self.step_MPa**2 / 12
        )

    @property
    def correlation_s(self) -> float:
        """Time in which the correlation falls to 1/e; 0 where it begins below."""
        if sum(w for w, _ in self.memory) <= np.exp(-1):
            return 0.0
        parts = np.array(self.memory)
        times = np.geomspace(0.01 * parts[:, 1].min(), 10 * parts[:, 1].max(), 200)
        left = np.exp(-times[:, None] / parts[:, 1]) @ parts[:, 0]
        return float(times[np.argmax(left < np.exp(-1))])


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


# -- memory ----------------------------------------------------------------------------


def _pink(power: float) -> tuple[Array, Array]:
    """Shares and times (samples) of the parts of 1/f noise."""
    weight = PARTS ** (power - 1)
    return weight / weight.sum(), PARTS


@cache
def _whiteners(length: int) -> tuple[list[Array], Array, Array]:
    """Of each memory: W (length - 4, length) with W y white and no cubic in it.

    And the logarithms of the determinants that the restricted likelihood needs; the
    correlation of a sample with the next.
    """
    t = np.linspace(-1, 1, length)
    trend = np.linalg.qr(np.vander(t, min(DEGREE, length // 4) + 1))[0]
    lag = np.arange(length)
    out, extra, next_ = [], [], []
    covariances = [p**lag if p else (lag == 0).astype(float) for p in PHI]
    covariances += [
        (w[:, None] * np.exp(-lag / tau[:, None])).sum(axis=0)
        for w, tau in map(_pink, PINK)
    ]
    covariances += [
        np.where(lag == 0, 1.0, share * np.exp(-lag / tau))
        for share in BESIDE
        for tau in SLOW
    ]
    for covariance in covariances:
        low = cholesky(toeplitz(covariance), lower=True)
        q, r = np.linalg.qr(solve_triangular(low, trend, lower=True))
        inverse = solve_triangular(low, np.eye(length), lower=True)
        out.append(inverse - q @ (q.T @ inverse))
        extra.append(-np.log(np.diag(low)).sum() - np.log(np.abs(np.diag(r))).sum())
        next_.append(covariance[1])
    return out, np.array(extra), np.array(next_)


@dataclass(frozen=True)
class Windows:
    """Stretches of equally many samples, and what each says of the noise."""

    like: Array  # (memories, windows), restricted log-likelihood
    variance: Array  # the same shape
    size: Array  # (windows,), root mean square of the stress
    whose: NDArray[np.integer]  # (windows,), the recording
    degrees: int

    def of(self, recording: int) -> NDArray[np.bool]:
        """The calm windows of a recording; roughness is what is new in a sample."""
        mine = self.whose == recording
        if not mine.any():
            return mine
        rough = self.variance[len(PHI) - 2]
        usual = max(np.quantile(rough[mine], CALM), USUAL * np.median(rough[mine]))
        return mine & (rough <= usual)


def _windows(
    residuals: Sequence[Array], stresses: Sequence[Array], length: int
) -> Windows | None:
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
    whiteners, extra, _ = _whiteners(length)
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
    """Times, s, and the log-likelihood (times, recordings) of memory as long.

    `like` (taus, recordings): of memories of so many samples.
    """
    low, high = taus[0] * interval.max(), taus[-1] * interval.max()
    times = np.geomspace(min(low, taus[0] * interval.min()), high, 60)
    out = np.empty((len(times), len(interval)))
    for r, step in enumerate(interval):
        out[:, r] = np.interp(np.log(times / step), np.log(taus), like[:, r])
    return times, out


def _shared(table: Array) -> tuple[int, float]:
    """Row of greatest likelihood for all recordings (rows, recordings), and its value.

    What a simulation misses only ever adds memory. So where the half of the recordings
    with the least of it contradicts all of them, it knows best.
    """
    best = int(np.argmax(table.sum(axis=1)))
    own = np.argmax(table, axis=0)
    half = np.argsort(own, kind="stable")[: (table.shape[1] + 1) // 2]
    least = int(np.argmax(table[:, half].sum(axis=1)))
    apart = table[least, half].sum() - table[best, half].sum()
    chosen = least if least < best and apart > DISAGREE else best
    return chosen, float(table[chosen].sum())


def _memory(
    windows: Sequence[Windows], interval: Array, count: int, several: bool
) -> tuple[Array, list[tuple[tuple[float, float], ...]]]:
    """Row of the table (recordings,), as a float, and first-order parts of each.

    `several`: whether it may have more than one part, the white one counted.
    """
    like = _by_recording(windows[0], count)
    for longer in windows[1:]:
        by = _by_recording(longer, count)
        like = np.where((by != 0).any(axis=0), by, like)
    first = len(PHI)
    value, tau = _either(like[:first], TAUS, interval)
    phi = np.exp(-1 / tau)
    phi = np.where(phi > 0.03, phi, 0.0)
    rows = np.interp(phi, PHI, np.arange(first))
    parts: list[tuple[tuple[float, float], ...]] = [
        ((1.0, float(t * step)),) if p > 0 else ()
        for p, t, step in zip(phi, tau, interval, strict=True)
    ]
    if not several:
        return rows, parts
    value += PREFERRED
    pink, at_pink = _shared(like[first : first + len(PINK)])
    if at_pink > value:
        weight, times = _pink(PINK[pink])
        rows = np.full(count, float(first + pink))
        parts = [tuple(zip(weight, times * step, strict=True)) for step in interval]
        value = at_pink
    first += len(PINK)
    for share in BESIDE:
        both, tau = _either(like[first : first + len(SLOW)], SLOW, interval)
        if both > value + DISAGREE:
            at = np.interp(np.log(tau), np.log(SLOW), np.arange(len(SLOW)))
            rows, value = first + at, both
            parts = [
                ((share, float(t * step)),)
                for t, step in zip(tau, interval, strict=True)
            ]
        first += len(SLOW)
    return rows, parts


def _either(like: Array, taus: Array, interval: Array) -> tuple[float, Array]:
    """Memory of as many samples, or of as many seconds: the likelier, in samples."""
    samples, at_samples = _shared(like)
    times, table = _in_seconds(like, taus, interval)
    second, at_second = _shared(table)
    if at_second >= at_samples:
        return at_second, times[second] / interval
    return at_samples, np.full(len(interval), taus[samples])


# -- level -----------------------------------------------------------------------------


def estimate(
    residuals: Sequence[Array],
    stresses: Sequence[Array],
    times: Sequence[Array],
    lengths: Sequence[int] = WINDOWS,
) -> list[Noise]:
    """Noise of each recording, from residuals of any smooth simulation, or stress.

    residuals, stresses and times are (n,) each; NaN marks what is missing. Windows of
    the shortest of the `lengths` alone say little of long memory, but are hardly
    misled by what a simulation misses; 1/f noise is looked for in longer ones only.
    """
    found = [_windows(residuals, stresses, length) for length in lengths]
    windows = [w for w in found if w is not None]
    steps = [quantum(s) for s in stresses]
    if not windows:  # too few samples of each to be pooled
        return [
            _short(x, s, q) for x, s, q in zip(residuals, stresses, steps, strict=True)
        ]
    interval = np.array([_interval(t) for t in times])
    first = windows[0]
    # Rounding lasts while the stress stands still: that is no memory of the channel.
    grain = np.array(steps)[first.whose] ** 2 / 12
    several = len(windows) > 1 and np.median(grain / first.variance[0]) < COARSE
    rows, parts = _memory(windows, interval, len(times), several)
    low = np.floor(rows).astype(int)[first.whose]
    share = rows[first.whose] - low
    column = np.arange(len(first.whose))
    high = np.minimum(low + 1, len(first.variance) - 1)
    variance = (1 - share) * first.variance[low, column]
    variance += share * first.variance[high, column]
    floor2, growth, kept = _levels(variance, first, len(times))
    out = []
    for r, (step, whole) in enumerate(zip(steps, parts, strict=True)):
        grain = step**2 / 12
        # Parts that a recording is too short to show are not there.
        memory = tuple((w, t) for w, t in whole if t < LONGEST * np.ptp(times[r]))
        lost = sum(w for w, _ in whole) - sum(w for w, _ in memory)
        if lost < 1:
            memory = tuple((w / (1 - lost), t) for w, t in memory)
            floor2[r] *= 1 - lost
        plain = max(floor2[r] - grain, 0.1 * floor2[r])
        count = int((kept & (first.whose == r)).sum())
        out.append(
            Noise(
                float(np.sqrt(plain)),
                float(np.sqrt(growth * floor2[r])),
                step,
                memory,
                count,
            )
        )
    return out


def _interval(time: Array) -> float:
    step = np.diff(time)
    step = step[step > 0]
    return float(np.median(step)) if len(step) else 1.0


def _levels(
    variance: Array, windows: Windows, count: int
) -> tuple[Array, float, NDArray[np.bool]]:
    """floor^2 (recordings,), its growth by stress^2, the windows that are noise alone.

    Recordings without windows have the level of all.
    """
    whose, half = windows.whose, windows.degrees / 2
    top = float(np.max(windows.size)) + 1e-300
    best: tuple[float, Array, float, NDArray[np.bool]] | None = None
    for growth in GROWTH:
        scale = 1 + growth * (windows.size / top) ** 2
        own = variance / scale
        level = np.array(
            [
                np.quantile(own[whose == r], 0.4) if (whose == r).any() else np.nan
                for r in range(count)
            ]
        )
        kept = np.ones(len(own), bool)
        for _ in range(4):
            kept = own < ROUGH * level[whose]
            for r in range(count):
                mine = kept & (whose == r)
                if mine.any():
                    level[r] = own[mine].mean()
        known = np.array([(kept & (whose == r)).sum() for r in range(count)])
        there = known > 0
        error = 1 / np.maximum(half * known[there], 1)  # variance of a log level
        log = np.log(level[there])
        spread, middle = _spread(log, error)
        w = spread / (spread + error)
        shrunk = np.full(count, middle)
        shrunk[there] = middle + w * (log - middle)
        ratio = own / np.exp(shrunk)[whose]
        # Windows that are no noise have a variance of their own, at a price.
        ratio = np.where(kept, ratio, np.log(ratio / ROUGH) + ROUGH)
        value = -half * np.sum(np.log(scale) + shrunk[whose] + ratio)
        value -= 0.5 * np.sum(np.log1p(spread / error))
        value -= 2.0 * (growth > 0)
        if best is None or value > best[0]:
            best = value, np.exp(shrunk), growth / top**2, kept
    assert best is not None
    return best[1:]


def _spread(log: Array, error: Array) -> tuple[float, float]:
    """Variance of the levels themselves and their mean, by moments, iterated."""
    spread = 0.0
    middle = float(log.mean())
    for _ in range(5):
        weight = 1 / (spread + error)
        middle = float(np.sum(weight * log) / weight.sum())
        if len(log) < 2:
            break
        spread = max(float(np.mean((log - middle) ** 2 - error)), 0.0)
    return spread, middle


def _short(residual: Array, stress: Array, step: float) -> Noise:
    """A few samples: third differences, taken as white."""
    x = residual[np.isfinite(residual)]
    if len(x) >= 5:
        rough = np.median(np.abs(np.diff(x, 3))) / 0.6745 / np.sqrt(20)
    else:
        rough = 0.01 * float(np.nanmax(np.abs(stress)))
    least = 1e-9 * float(np.nanmax(np.abs(stress), initial=0.0)) + 1e-300
    return Noise(max(float(rough), least), 0.0, step)
