"""Hyperelastic bases against their energies, closed forms and numerical integrals."""

import json
from dataclasses import replace

import numpy as np
import pytest
from export_made import Compiled
from made import MODULI

from softnn.contracts import Chunk, InputError
from softnn.fit import Data, Engine, Guess, fit
from softnn.mismatch.base import units_for
from softnn.mismatch.case import case_of
from softnn.mismatch.families import chosen
from softnn.model_file import Stored, from_dict, to_dict
from softnn.models import hyperelastic
from softnn.models.bases import build, check
from softnn.models.hyperelastic import LAWS, Hyper, stable_range
from softnn.recording import Recording
from softnn.simulate import simulate

STRAIN = np.array([-0.4, -0.1, 0.05, 0.3, 0.8])


def energy(law, m, a, b, c):
    """Energy in MPa, as the manuals of finite-element codes write it."""
    i1, i2 = a**2 + b**2 + c**2, a**-2 + b**-2 + c**-2
    if law in ("neo-hooke", "yeoh"):
        return sum(x * (i1 - 3) ** k for k, x in enumerate(m, start=1))
    if law == "mooney-rivlin":
        return m[0] * (i1 - 3) + m[1] * (i2 - 3)
    if law.startswith("ogden"):
        terms = zip(m[::2], m[1::2], strict=True)
        return sum(2 * mu / p**2 * (a**p + b**p + c**p - 3) for mu, p in terms)
    if law == "arruda-boyce":
        shares = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
        return m[0] * sum(
            x / m[1] ** (2 * k - 2) * (i1**k - 3**k)
            for k, x in enumerate(shares, start=1)
        )
    if law == "gent":
        return -m[0] * m[1] / 2 * np.log(1 - (i1 - 3) / m[1])
    volume = a * b * c
    return sum(
        2 * mu / p**2
        * (a**p + b**p + c**p - 3 + (volume ** (-p * beta) - 1) / beta)
        for mu, p, beta in (
            (m[k], m[k + 1], m[k + 2] / (1 - 2 * m[k + 2])) for k in (0, 3)
        )
    )  # fmt: skip


def made(law, prony=False, **more):
    times = (0.5, 20.0) if prony else ()
    unit = LAWS[law].unit(MODULI[law])
    name = law + ("-prony" if prony else "")
    return Hyper(name, law, unit, (-0.5, 1.0), times, **more)


@pytest.mark.parametrize("law", [x for x in LAWS if x != "hyperfoam"])
def test_a_law_is_the_derivative_of_its_energy(law):
    young = LAWS[law].young(MODULI[law])
    h = 1e-6

    def pulled(e):
        return energy(law, MODULI[law], 1 + e, (1 + e) ** -0.5, (1 + e) ** -0.5)

    def sheared(e):
        first = e / 2 + np.sqrt(1 + e**2 / 4)
        return energy(law, MODULI[law], first, 1 / first, 1.0)

    for work, mode in ((pulled, "uniaxial"), (sheared, "shear")):
        expected = (work(STRAIN + h) - work(STRAIN - h)) / (2 * h)
        found = young * made(law, mode=mode).curve(STRAIN)
        np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-8)


@pytest.mark.parametrize("ratios", [(0.1, 0.3), (0.2, 0.2)])
def test_a_foam_has_sides_of_least_energy(ratios):
    """Stress along, where the energy over the width of the sides is least."""
    m = list(MODULI["hyperfoam"])
    m[2], m[5] = ratios
    unit = LAWS["hyperfoam"].unit(tuple(m))
    foam = Hyper("hyperfoam", "hyperfoam", unit, (-0.5, 1.0))
    young = LAWS["hyperfoam"].young(tuple(m))
    wide = np.exp(np.linspace(-0.5, 0.5, 200_001))
    for e in STRAIN:
        least = [
            energy("hyperfoam", m, 1 + e + d, wide, wide).min() for d in (-1e-4, 1e-4)
        ]
        expected = (least[1] - least[0]) / 2e-4
        found = young * foam.curve(np.array([e]))[0]
        assert found == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("name", hyperelastic.NAMES)
def test_a_stiffness_is_the_initial_modulus(name):
    base = build(name, -0.3, 0.6, 0.1, 30.0)
    for one in base.starts():
        h = np.array([1e-6])
        slope = (one.curve(h) - one.curve(-h)) / 2e-6
        assert slope[0] == pytest.approx(1.0, rel=1e-5)
        values = {p.name: p.default for p in one.nonlinear}
        np.testing.assert_allclose(one.having(values).moduli, one.moduli, rtol=1e-9)


def test_a_poisson_ratio_near_a_half_is_incompressible():
    near = build("yeoh:nu=0.4999", 0.0, 1.0, 0.1, 9.0).curve(STRAIN)
    np.testing.assert_allclose(
        near, build("yeoh", 0.0, 1.0, 0.1, 9.0).curve(STRAIN), rtol=1e-3
    )
    # Small strain: E = 2 mu (1 + nu), where 1 MPa is 3 mu.
    h = np.array([1e-5])
    slope = build("yeoh:nu=0.2", 0.0, 1.0, 0.1, 9.0).curve(h) / h
    assert slope[0] == pytest.approx(2 / 3 * 1.2, rel=1e-3)


@pytest.mark.parametrize("mode", ["uniaxial", "shear"])
@pytest.mark.parametrize("law", ["yeoh", "ogden2"])
def test_a_series_relaxes_the_second_piola_kirchhoff_stress(law, mode):
    """Against the integral by midpoints, of the components S11 and S22, S12 and S22."""
    base = made(law, True, mode=mode)
    time = np.linspace(0, 30, 6001)
    strain = 0.6 * np.sin(time / 4) ** 2
    lasting, *moduli = 0.5, 0.3, 0.2
    (found,) = simulate(base, [lasting, *moduli], [], [Chunk(time, strain)])
    young_1 = base.curve(strain)
    if mode == "uniaxial":
        x = 1 + strain
        parts = (2 / 3 * young_1 / x, x), (-1 / 3 * young_1 * x**2, -(x**-2))
    else:
        first = strain / 2 + np.sqrt(1 + strain**2 / 4)
        t = LAWS[law].stresses(base.moduli, (first, 1 / first, np.ones_like(first)))
        c2 = first**2 / (1 + first**2)
        side = (1 - c2) * t[0] + c2 * t[1] - sum(t) / 3
        parts = (young_1 - strain * side, 1.0), (side, strain)
    expected = lasting * young_1
    for s, weight in parts:
        for k, tau in zip(moduli, base.relaxation_times, strict=True):
            middle = (time[1:] + time[:-1]) / 2
            last = np.array(
                [
                    np.sum(np.exp(-(t - middle[:i]) / tau) * np.diff(s[: i + 1]))
                    for i, t in list(enumerate(time))[::1000]
                ]
            )
            expected[::1000] += k * (weight * np.ones_like(s))[::1000] * last
    np.testing.assert_allclose(found[::1000], expected[::1000], rtol=1e-4, atol=1e-7)


def test_recordings_that_go_on_continue_the_series():
    base = made("yeoh", True)
    time = np.linspace(0, 20, 401)
    strain = 0.5 * (1 - np.abs(time / 10 - 1))
    whole = Chunk(time, strain)
    halves = [Chunk(time[s], strain[s]) for s in (slice(200), slice(200, None))]
    k = [1.0, 0.3, 0.2]
    (one,) = simulate(base, k, [], [whole])
    two = simulate(base, k, [], halves, continued=True)
    np.testing.assert_allclose(np.concatenate(two), one, rtol=1e-12)
    # The sum of branches for many sets of strains at once is the same.
    out, _ = base.branch_stress(
        base.decays(time, None),
        np.stack([strain, 0.5 * strain], axis=1),
        np.array(k[1:]),
    )
    np.testing.assert_allclose(out[:, 0], one - base.curve(strain), rtol=1e-9)


def recordings(base, stiffness, noise=0.0):
    rng = np.random.default_rng(0)
    out = []
    for name, high, pace in (("a", 0.9, 1.0), ("b", 0.9, 8.0), ("c", 0.5, 2.0)):
        time = np.linspace(0, 20 * pace, 301)
        strain = high * (1 - np.abs(time / (10 * pace) - 1))
        (stress,) = simulate(base, stiffness, [], [Chunk(time, strain)])
        stress = stress + noise * stress.max() * rng.standard_normal(301)
        out.append(Recording(time, strain, stress, name=name))
    return out


def test_a_fit_finds_the_moduli_that_made_the_data():
    truth = replace(made("yeoh", True), strain=(0.0, 0.9))
    case = case_of(recordings(truth, [1.0, 0.3, 0.2]), "c")
    data = Data(
        tuple("abc"),
        tuple(r.history for r in case.recordings),
        tuple(r.stress_MPa for r in case.recordings),
    )
    units = replace(units_for("yeoh-prony", data), relaxation_times=(0.5, 20.0))
    engine = Engine(data)
    found = min(
        (fit(engine, Guess(u, np.zeros(3)), iterations=60) for u in units.starts()),
        key=lambda f: f.chi2,
    )
    np.testing.assert_allclose(found.guess.stiffness, [1.0, 0.3, 0.2], rtol=0.02)
    np.testing.assert_allclose(found.guess.units.moduli, truth.moduli, rtol=0.02)


def test_auto_takes_the_law_that_made_the_data_and_says_by_how_much():
    truth = replace(made("mooney-rivlin", True), strain=(0.0, 0.9))
    truth = replace(truth, moduli=LAWS["mooney-rivlin"].unit((0.05, 0.2)))
    base = chosen(case_of(recordings(truth, [1.0, 0.3, 0.2], 0.005), "c"), False)
    assert base.name == "mooney-rivlin-prony"
    assert "neo-hooke-prony" in base.notes[0]


def test_a_law_that_ceases_to_rise_is_said_to_be_unstable():
    # Neo-Hooke with a fall: t = 2 C10 (1 + 2 c x)(l^2 - 1/l), x = l^2 + 2/l - 3.
    law, moduli = LAWS["yeoh"], (1 / 6, -0.05 / 6, 0.0)
    high = stable_range(law, moduli, -0.5, 4.0)[1]
    first = np.linspace(1.0, 5.0, 100_001)
    fall = [
        np.gradient((1 - 0.1 * (x**2 + 2 / x - 3)) * (x**2 - 1 / x))
        for x in (first, first**-2)  # a pull along; equibiaxial is a push along
    ]
    ends = first[np.argmax(fall[0] < 0)], first[np.argmax(fall[1] > 0)]
    assert high == pytest.approx(min(ends) - 1, rel=0.02)
    assert stable_range(law, (1 / 6, 0.0, 0.0), -0.5, 4.0) == (-0.5, 4.0)


def test_a_model_file_keeps_the_base():
    base = made("ogden2", True)
    stiffness = np.array([1.0, 0.2, 0.1])
    told = to_dict(Guess(base, stiffness), ["a"], "fresh", False)
    again = from_dict(json.loads(json.dumps(told)))
    assert again.units == base
    del told["base"]["moduli_of_1_MPa"]["MU2"]
    with pytest.raises(InputError, match="a ogden2 law has"):
        from_dict(told)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("yeo-prony", "did you mean 'yeoh-prony'"),
        ("yeoh:sheer", "'sheer' is no option"),
        ("hyperfoam:nu=0.5", "below 0.5"),
    ],
)
def test_names_and_options_are_checked(name, said):
    with pytest.raises(InputError, match=said):
        check(name)


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_exported_c_is_the_model(law, tmp_path):
    base = made(law, True)
    if law == "hyperfoam":  # C is written for terms of one Poisson ratio
        unit = LAWS[law].unit((0.1, 8.0, 0.2, 0.02, -2.0, 0.2))
        base = replace(base, moduli=unit)
    time = np.linspace(0, 30, 500)
    strain = 0.7 * np.sin(time / 3) * np.exp(-time / 40) - 0.05
    chunk = Chunk(time, strain)
    model = Stored(base, np.array([1.0, 0.3, 0.2]), (), (), False, "fresh")
    (expected,) = model.stress(["a"], [chunk], [None])
    found = Compiled(tmp_path, model).run(chunk)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
