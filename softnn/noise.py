r"""Level, memory and grain of the noise of each recording, estimated from the data.

Windows of samples are taken as a cubic in time plus noise of some first-order memory,
of so many samples or of so many seconds. Level and memory are those of greatest
restricted likelihood (Patterson and Thompson 1971, doi:10.1093/biomet/58.3.545), which
allows for the noise that the cubic takes up. Each recording has a level of its own,
shrunk towards that of all by how well its windows know it (James and Stein 1961).
Windows in which something else happens (a reversal, a slip) are rougher than the rest
and are left out. Level may grow with the stress; a quantised channel adds step^2 / 12.

Windows know nothing of what is slower than they are. Where a simulation misses little,
the spectrum of all it leaves does: a sum of white and first-order parts with times a
factor apart, which 1/f noise is too (Bernamont 1937), their shares of greatest
likelihood (Whittle 1953) by multiplicative steps (Fevotte and Idier 2011,
doi:10.1162/NECO_a_00168).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular, toeplitz

from softnn.contracts import Array

WINDOW = 48  # samples
DEGREE = 3
DISAGREE = 8.0  # of log-likelihood, beyond which recordings are not of one memory
CALM = 0.8  # of the windows of a recording: the others may hold a reversal
USUAL = 1.5  # times the median roughness, which no reversal need explain
COARSE = 0.5  # of the variance, from which rounding is most of it
ROUGH = 2.5  # times the expected variance: no window of noise has as much
PHI = np.concatenate([[0.0], 1 - np.geomspace(0.95, 0.008, 26)])
LONGEST = 0.3  # of a recording, the longest memory that it can show
APART = 4.0  # ratio of the times of the parts of a spectrum
BETWEEN = APART ** np.array([-0.4, -0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4])
PART = 2.0  # of log-likelihood, that a part must be worth: chance has it once in forty
ROUNDS = 50  # of the steps to their shares
FEWEST = 16  # samples of a spectrum
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


@cache
def _whiteners(length: int) -> tuple[list[Array], Array]:
    """Of each memory: W (length - 4, length) with W y white and no cubic in it.

    And the logarithms of the determinants that the restricted likelihood needs.
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


def _windows(residuals: Sequence[Array], stresses: Sequence[Array]) -> Windows | None:
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
    windows: Windows, interval: Array
) -> tuple[Array, list[tuple[tuple[float, float], ...]]]:
    """Row of the table (recordings,), as a float, and the first-order part of each."""
    tau = _either(_by_recording(windows, len(interval)), TAUS, interval)
    phi = np.exp(-1 / tau)
    phi = np.where(phi > 0.03, phi, 0.0)
    rows = np.interp(phi, PHI, np.arange(len(PHI)))
    return rows, [
        ((1.0, float(t * step)),) if p > 0 else ()
        for p, t, step in zip(phi, tau, interval, strict=True)
    ]


def _either(like: Array, taus: Array, interval: Array) -> Array:
    """Memory of as many samples, or of as many seconds: the likelier, in samples."""
    samples, at_samples = _shared(like)
    times, table = _in_seconds(like, taus, interval)
    second, at_second = _shared(table)
    if at_second >= at_samples:
        return times[second] / interval
    return np.full(len(interval), taus[samples])


# -- spectrum --------------------------------------------------------------------------


def _spectral(
    noise: Sequence[Noise],
    residuals: Sequence[Array],
    stresses: Sequence[Array],
    interval: Array,
) -> list[Noise]:
    """The noise with memory and levels as the spectra of the residuals have them.

    The parts are shared, with times in samples or in seconds, whichever is likelier.
    """
    spectra: list[Array] = []
    for one, x, s in zip(noise, residuals, stresses, strict=True):
        z = x / one.sigma(s)
        z = z[np.isfinite(z)]
        # What a fit takes up is missing from the lowest frequencies.
        power = np.abs(np.fft.rfft(z - z.mean()))[2:] ** 2 / len(z)
        good = len(z) >= FEWEST and 0 < power.sum() < np.inf
        spectra.append(power if good else power[:0])
    if not any(len(x) for x in spectra):
        return list(noise)
    samples = np.array([np.isfinite(x).sum() for x in residuals])
    fits = []
    for clock in (np.ones(len(interval)), interval):
        low, high = 0.5 * clock.min(), LONGEST * float((samples * clock).max())
        count = max(int(np.ceil(np.log(high / low) / np.log(APART))) + 1, 2)
        times = np.geomspace(low, max(high, 2 * low), count)
        fits.append((*_shares(spectra, times, clock), times, clock))
    best = max(fits, key=lambda f: f[0])
    share, times, clock = best[1], best[3], best[4]
    if share.any():
        for k in BETWEEN:
            moved = k * times[share > 0]
            fits.append((*_shares(spectra, moved, clock), moved, clock))
        best = max(fits, key=lambda f: f[0])
    _, share, level, times, clock = best
    return [
        replace(
            one,
            floor_MPa=float(one.floor_MPa * k),
            share=float(one.share * k),
            memory=tuple(
                (float(w), float(t * u)) for w, t in zip(share, times, strict=True) if w
            ),
        )
        for one, k, u in zip(noise, level, interval / clock, strict=True)
    ]


def _shares(
    spectra: Sequence[Array], times: Array, clock: Array
) -> tuple[float, Array, Array]:
    """Log-likelihood, share of each part, and what each level is to be multiplied by.

    `times` (parts,) in the unit of `clock` (recordings,), the time between samples.
    """
    count = np.array([len(x) for x in spectra])
    some = np.flatnonzero(count)
    shapes = []
    for r in some:
        angle = np.pi * np.arange(2, count[r] + 2)[:, None] / (count[r] + 1)
        phi = np.exp(-clock[r] / times)
        lines = (1 - phi**2) / (1 - 2 * phi * np.cos(angle) + phi**2)
        shapes.append(np.concatenate([np.ones((count[r], 1)), lines], axis=1))
    shape, power = np.concatenate(shapes), np.concatenate(spectra)
    unit = max(float(power.mean()), 1e-300)
    power = power / unit
    count = count[some]
    best = _weighted(shape, power, count, np.full(shape.shape[1], 1 / shape.shape[1]))
    for k in reversed(range(1, shape.shape[1])):  # the slowest first
        fewer = best[1].copy()
        fewer[k] = 0.0
        without = _weighted(shape, power, count, fewer)
        if without[0] > best[0] - PART:
            best = without
    like, weight, level = best
    changed = np.full(len(spectra), np.exp(np.log(level).mean()))
    changed[some] = level
    return like, weight[1:] / weight.sum(), np.sqrt(unit * weight.sum() * changed)


def _weighted(
    shape: Array, power: Array, count: NDArray[np.integer], weight: Array
) -> tuple[float, Array, Array]:
    """Log-likelihood, weights (parts,) and levels^2 (recordings,), from these weights.

    `shape` (frequencies of all, parts), `power` (frequencies of all,); a weight of 0
    stays 0.
    """
    starts = np.cumsum(count) - count
    level = np.ones(len(count))
    for _ in range(2):
        own = power / np.repeat(level, count)
        for _ in range(ROUNDS):
            sum_ = shape @ weight
            weight = weight * np.sqrt((own / sum_**2) @ shape / ((1 / sum_) @ shape))
        # A level is known to 1 / count, as a logarithm.
        log = np.log(np.add.reduceat(power / (shape @ weight), starts) / count)
        spread, middle = _spread(log, 1 / count)
        level = np.exp(middle + spread / (spread + 1 / count) * (log - middle))
    sum_ = np.repeat(level, count) * (shape @ weight)
    return -float(np.sum(np.log(sum_) + power / sum_)), weight, level


# -- level -----------------------------------------------------------------------------


def estimate(
    residuals: Sequence[Array],
    stresses: Sequence[Array],
    times: Sequence[Array],
    whole: bool = False,
) -> list[Noise]:
    """Noise of each recording, from residuals of any smooth simulation, or stress.

    residuals, stresses and times are (n,) each; NaN marks what is missing. Windows
    alone say little of long memory, but are hardly misled by what a simulation misses;
    the `whole` spectrum is.
    """
    windows = _windows(residuals, stresses)
    steps = [quantum(s) for s in stresses]
    if windows is None:  # too few samples of each to be pooled
        return [
            _short(x, s, q) for x, s, q in zip(residuals, stresses, steps, strict=True)
        ]
    interval = np.array([_interval(t) for t in times])
    rows, memory = _memory(windows, interval)
    low = np.floor(rows).astype(int)[windows.whose]
    share = rows[windows.whose] - low
    column = np.arange(len(windows.whose))
    high = np.minimum(low + 1, len(windows.variance) - 1)
    variance = (1 - share) * windows.variance[low, column]
    variance += share * windows.variance[high, column]
    floor2, growth, kept = _levels(variance, windows, len(times))
    out = []
    for r, (step, parts) in enumerate(zip(steps, memory, strict=True)):
        plain = max(floor2[r] - step**2 / 12, 0.1 * floor2[r])
        count = int((kept & (windows.whose == r)).sum())
        by_stress = float(np.sqrt(growth * floor2[r]))
        out.append(Noise(float(np.sqrt(plain)), by_stress, step, parts, count))
    # Rounding lasts while the stress stands still: that is no memory of the channel.
    grain = np.array(steps)[windows.whose] ** 2 / 12
    if whole and np.median(grain / windows.variance[0]) < COARSE:
        return _spectral(out, residuals, stresses, interval)
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
