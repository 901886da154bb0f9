"""The noise of one recording: level, growth with the stress, grain, memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softnn.contracts import Array


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


def spread_of(log: Array, error: Array) -> tuple[float, float]:
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
