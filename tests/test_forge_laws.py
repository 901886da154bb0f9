"""The laws and programmes of the forge against closed forms."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from bench.concealed import marching
from bench.concealed import unlisted as unlisted_things
from bench.concealed.bases import SKELETONS, Base, draw_base, maxwell
from bench.concealed.planting import Context, material_stress
from bench.concealed.programmes import (
    FAMILIES,
    HELD_OUT,
    STEP_S,
    Imposed,
    Pace,
    polyline,
    sample,
)
from bench.concealed.unlisted import UNLISTED

FAMILIES_AND_HELD_OUT = FAMILIES | HELD_OUT
PACE = Pace(peak=0.8, ramp_s=3.0, corner_s=0.2, cycle_hz=0.5)
BASE = Base("linear", {}, 1.0, 0.8, ())  # stress is strain: sizes are read off it


# --- integrators ----------------------------------------------------------------------


@pytest.mark.parametrize("time", [0.1, 1.0, 30.0])
def test_branch_relaxes_and_ramps_as_the_closed_form(time):
    t = STEP_S * np.arange(20_000)
    step = maxwell(np.ones_like(t), time)
    # The step is felt half a clock step early or late: that is the tolerance.
    np.testing.assert_allclose(step, np.exp(-t / time), atol=0.6 * STEP_S / time)
    ramp = maxwell(0.3 * t, time)
    np.testing.assert_allclose(ramp, 0.3 * time * -np.expm1(-t / time), rtol=1e-3)


def test_flow_laws_reduce_to_a_maxwell_branch():
    strain = polyline([(3, 0.8), (5, 0.8), (3, 0.0)], 0.2)
    exact = 2.0 * maxwell(strain, 4.0)
    linear = marching.flowing(strain, 2.0, marching.CARREAU, 1.0, 4.0, 0.0)
    np.testing.assert_allclose(linear, exact, atol=2e-3 * exact.max())
    small = 1e-4 * strain
    slow = marching.flowing(small, 2.0, marching.CARREAU, 1.0, 4.0, 1.5)
    np.testing.assert_allclose(slow, 1e-4 * exact, atol=2e-7 * exact.max())


def test_steady_flow_stress_solves_the_flow_law():
    # At a constant rate the stress settles where the dashpot takes all of it.
    strain = 0.05 * STEP_S * np.arange(60_000)
    for law, power in ((marching.CARREAU, 1.2), (marching.GAROFALO, 2.0)):
        last = marching.flowing(strain, 2.0, law, 0.1, 20.0, power)[-1]
        assert marching.flow_rate(last, law, 0.1, 20.0, power) == pytest.approx(
            2.0 * 0.05, rel=1e-6
        )


def test_finite_branch_is_maxwell_at_small_strain_and_exact_in_a_step():
    strain = 1e-4 * polyline([(3, 0.8), (5, 0.8), (3, 0.0)], 0.2)
    finite = marching.neo_hookean_branch(1 + strain, 1.5, 4.0)
    np.testing.assert_allclose(finite, 1.5 * maxwell(strain, 4.0), atol=4e-8)
    jump = marching.neo_hookean_branch(np.full(2, 1.8), 3.0, 1e6)
    assert jump[0] == pytest.approx(1.8**2 - 1 / 1.8, rel=1e-5)


def test_dahl_with_exponent_one_is_exponential():
    x = np.linspace(0, 0.2, 4001)
    force = marching.dahl(x, 0.5, 0.03, 1.0)
    np.testing.assert_allclose(force, -0.5 * np.expm1(-x / 0.03), atol=0.005)


def test_sliders_obey_masing():
    # Unloading from any point is the first loading doubled in both directions.
    yields = np.full(40, 0.5 / 40)
    stiffness = yields / np.linspace(0.005, 0.1, 40)
    up = np.linspace(0, 0.06, 601)
    force = marching.iwan(np.concatenate([up, up[-2::-1]]), stiffness, yields)
    first, back = force[:601], force[600:]
    np.testing.assert_allclose(back[::2][:300], first[600] - 2 * first[:300], atol=1e-9)
    assert marching.iwan(np.linspace(0, 1, 1000), stiffness, yields)[-1] == (
        pytest.approx(0.5)
    )


def test_skeletons_reduce_to_neo_hooke():
    x = np.linspace(0.8, 2.0, 50)
    neo = x - x**-2
    for name, shape, factor in (
        ("mooney-rivlin", {"c": 0.0}, 1.0),
        ("yeoh", {"c2": 0.0, "c3": 0.0}, 1.0),
        ("gent", {"limit": 1e12}, 1.0),
        ("demiray", {"b": 0.0}, 1.0),
        ("arruda-boyce", {"lock": 1e9}, 0.5),
        ("ogden", {"a": 2.0, "b": 4.0, "w": 0.0}, 0.5),
    ):
        np.testing.assert_allclose(SKELETONS[name][0](x, shape), factor * neo, 1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_modulus_is_the_secant_at_the_largest_strain(seed):
    base = draw_base(np.random.default_rng(seed), 0.7, linear=False, branches=3)
    assert base.spring(np.array([0.7]))[0] == pytest.approx(0.7 * base.modulus)
    assert base.spring(np.zeros(1))[0] == pytest.approx(0, abs=1e-12)


# --- what is on no list ---------------------------------------------------------------


def test_structure_breaks_only_above_the_yield_stress_and_recovers_at_rest():
    rebuild, breaking = np.array([5.0, 80.0]), np.array([1.0, 0.1])
    n = round(20 / STEP_S)
    below = marching.structure(np.full(n, 0.99), rebuild, breaking)
    np.testing.assert_allclose(below, 1)
    stress = np.concatenate([np.full(n, -3.0), np.zeros(n)])
    broken, rest = np.split(marching.structure(stress, rebuild, breaking), 2)
    assert (np.diff(broken) <= 1e-15).all()
    assert broken[-1] < 0.5
    assert (np.diff(rest) >= 0).all()
    assert rest[-1] < 1
    # One population at rest: broken bonds vanish as in a second-order reaction.
    one = marching.structure(stress, rebuild[:1], breaking[:1])
    start, t = 1 - one[n - 1], STEP_S * np.arange(1, n + 1)
    np.testing.assert_allclose(1 - one[n:], 1 / (1 / start + t / 5), rtol=1e-3)


def test_pore_fluid_diffuses_and_leaves_faster_than_it_enters():
    n = round(60 / STEP_S)
    drawn = marching.pore_suction(np.full(n, 1.0), 30.0, 12.0, 0.0)
    # At first with the root of time, at last exponentially, both known of a slab.
    t = STEP_S * np.arange(1, n + 1)
    mean = 1 - np.sqrt(16 * t / (np.pi * np.pi**2 * 30.0))
    early = (t > 0.3) & (t < 3)
    np.testing.assert_allclose(drawn[early], mean[early], atol=0.03)
    assert drawn[-1] == pytest.approx(8 / np.pi**2 * np.exp(-2), rel=1e-6)
    pressed = -marching.pore_suction(np.full(n, -1.0), 30.0, 12.0, 0.0)
    np.testing.assert_allclose(pressed[: n // 12], drawn[11::12][: n // 12], atol=1e-12)
    closed = marching.pore_suction(np.full(n, 1.0), 30.0, 12.0, 2.0)
    assert (closed > drawn).all()


def test_a_joint_peels_once_and_bonds_again_only_when_closed():
    up = np.linspace(0, 0.6, 3001)
    first = marching.tack(up, 0.05, 4.0)
    assert first.max() == pytest.approx(1, abs=0.01)
    assert up[first.argmax()] == pytest.approx(0.05, abs=1e-3)
    assert first[-1] < 1e-3
    peaks = [
        marching.tack(np.concatenate([up, np.zeros(round(s / STEP_S)), up]), 0.05, 4.0)[
            len(up) :
        ].max()
        for s in (0.0, 4.0, 40.0)
    ]
    assert peaks[0] < 0.1
    assert peaks[1] == pytest.approx(-np.expm1(-1), abs=0.03)
    assert peaks[2] == pytest.approx(1, abs=0.02)


def test_static_friction_grows_with_the_logarithm_of_rest():
    def peak(rest_s):
        travel = np.linspace(0, 0.2, 20_001)
        rest = np.zeros(round(rest_s / STEP_S))
        return marching.stiction(np.concatenate([rest, travel]), 0.03, 1.0).max()

    peaks = [peak(s) for s in (100.0, 1000.0, 10_000.0)]
    assert peaks[2] - peaks[1] == pytest.approx(peaks[1] - peaks[0], rel=0.1)
    # On the way it settles where contacts are made as fast as they are lost.
    steady = marching.stiction(0.1 * STEP_S * np.arange(20_000), 0.03, 1.0)[-1]
    assert steady == pytest.approx(np.log1p(0.03 / 0.1), rel=0.02)


def unlisted(name: str, strain: np.ndarray, size: float = 0.1) -> np.ndarray:
    """Stress under `strain` over the bare one, of a branchless linear base (n,)."""
    programme = Imposed("", strain, np.arange(len(strain)))
    stress = BASE.spring(strain)
    c = Context(np.random.default_rng(3), 1.0, BASE, PACE, [programme], [stress])
    effect = {m.__name__: m for m in UNLISTED}[name](c, size)
    stress = material_stress(BASE, [effect], strain, np.full(len(strain), 20.0))
    if effect.sensor:
        stress = effect.sensor(0, programme, stress)
    return stress / np.where(strain == 0, np.inf, strain)


def test_damage_accelerates_and_never_heals():
    loaded, rest = (round(s / STEP_S) for s in (60, 60))
    cycle = np.concatenate([np.full(loaded, 0.8), np.full(rest, 1e-6)])
    sound = unlisted("creep_damage", np.tile(cycle, 3), 0.2)
    assert (np.diff(sound) <= 1e-12).all()
    np.testing.assert_allclose(np.diff(sound[loaded : loaded + rest]), 0, atol=1e-12)
    lost = [a - b for a, b in itertools.pairwise([1, *sound[loaded - 1 :: 2 * loaded]])]
    assert lost[0] < lost[1] < lost[2]


def test_heat_comes_with_work_and_leaves_at_rest():
    hold = np.full(round(400 / STEP_S), 0.4)
    back_and_forth = 0.4 + 0.3 * np.sin(2 * np.pi * STEP_S * np.arange(20_000))
    factor = unlisted("self_heating", np.concatenate([hold, back_and_forth, hold]))
    n = len(hold)
    assert factor[n - 1] > 0.99
    assert factor[n + 20_000] < 0.93
    assert (np.diff(factor[n + 20_000 :]) >= 0).all()
    assert factor[-1] > 0.999


def test_a_leadscrew_errs_by_turns_from_where_it_stood():
    strain = np.linspace(0, PACE.peak, 40_001)
    programme = Imposed("", strain, np.arange(len(strain)))
    for seed in range(5):
        c = Context(np.random.default_rng(seed), 1.0, BASE, PACE, [programme], [strain])
        screw = unlisted_things.leadscrew(c, 0.01)
        off = screw.rig(0, programme, strain) - strain
        assert off[0] == 0
        turn = round(len(strain) * screw.parameters["pitch"] / PACE.peak)
        swings = [np.ptp(t) for t in np.split(off, range(turn, len(off), turn))[:-1]]
        assert 0.005 * PACE.peak < max(swings) < 0.021 * PACE.peak
        # Skewed: the steepest way down is not that of the way up.
        slope = np.diff(off)
        assert -slope.min() < 0.7 * slope.max() or slope.max() < 0.7 * -slope.min()
        # Worn: a turn in one place errs by more than in another.
        if len(swings) > 3:
            assert max(swings) > 1.1 * min(swings)


def test_curing_goes_with_the_logarithm_of_time():
    t = STEP_S * np.arange(round(1000 / STEP_S))
    ripple = 0.1 * np.sin(2 * np.pi * t)
    stress = unlisted("curing", ripple) * ripple
    moving = np.abs(np.diff(ripple)) > 1e-4
    tangent = np.diff(stress)[moving] / np.diff(ripple)[moving]
    at = [float(np.interp(s, t[1:][moving], tangent)) for s in (40, 200, 1000)]
    assert at[2] - at[1] == pytest.approx(at[1] - at[0], rel=0.1)
    assert at[0] > 1
    # Bonds are born at rest: what is held still knows nothing of them.
    held = unlisted("curing", np.full(1000, 0.5))
    np.testing.assert_allclose(held, 1, atol=1e-9)


def test_lost_blocks_shift_the_force_and_leave_it_alone_at_rest():
    rise = polyline([(20, 0.8), (20, 0.0)], 0.2)
    late = unlisted("lost_blocks", rise, 0.2) * rise
    assert late.max() == pytest.approx(0.8, rel=0.01)
    early = slice(0, round(0.05 * len(rise)))
    np.testing.assert_allclose(late[early], rise[early], atol=1e-12)
    assert np.abs(late - rise).max() > 0.01


# --- programmes -----------------------------------------------------------------------


@pytest.mark.parametrize("family", [*FAMILIES, *HELD_OUT])
@pytest.mark.parametrize("compress", [0.0, -0.2])
def test_programmes_start_and_end_at_rest(family, compress):
    pace = replace(PACE, compress=compress)
    rng = np.random.default_rng(3)
    strain = FAMILIES_AND_HELD_OUT[family](rng, pace)
    assert strain[0] == 0
    assert abs(strain[-1]) < 1e-9
    assert 0.3 * pace.peak < strain.max() <= pace.peak * (1 + 1e-9)
    assert strain.min() >= pace.peak * compress - 1e-9
    # No corner is sharper than the machine's power allows.
    assert np.abs(np.diff(strain)).max() < 0.05 * pace.peak
    for clock in ("steady", "two-speed", "jittered", "gappy"):
        index = sample(rng, strain, 500, clock)
        assert index[0] == 0
        assert (np.diff(index) > 0).all()
        assert index[-1] < len(strain)
        assert 250 <= len(index) <= 520
