"""Level, memory and resolution of the noise of each recording, estimated from the data.

A window of samples is modelled as a cubic in time plus first-order noise, with a memory
of so many samples or so many seconds. Level and memory maximise the restricted
likelihood (Patterson and Thompson 1971, doi:10.1093/biomet/58.3.545), which allows for
the noise that the cubic absorbs. Each recording has its own level, shrunk towards the
common level by how well its windows determine it (James and Stein 1961). Windows with
an event (a reversal, a slip) are rougher than the rest and are left out. The level may
grow with the stress; a quantised channel adds step^2 / 12.

Windows cannot show noise slower than themselves. Where a simulation fits well, the
spectrum of the whole residual can. It is a sum of white noise and first-order parts
with times spaced by a factor, which also represents 1/f noise (Bernamont 1937). The
shares of the parts maximise Whittle's likelihood (1953), by multiplicative steps
(Fevotte and Idier 2011, doi:10.1162/NECO_a_00168).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.noise.one import Noise, quantum, spread_of, white
from softnn.noise.spectrum import spectral
from softnn.noise.windows import Windows, memory, windowed

__all__ = ["Noise", "estimate", "quantum", "white"]

COARSE = 0.5  # share of the variance from which rounding dominates
ROUGH = 2.5  # times the expected variance; a rougher window holds more than noise
GROWTH = np.concatenate([[0.0], np.geomspace(0.03, 300, 18)])  # of variance, at peak


def estimate(
    residuals: Sequence[Array],
    stresses: Sequence[Array],
    times: Sequence[Array],
    whole: bool = False,
) -> list[Noise]:
    """Estimate the noise of each recording from the residuals of a smooth simulation.

    `residuals` and `stresses` [MPa] and `times` [s] are (n,) for each recording; NaN
    marks missing samples. Where there is no simulation, pass the stress as the
    residual. Windows alone say little about long memory, but model error hardly
    misleads them. The `whole` spectrum shows long memory and takes model error for
    noise, so use it only for a fit that misses little.
    """
    windows = windowed(residuals, stresses)
    steps = [quantum(s) for s in stresses]
    if windows is None:  # too few samples of each to be pooled
        return [
            _short(x, s, q) for x, s, q in zip(residuals, stresses, steps, strict=True)
        ]
    interval = np.array([_interval(t) for t in times])
    rows, parts_of = memory(windows, interval)
    low = np.floor(rows).astype(int)[windows.whose]
    share = rows[windows.whose] - low
    column = np.arange(len(windows.whose))
    high = np.minimum(low + 1, len(windows.variance) - 1)
    variance = (1 - share) * windows.variance[low, column]
    variance += share * windows.variance[high, column]
    floor2, growth, kept = _levels(variance, windows, len(times))
    out = []
    for r, (step, parts) in enumerate(zip(steps, parts_of, strict=True)):
        plain = max(floor2[r] - step**2 / 12, 0.1 * floor2[r])
        count = int((kept & (windows.whose == r)).sum())
        by_stress = float(np.sqrt(growth * floor2[r]))
        out.append(Noise(float(np.sqrt(plain)), by_stress, step, parts, count))
    # A rounding error lasts while the stress stands still; that is no channel memory.
    grain = np.array(steps)[windows.whose] ** 2 / 12
    if whole and np.median(grain / windows.variance[0]) < COARSE:
        return spectral(out, residuals, stresses, interval)
    return out


def _interval(time: Array) -> float:
    step = np.diff(time)
    step = step[step > 0]
    return float(np.median(step)) if len(step) else 1.0


def _levels(
    variance: Array, windows: Windows, count: int
) -> tuple[Array, float, NDArray[np.bool]]:
    """Floor^2 (recordings,), its growth by stress^2, and a mask of pure-noise windows.

    Recordings without windows get the common level.
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
        spread, middle = spread_of(log, error)
        w = spread / (spread + error)
        shrunk = np.full(count, middle)
        shrunk[there] = middle + w * (log - middle)
        ratio = own / np.exp(shrunk)[whose]
        # Windows with more than noise get a variance of their own, at a cost.
        ratio = np.where(kept, ratio, np.log(ratio / ROUGH) + ROUGH)
        value = -half * np.sum(np.log(scale) + shrunk[whose] + ratio)
        value -= 0.5 * np.sum(np.log1p(spread / error))
        value -= 2.0 * (growth > 0)
        if best is None or value > best[0]:
            best = value, np.exp(shrunk), growth / top**2, kept
    assert best is not None
    return best[1:]


def _short(residual: Array, stress: Array, step: float) -> Noise:
    """Noise of a recording with few samples: third differences, taken as white."""
    x = residual[np.isfinite(residual)]
    rough = white(x, 3) if len(x) >= 5 else 0.01 * float(np.nanmax(np.abs(stress)))
    least = 1e-9 * float(np.nanmax(np.abs(stress), initial=0.0)) + 1e-300
    return Noise(max(rough, least), 0.0, step)
