"""Strength, noise and oracle of the forge are what they are said to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from forge_made import BASE, PACE, order
from scipy.stats import norm

from bench.concealed import (
    forge,
    noises,
    oracle,
    orders,
    sensor,
)
from bench.concealed.bases import maxwell
from bench.concealed.planting import Context, Planted, material_stress, run_material
from bench.concealed.programmes import FAMILIES, STEP_S, Imposed
from bench.concealed.unlisted import UNLISTED

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
