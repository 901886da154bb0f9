"""What a family is, and the hooks by which a law acts on a test.

Every family (of noise, law, programme, material, stranger) stands on one side:
DEVELOPMENT cases draw from families of the first kind only, HELD_OUT cases from the
others. The side is written where the family is, once, with no regard to difficulty.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bench.hands.testing import Run, Setup

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


@dataclass(frozen=True)
class Act:
    """A law with its parameters drawn; the strength `a` comes last in every hook.

    Strengths run from `least` (below which the law is no longer itself) to `limit`.

    All work on the fine clock; at a = 0 every hook hands back what it was given (or
    nothing, for `extra`; or the linear branches, for `flow`).

    rig(i, t, strain, a): what reaches the specimen in recording i
    strain(run, e, a): what the material feels of it
    tempo(run, e, a): how much faster the branches relax
    flow(run, e, clock, a): stress of the branches, their own integrator
    spring(run, stress, a), whole(run, stress, a): on the spring; on all stress
    extra(run, e, stress, a): stress beside the others
    sensor(i, t, stress, a): what is written down in recording i
    """

    limit: float
    least: float = field(default=0.0, kw_only=True)
    parameters: dict[str, Any] = field(default_factory=dict)
    acts_on: str = "-"
    own_faults: bool = False  # of single recordings: not in held-out recordings
    rig: Callable[[int, Array, Array, float], Array] | None = None
    strain: Callable[[Run, Array, float], Array] | None = None
    tempo: Callable[[Run, Array, float], Array] | None = None
    flow: Callable[[Run, Array, Array, float], Array] | None = None
    spring: Callable[[Run, Array, float], Array] | None = None
    whole: Callable[[Run, Array, float], Array] | None = None
    extra: Callable[[Run, Array, Array, float], Array] | None = None
    sensor: Callable[[int, Array, Array, float], Array] | None = None


@dataclass(frozen=True)
class Law:
    """A published law for an effect, or a stranger (`effect` is then "alien")."""

    effect: str
    name: str
    side: str
    reference: str
    make: Callable[[Rng, Setup], Act]
    stage: str = "material"


def on_spring_or_whole(
    rng: Rng, hook: Callable[[Run, Array, float], Array], **rest: Any
) -> Act:
    """The same softening of the spring alone or of the whole response."""
    if rng.random() < 0.5:
        return Act(spring=hook, acts_on="spring", **rest)
    return Act(whole=hook, acts_on="whole", **rest)


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
