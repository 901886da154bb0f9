"""A base holds its own law: springs and branches of any times are nothing missing.

The stress is that of springs and Maxwell elements, exact between the corners of the
strain (Ferry 1980, ch. 3). Times lie on no grid, and one may be below the clock's step.
"""

import numpy as np
import pytest

from softnn.mismatch.case import Case
from softnn.mismatch.compare import NAMED
from softnn.mismatch.diagnosis import diagnose
from softnn.recording import Recording

SEEDS = range(4)


def branch(time, strain, stiffness, tau):
    """Stress of a Maxwell element, exact for a strain that is straight in between."""
    stress = np.zeros(len(time))
    for k, step in enumerate(np.diff(time)):
        kept = np.exp(-step / tau)
        rate = (strain[k + 1] - strain[k]) / step
        stress[k + 1] = stress[k] * kept + stiffness * tau * rate * (1 - kept)
    return stress


def programme(rng):
    """Ramp, hold of any length, and return or none; or three cycles."""
    reach, ramp = rng.uniform(0.2, 0.8), 10 ** rng.uniform(0, 2.5)
    hold = 10 ** rng.uniform(1, 3.5)
    corners, levels = [0, ramp, ramp + hold], [0, reach, reach]
    if rng.random() < 0.5:
        corners, levels = [*corners, 2 * ramp + hold], [*levels, 0]
    if rng.random() < 0.3:
        corners, levels = np.arange(7) * ramp, [0, reach] * 3 + [0]
    time = np.linspace(0, corners[-1], int(10 ** rng.uniform(2, 3)))
    time = np.unique(np.concatenate([time, np.linspace(0, ramp, 30)]))
    return time, np.interp(time, corners, levels)


def exact(seed: int, branches: int, bent: float, fluid: bool) -> Case:
    rng = np.random.default_rng(seed)
    tests = [programme(rng) for _ in range(rng.integers(1, 4))]
    taus = 10 ** rng.uniform(-0.5, 3, branches)
    stiffness = rng.uniform(0.2, 1, branches)
    made = []
    for time, strain in tests:
        stress = np.zeros(len(time)) if fluid else strain + bent * strain**3
        for one, tau in zip(stiffness, taus, strict=True):
            stress = stress + branch(time, strain, one, tau)
        made.append((time, strain, stress))
    noise = 1e-3 * max(np.abs(stress).max() for *_, stress in made)
    return Case(
        "exact",
        tuple(
            Recording(
                time,
                strain,
                stress + noise * rng.standard_normal(len(time)),
                name=f"r{number}",
            )
            for number, (time, strain, stress) in enumerate(made)
        ),
    )


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("base", "branches", "bent", "fluid"),
    [
        ("hooke", 0, 0.0, False),
        ("sls", 1, 0.0, False),
        ("sls", 1, 0.0, True),
        ("pl-sls", 1, 2.0, False),
        ("wiechert", 3, 0.0, False),
        ("wiechert", 3, 0.0, True),
        ("pl-wiechert", 3, 2.0, False),
        ("pl-wiechert", 3, 0.0, True),
    ],
)
def test_nothing_is_missing_from_a_base_that_made_the_recordings(
    base, branches, bent, fluid, seed
):
    found = diagnose(exact(seed, branches, bent, fluid), model=base)
    assert found.verdict in ("nothing_missing", "good_enough")
    assert max(found.probability.values(), default=0.0) < NAMED
