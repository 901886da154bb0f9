"""What a family is, and what all of them share.

Every family (of noise, law, programme, material, stranger) stands on one side:
DEVELOPMENT cases draw from families of the first kind only, HELD_OUT cases from the
others. The side is written where the family is, once, with no regard to difficulty.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator

DEVELOPMENT, HELD_OUT = "development", "held_out"
SIDES = (DEVELOPMENT, HELD_OUT)

EFFECTS = (  # the public vocabulary, in its order
    "slack",
    "grip_slip",
    "mullins_softening",
    "permanent_set",
    "friction_hysteresis",
    "relaxation_branch",
    "nonlinear_viscosity",
    "nonlinear_elasticity",
    "strain_dependent_relaxation",
    "finite_strain",
    "thermal_softening",
    "cyclic_softening",
    "tension_only",
    "inertia",
    "sensor_lag",
    "load_cell_drift",
    "zero_offset",
    "gain_error",
    "load_cell_saturation",
)


def some(rng: Rng, n: int, low: float = 0.3, high: float = 0.6) -> list[int]:
    """Some recordings of n, at least one, never all."""
    count = int(np.clip(round(rng.uniform(low, high) * n), 1, n - 1))
    return sorted(int(i) for i in rng.choice(n, count, replace=False))


def loguniform(rng: Rng, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def reach(e: Array) -> Array:
    """Largest elongation plus largest shortening so far, signed."""
    far = np.maximum.accumulate(np.maximum(e, 0))
    return far + np.minimum.accumulate(np.minimum(e, 0))


def farthest(e: Array) -> Array:
    """Largest strain so far, whichever way."""
    return np.maximum.accumulate(np.abs(e))
