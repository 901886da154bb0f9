"""Effects against closed forms."""

import numpy as np
import pytest
from effects_made import planted
from scipy.signal import lsim

from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.models.units import Units
from softnn.simulate import Term, run_on, simulate

# -- closed forms ----------------------------------------------------------------------


def test_relaxation_branch_is_the_exponential():
    law = effect("relaxation_branch")
    time = np.linspace(0, 10, 101)
    hold = Chunk(time, np.full(101, 0.5))
    out = simulate(
        Units("hooke", (0.0, 1.0)),
        [0.0],
        [Term(law, {"stiffness_MPa": 2.0, "relaxation_time_s": 3.0})],
        [hold],
    )[0]
    np.testing.assert_allclose(out, 2.0 * 0.5 * np.exp(-time / 3.0), rtol=1e-12)


def test_eyring_dashpot_relaxes_as_its_closed_form():
    # dg/dt = -(e/tau) sinh(g/e) has tanh(g/2e) = tanh(g0/2e) exp(-t/tau).
    law = effect("nonlinear_viscosity")
    time = np.linspace(0, 20, 201)
    hold = Chunk(time, np.full(201, 0.5))
    values = {"stiffness_MPa": 1.0, "time_s": 50.0, "threshold": 0.05}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [hold])[0]
    first = 2 * np.arctanh(out[0] / 0.1 * 0 + np.tanh(out[0] / 0.1))
    assert first == pytest.approx(out[0] / 0.05, rel=1e-6)
    expected = 0.1 * np.arctanh(np.tanh(out[0] / 0.1) * np.exp(-time / 50.0))
    np.testing.assert_allclose(out, expected, rtol=1e-6)


def test_eyring_dashpot_flows_steadily_at_arcsinh_of_the_rate():
    law = effect("nonlinear_viscosity")
    time = np.arange(0, 200, 0.05)
    ramp = Chunk(time, 0.01 * time)
    values = {"stiffness_MPa": 1.0, "time_s": 50.0, "threshold": 0.05}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [ramp])[0]
    assert out[-1] == pytest.approx(0.05 * np.arcsinh(0.01 * 50 / 0.05), rel=1e-4)


def test_friction_loop_is_twice_the_friction_high():
    law = effect("friction_hysteresis")
    chunk = Chunk(np.arange(400.0), 0.5 * np.sin(np.arange(400) / 30))
    values = {"friction_MPa": 0.1, "presliding": 0.01, "spread": 0.05, "growth": 0.0}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [chunk])[0]
    assert out.max() == pytest.approx(0.1, rel=1e-6)
    assert out.min() == pytest.approx(-0.1, rel=1e-6)


def test_dahl_friction_rises_exponentially():
    law = effect("friction_hysteresis", "BoucWen")
    strain = np.linspace(0, 0.1, 201)
    chunk = Chunk(np.arange(201.0), strain)
    values = {"friction_MPa": 1.0, "presliding": 0.02, "sharpness": 1.0, "growth": 0.0}
    out = simulate(Units("hooke", (0.0, 1.0)), [0.0], [Term(law, values)], [chunk])[0]
    np.testing.assert_allclose(out, 1 - np.exp(-strain / 0.02), atol=2e-4)


def test_sensor_lag_follows_a_ramp_late_by_its_time_constant():
    law = effect("sensor_lag")
    time = np.linspace(0, 10, 501)
    chunk = Chunk(time, 0.02 * time)
    one = Units("hooke", (0.0, 1.0))
    values = {"time_constant_s": 0.4, "quality_squared": 0.0}
    out = simulate(one, [1.0], [Term(law, values)], [chunk])[0]
    expected = 0.02 * (time - 0.4 * (1 - np.exp(-time / 0.4)))
    np.testing.assert_allclose(out, expected, atol=1e-12)


@pytest.mark.parametrize("quality", [0.0, 0.1, 0.25, 1 / 3, 0.5, 1.0])
def test_sensor_lag_is_the_filter_of_its_transfer_function(quality):
    law, time = effect("sensor_lag"), np.linspace(0, 5, 401)
    corners = np.random.default_rng(0).uniform(0, 0.1, 9)
    chunk = Chunk(time, np.interp(time, np.linspace(0, 5, 9), corners))
    values = {"time_constant_s": 0.3, "quality_squared": quality}
    one = Units("hooke", (0.0, 1.0))
    out = simulate(one, [1.0], [Term(law, values)], [chunk])[0]
    poles = [0.3**2 * quality, 0.3, 1.0] if quality else [0.3, 1.0]
    late = lsim(([1.0], poles), chunk.strain - chunk.strain[0], time)[1]
    np.testing.assert_allclose(out, chunk.strain[0] + late, atol=1e-12)


def test_recordings_warm_up_by_as_much_as_each_does():
    law, time = effect("load_cell_drift", "OwnWarmUp"), np.linspace(0, 60, 301)
    chunks = [Chunk(time, 0.0 * time) for _ in range(2)]
    values = {"drift_MPa_per_s": np.array([1e-4, -3e-4]), "warm_up_s": 20.0}
    out = simulate(Units("hooke", (0.0, 1.0)), [1.0], [Term(law, values)], chunks)
    for stress, rate in zip(out, (1e-4, -3e-4), strict=True):
        expected = rate * 20 * (1 - np.exp(-time / 20))
        np.testing.assert_allclose(stress, expected, atol=1e-15)


def test_inertia_of_a_sine_is_minus_omega_squared():
    law = effect("inertia")
    time = np.linspace(0, 2, 2001)
    chunk = Chunk(time, 0.3 * np.sin(5 * time))
    out = simulate(
        Units("hooke", (0.0, 1.0)), [0.0], [Term(law, {"mass": 2.0})], [chunk]
    )
    np.testing.assert_allclose(out[0][1:-1], -25 * 2 * chunk.strain[1:-1], rtol=1e-5)


def test_softening_meets_the_first_loading_at_the_largest_strain():
    law = effect("mullins_softening")
    chunk = law.telltale()
    spring = Units("hooke", (0.0, 1.0))
    values = planted(law, chunk)
    out = simulate(spring, [1.0], [Term(law, values)], [chunk])[0]
    top = np.isclose(chunk.strain, np.maximum.accumulate(chunk.strain), atol=1e-12)
    np.testing.assert_allclose(out[top], chunk.strain[top], rtol=1e-12)
    assert np.all(out[~top] <= chunk.strain[~top] + 1e-15)


def test_continued_slip_stays_and_regripped_slip_does_not():
    chunk = Chunk(np.arange(11.0), np.full(11, 0.5))
    values = {
        "slip": np.array([0.1, 0.0]),
        "moment_s": np.array([5.0, 5.0]),
        "duration_s": 1.0,
    }
    spring = Units("hooke", (0.0, 1.0))
    kept, fresh = (
        simulate(
            spring, [1.0], [Term(effect("grip_slip", f), values)], [chunk, chunk], True
        )
        for f in ("GripSlip", "RegrippedSlip")
    )
    assert kept[1][-1] == pytest.approx(0.4)
    assert fresh[1][-1] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("first", "begun"),
    [
        ([0.0, 0.1, 0.2, 0.3], 1.1),
        ([0.0, 0.1, 0.2, 5.2, 10.2], 1.1),  # a hold is recorded slowly
        ([0.0, 5.0, 5.1, 5.2], 1.1),  # one sample late
        ([0.0], 1.0),
        ([7.0, 7.1], 7.0),  # a clock that runs on
    ],
)
def test_recordings_that_go_on_do_so_at_once(first, begun):
    one, two = (Chunk(np.array(t), np.zeros(len(t))) for t in ([0.0, 0.5, 1.0], first))
    assert [id(c) for c in run_on([one, two], False)] == [id(one), id(two)]
    same, after = run_on([one, two], True)
    assert same.time_s is one.time_s
    assert after.time_s[0] == pytest.approx(begun)
    assert np.diff(after.time_s) == pytest.approx(np.diff(first))
