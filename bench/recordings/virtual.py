"""A set made up in seconds, so that the command can be seen to run anywhere."""

from __future__ import annotations

import numpy as np

from bench.recordings.groups import Group, splits
from bench.recordings.sets import Material
from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.models.units import Units
from softnn.recording import Recording
from softnn.simulate import Term, simulate


def made_up(seed: int) -> list[Group]:
    """Three specimens, cycled twice: a spring that softens (Mullins)."""
    rng = np.random.default_rng(seed)
    spring = Units("hooke", (0.0, 1.0))
    law = effect("mullins_softening")
    values = law.defaults() | {"depth": 0.4, "scale": 0.05}
    time = np.linspace(0, 12, 240)
    strain = np.interp(time, [0, 2, 4, 8, 12], [0, 0.3, 0, 0.6, 0])
    out = []
    for i in range(3):
        stress = simulate(
            spring, [1 + 0.1 * i], [Term(law, values)], [Chunk(time, strain)]
        )
        noise = 0.003 * rng.standard_normal(len(time))
        out.append(
            Recording(time, strain, stress[0] + noise, name=f"s{i}", test="cyclic")
        )
    material = Material((("mullins_softening",),), says="softening, put there")
    return [
        Group(
            "made-up", "", tuple(out), True, material, tuple(splits(["specimen"], out))
        )
    ]
