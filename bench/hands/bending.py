"""Laws that are wrong, as all are of a real material: what they change is bent.

What a law changes of the stress, c, is multiplied by powers of its own size, of strain
and of time, and part of it comes late; a material's law by 10 to 50 %, one of the
machine by a tenth of that, the bare response by 0.3 to 5 % (of time alone where the
base is straight: a curve would be an effect), and far less than any law would leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bench.hands import kernels
from bench.hands.families import Array, Rng, loguniform
from bench.hands.testing import Law, Planted, Setup, simulate

LOW, HIGH = 0.2, 5.0  # what a power may make of a stress, at most
SMALL = 0.02  # of the largest, which powers are taken beside


@dataclass(frozen=True)
class Bend:
    """Exponents of size, strain and time; the share that is late, and by how much."""

    size: float
    strain: float
    time: float
    late: float
    lag_s: float

    def __call__(self, change: Array, most: float, e: Array, em: float, t: Array):
        def power(x: Array, to: float) -> Array:
            return ((x + SMALL) / (1 + SMALL)) ** to

        whole = max(float(t[-1] - t[0]), 1e-9)
        shape = power(np.abs(change) / max(most, 1e-300), self.size)
        shape = shape * power(np.abs(e) / em, self.strain)
        shape = shape * power((t - t[0]) / whole, 0.3 * self.time)
        bent = change * np.clip(shape, LOW, HIGH)
        gaps = np.diff(t, prepend=t[0])
        slow = kernels.follow(bent, gaps, self.lag_s, self.lag_s)
        return (1 - self.late) * bent + self.late * slow


def draw_bend(rng: Rng, size: float, pace_s: float) -> Bend:
    """A bend of about this size."""
    a, b, c = size * rng.standard_normal(3)
    late = min(size * abs(float(rng.standard_normal())), 0.7)
    lag = pace_s * loguniform(rng, 0.1, 3.0)
    return Bend(float(a), float(b), float(c), late, lag)


@dataclass(frozen=True)
class Bends:
    """Of the bare response, and of each law."""

    bare: Bend
    laws: tuple[Bend, ...]

    @classmethod
    def draw(cls, rng: Rng, laws: Sequence[Law], setup: Setup) -> Bends:
        pace_s = setup.pace_s
        bare = draw_bend(rng, loguniform(rng, 0.003, 0.05), pace_s)
        if not setup.model.startswith("pl-"):
            bare = replace(bare, size=0.0, strain=0.0)
        sizes = [
            loguniform(rng, 0.1, 0.5) * (1.0 if law.stage == "material" else 0.1)
            for law in laws
        ]
        return cls(bare, tuple(draw_bend(rng, s, pace_s) for s in sizes))

    def milder(self) -> Bends:
        """The bare response bent by half as much."""
        b = self.bare
        half = Bend(b.size / 2, b.strain / 2, b.time / 2, b.late / 2, b.lag_s)
        return replace(self, bare=half)

    def described(self) -> dict[str, Any]:
        """For the truth file."""
        return asdict(self)


def simulate_bent(
    setup: Setup, planted: Planted, bends: Bends, held: bool = False
) -> list[Array]:
    """As `simulate`; every part of the stress bent."""
    courses = setup.courses[setup.n :] if held else setup.courses[: setup.n]
    parts = [(bends.bare, simulate(setup, (), held), setup.peak)]
    for k, bend in enumerate(bends.laws):
        recorded = _change(setup, planted, k, held=False)  # what is held is no measure
        most = max(float(np.abs(c).max()) for c in recorded)
        change = _change(setup, planted, k, held) if held else recorded
        parts.append((bend, change, most))
    out = simulate(setup, planted, held)
    for bend, change, most in parts:
        for k, (c, course) in enumerate(zip(change, courses, strict=True)):
            out[k] = out[k] + bend(c, most, course.strain, setup.em, course.time_s) - c
    return out


def _change(setup: Setup, planted: Planted, k: int, held: bool) -> list[Array]:
    """What law k changes of the stress, the others there."""
    rest = [p for i, p in enumerate(planted) if i != k]
    both = simulate(setup, planted, held), simulate(setup, rest, held)
    return [w - o for w, o in zip(*both, strict=True)]
