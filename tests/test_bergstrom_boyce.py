"""The Bergström-Boyce base against its equations, its limits and its cards."""

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_diagnose_files import FOLDER, conforms

from softnn.cards.loss import loss
from softnn.cards.read import read_card
from softnn.cards.written import WRITERS, card
from softnn.cli import main
from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.fit import Data, Engine, Guess, Piece
from softnn.json_file import write
from softnn.mismatch.base import start
from softnn.mismatch.case import case_of
from softnn.mismatch.families import chosen
from softnn.model_file import Stored, from_dict, to_dict
from softnn.models.bases import build
from softnn.models.bergstrom_boyce import BergstromBoyce
from softnn.models.hyperelastic import LAWS, Hyper
from softnn.models.units import Units
from softnn.recording import Recording
from softnn.simulate import simulate

REACH = (-0.4, 0.8)
BASE = BergstromBoyce((5.0,), 4.0, -0.6, 2.0, REACH)
MODULI = [1.5, 2.4]
# A ramp, a partial return, a ramp, a hold, compression, recovery without strain.
TIME = np.array([0.0, 10, 20, 30, 60, 70, 90, 300])
STRAIN = np.array([0.0, 0.8, 0.1, 0.8, 0.8, -0.3, 0.0, 0.0])
CORNERS = Chunk(TIME, STRAIN)


def sampled(time, corners=CORNERS):
    return Chunk(time, np.interp(time, corners.time_s, corners.strain))


def deviatoric(mu, limit, log_stretches):
    """Stress of the eight-chain network, from the energy that Abaqus's manual gives."""
    squares = np.exp(2 * log_stretches)
    shares = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
    slope = mu * sum(
        k * x * squares.sum() ** (k - 1) / limit ** (2 * k - 2)
        for k, x in enumerate(shares, start=1)
    )
    return 2 * slope * (squares - squares.mean())


def integrated(mu_a, mu_b, limit, creep, m, c):
    """Nominal stress at CORNERS: all three directions, in Mises's stress and rate."""

    def logs(t):
        along = np.log1p(np.interp(t, TIME, STRAIN))
        return np.array([along, -along / 2, -along / 2])

    def rate(t, viscous):
        s = deviatoric(mu_b, limit, logs(t) - viscous)
        mises = np.sqrt(1.5 * s @ s)
        chain = np.sqrt(np.exp(2 * viscous).mean())
        size = creep * (chain - 1 + 0.01) ** c * mises**m
        return 1.5 * size * s / max(mises, 1e-300)

    viscous, out = np.zeros(3), []
    for i, t in enumerate(TIME):
        if i:
            found = solve_ivp(
                rate, (TIME[i - 1], t), viscous, "Radau", rtol=1e-10, atol=1e-12
            )
            viscous = found.y[:, -1]
        s = deviatoric(mu_a, limit, logs(t))
        s = s + deviatoric(mu_b, limit, logs(t) - viscous)
        out.append((s[0] - s[1]) / np.exp(logs(t)[0]))
    return np.array(out)


@pytest.mark.parametrize(
    ("m", "c", "limit"), [(4.0, -0.6, 2.0), (1.0, 0.0, 1.3), (7.0, -1.0, 6.0)]
)
def test_the_stress_is_that_of_the_equations_in_space(m, c, limit):
    base = replace(BASE, stress_exponent=m, strain_exponent=c, locking_stretch=limit)
    mu_a, mu_b = (base.elastic.moduli[0] * e for e in MODULI)
    creep = base.creep_parameter(MODULI[1])
    (found,) = simulate(base, MODULI, [], [CORNERS])
    expected = integrated(mu_a, mu_b, limit, creep, m, c)
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def test_without_flow_both_networks_carry_and_with_fast_flow_the_first_alone():
    chunk = sampled(np.linspace(0, 300, 200))
    one = Hyper("arruda-boyce", "arruda-boyce", BASE.elastic.moduli, REACH)
    curve = one.curve(chunk.strain)
    for time, modulus in ((1e12, sum(MODULI)), (1e-12, MODULI[0])):
        base = replace(BASE, relaxation_times=(time,))
        (found,) = simulate(base, MODULI, [], [chunk])
        np.testing.assert_allclose(found, modulus * curve, atol=0.02 * curve.max())


def test_at_small_strain_a_linear_flow_is_a_maxwell_branch():
    base = replace(BASE, stress_exponent=1.0, strain_exponent=0.0, strain=(-3e-5, 8e-5))
    small = Chunk(TIME, 1e-4 * STRAIN)
    (found,) = simulate(base, MODULI, [], [small])
    branch = Units("sls", (0.0, 1.0), (5.0,))
    (expected,) = simulate(branch, MODULI, [], [small])
    np.testing.assert_allclose(found, expected, atol=2e-4 * expected.max())


def test_the_stress_does_not_depend_on_how_a_history_is_sampled():
    (coarse,) = simulate(BASE, MODULI, [], [CORNERS])
    rng = np.random.default_rng(0)
    for n in (30, 3000):
        time = np.sort(np.concatenate([TIME, TIME, rng.uniform(0, 300, n)]))
        (fine,) = simulate(BASE, MODULI, [], [sampled(time)])
        at = np.searchsorted(time, TIME, side="right") - 1
        np.testing.assert_allclose(fine[at], coarse, atol=1e-4 * coarse.max())


def test_recordings_that_go_on_and_many_strains_at_once_are_the_same():
    whole = sampled(np.linspace(0, 300, 601))
    parts = slice(333), slice(333, None)
    halves = [Chunk(whole.time_s[s], whole.strain[s]) for s in parts]
    (one,) = simulate(BASE, MODULI, [], [whole])
    two = simulate(BASE, MODULI, [], halves, continued=True)
    np.testing.assert_allclose(np.concatenate(two), one, rtol=1e-12)
    strains = np.stack([0.5 * whole.strain, whole.strain], axis=1)
    decays = BASE.decays(whole.time_s, None)
    second = np.array(MODULI[1:])
    out, _ = BASE.branch_stress(decays, strains, second)
    first = MODULI[0] * BASE.undamped(whole.strain)
    np.testing.assert_allclose(out[:, 1], one - first, atol=1e-12)
    assert not np.allclose(out[:, 0], out[:, 1])
    none = BASE.only(np.array([], int))
    out, _ = none.branch_stress(none.decays(whole.time_s, None), strains, second[:0])
    assert not out.any()


def test_any_parameters_of_a_search_give_a_finite_stress():
    jump = Chunk(np.array([0.0, 1e-3, 1.0, 2.0]), np.array([0.0, 4.0, -0.9, 4.0]))
    ranges = [(p.low, p.high) for p in BASE.nonlinear]
    for time, m, c, limit in product(*ranges):
        base = BergstromBoyce((time,), m, c, limit, REACH)
        assert np.isfinite(simulate(base, MODULI, [], [jump])[0]).all()


# -- fits ------------------------------------------------------------------------------


def recordings(scale=1.0, noise=1e-3):
    """Cycles at three rates and holds, as a machine records them."""
    rng = np.random.default_rng(0)
    out = []
    for name, pace in (("slow", 10.0), ("usual", 1.0), ("fast", 0.1)):
        corners = Chunk(
            pace * np.array([0.0, 10, 20, 30, 50, 60]),
            np.array([0.0, 0.8, 0.0, 0.5, 0.5, 0.0]),
        )
        chunk = sampled(np.linspace(0, 60 * pace, 241), corners)
        (stress,) = simulate(BASE, MODULI, [], [chunk])
        stress = stress + noise * rng.standard_normal(len(stress))
        out.append(Recording(chunk.time_s, chunk.strain, scale * stress, name=name))
    return out


def test_an_engine_that_knows_a_branch_of_the_same_time_keeps_them_apart():
    chunk = sampled(np.linspace(0, 300, 301))
    engine = Engine(Data(("a",), (chunk,), (np.zeros(301),)))
    engine.run(Guess(Units("sls", (0.0, 1.0), (5.0,)), np.array(MODULI)), False)
    found, _ = engine.run(Guess(BASE, np.array(MODULI)), False)
    np.testing.assert_allclose(found, simulate(BASE, MODULI, [], [chunk])[0])


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_a_fit_finds_the_parameters_that_made_the_data(scale):
    guess = start(case_of(recordings(scale), "c"), "bergstrom-boyce").fit.guess
    np.testing.assert_allclose(guess.stiffness, scale * np.array(MODULI), rtol=0.01)
    found, truth = guess.units, BASE
    assert isinstance(found, BergstromBoyce)
    assert found.relaxation_times[0] == pytest.approx(5.0, rel=0.05)
    for p in truth.nonlinear[1:]:
        assert getattr(found, p.name) == pytest.approx(p.default, rel=0.05)


def test_auto_takes_it_where_it_made_the_data():
    assert chosen(case_of(recordings(), "c"), False).name == "bergstrom-boyce"


@pytest.mark.slow
def test_a_folder_is_diagnosed_with_it_by_name(tmp_path, capsys):
    folder = tmp_path / "case"
    folder.mkdir()
    for r in recordings():
        rows = np.column_stack([r.time_s, r.strain, r.stress_MPa])
        head = {"header": "time_s,strain,stress_MPa", "comments": ""}
        np.savetxt(folder / f"{r.name}.csv", rows, delimiter=",", **head)
    asked = ["--model", "bergstrom-boyce", "--jobs", "1"]
    out = tmp_path / "out"
    assert main(["diagnose", str(folder), *asked, "--out", str(out)]) == 0
    result = json.loads((out / "case" / "diagnosis.json").read_text())
    assert result["selected"] == []
    assert result["fit"]["before"]["heldout_nrmse"] < 0.01
    assert "two eight-chain networks" in (out / "case" / "report.html").read_text()


# -- files -----------------------------------------------------------------------------


def stored():
    return Stored(BASE, np.array(MODULI), (), (), False, "fresh")


def test_a_model_file_keeps_the_base_and_is_simulated(tmp_path):
    told = to_dict(Guess(BASE, np.array(MODULI)), ["a"], "fresh", False)
    conforms(told, json.loads((FOLDER / "model.schema.json").read_text()))
    assert from_dict(json.loads(json.dumps(told))).units == BASE
    file = tmp_path / "model.json"
    write(file, told)
    rows = np.column_stack([TIME, STRAIN])
    head = {"header": "time_s,strain", "comments": ""}
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", **head)
    out = tmp_path / "out"
    asked = ["simulate", str(file), str(tmp_path / "a.csv"), "--out", str(out)]
    assert main(asked) == 0
    found = np.loadtxt(out / "a.csv", delimiter=",", skiprows=1)[:, -1]
    (expected,) = simulate(BASE, MODULI, [], [CORNERS])
    np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("stress_exponent", 0.5, "stress_exponent is 0.5; allowed is 1 to 20"),
        ("strain_exponent", 0.1, "strain_exponent is 0.1"),
        ("locking_stretch", 1.0, "locking_stretch is 1;"),
        (
            "relaxation_times_s",
            [],
            "0 relaxation times; a bergstrom",
        ),
        ("strain", [0.0, float("nan")], "both are finite"),
    ],
)
def test_numbers_out_of_range_are_refused(key, value, said):
    told = to_dict(Guess(BASE, np.array(MODULI)), ["a"], "fresh", False)
    told["base"][key] = value
    with pytest.raises(InputError, match=said):
        from_dict(told)


def test_its_name_is_checked_and_strains_are_needed():
    with pytest.raises(InputError, match="did you mean 'bergstrom-boyce'"):
        build("bergstrom-boice", 0.0, 0.5, 0.1, 60.0)
    with pytest.raises(InputError, match="never leaves zero"):
        build("bergstrom-boyce", 0.0, 0.0, 0.1, 60.0)


# -- cards -----------------------------------------------------------------------------


def read(tmp_path, text, **more):
    file = tmp_path / "card.inp"
    file.write_text(text)
    return read_card(str(file), **more)


def test_a_card_reads_back_as_the_model_in_any_unit(tmp_path):
    text = WRITERS["abaqus"][1](stored(), "m")
    lines = text.splitlines()
    rows = (lines.index(x) for x in ("*Hyperelastic, arruda-boyce", "*Hysteresis"))
    (mu, limit, _), (s, a, m, c) = (map(float, lines[k + 1].split(",")) for k in rows)
    assert (limit, s, m, c) == pytest.approx((2.0, 1.6, 4.0, -0.6))
    assert LAWS["arruda-boyce"].young((mu, limit)) == pytest.approx(MODULI[0])
    chunk = sampled(np.linspace(0, 300, 301))
    (expected,) = simulate(BASE, MODULI, [], [chunk])
    pascal = (
        "** stresses in Pa\n*Material, name=m\n*Hyperelastic, arruda-boyce\n"
        f"{1e6 * mu}, {limit}, 0.\n*Hysteresis\n{s}, {a * 1e-24}, {m}, {c}, 0.01\n"
    )
    both = text.replace("arruda-boyce", "arruda-boyce, moduli=instantaneous").replace(
        f"{mu:.9g}, {limit:.9g}", f"{(1 + s) * mu:.12g}, {limit:.9g}"
    )
    for one, unit in ((text, "MPa"), (pascal, "Pa"), (both, "MPa")):
        given = read(tmp_path, one)
        assert given.unit == unit
        (found,) = given.stored(unit, REACH).stress(["a"], [chunk], [None])
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-7)
    assert "with hysteresis" in given.said


def test_a_card_carries_the_scale_of_the_stress_and_names_what_it_lacks():
    pieces = []
    for name, values in (("gain_error", {"error": 0.25}), ("mullins_softening", {})):
        law = effect(name)
        pieces.append(Piece(law, law.defaults() | values, ()))
    model = replace(stored(), pieces=tuple(pieces), own=({}, {}))
    made, scaled = card(model), replace(model, pieces=model.pieces[:1], own=({},))
    assert made.left_out == (1,)
    assert made.mullins is None
    assert "NOT CARRIED: mullins_softening" in WRITERS["abaqus"][1](model, "m")
    assert loss(scaled, card(scaled)).whole < 1e-9
    text = WRITERS["abaqus"][1](scaled, "m")
    assert "nothing else of the model is missing" in text
    assert "instantaneous" not in text
    # The same strain at 1.25 times the stress flows alike: A falls with stress^m.
    (row,) = (x for x in text.splitlines() if x.startswith("1.6,"))
    plain = BASE.creep_parameter(MODULI[1])
    assert float(row.split(",")[1]) == pytest.approx(plain / 1.25**4)


@pytest.mark.parametrize("to", ["ansys", "febio", "c", "fmu"])
def test_other_exports_are_refused_in_one_line(to, tmp_path, capsys):
    file = tmp_path / "model.json"
    write(file, to_dict(Guess(BASE, np.array(MODULI)), ["a"], "fresh", False))
    assert main(["export", str(file), "--to", to, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "bergstrom-boyce" in error
    assert "--to abaqus" in error


LAW = "*Material, name=m\n*Hyperelastic, arruda-boyce\n0.5, 3., 0.\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (LAW + "*Hysteresis\n1.6, 0.5, 4., -1., 0.02\n", "E is 0.01 or left out"),
        (LAW + 2 * "*Hysteresis\n1.6, 0.5, 4., -1.\n", "stands there twice"),
        (LAW + "*Hysteresis\n1.6, 0.5, 4.\n", "one line of S, A, m and C"),
        (LAW + "*Hysteresis\n0., 0.5, 4., -1.\n", "S is 0 and A is 0.5"),
        (LAW + "*Hysteresis\n1.6, 0.5, 4., -2.\n", "strain_exponent is -2"),
        (LAW + "*Hysteresis\n1.6, 0.5, 400., -1.\n", "stress_exponent is 400"),
        (LAW.replace("0.\n", "9.\n") + "*Hysteresis\n1.6, 0.5, 4., -1.\n",
         "incompressible"),
        (LAW + "*Hysteresis\n1.6, 0.5, 4., -1.\n*Mullins effect\n1.5, 1., 0.1\n",
         "without a Prony series"),
        ("*Material, name=m\n*Hyperelastic, neo hooke\n0.5, 0.\n*Hysteresis\n"
         "1.6, 0.5, 4., -1.\n", "ARRUDA-BOYCE"),
    ],
)  # fmt: skip
def test_a_card_that_cannot_be_simulated_is_refused_in_one_line(text, said, tmp_path):
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert said in str(error.value)
