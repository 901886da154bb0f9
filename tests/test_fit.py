"""Separable least squares against solvers and closed forms from elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear, nnls

from softnn.bounded import bounded
from softnn.contracts import Chunk, InputError
from softnn.effects import EFFECTS, effect
from softnn.fit import Data, Engine, Guess, Piece, fit, put, slots, span
from softnn.mismatch.base import units_for
from softnn.mismatch.screen import only, start_pieces
from softnn.models.linear import StandardLinearSolid
from softnn.models.units import BASES, Units, build
from softnn.simulate import Term, simulate

RNG = np.random.default_rng(7)
TIME = np.cumsum(RNG.uniform(0.02, 0.2, 400))
STRAIN = 0.4 * np.abs(np.sin(TIME / 7)) * (1 + TIME / 80)


def test_bounded_equals_scipy():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        a = rng.standard_normal((40, 8))
        b = rng.standard_normal(40)
        low = np.where(rng.random(8) < 0.7, 0.0, -0.1)
        high = np.where(rng.random(8) < 0.5, np.inf, 0.2)
        ours = bounded(a.T @ a, a.T @ b, low, high, np.zeros(8))
        theirs = lsq_linear(a, b, (low, high), tol=1e-14).x
        np.testing.assert_allclose(ours, theirs, atol=1e-7)


def test_base_without_effects_is_non_negative_least_squares():
    units = Units("pl-wiechert", (0.0, 0.2, 0.5, 1.0), (0.3, 3.0, 30.0))
    rng = np.random.default_rng(0)
    stress = STRAIN**2 + 0.01 * rng.standard_normal(len(TIME))
    chunk = Chunk(TIME, STRAIN)
    found = fit(Engine(Data(("a",), (chunk,), (stress,))), Guess(units, np.zeros(6)))
    springs, branches, _ = units.respond(chunk)
    columns = np.concatenate([springs, branches], axis=1)
    # Segments are each like the one beside it, within ten times the mean stiffness.
    mean = np.abs(stress).max() / np.abs(STRAIN).max()
    alike = np.diff(np.eye(3, 6), axis=0) / (10 * mean)
    x, _ = nnls(np.vstack([columns, alike]), np.append(stress, [0.0, 0.0]))
    np.testing.assert_allclose(found.guess.stiffness, x, atol=1e-5)
    assert found.chi2 == pytest.approx(np.sum((stress - columns @ x) ** 2), rel=1e-8)
    # What ends at zero was free as well.
    assert (x == 0).any()
    assert found.parameters == len(x)


def test_units_are_the_standard_linear_solid():
    model = StandardLinearSolid()
    names = [p.name for p in model.parameters]
    values = dict(zip(names, (0.7, 0.4, 2.5), strict=True))
    assert names == ["equilibrium_stiffness", "stiffness", "relaxation_time"]
    chunk = Chunk(TIME, STRAIN)
    ours = simulate(Units("sls", (0.0, 1.0), (2.5,)), [0.7, 0.4], [], [chunk])[0]
    np.testing.assert_allclose(
        ours, model.apply(values, chunk)[0], rtol=1e-10, atol=1e-13
    )


def test_stress_of_the_base_is_its_columns_times_stiffness():
    strain = np.stack([STRAIN, -1.7 * STRAIN, 0.1 - STRAIN], axis=1)
    x = RNG.uniform(0.1, 2, 7) * (np.arange(7) != 5)
    for units in (
        Units("pl-wiechert", (-0.2, 0.0, 0.1, 0.3, 0.4), (0.1, 3.0, 50.0)),
        Units("wiechert", (0.0, 1.0), (0.1, 3.0, 50.0)),
        Units("hooke", (0.0, 1.0)),
    ):
        k = x[: units.columns]
        springs, branches = k[: units.segments], k[units.segments :]
        decays = units.decays(TIME, None)
        stress = units.spring_stress(strain, springs)
        half = len(TIME) // 2  # gone on with from where it was left
        first = tuple(d[:half] for d in decays), strain[:half]
        begun, state = units.branch_stress(*first, branches)
        rest = tuple(d[half:] for d in decays), strain[half:]
        stress += np.concatenate(
            [begun, units.branch_stress(*rest, branches, state)[0]]
        )
        for j in range(3):
            plain, viscous, _ = units.respond(Chunk(TIME, strain[:, j]))
            expected = plain @ springs + viscous @ branches
            np.testing.assert_allclose(stress[:, j], expected, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("mullins_softening", {"depth": 0.4}),
        ("load_cell_saturation", {"limit_MPa": 0.5, "knee": 0.1}),
        ("sensor_lag", {"time_constant_s": 0.3}),
    ],
)
def test_slope_is_the_derivative_by_each_stiffness(name, values):
    law = effect(name)
    units = Units("wiechert", (0.0, 1.0), (0.1, 3.0))
    x = np.array([1.0, 0.5, 0.3])
    engine = Engine(Data(("a",), (Chunk(TIME, STRAIN),), (STRAIN,)))
    pieces = (Piece(law, law.defaults() | values, ()),)
    stress, slope = engine.run(Guess(units, x, pieces), True)
    alone, _ = engine.run(Guess(units, x, pieces), False)
    np.testing.assert_allclose(stress, alone, rtol=1e-12)
    for j in range(3):
        step = 1e-5 * (np.arange(3) == j)
        up, _ = engine.run(Guess(units, x + step, pieces), False)
        down, _ = engine.run(Guess(units, x - step, pieces), False)
        by_hand = (up - down) / 2e-5
        np.testing.assert_allclose(slope[:, j], by_hand, atol=2e-3 * by_hand.max())


def test_continued_recordings_are_one_recording_cut_in_two():
    units = Units("pl-wiechert", (0.0, 0.3, 1.0), (0.5, 20.0))
    k = np.array([1.0, 2.0, 0.5, 0.5])
    terms = [Term(effect("mullins_softening"), _mullins())]
    whole = simulate(units, k, terms, [Chunk(TIME, STRAIN)])[0]
    halves = [Chunk(TIME[:150], STRAIN[:150]), Chunk(TIME[150:], STRAIN[150:])]
    parts = simulate(units, k, terms, halves, continued=True)
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=1e-10)


def _mullins(depth=0.4):
    law = effect("mullins_softening")
    return law.defaults() | {"depth": depth, "scale": 0.1}


def test_planted_effect_and_base_come_back_from_noise():
    units = build("pl-wiechert", 0.0, 0.8, 0.1, 40.0, segments=4)
    truth = np.zeros(units.columns)
    truth[:4] = [1.0, 0.8, 0.9, 1.5]
    truth[8] = 0.6
    chunks = tuple(Chunk(TIME, s * STRAIN) for s in (0.5, 1.0, 0.8))
    clean = simulate(
        units, truth, [Term(effect("mullins_softening"), _mullins())], chunks
    )
    rng = np.random.default_rng(11)
    stress = tuple(c + 0.003 * rng.standard_normal(len(c)) for c in clean)
    engine = Engine(Data(("a", "b", "c"), chunks, stress))
    engine.set_noise([np.full(len(c), 0.003) for c in clean], None)
    piece = Piece(effect("mullins_softening"), _mullins(0.1), ("depth", "scale"))
    found = fit(engine, Guess(units, np.zeros(units.columns), (piece,)), iterations=20)
    values = found.guess.pieces[0].values
    assert values["depth"] == pytest.approx(0.4, abs=0.02)
    assert values["scale"] == pytest.approx(0.1, rel=0.15)
    assert found.chi2 / len(found.residual) == pytest.approx(1.0, abs=0.1)


def test_missing_stress_costs_its_sample_only():
    units = Units("hooke", (0.0, 1.0))
    stress = 2.0 * STRAIN
    stress[5:50] = np.nan
    engine = Engine(Data(("a",), (Chunk(TIME, STRAIN),), (stress,)))
    found = fit(engine, Guess(units, np.zeros(1)))
    assert found.guess.stiffness[0] == pytest.approx(2.0, rel=1e-9)
    assert len(found.residual) == len(TIME) - 45


def test_bases():
    for name in BASES:
        units = build(name, -0.1, 0.9, 0.05, 100.0)
        assert (units.segments == 1) == (not name.startswith("pl-"))
    with pytest.raises(InputError, match="no base 'wichert'"):
        build("wichert", 0.0, 1.0, 0.1, 1.0)
    with pytest.raises(InputError, match="never leaves zero"):
        build("hooke", 0.0, 0.0, 0.1, 1.0)


def test_moves_are_made_on_top_of_what_a_simulation_has_beyond_its_stand_in():
    law = effect("load_cell_saturation")  # bends: the same move differs on top of it
    data = Data(("a",), (Chunk(TIME, STRAIN),), (STRAIN,))
    engine = Engine(data, remainder=[0.3 * np.sin(TIME)])
    values = law.defaults() | {"limit_MPa": 0.5, "knee": 0.1}
    pieces = (Piece(law, values, ("limit_MPa",)),)
    guess = Guess(Units("hooke", (0.0, 1.0)), np.array([1.0]), pieces)
    (slot,) = slots(guess)
    change = engine.beside(guess, [[(slot, 0.4)]])[:, 0]
    plain, _ = engine.run(guess, False)
    alone, _ = engine.run(put(guess, [slot], [0.4]), False)
    np.testing.assert_allclose(change, alone - plain, atol=1e-12)
    assert np.abs(change).max() > 0.01


@pytest.mark.parametrize("continued", [False, True])
@pytest.mark.parametrize("law", EFFECTS, ids=lambda law: law.id)
def test_all_starts_of_a_law_in_one_pass_are_each_by_itself(law, continued):
    chunk = law.telltale()
    chunks = (chunk, replace(chunk, strain=0.8 * chunk.strain))
    stress = tuple(c.strain + 0.01 * np.sin(c.time_s) for c in chunks)
    engine = Engine(Data(("a", "b"), chunks, stress, continued=continued))
    units = units_for("pl-wiechert", engine.data)
    guess = Guess(units, np.linspace(0.5, 1.0, units.columns))
    plain, _ = engine.run(guess, False)
    for form in law.forms:
        pieces = start_pieces(engine, form)
        alone = [engine.run(replace(guess, pieces=(p,)), False)[0] for p in pieces]
        wanted = np.stack(alone, axis=1) - plain[:, None]
        found = engine.by_each(guess, pieces)
        np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())
        assert np.abs(wanted).max() > 0


def test_recordings_that_nothing_moves_in_are_not_simulated(monkeypatch):
    law = effect("grip_slip")
    chunks = (law.telltale(),) * 3
    engine = Engine(Data(("a", "b", "c"), chunks, tuple(c.strain for c in chunks)))
    units = units_for("pl-wiechert", engine.data)
    guess = Guess(units, np.linspace(0.5, 1.0, units.columns))
    pieces = [only(p, np.array([1])) for p in start_pieces(engine, law)]
    asked, through = [], Engine._through
    monkeypatch.setattr(
        Engine, "_through", staticmethod(lambda *a: asked.append(a) or through(*a))
    )
    change = engine.by_each(guess, pieces)
    assert len(asked) == 1
    assert np.abs(change[engine.owner == 1]).max() > 0
    assert not change[engine.owner != 1].any()


def test_laws_of_a_strain_that_no_branch_follows_change_what_they_do_in_a_run():
    """Beside branches of several strains of their own, some change nothing at all."""
    chunk = effect("finite_strain").telltale()
    chunks = (chunk, replace(chunk, strain=0.8 * chunk.strain))
    engine = Engine(Data(("a", "b"), chunks, tuple(c.strain for c in chunks)))
    units = units_for("pl-wiechert", engine.data)
    own = effect("finite_strain")
    directed = next(form for form in own.forms if form.form == "DirectedBranches")
    others = [e for e in EFFECTS if e.id != own.id and not e.needs_temperature]
    forms = [form for law in others for form in law.forms if form.acts_before]
    (beside, *_) = start_pieces(engine, directed)
    guess = Guess(units, np.linspace(0.5, 1.0, units.columns), (beside,))
    plain, _ = engine.run(guess, False)
    idle = 0
    for form in forms:
        pieces = start_pieces(engine, form)
        joined = [replace(guess, pieces=(beside, p)) for p in pieces]
        alone = [engine.run(one, False)[0] - plain for one in joined]
        found = engine.by_each(guess, pieces)
        np.testing.assert_allclose(found, np.stack(alone, axis=1), atol=1e-9)
        idle += not found.any()
    assert 0 < idle < len(forms)


def test_span_leaves_out_columns_that_depend_on_others():
    x = np.random.default_rng(2).standard_normal((40, 3))
    q = span(np.column_stack([x, x @ [1.0, 2.0, -1.0], np.zeros(40)]))
    assert q.shape == (40, 3)
    np.testing.assert_allclose(q.T @ q, np.eye(3), atol=1e-9)


def test_finer_units_carry_the_same_stress():
    units = Units("pl-wiechert", (0.0, 0.25, 1.0), (0.5, 5.0))
    stress = STRAIN + STRAIN**2
    engine = Engine(Data(("a",), (Chunk(TIME, STRAIN),), (stress,)))
    coarse = fit(engine, Guess(units, np.ones(units.columns)))
    finer = units.finer()
    assert finer.segments == 4
    assert min(finer.relaxation_times) == min(units.relaxation_times) / 4
    assert set(units.knots) < set(finer.knots)
    assert set(units.relaxation_times) < set(finer.relaxation_times)
    fine = fit(engine, Guess(finer, np.ones(finer.columns)))
    assert fine.chi2 < coarse.chi2


def test_memory_of_the_noise_weighs_as_generalised_least_squares_does():
    rng = np.random.default_rng(9)
    stress = 2.0 * STRAIN + 0.05 * rng.standard_normal(len(TIME))
    engine = Engine(Data(("a",), (Chunk(TIME, STRAIN),), (stress,)))
    engine.set_noise([np.full(len(TIME), 0.05)], [((0.6, 0.5), (0.3, 4.0))])
    found = fit(engine, Guess(Units("hooke", (0.0, 1.0)), np.ones(1)))
    apart = np.abs(TIME[:, None] - TIME)
    dense = 0.6 * np.exp(-apart / 0.5) + 0.3 * np.exp(-apart / 4) + 0.1 * np.eye(400)
    inverse = np.linalg.inv(0.05**2 * dense)
    expected = STRAIN @ inverse @ stress / (STRAIN @ inverse @ STRAIN)
    assert found.guess.stiffness[0] == pytest.approx(expected, rel=1e-8)
    left = stress - expected * STRAIN
    assert found.chi2 == pytest.approx(left @ inverse @ left, rel=1e-8)
