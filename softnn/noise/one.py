"""The noise of one recording: level, growth with the stress, resolution, memory."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from softnn.contracts import Array


@dataclass(frozen=True)
class Noise:
    """Noise of one recording: sigma^2 = floor^2 + (share x stress)^2 + step^2 / 12.

    `floor_MPa` is the level at zero stress, `step_MPa` the resolution of the channel.
    `memory` holds the first-order parts, each a share of the variance and a time in s;
    the rest is white. `windows` is the number of windows behind the estimate.
    """

    floor_MPa: float
    share: float
    step_MPa: float
    memory: tuple[tuple[float, float], ...] = ()
    windows: int = 0

    def sigma(self, stress_MPa: Array) -> Array:
        """Standard deviation (n,) [MPa] at each stress (n,) [MPa]; NaN counts as 0."""
        s = np.nan_to_num(np.asarray(stress_MPa, float))
        return np.sqrt(
            self.floor_MPa**2 + (self.share * s) ** 2 + self.step_MPa**2 / 12
        )

    @property
    def correlation_s(self) -> float:
        """Time [s] at which the correlation falls to 1/e; 0 if it begins lower."""
        if sum(w for w, _ in self.memory) <= np.exp(-1):
            return 0.0
        parts = np.array(self.memory)
        times = np.geomspace(0.01 * parts[:, 1].min(), 10 * parts[:, 1].max(), 200)
        left = np.exp(-times[:, None] / parts[:, 1]) @ parts[:, 0]
        return float(times[np.argmax(left < np.exp(-1))])


def quantum(values: Array) -> float:
    """Step of a quantised channel, in the unit of `values`; 0 where it is continuous.

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


def white(values: Array, differences: int = 5) -> float:
    """Standard deviation of white noise on a smooth signal, in the unit of `values`.

    It is read off differences of this order between neighbouring samples, which a
    smooth signal hardly has. The median does not see jumps. Noise with memory counts
    in part: a first-order one with a correlation of 0.6 between neighbours by half.
    NaN are dropped; 0 with fewer than two more values than `differences`.

    >>> rng = np.random.default_rng(0)
    >>> white(np.linspace(0, 9, 4000) ** 2 + 0.01 * rng.normal(size=4000)).__round__(3)
    0.01
    """
    known = values[np.isfinite(values)]
    if len(known) < differences + 2:
        return 0.0
    rough = np.median(np.abs(np.diff(known, differences))) / 0.6745
    return float(rough / np.sqrt(comb(2 * differences, differences)))


def spread_of(log: Array, error: Array) -> tuple[float, float]:
    """Return the variance of true levels and their mean, from noisy log levels.

    `log` (n,) are logarithms of the levels, `error` (n,) their error variances. The
    estimate is by moments, iterated.
    """
    spread = 0.0
    middle = float(log.mean())
    for _ in range(5):
        weight = 1 / (spread + error)
        middle = float(np.sum(weight * log) / weight.sum())
        if len(log) < 2:
            break
        spread = max(float(np.mean((log - middle) ** 2 - error)), 0.0)
    return spread, middle
