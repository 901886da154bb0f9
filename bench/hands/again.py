"""Another recording of a case: any programme, the same hidden truth, fresh noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.hands.drawing import Case
from bench.hands.families import Array, Rng
from bench.hands.programmes import Course

# Laws that were drawn for the accelerations of the recorded programmes alone.
BOUND = {"inertia"}


def can_record(case: Case) -> bool:
    """Whether the machine of a case records other programmes on fresh specimens."""
    return not case.setup.continued and not BOUND & {law.effect for law in case.laws}


def record(
    case: Case, time_s: Array, strain: Array, rng: Rng, degC: Array | None = None
) -> Array:
    """Stress (n,) over strain (n,) of a fresh specimen of the mean kind, MPa.

    Faults of single recordings do not happen again. `degC` (n,) is the temperature, by
    default that of the room. The noise has the usual level of the case.
    """
    warmth = np.full(len(time_s), case.setup.rest_C) if degC is None else degC
    rate = 1 / float(np.median(np.diff(time_s)))
    course = Course("asked", rate, time_s, strain, warmth)
    courses = [*case.setup.courses[: case.setup.n], course]
    asked = replace(case, setup=replace(case.setup, courses=courses))
    (clean,) = asked.stress(held=True)
    usual = np.array([np.median(case.noise.levels)])
    return replace(case.noise, levels=usual).add(rng, 0, time_s, clean)
