"""Noise and logging: levels and memories of a stated size.

Every kind is Gaussian noise of unit variance (some of it white, the rest in
Ornstein-Uhlenbeck processes, counted in seconds or in samples) times a profile in MPa;
quantised stress is rounded on top of that. So its likelihood is known exactly, but for
the rounding, which counts as white noise of a twelfth of its step squared.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bench.hands import kernels
from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, loguniform

KINDS = {
    "white": DEVELOPMENT,
    "stress_share": DEVELOPMENT,
    "samples_memory": DEVELOPMENT,
    "pink": DEVELOPMENT,
    "range_share": HELD_OUT,
    "seconds_memory": HELD_OUT,
    "quantised": HELD_OUT,
    "white_and_slow": HELD_OUT,
}


@dataclass(frozen=True)
class Noise:
    """`levels` (recordings,) in MPa; `share` of the size of the stress comes on top."""

    kind: str
    fraction: float
    levels: Array
    share: float = 0.0
    by_samples: bool = False
    white: float = 1.0
    times: Array = field(default_factory=lambda: np.zeros(0))
    weights: Array = field(default_factory=lambda: np.zeros(0))
    quantum: float = 0.0

    def profile(self, i: int, clean: Array) -> Array:
        """Standard deviation at every sample, MPa."""
        rounding = self.quantum**2 / 12
        level = self.levels[i] + self.share * np.abs(clean)
        return np.sqrt(level**2 + rounding)

    def gaps(self, time: Array) -> Array:
        """Steps of the noise's clock."""
        if self.by_samples:
            return np.ones(len(time))
        return np.diff(time, prepend=time[0])

    def unit(self, rng: Rng, time: Array) -> Array:
        """The process of unit variance at these times."""
        gaps = self.gaps(time)
        out = np.sqrt(self.white) * rng.standard_normal(len(time))
        for tau, weight in zip(self.times, self.weights, strict=True):
            keep = np.exp(-gaps / tau)
            keep[0] = 0.0
            fresh = np.sqrt(1 - keep**2) * rng.standard_normal(len(time))
            y, x = np.empty(len(time)), 0.0
            for k in range(len(time)):
                x = keep[k] * x + fresh[k]
                y[k] = x
            out += np.sqrt(weight) * y
        return out

    def add(self, rng: Rng, i: int, time: Array, clean: Array) -> Array:
        """What is written down."""
        level = self.levels[i] + self.share * np.abs(clean)
        written = clean + level * self.unit(rng, time)
        if self.quantum:
            written = np.round(written / self.quantum) * self.quantum
        return written

    def whiten(self, i: int, time: Array, clean: Array, x: Array) -> Array:
        """Columns of x (n, p) in units of the noise, decorrelated."""
        x = x / self.profile(i, clean)[:, None]
        if not len(self.times):
            return x
        return kernels.whiten(
            self.gaps(time),
            self.times,
            self.weights,
            self.white,
            np.ascontiguousarray(x),
        )

    def described(self, clean: list[Array]) -> dict[str, Any]:
        """For the truth file; sigma as root mean square over each recording."""
        return {
            "kind": self.kind,
            "fraction_of_range": self.fraction,
            "sigma_MPa": [
                float(np.sqrt(np.mean(self.profile(i, c) ** 2)))
                for i, c in enumerate(clean)
            ],
            "floor_MPa": self.levels.tolist(),
            "share_of_stress": self.share,
            "memory_unit": "samples" if self.by_samples else "s",
            "memory_times": self.times.tolist(),
            "memory_shares": self.weights.tolist(),
            "white_share": self.white,
            "quantum_MPa": self.quantum,
        }


def draw_noise(
    rng: Rng, kind: str, clean: list[Array], pace: float, quiet: float = 1.0
) -> Noise:
    """0.1-1 % of the stress range, times `quiet`; the memory drawn."""
    whole = max(float(c.max()) for c in clean) - min(float(c.min()) for c in clean)
    fraction = quiet * loguniform(rng, 0.001, 0.01)
    level = fraction * whole
    same = np.full(len(clean), level)
    if kind == "stress_share":
        return Noise(kind, fraction, same * 0.3, share=fraction * rng.uniform(0.8, 2))
    if kind == "samples_memory":
        memory = np.array([loguniform(rng, 0.8, 12)])
        return Noise(
            kind,
            fraction,
            same,
            by_samples=True,
            white=0.0,
            times=memory,
            weights=np.ones(1),
        )
    if kind == "pink":  # equal power in every octave, up to the time of a ramp
        times = np.geomspace(0.01, pace * rng.uniform(0.5, 1.5), 7)
        return Noise(
            kind, fraction, same, white=0.1, times=times, weights=np.full(7, 0.9 / 7)
        )
    if kind == "range_share":
        own = np.array([max(float(np.ptp(c)), 0.1 * whole) for c in clean])
        return Noise(kind, fraction, fraction * own)
    if kind == "seconds_memory":
        memory = np.array([loguniform(rng, 0.02, 1.0)])
        return Noise(kind, fraction, same, white=0.0, times=memory, weights=np.ones(1))
    if kind == "quantised":
        return Noise(kind, fraction, same, quantum=level * rng.uniform(0.5, 4))
    if kind == "white_and_slow":
        memory = np.array([loguniform(rng, 0.1, 3.0)])
        share = rng.uniform(0.2, 0.7)
        return Noise(
            kind,
            fraction,
            same,
            white=share,
            times=memory,
            weights=np.array([1 - share]),
        )
    return Noise(kind, fraction, same)


def given(level: float, memory_s: float, clean: list[Array]) -> Noise:
    """Noise of this share of the stress range; `memory_s` correlates it (0: white)."""
    whole = max(float(c.max()) for c in clean) - min(float(c.min()) for c in clean)
    same = np.full(len(clean), level * whole)
    if not memory_s:
        return Noise("white", level, same)
    return Noise(
        "seconds_memory",
        level,
        same,
        white=0.0,
        times=np.array([memory_s]),
        weights=np.ones(1),
    )
