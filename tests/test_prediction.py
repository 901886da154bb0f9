"""Search by prediction: folds, refits without them, choice and decision."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, straight
from scipy.stats import t as student
from scipy.stats import ttest_rel

from softnn import Recording, diagnose
from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.fit import Data, Engine, Guess, Piece, fit
from softnn.mismatch import faults, judgement, prediction
from softnn.mismatch.base import Baseline, start
from softnn.mismatch.case import case_of
from softnn.mismatch.compare import SURE, shares
from softnn.mismatch.decision import Facts, Shows, decide_by_prediction, verdict
from softnn.mismatch.judgement import judge
from softnn.mismatch.prediction import Candidate, Fold, Folds, Judge, best, harms
from softnn.mismatch.screen import only
from softnn.model_file import from_dict, to_dict
from softnn.simulate import Term, simulate

SLACK, SOFT = effect("slack"), effect("mullins_softening")
CYCLES = [0, 0.5, 0.05, 0.5, 0.9, 0.1, 0.9, 0]
NOISE = 0.002  # MPa


def engine(paths=(CYCLES,) * 4, rates=(0.1,) * 4, terms=(), seed=0):
    """Recordings of made-up strips, weighed alike."""
    rng = np.random.default_rng(seed)
    chunks = tuple(straight(p, r, 0.06 / r) for p, r in zip(paths, rates, strict=True))
    stress = simulate(UNITS, STIFFNESS, list(terms), chunks)
    stress = tuple(s + NOISE * rng.standard_normal(len(s)) for s in stress)
    made = Engine(Data(tuple(f"r{i}" for i in range(len(chunks))), chunks, stress))
    return prediction.alike(made)


def left_out(made, specimens=()):
    return {f.recordings: f.by for f in prediction.folds(made, specimens)}


# --- folds ----------------------------------------------------------------------------


def test_recordings_rates_and_amplitudes_are_left_out_but_never_most_of_them():
    low = [0.4 * x for x in CYCLES]
    made = engine((CYCLES, CYCLES, CYCLES, low, low), (0.1, 0.1, 0.1, 0.1, 0.01))
    each = {(r,): "recording" for r in range(5)}
    # Of the rates and amplitudes, the rare ones; one recording is left out once.
    assert left_out(made) == each | {(3, 4): "amplitude"}
    two = [(0, 1), (2, 3), (4,)]
    found = left_out(made, two)
    assert found == dict.fromkeys(two, "specimen") | {(3, 4): "amplitude"}


def test_holds_are_left_out_as_a_kind_of_programme():
    held = [0, 0.9, 0.9]  # for a minute
    made = engine((CYCLES, CYCLES, held, held))
    assert left_out(made)[2, 3] == "programme"


def test_of_one_recording_stretches_are_left_out():
    made = engine((CYCLES,), (0.1,))
    found = prediction.folds(made, [])
    assert [f.by for f in found] == ["stretch"] * 5
    assert sum(f.rows for f in found).tolist() == [1] * len(made.target)


def test_many_recordings_are_left_out_several_at_a_time():
    made = engine((CYCLES,) * 20, (0.1,) * 20)
    found = [f for f in prediction.folds(made, []) if f.by == "recording"]
    assert len(found) == prediction.MOST_FOLDS
    assert sorted(r for f in found for r in f.recordings) == list(range(20))


def test_which_of_many_are_left_out_together_does_not_hang_on_their_order():
    made = engine((CYCLES,) * 20, (0.1,) * 20)
    rng, together = np.random.default_rng(1), []
    size = rng.permutation(20) + 1.0
    for order in (np.arange(20), rng.permutation(20)):
        data = made.data
        stress = tuple(size[r] * data.stress_MPa[r] for r in order)
        other = prediction.alike(Engine(replace(data, stress_MPa=stress)))
        found = [f for f in prediction.folds(other, []) if f.by == "recording"]
        together.append({frozenset(size[order[list(f.recordings)]]) for f in found})
    assert together[0] == together[1]


# --- fits without it ------------------------------------------------------------------


def test_a_refit_without_a_recording_is_a_fit_to_the_others():
    made = engine(terms=[Term(SOFT, SOFT.defaults() | {"depth": 0.4})])
    start = Piece(SOFT, SOFT.defaults() | {"depth": 0.2}, ("depth",))
    found = fit(made, Guess(UNITS, STIFFNESS, (start,)), iterations=30)
    judge = Judge(made, found.guess)
    one = judge.judged(found, refit=True)
    # By another route: recordings 1 to 3 alone, and the first simulated by that.
    data = made.data
    rest = Engine(Data(data.names[1:], data.chunks[1:], data.stress_MPa[1:]))
    other = fit(prediction.alike(rest), found.guess, iterations=30).guess
    missed = made.target - made.run(other, False)[0]
    assert judge.folds.every[0].recordings == (0,)
    expected = made.share[made.owner == 0] @ missed[made.owner == 0] ** 2
    assert one.errors[0] == pytest.approx(expected, rel=1e-3)
    # A step from the fit to all is nearly that, and the engine is as it was.
    assert judge.judged(found).errors == pytest.approx(one.errors, rel=0.05)
    assert fit(made, found.guess).chi2 == pytest.approx(found.chi2, rel=1e-3)


def gaps(*values):
    values = {"gap": np.array(values), "toe": 0.0}
    return Piece(
        SLACK, values, ("gap",), tuple((i,) for i in range(len(values["gap"])))
    )


def test_a_recording_not_met_has_the_mean_gap_of_the_others():
    guess = Guess(UNITS, STIFFNESS, (gaps(0.01, 0.02, 0.09),))
    new = prediction.unmet(guess, Fold("recording", np.ones(1, bool), (2,)), {})
    assert new.pieces[0].values["gap"].tolist() == pytest.approx([0.01, 0.02, 0.015])
    assert new.pieces[0].groups == ((0,), (1,))


def test_a_fault_stays_with_its_recording_and_is_not_learnt_from_it():
    known = gaps(0.0, 0.0, 0.09)
    guess = Guess(UNITS, STIFFNESS, (gaps(0.01, 0.02, 0.3),))
    fold = Fold("recording", np.ones(1, bool), (2,))
    new = prediction.unmet(guess, fold, {"slack": known})
    assert new.pieces[0].values["gap"].tolist() == pytest.approx([0.01, 0.02, 0.09])
    assert new.pieces[0].groups == ((0,), (1,))


def test_a_new_specimen_is_scaled_before_its_stress_is_clipped():
    """Twice as stiff, and cut off at half of that: its true scale leaves nothing."""
    law, cell = effect("gain_error"), effect("load_cell_saturation")
    chunks = [straight([0, 0.9, 0], 0.1, 0.5)] * 2
    limit = Piece(cell, cell.defaults() | {"limit_MPa": 1.0}, ())
    own = Piece(law, {"error": np.array([0.0, 1.0])}, (), ((1,),), nuisance=True)
    terms = [own.term(), limit.term()]
    stress = simulate(UNITS, STIFFNESS, terms, chunks)
    assert stress[1].max() == pytest.approx(1.0)
    made = Engine(Data(("a", "b"), tuple(chunks), tuple(stress)))
    fold = Fold("specimen", made.within((1,)), (1,))
    off = replace(own, values={"error": np.zeros(2)})
    guess = Guess(UNITS, STIFFNESS, (off, limit))
    left = prediction.missed(made, guess, fold, [(0,), (1,)])
    assert left < 1e-6 * float(np.sum(stress[1] ** 2))


def test_all_candidates_have_the_faults_that_are_given():
    offset = effect("zero_offset")
    own = {"offset_MPa": np.array([0.0, 0.0, 0.0, 0.2])}
    wrong = Piece(offset, offset.defaults() | own, ("offset_MPa",), ((3,),))
    made = engine(terms=[wrong.term()])
    base = Baseline(made, fit(made, Guess(UNITS, STIFFNESS)), [], "sls", False)
    found = prediction.search(base, [wrong])
    for one in found:
        assert "zero_offset" not in one.effects
        mine = next(p for p in one.fit.guess.pieces if p.effect.id == "zero_offset")
        assert mine.values["offset_MPa"][3] == pytest.approx(0.2, rel=0.05)
    bare = prediction.alone(base, found)
    assert bare.effects == frozenset()
    assert bare.errors.sum() > 2 * found[0].errors.sum()  # an offset that it lacks


@pytest.mark.parametrize("there", [True, False])
def test_a_fault_is_taken_only_where_it_spoils_the_fit_of_the_others(there):
    """A gap in one of five, or in none: the other four are predicted better, or not."""
    own = {"gap": np.array([0.0, 0.0, 0.08 * there, 0.0, 0.0]), "toe": 0.0}
    terms = [Term(SLACK, own)]
    made = engine((CYCLES,) * 5, (0.1,) * 5, terms)
    found = fit(made, Guess(UNITS, STIFFNESS), iterations=30)
    fault = only(gaps(0.0, 0.0, 0.08, 0.0, 0.0), np.array([2]))
    assert prediction.worth_it(made, found, fault) == there


def test_readings_at_one_limit_are_a_fault_of_all_candidates():
    made = engine()
    assert faults.at_limit(made) == []
    clipped = tuple(np.minimum(s, 0.8) for s in made.data.stress_MPa)
    cut = Engine(replace(made.data, stress_MPa=clipped))
    (fault,) = faults.at_limit(cut)
    assert fault.likely
    assert fault.piece.values["limit_MPa"] == pytest.approx(0.8)


def test_a_specimen_that_other_recordings_show_keeps_its_gap():
    piece = replace(gaps(0.01, 0.05, 0.05), groups=((0,), (1, 2)))
    guess = Guess(UNITS, STIFFNESS, (piece,))
    new = prediction.unmet(guess, Fold("recording", np.ones(1, bool), (2,)), {})
    assert new.pieces[0].values["gap"].tolist() == pytest.approx([0.01, 0.05, 0.05])


@pytest.mark.parametrize("gone", [0, 2])
def test_a_recording_not_met_has_the_scale_that_its_specimen_has_elsewhere(gone):
    """Also of the specimen to which scales refer (0 and 1), which has none itself."""
    law, scale = effect("gain_error"), np.array([0.0, 0.0, 0.3, 0.3, -0.1])
    own = Piece(law, {"error": scale}, (), ((2, 3), (4,)), nuisance=True)
    guess = Guess(UNITS, STIFFNESS, (own,))
    new = prediction.unmet(guess, Fold("rate", np.ones(1, bool), (gone,)), {})
    assert new.pieces[0].values["error"] == pytest.approx(scale)
    assert {r for g in new.pieces[0].groups for r in g} == {2, 3, 4} - {gone}


def test_a_stored_model_gives_new_recordings_the_mean_gap_and_no_fault():
    offset = effect("zero_offset")
    own = {"offset_MPa": np.array([0.0, 0.5])}
    wrong = Piece(offset, offset.defaults() | own, (), ((1,),))
    guess = Guess(UNITS, STIFFNESS, (gaps(0.02, 0.06), wrong))
    model = from_dict(to_dict(guess, ["a", "b"], "fresh", False))
    chunk = straight([0, 0.9], 0.1, 0.5)
    stress = model.stress(["a", "new"], [chunk] * 2, [None] * 2)
    taut = Term(SLACK, {"gap": np.array([0.02, 0.04]), "toe": 0.0})
    expected = simulate(UNITS, STIFFNESS, [taut], [chunk] * 2)
    np.testing.assert_allclose(stress, expected, rtol=1e-9)


def own_forms(made):
    base = Baseline(made, fit(made, Guess(UNITS, STIFFNESS)), [], "sls", False)
    return prediction._own_forms(base)


def test_a_single_loop_does_not_tell_softening_from_viscosity():
    loops, twice = engine(([0, 0.9, 0],) * 3, (0.1,) * 3), engine()
    assert "MullinsSoftening" in own_forms(loops)
    assert "MullinsSoftening" not in own_forms(twice)


def test_a_limit_takes_part_only_where_readings_stay_at_it():
    made = engine()
    assert "LoadCellSaturation" in own_forms(made)
    clipped = tuple(np.minimum(s, 0.8) for s in made.data.stress_MPa)
    cut = Engine(replace(made.data, stress_MPa=clipped))
    assert "LoadCellSaturation" not in own_forms(cut)


def test_faults_of_single_recordings_take_no_part_but_a_gap_does():
    out = own_forms(engine())
    assert {"ZeroOffset", "GainError", "GripSlip", "OwnDrift"} <= out
    assert not {"Slack", "LoadCellDrift", "SensorLag"} & out


# --- choice ---------------------------------------------------------------------------


def candidates(*rows, kinds=("specimen",) * 4):
    """The base and sets of effects with these errors in the folds."""
    rows_ = np.eye(len(kinds), dtype=bool)
    every = tuple(Fold(by, rows_[i], (i,)) for i, by in enumerate(kinds))
    known = Folds(every, np.ones(len(kinds)))
    out = []
    for names, errors in rows:
        laws = [Piece(effect(name), {}, ()) for name in names]
        one = SimpleNamespace(guess=Guess(UNITS, STIFFNESS, tuple(laws)))
        out.append(Candidate(one, np.square(np.array(errors, float)), known))
    return out


def posterior(found, apart=None):
    return prediction.posterior(found, apart or {}, enough=False)[0]


def test_the_base_stays_where_a_correction_is_worse_on_one_kind_of_recordings():
    kinds = ("recording", "recording", "recording", "rate")
    found = candidates(
        ((), (0.1, 0.1, 0.1, 0.2)),
        (("friction_hysteresis",), (0.01, 0.01, 0.01, 0.3)),
        (("finite_strain",), (0.08, 0.08, 0.08, 0.1)),
        kinds=kinds,
    )
    base, loops, finite = found
    assert harms(loops, base) == "rate"
    assert best(found) is finite
    assert best(found[:2]) is base


def test_the_corrected_model_has_what_is_sure():
    found = candidates(
        ((), [0.2] * 4),
        (("slack",), [0.02] * 4),
        (("mullins_softening",), [0.021] * 4),
    )
    assert best(found).effects == {"slack"}
    assert best(found, frozenset({"mullins_softening"})).effects == {
        "mullins_softening"
    }


def test_of_models_that_predict_alike_the_one_that_others_agree_with_is_taken():
    """The best is a stranger at other rates, by no more than chance ahead."""
    found = candidates(
        ((), [0.2] * 4),
        (("sensor_lag",), [0.0200] * 4),
        (("mullins_softening",), [0.0202] * 4),
        (("permanent_set",), [0.0204] * 4),
        (("finite_strain",), [0.1] * 4),  # far behind
    )
    laws = {"sensor_lag": {"time_constant_s": 1.0}, "finite_strain": {"amount": 3.0}}
    for one in found[1:]:
        (law,) = (effect(n) for n in one.effects)
        values = {**law.defaults(), **law.off, **laws.get(law.id, {})}
        one.fit.guess = Guess(UNITS, STIFFNESS, (Piece(law, values, ()),))
    made = engine()
    assert best(found).effects == {"sensor_lag"}
    assert best(found, engine=made).effects == {"mullins_softening"}
    sure = frozenset({"sensor_lag"})
    assert best(found, sure, made).effects == sure


def test_a_fold_in_which_a_law_fails_wholly_makes_the_others_no_less_certain():
    alike, fails = [0.01, 0.0102, 0.0099, 0.0101, 0.01], [0.01] * 4 + [0.1]
    rest = [0.03, 0.01, 0.0033, 0.02, 0.1]
    told, scattered = (
        shares(np.array([alike, one]), np.zeros(2), 1 / 4) for one in (fails, rest)
    )
    assert told[0] > SURE > scattered[0]


def test_what_is_better_by_chance_alone_corrects_nothing():
    found = candidates(((), [0.05] * 4), (("slack",), [0.0495] * 4))
    assert best(found) is found[0]


def test_scatter_of_recordings_is_no_harm():
    base, one = candidates(
        ((), (0.10, 0.02, 0.10, 0.10)), (("slack",), (0.02, 0.024, 0.02, 0.02))
    )
    assert harms(one, base) is None


def test_an_effect_that_others_replace_is_not_sure():
    found = candidates(
        ((), [0.2] * 4),
        (("mullins_softening", "slack"), [0.01] * 4),
        (("mullins_softening", "permanent_set"), [0.01] * 4),
    )
    effects = posterior(found).effects
    assert effects["mullins_softening"] > 0.9
    assert effects["slack"] == pytest.approx(effects["permanent_set"])
    assert effects["slack"] < 0.5


def test_what_is_left_stands_beside_a_name_and_not_in_its_place():
    """Half of the error stays, and yet every fold needs the effect."""
    told = posterior(candidates(((), [0.2] * 4), (("slack",), [0.1] * 4)))
    assert told.effects["slack"] > 0.9
    assert told.nothing == 0  # the base is not good enough


PAIR = np.array([[0.01, 0.02, 0.05, 0.1], [0.012, 0.021, 0.07, 0.11]])


def test_shares_are_those_of_a_paired_test():
    """Without a prior on the spread: Student's tail of the paired differences."""
    found = shares(PAIR, np.zeros(2), 0.0)
    log = np.log(PAIR + 1e-3)
    p = ttest_rel(log[1], log[0], alternative="greater").pvalue
    # The usual spread is a little smaller than this one: the two agree nearly.
    assert found[1] / (2 * found[1] + (1 - 2 * found[1])) == pytest.approx(
        p / (p + 0.5), abs=0.03
    )
    apart = shares(np.exp(np.log(PAIR) + [[0.0], [0.5]]), np.zeros(2), 0.0)
    assert apart[1] < found[1]


@pytest.mark.parametrize("unseen", [0.2, 1 / 3, 1.0])
def test_folds_that_share_recordings_tell_less(unseen):
    """Nadeau and Bengio 2003, eq. 9: t shrinks by the root of 1 + n n2 / n1."""

    def statistic(ratio):
        best, other = shares(PAIR, np.zeros(2), ratio)
        return student.isf(0.5 * other / best, 4)

    shrunk = statistic(0.0) / statistic(unseen)
    assert shrunk == pytest.approx(np.sqrt(1 + 4 * unseen))


def test_names_take_the_folds_for_what_they_leave_out():
    """Half of the samples are left out in each fold, or a quarter: so less is sure."""
    found = candidates(((), [0.2] * 4), (("slack",), [0.13, 0.17, 0.11, 0.15]))
    told = [posterior(found)]
    halves = [np.arange(4) % 2 == k for k in (0, 1, 0, 1)]
    every = zip(found[0].folds.every, halves, strict=True)
    known = Folds(tuple(replace(f, rows=rows) for f, rows in every), np.ones(4))
    found = [replace(c, folds=known) for c in found]
    told.append(posterior(found))
    assert told[0].effects["slack"] > told[1].effects["slack"] > 0.5
    errors = np.array([c.nrmse for c in found])
    expected = shares(errors, np.arange(2), 1.0)[1]
    assert told[1].effects["slack"] == pytest.approx(expected)
    least = prediction.posterior(found, {}, enough=False)[1].least["slack"]
    fewer = [shares(np.delete(errors, k, 1), np.arange(2), 1.0)[1] for k in range(4)]
    assert least == pytest.approx(min(fewer))


def test_what_is_left_out_is_counted_in_samples():
    every = [np.arange(10) < 5, np.arange(10) < 2]
    known = Folds(tuple(Fold("recording", rows, (0,)) for rows in every), np.ones(2))
    assert known.unseen == pytest.approx((1 + 0.25) / 2)


def test_laws_that_take_each_others_place_are_one_class():
    found = candidates(
        ((), [0.2] * 4),
        (("mullins_softening", "finite_strain"), [0.01] * 4),
        (("mullins_softening", "nonlinear_viscosity"), [0.01] * 4),
    )
    names = prediction.posterior(found, {}, enough=False)[1]
    (one,) = names.classes
    assert set(one.members) == {"finite_strain", "nonlinear_viscosity"}
    assert one.probability > 0.9
    assert one.name == "viscosity that depends on strain or rate"


def test_a_name_that_hangs_on_one_fold_is_not_steady():
    errors = [0.1] * 5, [0.1, 0.1, 0.1, 0.1, 0.002]
    found = candidates(
        ((), errors[0]), (("slack",), errors[1]), kinds=("recording",) * 5
    )
    names = prediction.posterior(found, {}, enough=False)[1]
    assert names.least["slack"] < names.probability["slack"]
    assert names.least["slack"] < 0.5


@pytest.mark.parametrize("recordings", [1, 2, 3, 5])
def test_one_or_two_recordings_make_no_name_sure(recordings):
    rows = ((), [0.2] * 5), (("slack",), [1e-4] * 5)  # as clear as can be
    found = candidates(*rows, kinds=("recording",) * 5)
    every = tuple(
        Fold("recording", f.rows, (i % recordings,) if recordings > 1 else ())
        for i, f in enumerate(found[0].folds.every)
    )
    known = Folds(every, found[0].folds.squares)
    told = posterior([replace(c, folds=known) for c in found])
    assert (told.effects["slack"] >= SURE) == (recordings > 2)
    assert told.effects["slack"] >= 0.5  # most likely all the same
    assert (told.nothing_named >= 0.1) == (recordings <= 2)


# --- decision -------------------------------------------------------------------------


SHOWS = Shows(few=False, only_loading=False)


def decided(found, correct, shows=SHOWS, apart=()):
    return decide_by_prediction(
        posterior(found, dict.fromkeys(apart, 0.97)),
        found[0],
        correct,
        lambda one: one.heldout,
        shows,
        apart=frozenset(apart),
    )


def test_names_and_the_corrected_model_are_two_results():
    found = candidates(
        ((), [0.2] * 4),
        (("mullins_softening", "slack"), [0.01] * 4),
        (("mullins_softening", "permanent_set"), [0.01] * 4),
    )
    told = decided(found, found[1])
    assert told.names == ("mullins_softening",)
    assert told.account.effects == {"mullins_softening", "slack"}
    assert told.verdict == "explained"  # 1 % is good enough
    assert told.after.nrmse < told.before.nrmse


def test_nothing_is_named_where_the_base_predicts_best():
    found = candidates(((), [0.05] * 4), (("slack",), [0.051] * 4))
    told = decided(found, found[0])
    assert (told.names, told.verdict) == ((), "unexplained")
    assert told.account is found[0]


def test_a_fault_that_corrects_is_no_effect_of_the_material():
    found = candidates(
        ((), [0.2] * 4), (("zero_offset",), [0.01] * 4), (("slack",), [0.012] * 4)
    )
    told = decided(found, found[1], apart=("zero_offset",))
    assert not told.helps  # of the material nothing predicts better
    assert told.names in ((), ("zero_offset",))


@pytest.mark.parametrize(
    "shows", [Shows(few=True, only_loading=False), Shows(few=False, only_loading=True)]
)
def test_recordings_that_show_little_correct_nothing(shows):
    found = candidates(((), [0.2] * 4), (("mullins_softening",), [0.01] * 4))
    told = decided(found, found[1], shows)
    assert (told.names, told.verdict) == ((), "undetermined")
    assert told.account is found[0]


def test_a_fault_of_one_recording_is_named_whatever_predicts_others():
    base, soft = candidates(((), [0.05] * 4), (("zero_offset",), [0.05] * 4))
    told = decided([base], soft, apart=("zero_offset",))
    assert told.names == ("zero_offset",)
    assert told.account is soft


def test_a_name_that_does_not_stay_is_not_given():
    found = candidates(((), [0.2] * 4), (("slack",), [0.01] * 4))
    told = decide_by_prediction(
        posterior(found),
        found[0],
        found[1],
        lambda one: one.heldout,
        SHOWS,
        unsteady=frozenset({"slack"}),
    )
    assert told.names == ()
    assert told.account is found[1]  # it corrects all the same


def test_a_ramp_of_few_samples_weighs_as_much_as_its_hold_in_a_fit():
    time = np.arange(0, 200, 0.5)
    chunk = Chunk(time, np.minimum(0.05 * time, 0.5))
    made = prediction.alike(Engine(Data(("a",), (chunk,), (chunk.strain,))))
    weight = made.sigma**-2
    ramp = time <= 10
    assert weight[ramp].sum() == pytest.approx(weight[~ramp].sum(), rel=0.15)


def test_no_correction_is_worse_than_what_it_corrects():
    base, soft = candidates(((), [0.05] * 4), (("zero_offset",), [0.08] * 4))
    told = decided([base], soft, apart=("zero_offset",))
    assert told.account is base
    assert told.after is told.before


@pytest.mark.parametrize(
    ("facts", "word", "action"),
    [
        (Facts(few=True, nothing=True), "undetermined", "record_more"),
        (Facts(noise=True, nothing=True), "undetermined", "check_signal"),
        (Facts(nothing=True, only_loading=True), "nothing_missing", "record_unloading"),
        (Facts(nothing=True), "nothing_missing", "use_simulation"),
        (Facts(enough=True, only_loading=True), "good_enough", "record_unloading"),
        (Facts(enough=True, sure=True), "good_enough", "use_simulation"),
        (Facts(sure=True, corrected=True, near=True), "explained", "use_corrected"),
        (Facts(sure=True, near=True), "partly_explained", "use_corrected_and_record"),
        (Facts(sure=True), "partly_explained", "record"),
        (Facts(only_loading=True), "undetermined", "record_unloading"),
        (Facts(missing=True), "unexplained", "record"),
        (
            Facts(missing=True, helps=True, corrected=True),
            "undetermined",
            "use_corrected_and_record",
        ),
        (Facts(missing=True, helps=True), "undetermined", "record"),
    ],
)
def test_every_row_of_the_table_of_verdicts(facts, word, action):
    assert verdict(facts) == (word, action)


# --- all of it ------------------------------------------------------------------------


def bent_strips(soft, tops=(0.5, 0.6, 0.7, 0.8), gaps=(0, 0, 0, 0), limit=np.inf):
    """Four strips of a material that no law here describes, softened or not.

    Each has its gap; the load cell ends at the limit.
    """
    out = []
    for i, (top, gap) in enumerate(zip(tops, gaps, strict=True)):
        path = [0, 0.5 * top, 0, 0.5 * top, top, 0, top, 0]
        chunk = straight(path, 0.1, 0.05)
        strain = np.maximum(chunk.strain - gap, 0)
        largest = np.maximum.accumulate(strain)
        below = np.clip((largest - strain) / 0.3, 0, 1)
        wavy = 1 + 0.15 * np.sin(9 * strain) * np.tanh(3 * largest)
        stress = 2 * strain * wavy * (1 - soft * below * np.tanh(4 * largest))
        rng = np.random.default_rng(i)
        noisy = stress + 5e-4 * rng.standard_normal(len(stress))
        noisy = np.minimum(noisy, limit)
        out.append(Recording(chunk.time_s, chunk.strain, noisy, name=f"s{i}"))
    return out


def test_a_search_that_cannot_decide_is_not_made(monkeypatch):
    """A spring that no law here has, and hardly any noise."""

    def thrown_away(*_):
        raise AssertionError("a search by likelihood")

    monkeypatch.setattr(judgement, "search", thrown_away)
    chunk = straight(CYCLES, 0.1, 0.05)
    spring = chunk.strain * (1 + 0.3 * np.sin(12 * chunk.strain))
    noise = 1e-4 * np.random.default_rng(0).standard_normal((3, len(spring)))
    strips = [Recording(chunk.time_s, chunk.strain, spring + n) for n in noise]
    assert judge(start(case_of(strips, "c"), "hooke")).judged_by == "prediction"


def test_the_corrected_model_is_the_central_one(monkeypatch):
    """The judgement asks for it on few samples, and gives what it is told."""
    base, told = start(case_of(bent_strips(0.35), "c"), "hooke"), []

    def marked(one, every, engine):
        assert engine is base.coarse
        told.append(replace(one, errors=1.01 * one.errors))
        return told[-1]

    monkeypatch.setattr(prediction, "central", marked)
    found = judge(base)
    assert found.decision.account.errors is told[0].errors


def test_softening_of_a_material_that_no_law_describes_is_named_by_prediction():
    found = diagnose(bent_strips(0.4), "hooke")
    assert found.result["judged_by"] == "prediction"
    assert "mullins_softening" in found.selected
    errors = found.result["fit"]
    assert errors["after"]["heldout_nrmse"] < 0.5 * errors["before"]["heldout_nrmse"]
    assert errors["after"]["worst"]["nrmse"] >= errors["after"]["heldout_nrmse"]
    stress = np.concatenate([strip.stress_MPa for strip in bent_strips(0.4)])
    noise = 5e-4 / np.sqrt(np.mean(stress**2))  # not what no law explains
    assert errors["noise_nrmse"] == pytest.approx(noise, rel=0.1)


@pytest.mark.slow
def test_faults_of_single_replicates_are_named_beside_softening():
    strips = bent_strips(0.4, (0.7,) * 4, (0, 0.05, 0, 0), 1.0)
    found = diagnose(strips, "hooke")
    assert found.result["judged_by"] == "prediction"
    assert {"slack", "load_cell_saturation"} <= set(found.selected)
    assert "mullins_softening" in found.selected
    # Readings at a limit are one, whatever law is the right one.
    chance = found.probability
    assert min(chance["load_cell_saturation"], chance["mullins_softening"]) > SURE
    told = {e["effect"]: e for e in found.result["explanations"]}
    assert told["slack"]["recordings"] == ["s1"]


@pytest.mark.slow
def test_replicates_nobody_named_are_specimens_unless_somebody_says_otherwise():
    strips = [
        replace(strip, stress_MPa=(1 + 0.1 * i) * strip.stress_MPa)
        for i, strip in enumerate(bent_strips(0.4, (0.7,) * 4))
    ]
    alike = [replace(strip, specimen="one") for strip in strips]
    several, one = (diagnose(every, "hooke").result["fit"] for every in (strips, alike))
    assert (several["heldout_by"], one["heldout_by"]) == ("specimen", "recording")
    assert several["after"]["heldout_nrmse"] < 0.5 * one["after"]["heldout_nrmse"]
