"""The actuator: closed forms, SciPy as a second route, and the published figures."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from softnn.actuator import Chain, Controller, bench, walk, walk_ode
from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.export.compiled import Compiled
from softnn.export.files import stored_of
from softnn.fit import Piece
from softnn.model_file import Stored
from softnn.models import Hooke
from softnn.models.units import Units
from softnn.motor import Bundle, Law, Motor, published_checks

UNITS = Units("pl-wiechert", (-1.0, 0.0, 0.1, 0.5), (0.1, 1.0, 10.0, 100.0))
STRIP = Stored(
    UNITS, np.array([6.0, 6.0, 3.0, 0.5, 0.5, 0.0, 0.5]), (), (), False, "virgin"
)
BUNDLE = Bundle().for_torque(15, 2.5)
compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def cycle(n=300, step=1e-3):
    """Torque wanted, 0 to 15 Nm and back, and the angle of a knee that swings."""
    t = np.arange(n) * step
    swing = 1 - np.cos(2 * np.pi * t)
    return 7.5 * swing, np.radians(5 + 29 * swing)


def test_a_law_steps_as_the_model_does():
    strain = np.sin(np.linspace(0, 20, 500)) * 0.6
    time = np.cumsum(np.random.default_rng(0).uniform(1e-3, 0.5, 500))
    (want,) = STRIP.stress([""], [Chunk(time, strain)], [None])
    law, steps = Law(STRIP), np.diff(time, prepend=time[0])
    got = [law.step(s, e) for s, e in zip(steps, strain, strict=True)]
    np.testing.assert_allclose(got, want, rtol=1e-12, atol=1e-14)
    piece = Piece(effect("tension_only"), {"amount": 1.0}, ())
    with pytest.raises(InputError, match="has no effects"):
        Law(replace(STRIP, pieces=(piece,)))


def test_motor_alone_reaches_its_speed_by_its_closed_form():
    motor = Motor.published()
    dt, volts = 1e-3, 12.0
    rows = np.array(motor.step_matrices(dt))
    x = np.zeros(3)
    for _ in range(100):
        x = rows @ [*x, volts, 0.0, 0.0]
    r, k, j = motor.resistance_ohm, motor.torque_constant_Nm_per_A, motor.inertia_kg_m2
    a = np.array([[-r, -motor.back_emf_V_s], [k, 0]])
    a /= np.array([[motor.inductance_H], [j]])
    rates, modes = np.linalg.eig(a)
    rest = np.array([0.0, volts / motor.back_emf_V_s])  # no torque, no current
    parts = np.linalg.solve(modes, -rest) * np.exp(rates * 100 * dt)
    np.testing.assert_allclose(x[:2], rest + (modes @ parts).real, rtol=1e-9, atol=1e-9)


def test_published_figures_of_the_motor():
    motor = Motor.published()
    assert motor.ratio == 81
    assert motor.inertia_kg_m2 == pytest.approx(79.2e-3 * 1e-4)  # g cm2
    found = published_checks(2.5)
    # K_a = K_b in SI units: 29.2 mNm/A and 0.029 V/(rad/s) are one figure, rounded.
    assert abs(found["torque_over_back_emf_constant_less_1"]) < 0.5 / 29
    assert found["current_A"] == pytest.approx(15 / 81 / 0.0292)
    assert found["stall_torque_Nm"] == pytest.approx(24 / 0.583 * 0.0292 * 81)
    assert found["speed_rpm"] > 50  # thesis section 7.4: up to 50 rpm, 15 Nm
    # Three areas of eight strips, the largest that of Table 7.2 at 50 % assistance.
    assert found["area_66_mm_mm2"] == pytest.approx(786, rel=0.01)
    assert found["area_printed_mm2"] == 72


def test_a_bundle_gives_the_torque_that_its_radius_was_made_for():
    assert BUNDLE.torque_Nm(2.5) == pytest.approx(15)
    assert BUNDLE.torque_Nm(-1) == 0  # a cable
    assert BUNDLE.strain(0.1) == pytest.approx(0.1 * BUNDLE.radius_mm / 33)


def test_bench_is_force_of_all_strips():
    time, strain = np.arange(5.0), np.linspace(0, 0.05, 5)
    hooke = stored_of(Hooke(), {"equilibrium_stiffness": 4.0})
    force = bench(Law(hooke), Bundle(strips=3, area_mm2=7.0), time, strain)
    np.testing.assert_allclose(force, 21 * 4 * strain)


@pytest.mark.parametrize("friction", [0.0, 0.02])
def test_sample_by_sample_and_scipy_agree(friction):
    chain = Chain(replace(Motor.published(), friction_Nm=friction), BUNDLE)
    goal, load = cycle(150)
    a = walk(chain, goal, load, Law(STRIP), Law(STRIP))
    b = walk_ode(chain, goal, load, Law(STRIP), Law(STRIP))
    # 15 Nm is full scale; friction bends within a sample, which costs some more.
    assert np.max(np.abs(a.torque_Nm - b.torque_Nm)) < (1e-2 if friction else 1e-4)
    assert np.max(np.abs(a.strain - b.strain)) < (1e-4 if friction else 1e-6)


def test_half_the_step_is_four_times_as_near():
    """A motor at a voltage, a spring on it: second order between samples."""
    errors = []
    for parts in (1, 2):
        step = 2e-3 / parts
        chain = Chain(Motor.published(), BUNDLE, Controller(0, 0), step)
        goal, load = cycle(60 * parts, step)
        a = walk(chain, goal, load, Law(STRIP), Law(STRIP))
        b = walk_ode(chain, goal, load, Law(STRIP), Law(STRIP))
        errors.append(np.max(np.abs(a.torque_Nm - b.torque_Nm)))
    assert errors[0] / errors[1] > 3


def test_a_right_model_follows_the_reference_and_a_wrong_one_errs_by_as_much():
    chain = Chain(Motor.published(), BUNDLE)
    goal, load = cycle(1500)
    right = walk(chain, goal, load, Law(STRIP), Law(STRIP))
    np.testing.assert_array_equal(right.torque_Nm, right.estimate_Nm)
    error = np.sqrt(np.mean((right.torque_Nm - goal) ** 2) / np.mean(goal**2))
    assert error < 0.03
    twice = replace(STRIP, stiffness=2 * STRIP.stiffness)
    wrong = walk(chain, goal, load, Law(STRIP), Law(twice))
    np.testing.assert_allclose(wrong.torque_Nm, wrong.estimate_Nm / 2, atol=1e-12)
    assert abs(np.mean(wrong.estimate_Nm - goal)) < 0.3


def test_voltage_stays_within_its_limits_and_does_not_wind_up():
    weak = replace(Motor.published(), voltage_V=3.0)
    goal, load = cycle(1500)
    found = walk(Chain(weak, BUNDLE), goal, load, Law(STRIP), Law(STRIP))
    assert np.max(np.abs(found.voltage_V)) == 3.0


def test_lengths_must_agree():
    both = (Law(STRIP), Law(STRIP))
    with pytest.raises(InputError, match="as many of both"):
        walk(Chain(Motor.published(), BUNDLE), *[np.zeros(n) for n in (3, 2)], *both)


@compiler
def test_a_compiled_strip_is_the_same_strip():
    goal, load = cycle(300)
    chain = Chain(Motor.published(), BUNDLE)
    a = walk(chain, goal, load, Law(STRIP), Law(STRIP))
    one = Compiled(STRIP)
    b = walk(chain, goal, load, Law(STRIP), one)
    np.testing.assert_allclose(a.torque_Nm, b.torque_Nm, atol=1e-9)
    one.reset()
    time, strain = np.arange(50) * 0.01, np.linspace(0, 0.4, 50)
    (want,) = STRIP.stress([""], [Chunk(time, strain)], [None])
    np.testing.assert_allclose(one.run(time, strain), want, rtol=1e-12)
