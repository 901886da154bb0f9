"""Cases by other hands: closed forms of their laws, their noises, their two sides."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import erf

from bench.hands import again, kernels, noises, programmes, softening
from bench.hands.bases import Base
from bench.hands.drawing import AGAIN, draw, draw_setup
from bench.hands.families import DEVELOPMENT, EFFECTS, HELD_OUT, SIDES
from bench.hands.forging import forge
from bench.hands.materials import SKELETONS, SPECTRA, Material
from bench.hands.orders import LAWS, STRANGERS, laws_of
from bench.hands.programmes import PROGRAMMES, Course
from bench.hands.testing import Act, Law, Setup, linear_flow, simulate
from bench.trials.sealing import read_truth

PLAIN = noises.Noise("white", 0.01, np.full(9, 0.01))


def a_setup(
    time: np.ndarray, *strains: np.ndarray, taus=(3.0,), moduli=(0.5,)
) -> Setup:
    """Recordings of a neo-Hookean bar of 1 MPa with branches."""
    material = Material(
        "neo_hooke",
        {},
        1.0,
        "few",
        np.array(taus),
        np.array(moduli),
        lambda e: ((1 + e) - (1 + e) ** -2) / 3,
    )
    rate = 1 / (time[1] - time[0])
    courses = [Course("x", rate, time, e, np.full(len(time), 20.0)) for e in strains]
    em = max(float(np.abs(e).max()) for e in strains)
    setup = Setup(
        "pl-wiechert",
        "tension",
        material,
        courses,
        len(courses),
        False,
        np.ones(len(courses)),
        em,
        2.0,
        20.0,
        0.0,
    )
    setup.settle()
    return setup


def triangle(n: int = 400, turns: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Time (0.02 s apart) and triangles between 0 and 0.5."""
    time = np.arange(n + 1) * 0.02
    return time, 0.5 * (1 - np.abs(1 - 2 * ((turns * np.arange(n + 1) / n) % 1)))


def a_law(effect: str, name: str) -> Law:
    return next(w for w in LAWS if w.effect == effect and w.name == name)


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_has_two_laws_on_each_side(effect):
    for side in SIDES:
        assert len(laws_of(effect, side)) >= (1 if effect == "inertia" else 2)


def test_the_sides_share_no_family():
    everything = (*LAWS, *STRANGERS, *SKELETONS, *SPECTRA, *PROGRAMMES)
    named = [(type(f).__name__, getattr(f, "effect", ""), f.name) for f in everything]
    assert len(set(named)) == len(named)
    assert {f.side for f in everything} == set(SIDES)
    assert set(noises.KINDS.values()) == set(SIDES)
    for law in LAWS:
        makers = {w.make for w in LAWS if w.side != law.side}
        assert law.make not in makers


@pytest.mark.parametrize(
    "law", [*LAWS, *STRANGERS], ids=lambda w: f"{w.effect}-{w.name}"
)
def test_off_is_the_base_and_little_is_close_to_it(law):
    rng = np.random.default_rng(5)
    setup, *_ = draw_setup(rng, law.side, (law,), "pl-wiechert", 1)
    act = law.make(rng, setup)
    bare = np.concatenate(simulate(setup, ()))
    moved = [
        np.abs(np.concatenate(simulate(setup, [(act, a)])) - bare).max() / setup.peak
        for a in (0.0, 1e-4 * act.limit, act.limit)
    ]
    assert moved[0] < 1e-12
    assert moved[1] < 0.02 * moved[2] + 1e-4
    assert np.isfinite(moved[2])


def test_ogden_roxburgh_at_a_point_by_hand():
    """eta = 1 - erf((Wm - W)/(m + beta Wm))/r on unloading (1999, eq. 5.1)."""
    time, strain = triangle(turns=1)
    setup = a_setup(time, strain, taus=(), moduli=())
    rng = np.random.default_rng(1)
    act = softening.ogden_roxburgh(rng, setup)
    found = simulate(setup, [(act, 0.4)])[0]

    def work(e: float) -> float:  # of (l - l^-2)/3
        return ((1 + e) ** 2 / 2 + 1 / (1 + e) - 1.5) / 3

    k, m, beta = 300, act.parameters["m"], act.parameters["beta"]
    most = work(0.5)
    eta = 1 - 0.4 * erf((most - work(strain[k])) / (m * most + beta * most))
    stress = ((1 + strain[k]) - (1 + strain[k]) ** -2) / 3
    assert found[k] == pytest.approx(eta * stress, rel=1e-4)
    assert found[:200] == pytest.approx(simulate(setup, ())[0][:200], rel=1e-9)


def test_dahl_loop_has_the_area_of_its_closed_form():
    """Steady loop of amplitude X: area 4 (X - F0 d) with F0 = tanh(X/d), unit strength.

    On loading F = 1 - (1 + F0) exp(-(x + X)/d), so F0 = tanh(X/d) at x = X.
    """
    length, size = 0.1, 0.15
    x = size * np.sin(np.linspace(0, 16 * np.pi, 40001))
    f = kernels.dahl(np.diff(x, prepend=0.0), length, 1.0)
    last = slice(35000, 40001)
    area = np.sum((f[last][1:] + f[last][:-1]) / 2 * np.diff(x[last]))
    assert f[last].max() == pytest.approx(np.tanh(size / length), rel=1e-3)
    assert area == pytest.approx(4 * (size - length * np.tanh(size / length)), rel=1e-3)


def test_bouc_wen_saturates_at_one_and_iwan_slider_at_its_reach():
    x = np.diff(np.linspace(0, 5, 5001), prepend=0.0)
    assert kernels.bouc_wen(x, 0.2, 0.6, 1.7)[-1] == pytest.approx(1, abs=1e-6)
    assert kernels.slider(x, 0.3)[-1] == 0.3


def test_berg_reaches_half_at_its_half_travel():
    """F = u/(half + u) from rest (Berg 1998), so 1/2 at `half`, 3/4 at 3 `half`."""
    x = np.linspace(0, 0.3, 3001)
    f = kernels.berg(x, 0.1)
    assert f[1000] == pytest.approx(0.5)
    assert f[3000] == pytest.approx(0.75)


def test_a_maxwell_branch_on_a_ramp_and_its_eyring_limit():
    """E rate tau (1 - exp(-t/tau)); a steady Eyring flow at s0 asinh(E rate tau/s0)."""
    t = np.linspace(0, 20, 4001)
    dt, steps, one = np.diff(t, prepend=0.0), np.diff(0.1 * t, prepend=0.0), np.ones(1)
    linear = kernels.responses(steps, dt, 2 * one)[:, 0]
    assert linear == pytest.approx(0.2 * -np.expm1(-t / 2), abs=1e-12)
    bent = kernels.flow(steps, dt, 2 * one, one, 0, 0.05 * one, 0.0)
    assert bent[-1] == pytest.approx(0.05 * np.arcsinh(0.2 / 0.05), rel=1e-4)


def test_upper_convected_limits():
    """Slow tension: viscosity E tau; quick: neo-Hooke (Oldroyd 1950)."""
    t = np.linspace(0, 4, 4001)
    dt = np.diff(t, prepend=0.0)
    slow = kernels.convected(1 + 1e-5 * t, dt, 0.1)
    assert slow[-1] == pytest.approx(1e-5 * 0.1, rel=1e-3)
    stretch = 1 + 0.2 * t
    quick = kernels.convected(stretch, dt, 1e7)
    assert quick[-1] == pytest.approx((stretch[-1] - stretch[-1] ** -2) / 3, rel=1e-3)
    solid = kernels.spring_in_dashpot(stretch, dt, 1e9)
    assert solid[-1] == pytest.approx((stretch[-1] - stretch[-1] ** -2) / 3, rel=1e-5)


def test_schapery_with_a_step_is_h1_times_h2():
    """A step of strain e: branches h1 h2 E e exp(-t/tau), x = 1 at the largest."""
    time = np.arange(200) * 0.02
    setup = a_setup(time, np.full(200, 0.5))
    act = a_law("strain_dependent_relaxation", "schapery").make(
        np.random.default_rng(0), setup
    )
    h1, h2 = 1 + 0.6 * act.parameters["h1"], 1 + 0.6 * act.parameters["h2"]
    spring = setup.material.spring(np.full(200, 0.5))
    found = simulate(setup, [(act, 0.6)])[0] - spring
    assert found == pytest.approx(h1 * h2 * 0.25 * np.exp(-time / 3.0), rel=1e-9)


def test_wlf_shifts_by_its_factor():
    time = np.arange(200) * 0.02
    setup = a_setup(time, np.full(200, 0.5))
    warm = replace(setup.courses[0], warmth_C=np.full(200, 30.0))
    setup.courses[0] = warm
    act = a_law("thermal_softening", "wlf").make(np.random.default_rng(0), setup)
    shift = 10 ** (5 * 10 / (act.parameters["C2"] + 10))
    found = simulate(setup, [(act, 5.0)])[0] - setup.material.spring(warm.strain)
    assert found == pytest.approx(0.25 * np.exp(-shift * time / 3.0), rel=1e-9)


def test_lags_trail_a_ramp_by_their_time():
    """First order, two stages, delay, mean of the last 2a: all by a, once steady."""
    t = np.linspace(0, 10, 2001)
    setup = a_setup(t, 0.05 * t)
    for law in LAWS:
        if law.effect == "sensor_lag":
            act = law.make(np.random.default_rng(0), setup)
            assert act.sensor is not None
            assert 3 * t[-1] - act.sensor(0, t, 3 * t, 0.4)[-1] == pytest.approx(1.2)


def test_hencky_and_green_branches_at_a_step():
    """ln(l)/l and l (l^2 - 1)/2 in place of l - 1."""
    time = np.arange(50) * 0.02
    setup = a_setup(time, np.full(50, 0.5))
    spring = setup.material.spring(np.full(50, 0.5))[0]
    for name, size in (("hencky", np.log(1.5) / 1.5), ("green", 1.5 * 1.25 / 2)):
        act = a_law("finite_strain", name).make(np.random.default_rng(0), setup)
        found = simulate(setup, [(act, 1.0)])[0][0]
        assert found - spring == pytest.approx(0.5 * size)


def a_finite(name: str, strain: np.ndarray, tau: float = 3.0) -> tuple[Act, np.ndarray]:
    """A law of finite strain alone: stress of its branch of 0.5 MPa, 0.02 s a step."""
    setup = a_setup(np.arange(len(strain)) * 0.02, strain, taus=(tau,))
    act = a_law("finite_strain", name).make(np.random.default_rng(0), setup)
    return act, simulate(setup, [(act, 1.0)])[0] - setup.material.spring(strain)


def test_ogden_overstress_at_once_and_back_when_relaxed():
    """At once Ogden's stress k/l; back at l = 1, relaxed, -(2 k/l^2 + k l)/3."""
    strain = np.append(np.full(9000, 0.8), 0.0)
    act, found = a_finite("ogden_overstress", strain, tau=2.0)
    alpha = act.parameters["alpha"]
    k = 2 / (3 * alpha) * (1.8**alpha - 1.8 ** (-alpha / 2))
    assert found[0] == pytest.approx(0.5 * k / 1.8)
    assert found[50] == pytest.approx(found[0] * np.exp(-50 * 0.02 / 2.0))
    back = -0.5 * (2 * k / 1.8**2 + 1.8 * k) / 3
    assert found[-1] == pytest.approx(back, rel=0.01)


@pytest.mark.parametrize("e", [2.0, -0.6])
def test_micro_sphere_at_once_is_elastic(e):
    """dW/dl of W = E 5/2 <(ln L)^2>, over chains, L = |F r|, and tubes, |F^-T r|."""
    act, found = a_finite("micro_sphere", np.full(50, e))
    tubes, c = act.parameters["tubes"], (np.arange(20000) + 0.5) / 20000

    def energy(y: float) -> float:
        sizes = [np.log(c**2 * z**2 + (1 - c**2) / z) / 2 for z in (y, 1 / y)]
        chain, tube = (2.5 * np.mean(size**2) for size in sizes)
        return (1 - tubes) * chain + tubes * tube

    slope = (energy(1 + e + 1e-5) - energy(1 + e - 1e-5)) / 2e-5
    assert found[0] == pytest.approx(0.5 * slope, rel=1e-4)
    assert found[-1] == pytest.approx(found[0] * np.exp(-49 * 0.02 / 3.0))


@pytest.mark.parametrize("name", ["ogden_overstress", "micro_sphere"])
def test_a_small_strain_leaves_the_branches_linear(name):
    time, strain = triangle()
    _, found = a_finite(name, 0.006 * strain)
    setup = a_setup(time, 0.006 * strain)
    linear = linear_flow(setup.material, 0.006 * strain, np.diff(time, prepend=time[0]))
    assert found == pytest.approx(linear, abs=0.01 * np.abs(linear).max())


def test_a_parabolic_toe():
    """Parabolic toe meets its straight part with slope one at twice the gap."""
    time, strain = triangle(turns=1)
    setup = a_setup(time, strain)
    act = a_law("slack", "parabolic_toe").make(np.random.default_rng(3), setup)
    assert act.rig is not None
    gap = 0.1 * 0.5 * act.parameters["shares"][0]
    passed = act.rig(0, time, np.array([gap, 2 * gap, 0.5]), 0.1)
    assert passed == pytest.approx([gap / 4, gap, 0.5 - gap])


@pytest.mark.parametrize("kind", noises.KINDS)
def test_noise_has_its_level_and_whitens_to_one(kind):
    rng = np.random.default_rng(3)
    time = np.arange(20000) * 0.01
    clean = np.sin(time)
    noise = noises.draw_noise(rng, kind, [clean, 0.3 * clean], 0.5)
    gap = noise.add(rng, 0, time, clean) - clean
    level = np.sqrt(np.mean(noise.profile(0, clean) ** 2))
    assert np.std(gap) == pytest.approx(level, rel=0.12)
    white = noise.whiten(0, time, clean, gap[:, None])[:, 0]
    assert np.std(white) == pytest.approx(1, rel=0.03)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.03


def test_pink_noise_falls_as_one_over_frequency():
    rng = np.random.default_rng(0)
    time = np.arange(2**16) * 0.01
    noise = noises.draw_noise(rng, "pink", [np.ones(9), -np.ones(9)], 10.0)
    power = np.abs(np.fft.rfft(noise.unit(rng, time))) ** 2
    f = np.fft.rfftfreq(len(time), 0.01)
    bands = [(0.05, 0.1), (0.4, 0.8), (3.2, 6.4)]
    means = [power[(f > a) & (f < b)].mean() for a, b in bands]
    slope = np.log(means[2] / means[0]) / np.log(64)
    assert slope == pytest.approx(-1, abs=0.2)


def test_the_base_finds_what_it_is_made_of_and_not_more():
    time, strain = triangle()
    setup = a_setup(time, strain, strain / 2)
    base = Base(setup, PLAIN, scales=False)
    assert base.energy(simulate(setup, ())) < 0.2
    offset = [np.zeros(401), np.full(401, 0.1)]
    bumped = [c + o for c, o in zip(base.clean, offset, strict=True)]
    assert 40 < base.energy(bumped) < 2 * 401 * 100
    assert base.energy(bumped, offset) < 0.2
    setup.factors = np.array([1.0, 1.3])
    assert Base(setup, PLAIN, scales=True).energy(simulate(setup, ())) < 0.2
    assert Base(setup, PLAIN, scales=False).energy(simulate(setup, ())) > 40


def test_linear_flow_does_not_mind_the_step():
    """Exact for straight strain: the same at a fifth of the step."""
    time, strain = triangle()
    fine = np.linspace(0, time[-1], 2001)
    setup = a_setup(time, strain)
    coarse = linear_flow(setup.material, strain, np.diff(time, prepend=0.0))
    again = linear_flow(
        setup.material, np.interp(fine, time, strain), np.diff(fine, prepend=0.0)
    )
    assert again[::5] == pytest.approx(coarse, abs=1e-12)


def test_rounded_corners_keep_the_first_strain():
    strain = np.concatenate([np.linspace(0, 1, 100), np.linspace(1, 0, 100)])
    smooth = programmes.rounded(strain, 10)
    assert len(smooth) == 200
    assert smooth[0] == pytest.approx(0, abs=1e-12)
    assert smooth.max() < 1


def test_same_seed_same_files_and_no_hint_in_the_cases(tmp_path: Path):
    counts = {"nulls": 1, "singles": 2, "pairs": 1, "aliens": 1, "mixed": 1, "bent": 1}
    for folder in ("a", "b"):
        forge(tmp_path / folder, seed=4, side=HELD_OUT, **counts)
    first = sorted(p for p in (tmp_path / "a").rglob("*") if p.is_file())
    for path in first:
        twin = tmp_path / "b" / path.relative_to(tmp_path / "a")
        assert path.read_bytes() == twin.read_bytes()
    told = [json.loads(p.read_text()) for p in (tmp_path / "a/truth").rglob("*.json")]
    assert sorted(t["cls"] for t in told) == [
        "alien",
        "bent",
        "mixed",
        "null",
        "pair",
        "single",
        "single",
    ]
    words = {w for t in told for w in (*t["effects"], t["alien"] or "alien", t["cls"])}
    for path in (tmp_path / "a/cases").rglob("*"):
        text = str(path.relative_to(tmp_path))
        if path.suffix == ".toml":
            text += path.read_text()
        elif path.suffix == ".csv":
            text += path.read_text().splitlines()[0]
        assert not [w for w in words if w in text]
    with pytest.raises(FileExistsError, match="new folder"):
        forge(tmp_path / "a", seed=4, side=HELD_OUT, **counts)


@pytest.mark.parametrize("side", SIDES)
def test_one_effect_beside_a_stranger_is_told_so(side, tmp_path: Path):
    forge(tmp_path, seed=4, side=side, nulls=0, singles=0, pairs=0, aliens=0, mixed=1)
    (told,) = (json.loads(p.read_text()) for p in tmp_path.rglob("truth.json"))
    (effect,), stranger = told["effects"], told["alien"]
    assert effect in EFFECTS
    assert stranger in {s.name for s in STRANGERS}
    assert set(told["laws"]) == {effect, f"alien:{stranger}"}
    assert min(told["energy_beyond_the_other"].values()) > 0
    truth = read_truth("a", told)
    assert (truth.cls, truth.effects) == ("mixed", (effect,))


def test_no_spring_has_a_negative_energy():
    # Powers of it are taken. Beyond 95 % strain zero is no point of its grid.
    e = np.append(np.linspace(-0.2, 0.2, 997), 1.77)
    for kind in SKELETONS:
        _, curve = kind.make(np.random.default_rng(3), 1.77)
        spring = replace(a_setup(e, e).material, curve=curve)
        assert spring.energy(e).min() >= 0.0


def test_nulls_conceal_nothing():
    case = draw(2, 0, "null", DEVELOPMENT)
    assert case.laws == ()
    assert case.energies["energy_after_refit"] < 3


def test_where_no_base_is_adequate_another_is_drawn():
    # Two hundred tries with a linear spring at large strain gave none.
    case = draw(20016, 7, "bent", "held_out")
    assert [law.effect for law in case.laws] == ["mullins_softening", "finite_strain"]
    assert case.tries >= AGAIN


def test_another_recording_is_of_the_same_truth():
    """A held programme, recorded anew without noise, has the stress of the held one."""
    index = next(i for i in range(9) if again.can_record(draw(3, i, "pair", SIDES[0])))
    case = draw(3, index, "pair", SIDES[0])
    course, held = case.setup.courses[case.setup.n], case.stress(held=True)[0]
    silent = noises.Noise("white", 0.0, np.zeros(case.setup.n))
    rng = np.random.default_rng(0)

    def recorded(noise):
        other = replace(case, noise=noise)
        return again.record(other, course.time_s, course.strain, rng, course.warmth_C)

    np.testing.assert_allclose(recorded(silent), held, atol=1e-9)
    loud = noises.Noise("white", 0.01, np.array([0.01, 0.02, 0.03]))
    assert np.std(recorded(loud) - held) == pytest.approx(0.02, rel=0.15)  # the median
