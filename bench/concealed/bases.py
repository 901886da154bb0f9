"""The physics that every simulation has: a spring and linear Maxwell branches.

The springs are incompressible hyperelastic laws in uniaxial tension (engineering
stress against stretch); the branches follow engineering strain by the trapezoidal
rule on the fine clock (A-stable, second order).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from bench.concealed.programmes import STEP_S, Array

Shape = dict[str, float]


def _invariant(x: Array) -> Array:
    return x**2 + 2 / x - 3


def _linear(x: Array, p: Shape) -> Array:
    return x - 1


def _mooney_rivlin(x: Array, p: Shape) -> Array:
    return (x - x**-2) * (1 + p["c"] / x)


def _yeoh(x: Array, p: Shape) -> Array:
    i = _invariant(x)
    return (x - x**-2) * (1 + 2 * p["c2"] * i + 3 * p["c3"] * i**2)


def _gent(x: Array, p: Shape) -> Array:
    return (x - x**-2) / (1 - _invariant(x) / p["limit"])


def _limit(stretch: float) -> float:
    return float(_invariant(np.array(stretch)))


def _ogden(x: Array, p: Shape) -> Array:
    a, b, w = p["a"], p["b"], p["w"]
    first = (x ** (a - 1) - x ** (-a / 2 - 1)) / a
    return first + w * (x ** (b - 1) - x ** (-b / 2 - 1)) / b


def _arruda_boyce(x: Array, p: Shape) -> Array:
    i = _invariant(x) + 3
    series = enumerate((1 / 2, 1 / 10, 33 / 1050, 76 / 7000, 2595 / 673750))
    slope = sum(c * (i / p["lock"] ** 2) ** k for k, c in series)
    return (x - x**-2) * np.asarray(slope)


def _demiray(x: Array, p: Shape) -> Array:
    return (x - x**-2) * np.exp(p["b"] * _invariant(x))


Draw = Callable[[np.random.Generator, float], Shape]  # from (rng, largest strain)
SKELETONS: dict[str, tuple[Callable[[Array, Shape], Array], Draw]] = {
    "mooney-rivlin": (_mooney_rivlin, lambda r, e: {"c": r.uniform(0.2, 2.0)}),
    "yeoh": (
        _yeoh,
        lambda r, e: {
            "c2": r.uniform(-0.04, 0.1) / e,
            "c3": r.uniform(0.002, 0.05) / e**3,
        },
    ),
    "gent": (
        _gent,
        lambda r, e: {"limit": _limit(1 + e * r.uniform(1.3, 2.2))},
    ),
    "ogden": (
        _ogden,
        lambda r, e: {
            "a": r.uniform(1.2, 2.2),
            "b": r.uniform(3.0, 6.0),
            "w": r.uniform(0.02, 0.2),
        },
    ),
    "arruda-boyce": (_arruda_boyce, lambda r, e: {"lock": r.uniform(1.1, 2) * (1 + e)}),
    "demiray": (_demiray, lambda r, e: {"b": r.uniform(0.02, 0.5) / e}),
}


@dataclass(frozen=True)
class Base:
    """Spring and branches of one case; stress in MPa.

    `modulus` is the spring's secant modulus at the largest strain; `branches` are
    (stiffness MPa, relaxation time s).
    """

    name: str
    shape: Shape
    modulus: float
    peak_strain: float
    branches: tuple[tuple[float, float], ...]

    def spring(self, strain: Array) -> Array:
        law = _linear if self.name == "linear" else SKELETONS[self.name][0]
        # A rig can crush a strip further than any law here holds.
        stretch = np.maximum(1 + strain, 0.2)
        top = float(law(np.array([1 + self.peak_strain]), self.shape)[0])
        return law(stretch, self.shape) * (self.modulus * self.peak_strain / top)

    def relaxing(self, strain: Array) -> Array:
        """Summed stress of the branches for branch strain (n,)."""
        total = np.zeros_like(strain)
        for stiffness, time in self.branches:
            total += stiffness * maxwell(strain, time)
        return total


def maxwell(strain: Array, relaxation_time_s: float) -> Array:
    """Stress of a branch of unit stiffness, from rest at zero strain (n,)."""
    a = STEP_S / (2 * relaxation_time_s)
    return lfilter([1 / (1 + a), -1 / (1 + a)], [1, -(1 - a) / (1 + a)], strain)


def draw_base(
    rng: np.random.Generator, peak_strain: float, linear: bool, branches: int
) -> Base:
    """A spring that stiffens or softens by less than eight times, and its branches."""
    modulus = float(10 ** rng.uniform(-1.3, 0.7))
    grid = 1 + np.linspace(-0.2, 1.0, 300) * peak_strain
    name, shape = "linear", {}
    while not linear:
        name = str(rng.choice(list(SKELETONS)))
        law, draw = SKELETONS[name]
        shape = draw(rng, peak_strain)
        tangent = np.gradient(law(np.maximum(grid, 0.2), shape), grid)
        used = tangent[grid >= 1]
        if tangent.min() > 0 and used.max() < 8 * used.min():
            break
    # Far enough apart to be different branches, within what the recordings show.
    decades = np.linspace(-0.7, 1.9, branches + 2)[1:-1] if branches > 1 else [0.6]
    times = 10 ** (np.asarray(decades) + rng.uniform(-0.25, 0.25, branches))
    weights = rng.dirichlet(np.full(branches, 3.0)) if branches else np.zeros(0)
    total = rng.uniform(0.3, 0.9)
    return Base(
        name,
        shape,
        modulus,
        peak_strain,
        tuple(
            (float(modulus * total * w), float(t))
            for w, t in zip(weights, times, strict=True)
        ),
    )
