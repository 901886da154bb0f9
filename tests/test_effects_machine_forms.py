"""Forms of the faults of rigs and sensors, against closed forms."""

import numpy as np
import pytest

from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.models.units import Units
from softnn.simulate import Term, simulate

SPRING = Units("hooke", (0.0, 1.0))


def pulled(name, form, values, strain, time=None):
    """Stress of a spring of 2 MPa."""
    strain = np.asarray(strain, float)
    time = np.arange(len(strain), dtype=float) if time is None else time
    term = Term(effect(name, form), values)
    return simulate(SPRING, [2.0], [term], [Chunk(time, strain)])[0]


@pytest.mark.parametrize("seat", [0.0, 0.5, 1.0])
def test_play_loses_the_gap_at_a_turn_and_its_seat_before(seat):
    strain = [0.0, 0.3, 0.5, 0.45, 0.2, 0.0, -0.4, 0.3]
    values = {"gap": 0.1, "seat": seat}
    out = pulled("slack", "Backlash", values, strain) / 2.0
    first, back = 0.1 * seat, 0.1 * (1 - seat)
    turned = max(0.5 - first, 0.45 - first)  # 0.05 of the gap is not yet crossed
    expected = [0, 0.3 - first, 0.5 - first, turned, 0.2 + back, back, -0.4 + back]
    np.testing.assert_allclose(out, [*expected, 0.3 - first], atol=1e-12)


def test_a_gap_grows_with_time_and_is_none_beyond_it():
    strain = [0.0, 0.03, 0.5, 0.03, -0.5]
    values = {"gap": 0.02, "toe": 0.0, "growth_per_s": 0.5}
    out = pulled("slack", "GrowingGap", values, strain) / 2.0
    np.testing.assert_allclose(out, [0, 0, 0.46, 0, -0.44], atol=1e-12)


@pytest.mark.parametrize("power", [1.0, 3.0, 8.0])
def test_a_held_specimen_creeps_out_of_its_grips_by_a_power_law(power):
    # dg/dt = -r g^n from 0.4: an exponential, or g^(1-n) straight in time.
    time, rate = np.linspace(0, 50, 501), 0.02 / 0.4 ** (power - 1)
    values = {"rate_per_s": rate, "exponent": power}
    hold = np.full(501, 0.4)
    hold[0] = 0.0
    out = pulled("grip_slip", "CreepingGrip", values, hold, time) / 2.0
    t = time[1:]
    if power == 1:
        expected = 0.4 * np.exp(-rate * t)
    else:
        grown = 0.4 ** (1 - power) + (power - 1) * rate * t
        expected = grown ** (1 / (1 - power))
    np.testing.assert_allclose(out[1:], expected, rtol=3e-2)  # half a step early
    ratio = out[101:] / expected[100:]
    np.testing.assert_allclose(ratio, 1.0, rtol=2e-3)


def test_slip_goes_on_where_the_recording_before_ended():
    one, two = (Chunk(np.linspace(0, 9, 91), np.full(91, 0.4)) for _ in range(2))
    law = effect("grip_slip", "CreepingGrip")
    term = Term(law, {"rate_per_s": 0.05, "exponent": 1.0})
    first, after = simulate(SPRING, [2.0], [term], [one, two], True)
    assert after[0] < first[-1]
    assert after[0] == pytest.approx(first[-1], rel=0.01)


def test_a_zero_that_settles_moves_loaded_or_not():
    time = 7.0 + np.linspace(0, 30, 301)  # a clock that runs on
    values = {"offset_MPa": 0.2, "settling_s": 5.0, "returning": 0.7}
    for strain in (np.zeros(301), 0.5 * np.sin(time) ** 2):
        out = pulled("zero_offset", "SettlingOffset", values, strain, time)
        added = 0.2 * (0.3 + 0.7 * np.exp(-(time - 7) / 5))
        np.testing.assert_allclose(out - 2.0 * strain, added, atol=1e-12)


def test_an_overload_stop_lets_a_share_through_on_either_side():
    strain = np.array([0.0, 0.2, 0.5, -0.1, -0.4])
    values = {"limit_MPa": 0.6, "pushed_MPa": 0.3, "beyond": 0.25, "knee": 0.0}
    out = pulled("load_cell_saturation", "UnevenLimits", values, strain)
    np.testing.assert_allclose(out, [0, 0.4, 0.7, -0.2, -0.425], rtol=1e-12)


def test_alike_and_without_a_stop_limits_are_those_of_the_main_law():
    strain = np.linspace(-0.6, 0.6, 61)
    for knee in (0.0, 0.2):
        main = {"limit_MPa": 0.5, "knee": knee}
        uneven = main | {"pushed_MPa": 0.5, "beyond": 0.0}
        np.testing.assert_allclose(
            pulled("load_cell_saturation", "UnevenLimits", uneven, strain),
            pulled("load_cell_saturation", None, main, strain),
            rtol=1e-12,
        )


def test_a_range_of_its_own_clips_one_recording_alone():
    pull = Chunk(np.arange(3.0), np.array([0.0, 0.5, -0.5]))
    values = {"narrowness_per_MPa": np.array([0.0, 2.5])}
    term = Term(effect("load_cell_saturation", "OwnRange"), values)
    wide, narrow = simulate(SPRING, [2.0], [term], [pull, pull])
    np.testing.assert_array_equal(wide, [0.0, 1.0, -1.0])
    np.testing.assert_allclose(narrow, [0.0, 0.4, -0.4])
