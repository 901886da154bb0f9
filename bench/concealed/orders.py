"""What is to be forged: the effects there are, and the cases of a trial."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.concealed import material, rig, sensor
from bench.concealed.planting import Context, Planted
from bench.concealed.unlisted import UNLISTED

# In the order of a measurement; within the material, what changes the spring first.
EFFECTS: tuple[Callable[[Context], Planted], ...] = (
    rig.slack,
    rig.grip_slip,
    material.nonlinear_elasticity,
    material.mullins_softening,
    material.permanent_set,
    material.friction_hysteresis,
    material.relaxation_branch,
    material.nonlinear_viscosity,
    material.strain_dependent_relaxation,
    material.finite_strain,
    material.thermal_softening,
    material.cyclic_softening,
    material.tension_only,
    sensor.inertia,
    sensor.sensor_lag,
    sensor.load_cell_drift,
    sensor.zero_offset,
    sensor.gain_error,
    sensor.load_cell_saturation,
)
NAMES = tuple(plant.__name__ for plant in EFFECTS)
SENSORS = NAMES[NAMES.index("inertia") :]
# Sizes that a recording has for itself alone say nothing about the next one.
OWN_SIZE = {"slack", "grip_slip", "zero_offset", "gain_error"}
# Two of these are two forms of one thing, or ask for programmes that exclude each
# other (compression shows tension-only; a slack strip cannot be compressed).
NOT_TOGETHER = (
    {"tension_only", "slack"},
    {"tension_only", "grip_slip"},
    {"finite_strain", "strain_dependent_relaxation"},
    {"finite_strain", "nonlinear_elasticity"},
    {"finite_strain", "relaxation_branch"},
    {"nonlinear_viscosity", "relaxation_branch"},
)
NEEDS_SINE = ("cyclic_softening", "inertia", "sensor_lag")
FIRST_TRIAL_SEED = 10_000  # below: development; from here on also held-out programmes


@dataclass(frozen=True)
class Order:
    """What is to be forged: one case."""

    name: str
    group: str  # "single", "pair", "null" or "unlisted"
    effects: tuple[str, ...]
    strength: float
    seed: int
    number: int
    dirty: bool = False
    simulated: bool = False
    # Noise is drawn unless it is prescribed: its level as a share of the stress range,
    # and its correlation time (0 for white).
    level: float | None = None
    correlation_s: float | None = None

    @property
    def prescribed(self) -> dict[str, float]:
        """What of the noise is not left to chance."""
        both = {"level": self.level, "correlation_s": self.correlation_s}
        return {k: v for k, v in both.items() if v is not None}


def order_of(answer: Mapping[str, Any]) -> Order:
    """The order that an answer of the key belongs to: it can be forged again."""
    return Order(
        answer["case"],
        answer["group"],
        tuple(answer["effects"]),
        *(answer[k] for k in ("strength", "seed", "number", "dirty", "simulated")),
        **answer.get("prescribed", {}),
    )


def plan(
    seed: int,
    strength: float,
    *,
    each: int,
    nulls: int,
    pairs: int,
    unlisted: int,
    only: Sequence[str] = (),
    dirty: float = 0.15,
    simulated: float = 0.1,
) -> list[Order]:
    """Orders of a trial, shuffled; `dirty` and `simulated` are shares of the cases."""
    rng = np.random.default_rng([seed, 2**32 - 1])
    kinds: list[tuple[str, tuple[str, ...]]] = []
    for name in only or NAMES:
        kinds += [("single", (name,))] * each
    kinds += [("null", ())] * nulls
    allowed = [
        two
        for two in itertools.combinations(NAMES, 2)
        if not any(set(two) == bad for bad in NOT_TOGETHER)
    ]
    drawn = rng.permutation(len(allowed))
    kinds += [("pair", allowed[drawn[i % len(allowed)]]) for i in range(pairs)]
    others = [m.__name__ for m in UNLISTED]
    kinds += [("unlisted", (others[i % len(others)],)) for i in range(unlisted)]
    orders = []
    for number, k in enumerate(rng.permutation(len(kinds))):
        group, effects = kinds[k]
        orders.append(
            Order(
                f"case-{number + 1:04d}",
                group,
                effects,
                strength,
                seed,
                number,
                bool(rng.random() < dirty),
                bool(rng.random() < simulated),
            )
        )
    return orders
