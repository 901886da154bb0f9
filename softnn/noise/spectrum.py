"""Memory and level of the noise from the whole spectrum of the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.noise.one import Noise, spread_of

LONGEST = 0.3  # share of a recording; it cannot show a longer memory
APART = 4.0  # ratio of the times of the parts of a spectrum
BETWEEN = APART ** np.array([-0.4, -0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4])
PART = 2.0  # nats that a part must gain; chance gains as much once in forty
ROUNDS = 50  # multiplicative steps towards the shares
FEWEST = 16  # samples that a spectrum needs


def spectral(
    noise: Sequence[Noise],
    residuals: Sequence[Array],
    stresses: Sequence[Array],
    interval: Array,
) -> list[Noise]:
    """Return the noise with memory and levels from the spectra of the residuals.

    `residuals` and `stresses` are (n,) [MPa] each, `interval` (recordings,) is the
    sampling interval [s]. All recordings share the parts; their times are equal in
    samples or in seconds, whichever is likelier. Recordings that are too short are
    unchanged in level.
    """
    spectra: list[Array] = []
    for one, x, s in zip(noise, residuals, stresses, strict=True):
        z = x / one.sigma(s)
        z = z[np.isfinite(z)]
        # The fit has absorbed part of the lowest frequencies, so they are left out.
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
    """Log-likelihood, share of each part, factor for the level of each recording.

    `times` (parts,) are in the unit of `clock` (recordings,), the sampling interval.
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
    """Log-likelihood, weights (parts,) and squared levels (recordings,).

    The search starts from `weight`; a weight of 0 stays 0. `shape` is (frequencies of
    all recordings, parts), `power` (frequencies of all recordings,).
    """
    starts = np.cumsum(count) - count
    level = np.ones(len(count))
    for _ in range(2):
        own = power / np.repeat(level, count)
        for _ in range(ROUNDS):
            sum_ = shape @ weight
            weight = weight * np.sqrt((own / sum_**2) @ shape / ((1 / sum_) @ shape))
        # The logarithm of a level has the variance 1 / count.
        log = np.log(np.add.reduceat(power / (shape @ weight), starts) / count)
        spread, middle = spread_of(log, 1 / count)
        level = np.exp(middle + spread / (spread + 1 / count) * (log - middle))
    sum_ = np.repeat(level, count) * (shape @ weight)
    return -float(np.sum(np.log(sum_) + power / sum_)), weight, level
