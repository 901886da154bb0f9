"""What tests of the effects share."""

import numpy as np

from softnn.contracts import Chunk, Effect, Scales
from softnn.models.units import Units
from softnn.simulate import Term, simulate

UNITS = Units("pl-wiechert", (-1.0, 0.0, 0.4, 1.0), (0.3, 5.0))

STIFFNESS = np.array([0.8, 0.9, 1.4, 0.5, 0.4])


def scales(chunk: Chunk) -> Scales:
    stress = simulate(UNITS, STIFFNESS, [], [chunk])[0]
    warm = chunk.temperature_C
    return Scales(
        strain=float(np.abs(chunk.strain).max()),
        stress_MPa=float(np.abs(stress).max()),
        interval_s=float(np.median(np.diff(chunk.time_s))),
        duration_s=np.array([chunk.time_s[-1]]),
        temperature_C=0.0 if warm is None else float(np.ptp(warm)),
    )


def planted(law: Effect, chunk: Chunk) -> dict[str, float]:
    """Values of the effect's first start, as numbers."""
    values = law.defaults() | law.starts(scales(chunk))[0]
    return {k: float(np.ravel(v)[0]) for k, v in values.items()}


def stress(law: Effect, values: dict[str, float], chunk: Chunk) -> np.ndarray:
    return simulate(UNITS, STIFFNESS, [Term(law, values)], [chunk])[0]
