"""Noise of the stress channel, of a stated root mean square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.concealed.programmes import Array

KINDS = ("white", "coloured", "heteroscedastic", "quantised")
LEVELS = (0.002, 0.005, 0.01)  # of the stress range of the case


@dataclass(frozen=True)
class Noise:
    """`sigma_MPa` rms; `correlation_s` of the coloured kind, 0 of the others."""

    kind: str
    sigma_MPa: float
    correlation_s: float
    growth: float  # heteroscedastic: noise at the peak stress over that at zero

    def profile(self, clean: Array, peak: float) -> Array:
        """Standard deviation at every sample (n,), MPa, rms `sigma_MPa`."""
        if self.kind != "heteroscedastic":
            return np.full(len(clean), self.sigma_MPa)
        shape = 1 + (self.growth - 1) * np.abs(clean) / peak
        return self.sigma_MPa * shape / np.sqrt(np.mean(shape**2))

    def add(
        self, rng: np.random.Generator, time_s: Array, clean: Array, peak: float
    ) -> Array:
        """What is written down for `clean` (n,), at irregular times too."""
        white = rng.standard_normal(len(clean))
        if self.kind == "coloured":
            # Ornstein-Uhlenbeck, exact between samples.
            keep = np.exp(-np.diff(time_s, prepend=time_s[0]) / self.correlation_s)
            fresh = np.sqrt(1 - keep**2)
            fresh[0] = 1.0
            for i in range(1, len(white)):
                white[i] = keep[i] * white[i - 1] + fresh[i] * white[i]
        if self.kind == "quantised":
            # Half the variance from rounding, half from noise that dithers it.
            step = self.sigma_MPa * np.sqrt(6)
            noisy = clean + self.sigma_MPa * np.sqrt(0.5) * white
            return np.round(noisy / step) * step
        return clean + self.profile(clean, peak) * white


def of_colour(correlation_s: float) -> Noise:
    """Noise of unit size, white at 0 s."""
    kind = "coloured" if correlation_s > 0 else "white"
    return Noise(kind, 1.0, correlation_s, 1.0)


def draw_noise(rng: np.random.Generator, stress_range: float) -> Noise:
    """Kind and level at random."""
    kind = str(rng.choice(KINDS, p=(0.4, 0.25, 0.2, 0.15)))
    return Noise(
        kind,
        float(rng.choice(LEVELS)) * stress_range,
        float(10 ** rng.uniform(-1.0, 0.0)) if kind == "coloured" else 0.0,
        float(rng.uniform(2.0, 5.0)),
    )
