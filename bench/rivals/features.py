"""Features of a strain history that learners use; none looks ahead in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softnn.contracts import Array, Chunk
from softnn.fit import Data
from softnn.neural.history import filtered
from softnn.recording import Recording

MEMORIES = 7
STILL = 0.02  # of the typical speed: below it the strain stands still
BACK = 0.1  # of the largest strain: a smaller way back is no turn
SETS = {
    "memory": ("strain", "memory", "temperature"),
    "state": (
        "strain",
        "memory",
        "temperature",
        "largest",
        "direction",
        "rate",
        "turns",
        "travel",
    ),
}


@dataclass(frozen=True)
class Features:
    """Columns of histories (n, k), each centred and scaled over the fitted recordings.

    `memory`: strain behind first-order lags of `times_s`. `largest`: the largest size
    of strain so far. `direction`: -1, 0 or 1. `rate`: the inverse hyperbolic sine of
    the strain rate over `speed`. `turns`: reversals of strain. `travel`: the length of
    the way of strain so far. The last two as logarithms of one more.
    """

    names: tuple[str, ...]
    times_s: tuple[float, ...]
    speed: float
    size: float
    middle: Array
    spread: Array

    @classmethod
    def of(cls, data: Data, names: Sequence[str]) -> Features:
        """Times from a few samples to the longest recording; scales of the columns."""
        scales = data.scales()
        if any(c.temperature_C is None for c in data.chunks):
            names = [n for n in names if n != "temperature"]
        shortest = 3 * scales.interval_s
        longest = max(float(scales.duration_s.max()), 3 * shortest)
        times = tuple(float(t) for t in np.geomspace(shortest, longest, MEMORIES))
        rates = np.concatenate([np.abs(_rate(c)) for c in data.chunks])
        speed = float(np.median(rates[rates > 0])) if (rates > 0).any() else 1.0
        plain = cls(tuple(names), times, speed, scales.strain, np.zeros(1), np.ones(1))
        rows = np.concatenate([plain.raw(c) for c in data.chunks])
        spread = rows.std(axis=0)
        middle, spread = rows.mean(axis=0), np.where(spread > 1e-9, spread, 1.0)
        return cls(tuple(names), times, speed, scales.strain, middle, spread)

    def at(self, chunk: Chunk) -> Array:
        """Features (n, k) of a history."""
        return (self.raw(chunk) - self.middle) / self.spread

    def raw(self, chunk: Chunk) -> Array:
        strain = np.asarray(chunk.strain, float)
        parts = []
        for name in self.names:
            if name == "memory":
                asked = Recording(chunk.time_s, strain, np.zeros_like(strain))
                parts += [filtered(asked, t) for t in self.times_s]
            else:
                parts.append(getattr(self, f"_{name}")(chunk, strain))
        return np.stack(parts, axis=1)

    def labels(self) -> list[str]:
        """The name of each column."""
        out: list[str] = []
        for name in self.names:
            several = [f"memory{i + 1}" for i in range(len(self.times_s))]
            out += several if name == "memory" else [name]
        return out

    def _strain(self, chunk: Chunk, strain: Array) -> Array:
        return strain

    def _largest(self, chunk: Chunk, strain: Array) -> Array:
        return np.maximum.accumulate(np.abs(strain))

    def _direction(self, chunk: Chunk, strain: Array) -> Array:
        rate = _rate(chunk)
        return np.where(np.abs(rate) > STILL * self.speed, np.sign(rate), 0.0)

    def _rate(self, chunk: Chunk, strain: Array) -> Array:
        return np.arcsinh(_rate(chunk) / self.speed)

    def _turns(self, chunk: Chunk, strain: Array) -> Array:
        return np.log1p(turns(strain, BACK * self.size))

    def _travel(self, chunk: Chunk, strain: Array) -> Array:
        way = np.cumsum(np.abs(np.diff(strain, prepend=strain[0])))
        return np.log1p(way / max(self.size, 1e-12))

    def _temperature(self, chunk: Chunk, strain: Array) -> Array:
        if chunk.temperature_C is None:
            raise ValueError("a history without the temperature that others have")
        warm, known = chunk.temperature_C, np.isfinite(chunk.temperature_C)
        return np.interp(chunk.time_s, chunk.time_s[known], warm[known])


def _rate(chunk: Chunk) -> Array:
    step = np.maximum(np.diff(chunk.time_s, prepend=chunk.time_s[0]), 1e-9)
    rate = np.diff(chunk.strain, prepend=chunk.strain[0]) / step
    if len(rate) > 1:
        rate[0] = rate[1]
    return rate


def turns(strain: Array, back: float) -> Array:
    """Reversals of strain (n,) by more than `back` that are over at each moment.

    >>> turns(np.array([0, 1, 0.95, 1, 0, 1.0]), 0.1).tolist()
    [0, 0, 0, 0, 1, 2]
    """
    out, count, way = np.zeros(len(strain), int), 0, 0
    high = low = float(strain[0])
    for i, x in enumerate(strain.tolist()):
        high, low = max(high, x), min(low, x)
        if way >= 0 and high - x > back:
            count, way, low = count + (way > 0), -1, x
        elif way <= 0 and x - low > back:
            count, way, high = count + (way < 0), 1, x
        out[i] = count
    return out


def rows(found: Features, data: Data) -> tuple[Array, Array]:
    """Features (n, k) and stress (n,) of all samples with a stress."""
    x, y = [], []
    for chunk, stress in zip(data.chunks, data.stress_MPa, strict=True):
        good = np.isfinite(stress)
        x.append(found.at(chunk)[good])
        y.append(stress[good])
    return np.concatenate(x), np.concatenate(y)
