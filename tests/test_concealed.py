"""The forge against closed forms, and the scorer against cases counted by hand."""

from __future__ import annotations

import ast
import itertools
import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from studies.concealed import (
    forge,
    marching,
    noises,
    oracle,
    orders,
    reporting,
    rivals,
    scoring,
    sealing,
    sensor,
    settings,
    trial,
)
from studies.concealed import unlisted as unlisted_things
from studies.concealed.bases import SKELETONS, Base, draw_base, maxwell
from studies.concealed.planting import (
    Context,
    Planted,
    material_stress,
    run_material,
)
from studies.concealed.programmes import (
    FAMILIES,
    HELD_OUT,
    STEP_S,
    Imposed,
    Pace,
    polyline,
    sample,
)
from studies.concealed.unlisted import UNLISTED

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


def test_unlisted_things_take_turns():
    wanted = orders.plan(5, 1.0, each=0, nulls=0, pairs=0, unlisted=60)
    counts = pd.Series([o.effects[0] for o in wanted]).value_counts()
    assert set(counts.index) == {m.__name__ for m in UNLISTED}
    assert counts.max() - counts.min() <= 1


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


# --- strength -------------------------------------------------------------------------


def planted(name: str, seed: int, strength: float = 1.0) -> tuple[Planted, Context]:
    """An effect planted in unit stiffness; one branch where it needs one."""
    rng = np.random.default_rng(seed)
    base = replace(BASE, branches=((0.5, 2.0),))
    programmes = [
        Imposed(n, s := f(rng, PACE), np.arange(len(s)))
        for n, f in FAMILIES.items()
        if n != "hold"
    ]
    rest = [np.full(len(p.strain), 23.0) for p in programmes]
    stress = run_material(base, (), programmes, rest, False)
    context = Context(rng, strength, base, PACE, programmes, stress)
    make = dict(zip(orders.NAMES, orders.EFFECTS, strict=True))[name]
    return make(context), context


def elastic(effect: Planted, strain: np.ndarray, degC: float = 23.0) -> np.ndarray:
    return material_stress(BASE, [effect], strain, np.full(len(strain), degC))


UP_DOWN = np.concatenate([np.linspace(0, 0.8, 4001), np.linspace(0.8, 0, 4001)[1:]])


def softening(p: Planted, c: Context) -> float:
    again = elastic(p, np.concatenate([UP_DOWN, UP_DOWN[:40]]))[-1] / UP_DOWN[39]
    return 1 - again / (elastic(p, UP_DOWN[:40])[-1] / UP_DOWN[39])


def residual(p: Planted, c: Context) -> float:
    down = elastic(p, UP_DOWN)[4000:]
    return float(np.interp(0, down[::-1], UP_DOWN[4000:][::-1])) / 0.8


def loop(p: Planted, c: Context) -> float:
    stress = elastic(p, UP_DOWN)
    return float(stress[2000] - stress[-2001]) / 2 / c.peak


def cycle_loss(p: Planted, c: Context) -> float:
    many = elastic(p, np.tile(UP_DOWN, 11))
    # Mid-loading of the second cycle and of the eleventh: a decade of cycles.
    first, tenth = many[8000 + 2000], many[80_000 + 2000]
    return float(1 - tenth / first)


def drift_per_hour(p: Planted, c: Context) -> float:
    long = Imposed("hold", np.zeros(75_001), np.arange(75_001))  # 300 s
    drift = p.sensor(0, long, np.zeros(75_001))
    return abs(drift[-1]) * 12 / c.peak


def taut(p: Planted, c: Context) -> float:
    strain = UP_DOWN[:4001]
    programme = Imposed("ramp", strain, np.arange(4001))
    return float(strain[-1] - p.rig(0, programme, strain)[-1]) / PACE.peak


def slipped(p: Planted, c: Context) -> float:
    lost = [
        float((m.strain - p.rig(i, m, m.strain))[-1])
        for i, m in enumerate(c.programmes)
    ]
    assert 0 < np.sum(np.array(lost) > 1e-9) < len(lost)  # in some, not in all
    return max(lost) / PACE.peak


def recorded(p: Planted, c: Context) -> list[np.ndarray]:
    return [
        p.sensor(i, m, s)
        for i, (m, s) in enumerate(zip(c.programmes, c.stress, strict=True))
    ]


def offset(p: Planted, c: Context) -> float:
    moved = [float(r[0] - s[0]) for r, s in zip(recorded(p, c), c.stress, strict=True)]
    assert np.count_nonzero(moved) == round(len(moved) / 3)
    return max(np.abs(moved)) / c.peak


def gain(p: Planted, c: Context) -> float:
    ratio = [r.max() / s.max() for r, s in zip(recorded(p, c), c.stress, strict=True)]
    changed = np.abs(np.array(ratio) - 1)
    assert np.count_nonzero(changed > 1e-9) == round(len(ratio) / 3)
    return float(changed.max())


def clipped(p: Planted, c: Context) -> float:
    return max(float(r.max()) for r in recorded(p, c)) / c.peak


def mean_delay(p: Planted, c: Context) -> float:
    ramp = STEP_S * np.arange(5000)
    return float(ramp[-1] - p.sensor(0, Imposed("", ramp, np.arange(5000)), ramp)[-1])


def inertial(p: Planted, c: Context) -> float:
    moved = [
        np.abs(r - s)[50:-50].max()
        for r, s, m in zip(recorded(p, c), c.stress, c.programmes, strict=True)
        if m.family == "sine"
    ]
    return float(max(moved)) / c.peak


def stiffness_of_extra(p: Planted, c: Context) -> float:
    jump = elastic(p, np.full(2, 1e-6))
    return float(jump[0] / 1e-6 - 1)


def change_of_branch(p: Planted, c: Context) -> float:
    base = replace(BASE, branches=((1.0, 1e9),))
    still = np.full(2, 23.0)

    def tangent(e: float) -> float:
        jump = np.array([e, e + 1e-5])
        if p.form == "amplified":
            return float(
                material_stress(base, [p], jump[:1], still[:1])[0]
                - material_stress(BASE, [], jump[:1], still[:1])[0]
            ) / float(e)
        whole = material_stress(base, [p], jump, still)
        return float((whole[1] - whole[0]) / 1e-5 - 1)

    ratio = tangent(0.8) / tangent(1e-4)
    return max(ratio, 1 / ratio)


def stiffness_ratio(p: Planted, c: Context) -> float:
    tangent = np.gradient(elastic(p, UP_DOWN[:4001]))
    return float(tangent.max() / tangent.min())


def compression_lost(p: Planted, c: Context) -> float:
    return 1 - float(elastic(p, np.full(2, -0.5))[0]) / -0.5


def per_degree(p: Planted, c: Context) -> float:
    warm, cool = (elastic(p, UP_DOWN[:4001], t)[-1] for t in (23.5, 22.5))
    return float((cool - warm) / 0.8)


# What strength 1 means, read off signals: (what, lowest, highest).
STRENGTH = {
    "slack": (taut, 0.02, 0.081),
    "grip_slip": (slipped, 0.06, 0.14),
    "nonlinear_elasticity": (stiffness_ratio, 2.0, 8.0),
    "mullins_softening": (softening, 0.23, 0.51),
    "permanent_set": (residual, 0.05, 0.20),
    "friction_hysteresis": (loop, 0.035, 0.121),
    "relaxation_branch": (stiffness_of_extra, 0.28, 0.71),
    "nonlinear_viscosity": (stiffness_of_extra, 0.69, 1.31),
    "strain_dependent_relaxation": (change_of_branch, 1.98, 3.03),
    "thermal_softening": (per_degree, 0.006, 0.015),
    "cyclic_softening": (cycle_loss, 0.07, 0.17),
    "tension_only": (compression_lost, 0.95, 1.0),
    "inertia": (inertial, 0.035, 0.121),
    "sensor_lag": (mean_delay, 0.118, 0.402),
    "load_cell_drift": (drift_per_hour, 0.42, 1.95),
    "zero_offset": (offset, 0.03, 0.08),
    "gain_error": (gain, 0.06, 0.15),
    "load_cell_saturation": (clipped, 0.68, 0.86),
}


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", STRENGTH)
def test_strength_one_is_what_it_says(name, seed):
    measure, low, high = STRENGTH[name]
    assert low <= measure(*planted(name, seed)) <= high


def test_every_effect_has_its_strength_measured():
    # Finite strain has no size of its own: it is the largest strain that makes it.
    assert set(STRENGTH) == set(orders.NAMES) - {"finite_strain"}


@pytest.mark.parametrize("name", orders.NAMES)
def test_an_effect_vanishes_with_its_strength(name):
    effect, c = planted(name, 1, strength=1e-6)
    rest = [np.full(len(p.strain), 20.0) for p in c.programmes]
    with_it = run_material(c.base, [effect], c.programmes, rest, False)
    for i, (a, b) in enumerate(zip(with_it, c.stress, strict=True)):
        read = effect.sensor(i, c.programmes[i], a) if effect.sensor else a
        np.testing.assert_allclose(read, b, atol=1e-4 * c.peak)


@pytest.mark.parametrize("name", [m.__name__ for m in UNLISTED])
def test_unlisted_things_have_the_stated_size(name):
    answer = forge.forge_case(order("unlisted", (name,), 7)).answer
    share = answer["planted"][name]["parameters"]["share_of_peak"]
    # Those that scale stiffness cannot always reach it: their size is capped.
    size = answer["planted"][name]["parameters"]["size"]
    assert 0.079 <= share <= 0.152 or (size == 0.6 and share < 0.08)


def test_running_mean_and_poles_do_not_look_ahead():
    step = (np.arange(2000) >= 1000).astype(float)
    for seed in range(6):
        effect, _ = planted("sensor_lag", seed)
        read = effect.sensor(0, Imposed("", step, np.arange(2000)), step)
        np.testing.assert_allclose(read[:1000], 0, atol=1e-12)
    assert sensor.low_pass(np.full(10, 3.0), 0.1) == pytest.approx(np.full(10, 3.0))


# --- noise and oracle -----------------------------------------------------------------


@pytest.mark.parametrize("kind", noises.KINDS)
def test_noise_has_the_stated_level(kind):
    rng = np.random.default_rng(5)
    time = np.sort(rng.uniform(0, 4000, 40_000))
    clean = np.abs(np.sin(time / 9))
    noise = noises.Noise(kind, 0.01, 0.3 if kind == "coloured" else 0.0, 3.0)
    error = noise.add(rng, time, clean, 1.0) - clean
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.01, rel=0.03)


def test_coloured_noise_forgets_exponentially_on_an_irregular_clock():
    rng = np.random.default_rng(6)
    time = np.cumsum(rng.uniform(0.05, 0.4, 200_000))
    noise = noises.Noise("coloured", 1.0, 0.3, 1.0)
    error = noise.add(rng, time, np.zeros_like(time), 1.0)
    gap = np.diff(time)
    for low, high in ((0.05, 0.1), (0.2, 0.25), (0.35, 0.4)):
        near = (gap > low) & (gap < high)
        found = np.mean(error[:-1][near] * error[1:][near])
        assert found == pytest.approx(np.mean(np.exp(-gap[near] / 0.3)), abs=0.02)
    white = oracle.whiten(error[:, np.newaxis], [time], 0.3)[:, 0]
    assert np.std(white) == pytest.approx(1, abs=0.01)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.01


def test_oracle_power_is_that_of_a_normal_test():
    edge = norm.ppf(1 - oracle.FALSE_ALARM / 2)
    for energy in (0.0, 2.0, 9.0, 30.0):
        shift = np.sqrt(energy)
        exact = norm.sf(edge - shift) + norm.cdf(-edge - shift)
        assert oracle.power(energy, 1) == pytest.approx(exact, rel=1e-6)


def test_oracle_sees_only_what_the_base_cannot_move():
    rng = np.random.default_rng(2)
    strain = FAMILIES["growing"](rng, PACE)
    p = Imposed("growing", strain, np.arange(0, len(strain), 10))
    refit = oracle.refit("pl-wiechert", [p], [np.zeros(0)], [2.0])
    time, sigma = [p.time_s[p.index]], np.full(len(p.index), 0.01)
    inside = (maxwell(strain, 2.0) + np.clip(strain, 0, strain.max() / 2))[p.index]
    still = np.zeros_like(inside)
    seen = oracle.visible_energy(refit, still, inside, time, sigma, 0.0)
    assert seen < 1e-6 * np.sum((inside / sigma) ** 2)
    outside = rng.standard_normal(len(p.index))
    seen = oracle.visible_energy(None, still, outside, time, sigma, 0.0)
    assert seen == pytest.approx(np.sum((outside / sigma) ** 2))
    # One branch cannot be two, though each alone is one that it could be.
    one = oracle.refit("pl-sls", [p], [np.zeros(0)], [2.0, 20.0])
    two = maxwell(strain, 2.0)[p.index], maxwell(strain, 20.0)[p.index]
    assert oracle.visible_energy(one, *two, time, sigma, 0.0) > 100
    assert oracle.visible_energy(one, two[0], 0.5 * two[0], time, sigma, 0.0) < 1e-3
    left = oracle.absorb(refit, inside, sigma)
    assert np.sqrt(np.mean(left**2)) < 1e-6
    # Beside another effect: what a bend of that, or a lag, could be is not seen.
    able = oracle.bent(None, [outside], [p])
    for bend in (outside * strain[p.index] ** 2, np.r_[[outside[0]] * 3, outside[:-3]]):
        assert oracle.visible_energy(able, still, bend, time, sigma, 0.0) < 1e-3
    assert oracle.visible_energy(able, still, inside, time, sigma, 0.0) > 1e4


# --- cases ----------------------------------------------------------------------------


def order(group: str, effects: tuple[str, ...], number: int = 0) -> orders.Order:
    return orders.Order("case-0001", group, effects, 1.0, 11, number)


@pytest.mark.parametrize("number", range(6))
def test_nothing_is_missing_from_a_null(number):
    answer = forge.forge_case(order("null", (), number)).answer
    # What a refit leaves of the clean stress drowns in the noise, everywhere.
    assert answer["left_nrmse"] < 0.06 * answer["noise_nrmse"]
    assert not any(answer["left"])
    assert not any(answer["acts"])


@pytest.fixture(scope="module")
def forged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("forged")
    wanted = orders.plan(
        12,
        1.0,
        each=1,
        nulls=2,
        pairs=1,
        unlisted=1,
        only=["mullins_softening", "thermal_softening"],
        dirty=0.5,
    )
    sealing.write_cases(wanted, folder)
    return folder, wanted


def test_a_case_shows_nothing_but_the_recordings(forged):
    folder, wanted = forged
    answers = sealing.open_key(folder)
    assert len(answers) == len(wanted) == 6
    assert {p.name for p in folder.iterdir()} == {"cases", "sealed", "seal.json"}
    for answer in answers:
        case = folder / "cases" / answer["case"]
        assert {p.name for p in case.iterdir()} == {"recordings", "case.toml"}
        told = tomllib.loads((case / "case.toml").read_text())
        assert set(told) <= {"model", "history", "specimen"}
        assert ("model" in told) != answer["simulated"]
        files = sorted((case / "recordings").iterdir())
        assert [f.stem for f in files] == [r["name"] for r in answer["recordings"]]
        written, clean = [], []
        for file, r in zip(files, answer["recordings"], strict=True):
            table = pd.read_csv(file)
            assert len(table) == r["samples"]
            assert 250 <= len(table) <= 3100
            assert (np.diff(table.time_s) > 0).all()
            assert set(table) <= {
                "time_s",
                "strain",
                "stress_MPa",
                "temperature_C",
                "simulated_MPa",
            }
            assert answer["dirty"] == bool(table.stress_MPa.isna().any())
            written.append(table.stress_MPa.to_numpy())
            clean.append(r["clean_MPa"])
        left = np.concatenate(written) - np.concatenate(clean)
        sigma = answer["noise"]["sigma_MPa"]
        assert np.sqrt(np.nanmean(left**2)) == pytest.approx(sigma, rel=0.15)
        assert sigma == pytest.approx(
            answer["noise"]["level"] * np.ptp(np.concatenate(clean)), rel=1e-4
        )


def test_the_key_is_refused_when_it_has_been_touched(forged, tmp_path):
    folder, wanted = forged
    again = tmp_path / "again"
    seal = sealing.write_cases(wanted, again)
    assert seal == json.loads((folder / "seal.json").read_text())["key_sha256"]
    (again / "sealed" / "key.json.gz").write_bytes(b"other")
    with pytest.raises(ValueError, match="the key has SHA-256"):
        sealing.open_key(again)
    with pytest.raises(FileExistsError, match="is not empty"):
        sealing.write_cases(wanted, again)


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing(forged, tmp_path):
    folder, wanted = forged
    seal = sealing.write_cases(wanted, tmp_path / "two", jobs=2)
    assert seal == json.loads((folder / "seal.json").read_text())["key_sha256"]


def test_the_unseen_programme_is_the_same_specimen_again():
    one = order("single", ("nonlinear_viscosity",), 4)
    _, setting, effects = forge.draw_case(one)
    kept = forge.unseen(one, setting, effects)
    assert kept is not None
    strain = FAMILIES_AND_HELD_OUT["zigzag"](
        np.random.default_rng([one.seed, one.number, 1]), setting.pace
    )
    stress = material_stress(setting.base, effects, strain, np.zeros(len(strain)))
    index = np.round(np.array(kept["time_s"]) / STEP_S).astype(int)
    np.testing.assert_allclose(kept["clean_MPa"], stress[index], rtol=1e-6)
    assert forge.unseen(order("single", ("slack",)), setting, effects) is None


def test_a_continued_history_is_one_history():
    rng = np.random.default_rng(1)
    strains = [f(rng, PACE) for f in (FAMILIES["sine"], FAMILIES["growing"])]
    programmes = [Imposed("", s, np.arange(len(s))) for s in strains]
    rest = [np.full(len(s), 23.0) for s in strains]
    base = replace(BASE, branches=((0.7, 20.0),))
    parts = run_material(base, (), programmes, rest, continued=True)
    whole = base.spring(np.concatenate(strains))
    whole = whole + 0.7 * maxwell(np.concatenate(strains), 20.0)
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)
    fresh = run_material(base, (), programmes, rest, continued=False)
    np.testing.assert_array_equal(fresh[0], parts[0])
    assert np.abs(fresh[1] - parts[1]).max() > 0.01


@pytest.mark.slow
@pytest.mark.parametrize("name", orders.NAMES)
def test_planted_effects_can_be_seen_at_a_third_of_the_strength(name):
    power = [
        forge.forge_case(replace(order("single", (name,), n), strength=0.3)).answer[
            "planted"
        ][name]["oracle_power"]
        for n in range(4)
    ]
    assert np.mean(power) > 0.7


def test_rivals_that_can_be_told_apart_and_one_that_cannot():
    # An offset in some recordings is a far cry from softening.
    one = order("single", ("zero_offset",), 3)
    answer = forge.forge_case(one).answer
    power = rivals.distinct_power(one, answer)
    assert "zero_offset" not in power
    assert power["mullins_softening"] > 0.99
    assert list(power.values()) == sorted(power.values())
    # Nothing at all can be told from anything: only false alarms are left.
    nothing = order("null", (), 3)
    power = rivals.distinct_power(nothing, forge.forge_case(nothing).answer)
    assert max(power.values()) < 0.02


def test_an_answer_can_be_forged_again(forged):
    folder, wanted = forged
    assert [orders.order_of(a) for a in sealing.open_key(folder)] == wanted


def test_no_pair_excludes_itself():
    names = {n for bad in orders.NOT_TOGETHER for n in bad}
    assert names <= set(orders.NAMES)
    wanted = orders.plan(1, 1.0, each=0, nulls=0, pairs=40, unlisted=0)
    assert len({o.effects for o in wanted}) == 40
    for one, two in itertools.combinations(wanted, 2):
        assert set(one.effects) != set(two.effects)


def test_the_forge_knows_nothing_of_softnn():
    folder = Path(forge.__file__).parent
    for file in folder.glob("*.py"):
        tree = ast.parse(file.read_text())
        imported = [
            name
            for node in ast.walk(tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for name in (
                [node.module or ""]
                if isinstance(node, ast.ImportFrom)
                else [a.name for a in node.names]
            )
        ]
        knows = [n for n in imported if n.split(".")[0] == "softnn"]
        assert not knows or file.name in ("trial.py", "reporting.py"), (
            f"{file.name} imports {knows}"
        )


# --- scoring --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("right", "of", "low", "high"),
    # Newcombe (1998), doi:10.1002/(SICI)1097-0258(19980430)17:8<857::AID-SIM777>3.0
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_intervals_as_published(right, of, low, high):
    assert scoring.wilson(right, of) == pytest.approx((low, high), abs=5e-5)


def answer_of(
    group: str, *effects: str, power: float = 1.0, beside: float = 1.0
) -> dict:
    return {
        "case": "c",
        "group": group,
        "effects": list(effects),
        "planted": {
            e: {"oracle_power": power, "power_beside": beside} for e in effects
        },
        "recordings": [{"name": "recording-01", "samples": 10}],
        "acts": [[[2, 6]]],
        "left": [[]],
        "noise": {"kind": "white", "level": 0.01, "sigma_MPa": 0.003},
        "unseen": {"clean_MPa": [1.0, 2.0]} if group == "single" else None,
        "noise_nrmse": 0.02,
        "left_nrmse": 0.015,
        "dirty": False,
        "simulated": False,
        "history": "fresh",
    }


def said(
    verdict: str,
    *selected: str,
    chance: float = 0.9,
    mismatch=(),
    base: float = 0.1,
    after: float = 0.03,
) -> dict:
    return {
        "verdict": verdict,
        "selected": list(selected),
        "explanations": [
            {"effect": s, "probability": chance, "equivalent": ["slack"]}
            for s in selected
        ],
        "mismatch": list(mismatch),
        "fit": {
            "before": {"nrmse": base},
            "after": {"nrmse": after, "heldout_nrmse": 0.021},
        },
    }


def test_what_counts_as_right():
    one = answer_of("single", "zero_offset")
    assert scoring.right(one, said("explained", "zero_offset"))
    assert scoring.right(one, said("partly_explained", "zero_offset"))
    assert not scoring.right(one, said("undetermined", "zero_offset"))
    assert not scoring.right(one, said("explained", "zero_offset", "slack"))
    two = answer_of("pair", "zero_offset", "slack")
    assert scoring.right(two, said("explained", "slack", "zero_offset"))
    assert not scoring.right(two, said("explained", "slack"))
    null = answer_of("null")
    assert scoring.right(null, said("nothing_missing"))
    assert not scoring.right(null, said("undetermined"))
    other = answer_of("unlisted", "hum")
    assert scoring.right(other, said("unexplained"))
    assert scoring.right(other, said("partly_explained", "slack", chance=0.3))
    assert not scoring.right(other, said("partly_explained", "slack", chance=0.6))
    for answer in (one, two, null, other):
        assert not scoring.right(answer, scoring.ABSENT)


def test_region_f1_by_hand():
    answer = answer_of("single", "slack")
    times = {"recording-01": np.arange(10.0)}
    # Truth is samples 2-5; found is 4-8: two shared, two missed, three too many.
    region = {"recording": "recording-01", "start_s": 3.5, "end_s": 8.0}
    d = said("explained", "slack", mismatch=[region])
    assert scoring.region_f1(answer, d, times) == pytest.approx(4 / 9)
    assert scoring.region_f1(answer, d, times, "left") is None


def test_scores_counted_by_hand():
    cases = [
        (answer_of("single", "zero_offset"), said("explained", "zero_offset")),
        (answer_of("single", "zero_offset"), said("explained", "gain_error")),
        (answer_of("single", "slack"), said("explained", "zero_offset")),
        (answer_of("single", "inertia"), said("explained", "inertia", "gain_error")),
        (answer_of("single", "slack", power=0.2), said("nothing_missing")),
        (answer_of("null"), said("nothing_missing")),
        (answer_of("null"), said("explained", "slack")),
        (answer_of("unlisted", "hum"), said("unexplained")),
        (answer_of("pair", "slack", "inertia"), scoring.ABSENT),
    ]
    answers = [{**a, "case": str(i)} for i, (a, _) in enumerate(cases)]
    diagnoses = {str(i): d for i, (_, d) in enumerate(cases)}
    times = {str(i): {"recording-01": np.arange(10.0)} for i in range(len(cases))}
    # The error of 0.004 and the noise of 0.003 make 0.005.
    simulated = {"0": np.array([1.004, 1.996])}
    found = scoring.score(answers, diagnoses, times, simulated)
    assert found["groups"]["single"]["right"] == 1
    assert found["groups"]["single"]["of"] == 5
    assert found["groups"]["null"]["rate"] == 0.5
    assert found["effects"]["zero_offset"]["rate"] == 0.5
    assert found["confusion"]["zero_offset"] == {"zero_offset": 1, "gain_error": 1}
    assert found["confusion"]["slack"] == {"zero_offset": 1, "nothing_missing": 1}
    assert found["confusion"]["inertia"] == {"it and more": 1}
    assert found["power"] == pytest.approx((2 / 5) / ((4 + 0.2) / 5))
    assert found["unseen_over_floor"] == pytest.approx(5 / 3)
    assert found["unseen_of"] == 1
    assert found["unlisted_noticed"]["rate"] == 1
    assert found["heldout_over_floor"] == pytest.approx(0.021 / 0.02)
    causes = {m["case"]: m["cause"] for m in found["misses"]}
    assert causes == {
        "1": "another effect named",
        "2": "listed as equivalent to what was named",
        "3": "right, and more",
        "4": "not visible in these recordings, the oracle's power is below 0.8",
        "6": "something named where nothing is missing",
        "8": "no diagnosis was written",
    }


@pytest.mark.parametrize(
    ("answer", "diagnosis", "cause"),
    [
        (
            answer_of("pair", "friction_hysteresis", "inertia", beside=0.3),
            said("explained", "inertia"),
            "one of two, in whose forms the other is lost, says the oracle",
        ),
        (
            answer_of("pair", "friction_hysteresis", "inertia", beside=0.9),
            said("explained", "inertia"),
            "one of two found",
        ),
        # Noise is 0.02 in these cases.
        (
            answer_of("unlisted", "hum"),
            said("explained", "slack", after=0.0201),
            "on no list, but what was named leaves no more than noise",
        ),
        (
            answer_of("unlisted", "hum"),
            said("explained", "slack", after=0.0204),
            "confident name for something on no list",
        ),
    ],
)
def test_a_miss_says_whether_the_other_could_be_seen(answer, diagnosis, cause):
    times = {"c": {"recording-01": np.arange(10.0)}}
    (miss,) = scoring.score([answer], {"c": diagnosis}, times, {})["misses"]
    assert miss["cause"] == cause


def test_concealed_is_what_the_base_alone_hides():
    cases = [
        (answer_of("single", "slack"), said("explained", "slack", base=0.04)),
        (answer_of("single", "slack"), said("explained", "slack", base=0.06)),
        (answer_of("single", "slack"), said("nothing_missing", base=0.01)),
        # Right, and more: named, but not right.
        (
            answer_of("single", "inertia"),
            said("explained", "inertia", "slack", base=0.049),
        ),
        # Without a diagnosis: 0.015 left by the key's refit and 0.02 of noise, 0.025.
        (answer_of("single", "inertia"), scoring.ABSENT),
        (answer_of("null"), said("nothing_missing", base=0.02)),
    ]
    answers = [{**a, "case": str(i)} for i, (a, _) in enumerate(cases)]
    times = {str(i): {"recording-01": np.arange(10.0)} for i in range(len(cases))}
    diagnoses = {str(i): d for i, (_, d) in enumerate(cases)}
    found = scoring.score(answers, diagnoses, times, {})["concealment"]
    assert found["cases"][4]["base_nrmse"] == pytest.approx(0.025)
    slack, inertia = found["effects"]["slack"], found["effects"]["inertia"]
    assert (slack["accepted"]["right"], slack["accepted"]["of"]) == (2, 3)
    assert (slack["named"]["right"], slack["named"]["of"]) == (1, 2)
    assert (inertia["named"]["right"], inertia["right"]["right"]) == (1, 0)
    single = found["groups"]["single"]
    assert (single["right"]["right"], single["right"]["of"]) == (1, 4)
    assert single["right"]["high"] == pytest.approx(scoring.wilson(1, 4)[1])
    assert found["groups"]["null"]["accepted"]["rate"] == 1


def test_a_case_is_made_at_any_level_of_noise():
    # No bent spring is good enough beside noise as small as that.
    springs: dict[float, list[str]] = {1e-6: [], 0.01: []}
    for level, names in springs.items():
        for number in range(12):
            one = replace(order("single", ("slack",), number), level=level)
            rng = np.random.default_rng([one.seed, one.number])
            names.append(settings.draw_setting(rng, one).base.name)
    assert set(springs[1e-6]) == {"linear"}
    assert set(springs[0.01]) > {"linear"}


@pytest.mark.parametrize("colour", [0.0, 0.1, 1.0])
def test_prescribed_noise_is_as_prescribed(colour):
    one = replace(order("single", ("zero_offset",), 7), level=0.005)
    one = replace(one, correlation_s=colour)
    forged = forge.forge_case(one)
    clean, left = [], []
    by_step = []
    for r in forged.answer["recordings"]:
        table = forged.tables[r["name"]]
        noise = table.stress_MPa.to_numpy() - np.array(r["clean_MPa"])
        step = np.diff(table.time_s)
        keep = np.exp(-step / colour) if colour else np.zeros_like(step)
        by_step.append(noise[1:] * noise[:-1] - keep * noise[:-1] ** 2)
        clean.append(r["clean_MPa"])
        left.append(noise)
    sigma = 0.005 * np.ptp(np.concatenate(clean))
    assert np.sqrt(np.mean(np.concatenate(left) ** 2)) == pytest.approx(sigma, rel=0.2)
    # Neighbours correlate as exp(-step / time), whatever the step.
    products = np.concatenate(by_step) / sigma**2
    assert abs(products.mean()) < 4 / np.sqrt(len(products))
    assert orders.order_of(forged.answer) == one
    # The same material and effect at any noise: only what is drawn last differs.
    other = forge.forge_case(replace(one, correlation_s=None))
    assert (
        other.answer["planted"]["zero_offset"]["parameters"]
        == (forged.answer["planted"]["zero_offset"]["parameters"])
    )


@pytest.mark.parametrize(
    ("group", "effects", "number", "total_MPa", "samples"),
    # Written down before noise could be prescribed.
    [
        ("null", (), 1, 15380.9951717909, 6607),
        ("single", ("gain_error",), 2, 4617.0241284538, 12560),
        ("pair", ("slack", "mullins_softening"), 3, 847.4500759396, 9737),
    ],
)
def test_seeds_forge_what_they_always_forged(
    group, effects, number, total_MPa, samples
):
    tables = forge.forge_case(order(group, effects, number)).tables.values()
    assert sum(map(len, tables)) == samples
    total = sum(float(t.stress_MPa.abs().sum()) for t in tables)
    assert total == pytest.approx(total_MPa, rel=1e-9)


@pytest.mark.slow
def test_a_perfect_diagnosis_meets_every_bar(forged, tmp_path, monkeypatch):
    """The whole way from the key to the report, with diagnoses written by the key."""
    folder, _ = forged
    monkeypatch.setattr(reporting, "RUNS", tmp_path)
    for answer in sealing.open_key(folder):
        listed = answer["group"] in ("single", "pair")
        verdict = "explained" if listed else "unexplained"
        mismatch = []
        times = scoring.read_times(answer, folder / "cases")
        for r, spans in zip(answer["recordings"], answer["acts"], strict=True):
            for start, end in spans:
                t = times[r["name"]]
                mismatch.append(
                    {"recording": r["name"], "start_s": t[start], "end_s": t[end - 1]}
                )
        told = said(
            "nothing_missing" if answer["group"] == "null" else verdict,
            *(answer["effects"] if listed else ()),
            mismatch=mismatch,
        )
        told["fit"]["before"]["nrmse"] = 0.03
        told["fit"]["after"]["heldout_nrmse"] = answer["noise_nrmse"]
        place = folder / "diagnoses" / answer["case"]
        place.mkdir(parents=True)
        (place / "diagnosis.json").write_text(json.dumps(told))
    record = {
        "label": "strength-1",
        "strength": 1.0,
        "seed": 12,
        "published": False,
        "smoke": True,
        "cases": 6,
        "jobs": 1,
        "key_sha256": json.loads((folder / "seal.json").read_text())["key_sha256"],
        "seconds_alone": 1.0,
    }
    trial.write_record(folder, record)
    assert trial.main(["--score-only", str(folder)]) == 0
    result = json.loads((folder / "concealed.json").read_text())
    bars = result["trials"]["strength-1"]["bars"]
    assert len(bars) == 10
    # There is no model to simulate, so nothing is said about the unseen programme.
    assert [b["key"] for b in bars if b["met"] is None] == ["unseen_over_floor"]
    assert all(b["met"] for b in bars if b["met"] is not None), bars
    assert result["headline"]["strength-1/single_right"] == 1
    assert (folder / "concealed-strength-1.png").stat().st_size > 5000
    assert (tmp_path / "smoke" / "mlflow.db").exists()


def test_the_command_forges_and_refuses(tmp_path, capsys):
    where = str(tmp_path / "f")
    small = ["--cases", "1", "--only", "slack", "--nulls", "0", "--pairs", "0"]
    small += ["--unlisted", "0", "--jobs", "1"]
    assert trial.main(["--forge-only", where, *small]) == 0
    assert "1 cases in" in capsys.readouterr().out
    assert trial.main(["--forge-only", where, *small]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert trial.main(["--forge-only", where, "--only", "magic"]) == 2
    assert "no effect is called 'magic'" in capsys.readouterr().err
