"""Preparation against curves whose answer is known in closed form."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from prepared_made import RATE, hold
from scipy.signal import savgol_filter

from softnn import prepare
from softnn.contracts import InputError
from softnn.prepare.smoothing import savitzky_golay
from softnn.recording import Geometry, Recording


def neo_hookean(strain):
    """Engineering stress of mu = 1 MPa: initial modulus 3 MPa, softening after."""
    stretch = 1 + strain
    return stretch - stretch**-2


def pulled(stress_of, ultimate=2.0, slack=0.0, noise=0.0, n=2001, tail=30, **about):
    """A test as the machine sees it: slack, curve, failure, a few samples more."""
    strain = np.linspace(0, ultimate + slack, n)
    stress = stress_of(np.maximum(strain - slack, 0))
    step = strain[1]
    strain = np.concatenate([strain, strain[-1] + step * np.arange(1, tail + 1)])
    stress = np.concatenate([stress, np.zeros(tail)])
    stress = stress + noise * np.random.default_rng(1).standard_normal(len(stress))
    return Recording(strain / RATE, strain, stress, rate_per_s=RATE, **about)


def flipped(recording):
    return Recording(recording.time_s, -recording.strain, -recording.stress_MPa)


# --- failure -------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("turn", [lambda r: r, flipped])
def test_failure_is_cut_at_the_last_whole_sample(noise, turn):
    cut = prepare.cut_failure(turn(pulled(neo_hookean, noise=noise)))
    assert abs(len(cut) - 2001) <= (0 if noise < 0.02 else 3)
    assert cut.log[-1].name == "cut_failure"


def test_failure_on_a_noisy_plateau_is_not_cut_at_the_highest_noise():
    flat = pulled(lambda e: np.minimum(3 * e, 0.3), noise=0.003)
    assert flat.stress_MPa.argmax() < 1900  # the trap: the peak lies anywhere
    assert len(prepare.cut_failure(flat)) == 2001


def test_slow_tearing_is_cut_and_a_slip_that_recovers_is_not():
    strain = np.linspace(0, 2, 1000)
    torn = np.where(strain < 1.5, strain, 1.5 - 4 * (strain - 1.5))
    cut = prepare.cut_failure(Recording(strain, strain, torn))
    assert cut.strain[-1] == pytest.approx(1.5 * (1 + 0.05 / 4), abs=0.004)
    slip = np.where(np.abs(strain - 1) < 0.02, 0.6 * strain, strain)
    assert len(prepare.cut_failure(Recording(strain, strain, slip))) == 1000


def test_cycles_and_relaxation_are_not_failure():
    time = np.linspace(0, 60, 3001)
    strain = 0.5 * np.abs(((time / 5 + 1) % 2) - 1)
    strain = strain.max() - strain
    cycles = Recording(
        time, strain, neo_hookean(strain) - 0.1 * (np.gradient(strain) < 0)
    )
    assert len(prepare.cut_failure(cycles)) == len(cycles)
    held = hold()
    assert len(prepare.cut_failure(held)) == len(held)
    assert len(prepare.cut_failure(flipped(held))) == len(held)


def test_snap_in_a_hold_is_failure():
    held = hold()
    stress = held.stress_MPa.copy()
    broken = int(np.searchsorted(held.time_s, 6.0))
    stress[broken:] = 0
    cut = prepare.cut_failure(Recording(held.time_s, held.strain, stress))
    assert len(cut) == broken


def test_no_failure_leaves_every_sample():
    strain = np.linspace(0, 1, 50)
    whole = Recording(strain, strain, neo_hookean(strain))
    assert len(prepare.cut_failure(whole)) == 50
    with pytest.raises(InputError, match=r"drop is .* allowed"):
        prepare.cut_failure(whole, drop=1.5)


# --- toe -----------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [lambda r: r, flipped])
def test_toe_of_a_bilinear_curve_is_its_slack_exactly(turn):
    """Slack 0.05, then 3 MPa: D638's line meets zero load at 0.05."""
    cut = prepare.cut_failure(turn(pulled(lambda e: 3 * e, slack=0.05)))
    toed = prepare.compensate_toe(cut)
    assert toed.log[-1].arguments["shift"] == pytest.approx(0.05, abs=1e-9)
    assert abs(toed.strain[0]) == 0
    assert abs(toed.stress_MPa[0]) == 0
    np.testing.assert_allclose(toed.stress_MPa, 3 * toed.strain, atol=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
def test_rounded_toe_before_a_rubber_curve(noise):
    """A quadratic toe of width w into slope E: the line meets zero at slack + w / 2."""
    width, slack = 0.04, 0.06

    def rounded(strain):
        toe = strain**2 / (2 * width)
        return neo_hookean(np.where(strain < width, toe, strain - width / 2))

    cut = prepare.cut_failure(pulled(rounded, slack=slack, noise=noise))
    shift = prepare.compensate_toe(cut).log[-1].arguments["shift"]
    assert shift == pytest.approx(slack + width / 2, abs=0.004 + noise)


def test_short_slack_in_noise_is_found():
    """Seven samples of slack, load noise a twentieth of the load at strain 0.1."""
    strain = np.linspace(0, 2, 700)
    errors = []
    for seed in range(20):
        noise = 0.013 * np.random.default_rng(seed).standard_normal(700)
        stress = neo_hookean(np.maximum(strain - 0.02, 0)) + noise
        toed = prepare.compensate_toe(Recording(strain, strain, stress))
        errors.append(toed.log[-1].arguments["shift"] - 0.02)
    assert np.abs(errors).max() < 0.015
    assert abs(np.mean(errors)) < 0.005  # the steepest of noisy chords is too steep


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01])
def test_clean_rubber_curve_is_hardly_shifted(noise):
    cut = prepare.cut_failure(pulled(neo_hookean, noise=noise))
    shift = prepare.compensate_toe(cut).log[-1].arguments["shift"]
    assert shift <= noise  # exactly none without noise


@pytest.mark.parametrize("stress_of", [lambda e: e**2, lambda e: np.expm1(3 * e)])
def test_a_curve_that_stiffens_throughout_has_no_toe(stress_of):
    curve = pulled(stress_of, tail=0)
    toed = prepare.compensate_toe(curve)
    assert toed.log[-1].arguments["shift"] == 0
    assert len(toed) == len(curve)


# --- one curve from several ----------------------------------------------------------


def test_mean_of_scaled_curves_is_the_curve_of_the_mean_scale():
    scales = [0.8, 1.0, 1.3]
    group = [
        pulled(lambda e, s=s: s * neo_hookean(e), tail=0, material="M", name=str(s))
        for s in scales
    ]
    (mean,) = prepare.unify(group, samples=501)
    np.testing.assert_allclose(
        mean.stress_MPa, np.mean(scales) * neo_hookean(mean.strain), atol=1e-6
    )
    np.testing.assert_allclose(mean.time_s, mean.strain / RATE, atol=1e-9)
    assert mean.log[-1].arguments["specimens"] == ["0.8", "1.0", "1.3"]


def test_mean_goes_on_without_a_jump_when_specimens_fail():
    """Slopes 1 and 2 to strains 1 and 2: mean slope 1.5 to 1, then 2 to the end 1.5."""
    group = [
        pulled(lambda e: e, ultimate=1.0, tail=0),
        pulled(lambda e: 2 * e, ultimate=2.0, tail=0),
    ]
    (mean,) = prepare.unify(group, samples=301)
    assert mean.strain[-1] == pytest.approx(1.5)
    assert mean.stress_MPa[-1] == pytest.approx(1.5 * 1 + 2 * 0.5)
    assert np.diff(mean.stress_MPa).max() <= 2 * mean.strain[1] * (1 + 1e-9)
    assert mean.log[-1].arguments["whole_at_the_end"] == 1


def test_groups_are_material_test_and_rate():
    made = [
        pulled(neo_hookean, material=m, test="tensile") for m in "AB" for _ in range(2)
    ]
    slow = [Recording(r.time_s, r.strain, r.stress_MPa, material="A") for r in made[:1]]
    names = [[r.material for r in g] for g in prepare.by_group(made + slow)]
    assert names == [["A"], ["A", "A"], ["B", "B"]]
    assert len(prepare.unify(made)) == 2
    with pytest.raises(InputError, match="no test specimens"):
        prepare.unify([])


# --- noise, offset, units ------------------------------------------------------------


def test_smoothing_is_scipys_over_one_second_and_only_where_noisy():
    noisy = pulled(neo_hookean, noise=0.01, tail=0)  # 0.01 s a sample: 100 in a second
    smoothed = prepare.smooth(noisy)
    expected = savgol_filter(noisy.stress_MPa, 99, 2)
    np.testing.assert_allclose(smoothed.stress_MPa, expected, rtol=0, atol=1e-11)
    clean = pulled(neo_hookean, tail=0)
    np.testing.assert_array_equal(prepare.smooth(clean).stress_MPa, clean.stress_MPa)
    assert prepare.smooth(clean).log[-1].arguments["peak_to_peak_MPa"] == 0


@pytest.mark.parametrize(
    ("samples", "window", "order"),
    [(50, 3, 0), (50, 7, 3), (51, 51, 2), (300, 31, 4), (9, 9, 5)],
)
def test_the_filter_of_savitzky_and_golay_is_scipys(samples, window, order):
    values = np.random.default_rng(samples).normal(size=samples)
    found = savitzky_golay(values, window, order)
    expected = savgol_filter(values, window, order)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10)


def test_smoothing_takes_noise_away_and_not_the_bend():
    """A knee at strain 0.02, pulled at 0.25 /s: a second is a dozen knees long."""
    strain = np.linspace(0, 2, 4001)
    truth = -np.expm1(-strain / 0.02) + 0.1 * strain
    rng = np.random.default_rng(0)
    noisy = Recording(strain / 0.25, strain, truth + 0.002 * rng.standard_normal(4001))
    guarded, plain = prepare.smooth(noisy), prepare.smooth(noisy, guard=np.inf)
    assert plain.log[-1].arguments["window"] == 499
    errors = [np.abs(r.stress_MPa - truth).max() for r in (plain, guarded, noisy)]
    assert errors[0] > 0.4  # of a knee of 1: the rule alone loses it
    assert errors[1] < errors[2]


def test_noise_of_white_noise_on_a_curve():
    noisy = pulled(neo_hookean, noise=0.02, n=20001)
    assert prepare.white_noise(noisy.stress_MPa) == pytest.approx(0.02, rel=0.03)


def test_negative_offset_goes_and_a_positive_one_stays():
    for offset, left in [(-0.2, 0.0), (0.2, 0.2)]:
        curve = pulled(lambda e, o=offset: 3 * e + o, tail=0)
        assert prepare.remove_negative_offset(curve).stress_MPa[0] == left


def test_stress_and_strain_from_load_elongation_and_geometry():
    empty = np.zeros(3)
    raw = Recording(
        np.arange(3.0),
        empty,
        empty,
        force_N=np.array([0, 9.0, 18.0]),
        elongation_mm=np.array([0, 3.3, 6.6]),
        geometry=Geometry(length_mm=33, width_mm=6, thickness_mm=1.5),
    )
    made = prepare.stress_strain(raw)
    np.testing.assert_allclose(made.strain, [0, 0.1, 0.2])
    np.testing.assert_allclose(made.stress_MPa, [0, 1, 2])
    with pytest.raises(InputError, match="geometry has no area"):
        prepare.stress_strain(Recording(**raw.columns, geometry=Geometry(length_mm=33)))
    with pytest.raises(InputError, match="no force_N; load and elongation are needed"):
        prepare.stress_strain(Recording(raw.time_s, empty, empty))


def test_resampling_keeps_a_straight_curve_and_its_ends():
    curve = pulled(lambda e: 3 * e, tail=0)
    few = prepare.resample(curve, 7)
    np.testing.assert_allclose(np.diff(few.strain), 2 / 6)
    np.testing.assert_allclose(few.stress_MPa, 3 * few.strain)
    np.testing.assert_allclose(few.time_s, few.strain / RATE)
    with pytest.raises(InputError, match="samples is 1; at least 2"):
        prepare.resample(curve, 1)


def test_resampling_is_numpys_interpolation_to_the_last_bit():
    curve = pulled(neo_hookean, noise=0.01, tail=0)
    warm = np.where(np.arange(len(curve)) % 50 == 7, np.nan, 20.0)
    curve = replace(curve, temperature_C=warm)
    for samples in (90, len(curve), 5000):
        found = prepare.resample(curve, samples)
        for name in ("time_s", "stress_MPa", "temperature_C"):
            expected = np.interp(found.strain, curve.strain, curve.columns[name])
            np.testing.assert_array_equal(found.columns[name], expected)


# --- all together --------------------------------------------------------------------


@pytest.mark.parametrize("turn", [lambda r: r, flipped])
def test_a_specimen_comes_back_from_slack_noise_and_failure(turn):
    raw = turn(pulled(neo_hookean, slack=0.07, noise=0.005))
    ready = prepare.specimen(raw, samples=400)
    assert len(ready) == 400
    x, y = np.abs(ready.strain), np.abs(ready.stress_MPa)
    np.testing.assert_allclose(y, neo_hookean(x), atol=0.03)
    assert x[-1] == pytest.approx(2.0, abs=0.01)
    assert [s.name for s in ready.log] == [
        "cut_failure",
        "compensate_toe",
        "smooth",
        "remove_negative_offset",
        "resample",
    ]


def test_missing_values_are_left_out_and_counted():
    raw = pulled(neo_hookean)
    stress = raw.stress_MPa.copy()
    stress[5:8] = np.nan
    ready = prepare.specimen(Recording(raw.time_s, raw.strain, stress))
    assert ready.log[0].arguments == {"removed": 3}


def rounded(low, high):
    return st.floats(low, high).map(lambda v: round(v, 9))  # as a file writes them


VALUES = st.one_of(
    rounded(-10, 10), st.just(0.0), st.just(float("nan")), rounded(-1e-6, 1e9)
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(rounded(0, 10), VALUES, VALUES), min_size=2, max_size=60))
def test_any_numbers_give_a_specimen_or_one_line(rows):
    steps, strain, stress = np.array(rows).T
    with contextlib.suppress(InputError):
        raw = Recording(np.cumsum(steps), strain, stress)
        ready = prepare.specimen(raw, samples=20)
        assert len(ready) == 20
        assert np.isfinite(ready.stress_MPa).all()
        assert prepare.segments(ready)[-1].stop == 20
        (mean,) = prepare.unify([ready, ready])
        assert np.isfinite(mean.stress_MPa).all()
