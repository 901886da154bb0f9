"""Recordings that a fitted model simulates are those of the law it was fitted to."""

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.metrics import nrmse
from softnn.neural.history import filtered
from softnn.recording import Recording
from softnn.study.augmentation import BEYOND, RATES, simulations
from softnn.study.material_data import Data
from studies.shown.augmentation import headline_of


def ramp(rate, name="", points=120):
    """Loading to 0.5 of a spring of 1 MPa beside a branch of 2 MPa and 3 s."""
    strain = np.linspace(0, 0.5, points)
    bare = Recording(strain / rate, strain, strain)
    return Recording(
        strain / rate,
        strain,
        strain + 2 * (strain - filtered(bare, 3.0)),
        test="tensile",
        rate_per_s=rate,
        name=name,
    )


def data(rates):
    recordings = [ramp(rate, f"at {rate}") for rate in rates]
    return Data("made", "linear", recordings, [])


def test_simulated_ramps_are_those_of_the_law_between_and_beyond():
    made = simulations(data([0.01, 0.1, 1.0]), {1})
    assert len(made) == RATES
    rates = [r.rate_per_s for r in made]
    assert min(rates) == pytest.approx(0.01 / BEYOND)
    assert max(rates) == pytest.approx(1.0 * BEYOND)
    for one in made:
        if 0.01 <= one.rate_per_s <= 1.0:
            truth = ramp(one.rate_per_s, points=len(one))
            assert nrmse(one.stress_MPa, truth.stress_MPa) < 0.03


def test_one_rate_and_no_hold_are_refused():
    with pytest.raises(InputError, match="nothing can be fitted"):
        simulations(data([0.01, 0.1]), {1})


def test_help_and_harm_are_beyond_the_error():
    rows = [{"gain": g, "gain_error": 0.1} for g in (0.3, 0.05, -0.05, -0.2)]
    assert headline_of(rows) == {"networks": 4, "helped": 1, "harmed": 1}
