"""Phases, regions, held-out errors, gaps, thinning; and which recordings to refuse."""

from dataclasses import replace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, histories, straight

from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.fit import Data, Engine, Guess, Piece, fit
from softnn.metrics import weights
from softnn.mismatch.base import start
from softnn.mismatch.candidates import candidates
from softnn.mismatch.case import Case, mask_failure, mask_gaps, sparse, thin, to_data
from softnn.mismatch.diagnosis import diagnose
from softnn.mismatch.locate import only_loading
from softnn.mismatch.verify import heldout, ratio_interval
from softnn.models.units import Units
from softnn.recording import Recording
from softnn.simulate import Term, simulate
from softnn.state import BRANCHES, phases, runs


def test_phases_of_a_triangle_with_a_hold():
    chunk = straight([0, 0.5, 0.1, 0.6, 0.6, 0], 0.1, 0.05)
    told = [BRANCHES[b] for b in phases(chunk).branch]
    at = {t: told[int(t / 0.05)] for t in (2.5, 7.0, 11.0, 13.5, 40.0, 77.0)}
    assert at == {
        2.5: "first loading",
        7.0: "unloading",
        11.0: "reloading",
        13.5: "first loading",
        40.0: "hold",
        77.0: "unloading",
    }
    assert phases(chunk).cycle.max() == 2


def test_phases_do_not_depend_on_how_fine_the_clock_is():
    chunk = straight([0, 0.5, 0.1, 0.6, 0.6, 0], 0.1, 0.05)
    coarse = Chunk(np.floor(chunk.time_s / 0.1) * 0.1, chunk.strain)
    apart = phases(chunk).branch != phases(coarse).branch
    assert apart.mean() < 0.02


def test_runs():
    mask = np.array([1, 1, 0, 1, 1, 1], bool)
    label = np.array([0, 0, 0, 1, 1, 2])
    assert runs(mask, label) == [(0, 2), (3, 5), (5, 6)]


def test_heldout_of_a_linear_base_is_that_of_refitting():
    rng = np.random.default_rng(2)
    chunks = tuple(histories()[:3])
    units = Units("pl-sls", (0.0, 0.2, 1.0), (1.0,))
    units = Units("pl-wiechert", units.knots, (0.5, 5.0))
    stress = tuple(
        s + 0.01 * rng.standard_normal(len(s))
        for s in simulate(UNITS, STIFFNESS, [], chunks)
    )
    engine = Engine(Data(("a", "b", "c"), chunks, stress))
    found = fit(engine, Guess(units, np.zeros(4)))
    errors = heldout(engine, found).errors
    for r in range(3):
        rest = [i for i in range(3) if i != r]
        other = Engine(
            Data(
                ("x", "y"),
                tuple(chunks[i] for i in rest),
                tuple(stress[i] for i in rest),
            )
        )
        alone = fit(other, Guess(units, np.zeros(4))).guess
        (predicted,) = simulate(units, alone.stiffness, [], [chunks[r]])
        expected = float(engine.data.weights[r] @ (predicted - stress[r]) ** 2)
        assert errors[r] == pytest.approx(expected, rel=2e-3)


def test_misfit_left_out_is_that_of_a_prediction_with_its_covariance():
    rng = np.random.default_rng(4)
    chunks = tuple(histories()[:3])
    stress = tuple(
        s + 0.01 * rng.standard_normal(len(s))
        for s in simulate(UNITS, STIFFNESS, [], chunks)
    )
    sigma = [np.full(len(s), 0.01) for s in stress]
    engine = Engine(Data(("a", "b", "c"), chunks, stress), sigma)
    found = fit(engine, Guess(UNITS, np.zeros(len(STIFFNESS))))
    assert np.all(found.guess.stiffness > 0)
    j, target = found.jacobian, engine.whiten(engine.target)
    total = 0.0
    for r in range(3):
        own = engine.owner == r
        inverse = np.linalg.inv(j[~own].T @ j[~own])
        missed = target[own] - j[own] @ (inverse @ (j[~own].T @ target[~own]))
        covariance = np.eye(own.sum()) + j[own] @ inverse @ j[own].T
        total += missed @ np.linalg.solve(covariance, missed)
    assert heldout(engine, found).misfit == pytest.approx(total / len(target), rel=1e-4)
    assert total / len(target) == pytest.approx(1, abs=0.1)


def test_heldout_of_one_recording_with_values_of_its_own_is_that_of_refitting():
    # Five stretches; what the recording alone has is read off the other four.
    rng = np.random.default_rng(3)
    chunks, offset = tuple(histories()[:1]), effect("zero_offset")
    term = Term(offset, {"offset_MPa": np.array([0.2])})
    (stress,) = simulate(UNITS, STIFFNESS, [term], chunks)
    noisy = stress + 0.01 * rng.standard_normal(len(stress))
    engine = Engine(Data(("a",), chunks, (noisy,)), [np.full(len(noisy), 0.01)])
    piece = Piece(offset, {"offset_MPa": np.array([0.1])}, ("offset_MPa",), ((0,),))
    for fixed in (False, True):
        guess = Guess(UNITS, np.asarray(STIFFNESS, float), (piece,))
        found = fit(engine, guess, fixed_base=fixed)
        errors = heldout(engine, found).errors
        assert len(errors) == 5
        for g, error in enumerate(errors):
            test = np.arange(len(noisy)) * 5 // len(noisy) == g
            if fixed:
                level = (noisy - stress + 0.2)[~test].mean()
                share = engine.share[test]
                expected = share @ (noisy - stress + 0.2 - level)[test] ** 2
                assert error == pytest.approx(expected, rel=2e-3)
            assert error < 1.3 * engine.share[test].sum() * 0.01**2


def test_ratio_interval_covers_the_ratio():
    rng = np.random.default_rng(0)
    before = rng.uniform(1, 2, 7)
    ratio, low, high = ratio_interval(before, 0.25 * before, rng)
    assert ratio == pytest.approx(0.5)
    assert low == pytest.approx(0.5)
    assert high == pytest.approx(0.5)


def test_stress_after_a_gap_on_the_move_is_not_used():
    time = np.concatenate([np.arange(0, 10, 0.1), np.arange(13, 60, 0.1)])
    strain = 0.3 * np.sin(2 * np.pi * time / 2.0)
    recording = Recording(time, strain, strain, name="a")
    case = Case("c", (recording,))
    stress = mask_gaps(case).recordings[0].stress_MPa
    assert np.isnan(stress[(time > 12) & (time < 30)]).all()
    assert np.isfinite(stress[(time < 10) | (time > 40)]).all()
    still = Recording(time, np.full(len(time), 0.3), strain, name="a")
    held = mask_gaps(Case("c", (still,))).recordings[0].stress_MPa
    assert np.isfinite(held).all()


def cut(time, strain, stress):
    """Share of the samples after which softnn takes the specimen for failed."""
    case = Case("c", (Recording(time, strain, stress, name="a"),))
    (seen,) = mask_failure(case).recordings
    return np.isfinite(seen.stress_MPa).mean()


def test_what_relaxes_has_not_failed():
    """A ramp, and a hold in which nine tenths of the stress relax in a second."""
    time = np.linspace(0, 60, 3001)
    strain = np.minimum(time / 10, 1.0)
    held = np.exp(-np.maximum(time - 10, 0))
    assert cut(time, strain, strain * (0.1 + 0.9 * held)) == 1.0
    assert cut(time, strain, strain * (time < 30)) == pytest.approx(0.5, abs=0.01)


def test_friction_that_turns_round_has_not_failed():
    time = np.linspace(0, 20, 2001)
    strain = 1 - np.abs(time / 10 - 1)
    assert cut(time, strain, np.where(time < 10, 1.0, -1.0)) == 1.0


def test_a_pull_that_goes_on_without_stress_has_failed():
    strain = np.linspace(0, 5, 1001)
    assert cut(strain, strain, strain * (strain < 3)) == pytest.approx(0.6, abs=0.01)
    assert cut(strain, -strain, -strain * (strain < 3)) == pytest.approx(0.6, abs=0.01)
    start = np.exp(-strain)  # a blank run: a start, and then nothing
    assert cut(strain, strain, start) == 1.0


def test_fewer_samples_give_the_same_error():
    """`sparse` chooses samples by weight; a wrong hold counts as much among them."""
    time = np.linspace(0, 520, 2601)
    strain = np.minimum(time / 300, 1.0) - np.maximum(time - 420, 0) / 300
    wrong = 0.1 * ((time > 300) & (time < 420))
    case = Case("c", (Recording(time, strain, strain + wrong, name="a"),))

    def error(case):
        (data,) = case.recordings
        weight = weights(data.time_s, data.strain)
        return np.sqrt(
            weight @ (data.stress_MPa - data.strain) ** 2 / (weight @ data.strain**2)
        )

    assert error(case) > 0.04
    for most in (1000, 300):
        assert error(sparse(case, most)) == pytest.approx(error(case), rel=0.02)


def test_thinning_keeps_reversals():
    time = np.arange(0, 100, 0.01)
    strain = 0.5 * np.abs((time / 10) % 2 - 1)
    case = Case("c", (Recording(time, strain, strain, name="a"),))
    few = to_data(thin(case, 200)).chunks[0]
    assert len(few.time_s) < 300
    assert np.interp(10.0, few.time_s, few.strain) == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.interp(time, few.time_s, few.strain) - strain).max() < 0.01


@pytest.mark.parametrize("count", [1000, 1001, 1700, 2400])
def test_thinning_forgets_one_sample_of_a_row_less(count):
    time = 0.1 * np.arange(count)
    strain = 0.5 * np.abs((time / 10) % 2 - 1)
    whole = Recording(time, strain, strain, name="a")
    for row in (1, 500, count - 2):
        less = [
            np.delete(getattr(whole, name), row)
            for name in ("time_s", "strain", "stress_MPa")
        ]
        kept = [
            set(thin(Case("c", (one,)), 1000).recordings[0].time_s)
            for one in (whole, Recording(*less, name="a"))
        ]
        assert len(kept[0] ^ kept[1]) <= 4  # of a corner, both beside it
        assert len(kept[0]) > 500


def test_thinning_keeps_fast_stretches_dense():
    fast, slow = np.arange(0, 2, 0.001), 2 + np.arange(0, 2000.0)
    time = np.concatenate([fast, slow])
    recording = Recording(time, time, time, name="a")
    kept = thin(Case("c", (recording,)), 1000).recordings[0].time_s
    assert (kept < 2).sum() == pytest.approx(500, abs=2)


@pytest.mark.parametrize(
    ("levels", "only"),
    [
        ([0, 0.8], True),
        ([0, 0, 0.8], True),
        ([0, 0.8, 0.8], False),
        ([0, 0.8, 0], False),
    ],
)
def test_a_wait_before_the_pull_is_no_hold(levels, only):
    chunk = straight(levels, 0.02, 0.1)
    data = Data(("a",), (chunk,), (chunk.strain,))
    assert only_loading(Engine(data)) == only


@pytest.mark.parametrize(("dwell_s", "only"), [(4.0, True), (12.0, False)])
def test_a_short_dwell_at_the_end_of_a_pull_is_no_hold(dwell_s, only):
    time = np.arange(0, 40 + dwell_s, 0.1)
    chunk = Chunk(time, 0.02 * np.minimum(time, 40.0))
    data = Data(("a",), (chunk,), (chunk.strain,))
    assert only_loading(Engine(data)) == only


def test_a_dwell_is_as_long_as_it_lasts_however_few_its_samples():
    time = np.concatenate([np.arange(0, 40, 0.1), [40, 44, 48, 52]])
    chunk = Chunk(time, 0.02 * np.minimum(time, 40.0))
    assert not only_loading(Engine(Data(("a",), (chunk,), (chunk.strain,))))


@pytest.mark.parametrize(
    ("levels", "shown"),
    [
        ([0, 0.4, 0.4, 0.8, 0.8], False),  # held twice, never let back
        ([0, 0.8, 0.8, 0.79], False),
        ([0, 0.4, 0.4, 0.8, 0.8, 0.4], True),
        ([0, 0.8], True),  # first loading alone has a verdict of its own
    ],
)
@pytest.mark.parametrize("split", [False, True])
def test_what_shows_on_the_way_back_is_not_asked_for_before(levels, shown, split):
    chunk = straight(levels, 0.02, 0.1)
    chunks = [chunk]
    if split and len(levels) > 4:  # the same history, recorded in two parts
        half = len(chunk.time_s) // 2
        chunks = [
            Chunk(chunk.time_s[part], chunk.strain[part])
            for part in (slice(half), slice(half, None))
        ]
    names = tuple("ab"[: len(chunks)])
    strains = tuple(c.strain for c in chunks)
    engine = Engine(Data(names, tuple(chunks), strains, continued=split))
    asked = {e.id for e in candidates(engine, Units("pl-wiechert", (0.0, 1.0)).has)}
    back = {"mullins_softening", "permanent_set", "cyclic_softening"}
    back |= {"friction_hysteresis"}
    assert (back <= asked) if shown else not (back & asked)
    assert {"finite_strain", "nonlinear_viscosity", "slack"} <= asked


# -- recordings that cannot be used, and some that only look so ------------------------


def spring(time, strain, scale=1.0, name="a", noise=0.002):
    rng = np.random.default_rng(0)
    stress = scale * (strain + noise * rng.standard_normal(len(strain)))
    return Recording(time, strain, stress, name=name)


TIME = np.linspace(0, 40, 400)
STRAIN = 0.3 * (1 - np.abs(TIME / 20 - 1))


def test_relaxation_times_begin_at_the_interval_of_the_recording():
    """Though the search looks at fewer samples than were recorded."""
    time = np.linspace(0, 40, 4001)
    strain = 0.3 * (1 - np.abs(time / 20 - 1))
    base = start(Case("c", (spring(time, strain),)), "wiechert")
    assert len(base.engine.target) < len(time)
    assert min(base.fit.guess.units.relaxation_times) == pytest.approx(0.01)


def test_a_recording_of_many_repeated_stamps_is_diagnosed():
    time = np.repeat(TIME[::4], 4)  # the median of the steps is zero
    found = diagnose(Case("c", (spring(time, STRAIN),)), "wiechert").result
    assert found["verdict"] in ("nothing_missing", "undetermined")


def test_gaps_are_looked_for_among_the_steps_that_are_none():
    time = np.repeat(np.arange(50_000.0), 3)
    strain = 0.3 * np.sin(time / 300)
    (seen,) = mask_gaps(Case("c", (spring(time, strain),))).recordings
    assert np.isfinite(seen.stress_MPa).all()
    time = np.where(time > 20_000, time + 2_000, time)
    (seen,) = mask_gaps(Case("c", (spring(time, strain),))).recordings
    lost = np.isnan(seen.stress_MPa)
    assert lost.any()
    assert time[lost].min() > 20_000
    assert time[lost].max() < 22_001 + 8 * 2_001


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"time_s": np.zeros(400)}, "clock"),
        ({"time_s": TIME * 1e-300}, "clock"),
        ({"time_s": TIME * 1e300}, "clock"),
        ({"strain": 1e-300 * STRAIN}, "elongation over length"),
        ({"strain": 1e3 * STRAIN}, "per cent"),
        ({"strain": 0 * STRAIN}, "never leaves zero"),
        ({"stress_MPa": 0 * STRAIN}, "connected"),
        ({"stress_MPa": 1e-300 * STRAIN}, "connected"),
        ({"stress_MPa": 1e300 * STRAIN}, "in MPa"),
    ],
)
def test_what_cannot_be_a_recording_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        diagnose(Case("c", (replace(spring(TIME, STRAIN), **change),)), "hooke")


def test_names_must_differ_and_there_must_be_one():
    twice = spring(TIME, STRAIN), spring(TIME, STRAIN)
    with pytest.raises(InputError, match="two recordings are called 'a'"):
        diagnose(Case("c", twice), "hooke")
    with pytest.raises(InputError, match="no recordings"):
        diagnose(Case("c", ()), "hooke")


@pytest.mark.slow  # fewer samples end before all is tried
@pytest.mark.parametrize("stress", [np.full(400, 0.3), np.where(TIME > 20, 0.3, 0.0)])
def test_a_stress_that_does_not_follow_is_no_reason_to_break_off(stress):
    case = Case("c", (Recording(TIME, STRAIN, stress, name="a"),))
    assert diagnose(case, "hooke").result["verdict"]
