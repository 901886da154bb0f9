"""Fits to a hold, on holds whose branches are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from softnn.contracts import Chunk, InputError
from softnn.models import StandardLinearSolid, Wiechert
from softnn.models.relaxation import (
    Relaxation,
    best_branches,
    collocation,
    held_out_branches,
    log_spaced,
    mean_hold,
    non_negative,
    three_points,
)

TRUE = Relaxation(1.0, (0.5, 0.3, 0.2), (2.0, 30.0, 400.0), "given")
TIME = np.linspace(0, 5000, 5001)


def test_modulus_is_the_models_closed_form():
    parameters = {"equilibrium_stiffness": 1.0, **TRUE.branch_parameters}
    expected = Wiechert(3).relaxation(parameters, TIME)
    np.testing.assert_allclose(TRUE.modulus(TIME), expected, rtol=1e-14)
    assert TRUE.branches == 3


@pytest.mark.parametrize("share", [0.9, 0.3, 0.05])
def test_three_points_finds_tau_whatever_the_share_that_decays(share):
    # Where the whole stress, not its decaying part, is taken to 36.8 %, a decay of
    # less than 63.2 % has no such time at all.
    fit = three_points(TIME, (1 - share) + share * np.exp(-TIME / 120))
    assert fit.relaxation_time[0] == pytest.approx(120, rel=1e-4)
    assert fit.stiffness[0] == pytest.approx(share, rel=1e-12)
    assert fit.equilibrium == pytest.approx(1 - share, rel=1e-12)
    assert fit.rmse < 1e-5


def test_three_points_gives_a_standard_linear_solid_its_parameters_back():
    given = {"equilibrium_stiffness": 0.8, "stiffness": 1.7, "relaxation_time": 12.0}
    stress, _ = StandardLinearSolid().apply(given, Chunk(TIME, np.full(5001, -0.15)))
    fit = three_points(TIME, stress / -0.15)
    found = (fit.equilibrium, *fit.stiffness, *fit.relaxation_time)
    np.testing.assert_allclose(found, (0.8, 1.7, 12.0), rtol=2e-3)


def test_collocation_solves_the_thesis_equations():
    # Eq. 5.3 at the relaxation times; then k_1 makes the start right.
    modulus = TRUE.modulus(TIME)
    fit = collocation(TIME, modulus, 6)
    tau, k = np.array(fit.relaxation_time), np.array(fit.stiffness)
    np.testing.assert_allclose(tau, np.geomspace(1, 5000, 6))
    before = k.copy()
    before[0] += modulus[0] - fit.modulus(0.0)  # nil: already corrected
    assert fit.modulus(0.0) == pytest.approx(modulus[0], rel=1e-12)
    solved = np.linalg.solve(
        np.exp(-tau[:, None] / tau), np.interp(tau, TIME, modulus) - modulus[-1]
    )
    np.testing.assert_allclose(k[1:], solved[1:], rtol=1e-9)
    assert fit.equilibrium == modulus[-1]


def test_collocation_reports_negative_stiffnesses():
    fit = collocation(TIME, TRUE.modulus(TIME), 10)
    assert fit.negative == int((np.array(fit.stiffness) < 0).sum())
    assert fit.negative > 0
    assert fit.to_dict()["negative_stiffnesses"] == fit.negative
    assert non_negative(TIME, TRUE.modulus(TIME), 10).negative == 0


def test_non_negative_finds_planted_branches_on_their_own_grid():
    grid = np.sort([*TRUE.relaxation_time, 0.2, 8.0, 100.0, 2000.0])
    fit = non_negative(TIME, TRUE.modulus(TIME), 7, times_s=grid)
    found = dict(zip(fit.relaxation_time, fit.stiffness, strict=True))
    for tau, k in found.items():
        planted = dict(zip(TRUE.relaxation_time, TRUE.stiffness, strict=True))
        assert k == pytest.approx(planted.get(tau, 0.0), abs=1e-6)
    assert fit.equilibrium == pytest.approx(1.0, rel=1e-6)


def test_non_negative_allows_for_the_ramp():
    ramp = 5.0
    time = np.concatenate([np.linspace(0, ramp, 200)[:-1], ramp + TIME])
    strain = np.minimum(time / ramp, 1.0) * 0.2
    parameters = {"equilibrium_stiffness": 1.0, **TRUE.branch_parameters}
    stress, _ = Wiechert(3).apply(parameters, Chunk(time, strain))
    held = stress[199:] / 0.2
    kept = non_negative(TIME, held, 3, ramp_s=ramp, times_s=TRUE.relaxation_time)
    np.testing.assert_allclose(kept.stiffness, TRUE.stiffness, rtol=1e-6)
    ignored = non_negative(TIME, held, 3, times_s=TRUE.relaxation_time)
    assert ignored.stiffness[0] < 0.7 * TRUE.stiffness[0]


def test_non_negative_is_a_least_squares_optimum():
    rng = np.random.default_rng(2)
    modulus = TRUE.modulus(TIME) + rng.normal(0, 0.01, len(TIME))
    fit = non_negative(TIME, modulus, 4)
    tau = np.array(fit.relaxation_time)
    design = np.column_stack([np.ones_like(TIME), np.exp(-TIME[:, None] / tau)])
    other = minimize(
        lambda k: np.mean((design @ k - modulus) ** 2),
        np.full(5, 0.1),
        jac=lambda k: 2 * design.T @ (design @ k - modulus) / len(TIME),
        bounds=[(0, None)] * 5,
        options={"ftol": 1e-15, "gtol": 1e-12},
    )
    assert fit.rmse**2 <= other.fun * (1 + 1e-9)
    np.testing.assert_allclose(fit.rmse**2, other.fun, rtol=1e-5)


def test_more_branches_fit_better_until_there_are_enough():
    hold = log_spaced(TIME, TRUE.modulus(TIME))
    best, errors = best_branches(hold, non_negative)
    assert errors[0] > 2 * errors[2]
    assert best.rmse == min(errors)
    assert len(errors) == 10


def test_held_out_error_is_that_of_predicting_what_was_left_out():
    rng = np.random.default_rng(3)
    time = np.geomspace(1, 5000, 120) - 1
    holds = [
        (time, stiff * TRUE.modulus(time) + rng.normal(0, 0.02, len(time)))
        for stiff in (0.9, 1.0, 1.05, 1.1)
    ]
    count, errors = held_out_branches(holds)
    assert count == int(np.argmin(errors)) + 1
    # Nothing predicts a hold better than the noise of that hold allows.
    assert 0.018 < min(errors) < 0.025
    # Left out in turn, by hand, for three branches.
    squares = []
    for i, (t, modulus) in enumerate(holds):
        others = np.mean([h[1] for j, h in enumerate(holds) if j != i], axis=0)
        predicted = non_negative(t, others, 3).modulus(t)
        factor = np.linalg.lstsq(predicted[:, None], modulus, rcond=None)[0]
        squares.append((factor * predicted - modulus) ** 2)
    assert errors[2] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_held_out_stretches_of_one_hold_refuse_a_branch_too_few():
    count, errors = held_out_branches([log_spaced(TIME, TRUE.modulus(TIME))])
    assert count > 1
    assert errors[0] > 3 * min(errors)


def test_log_spaced_keeps_the_start_and_the_mean():
    time, modulus = log_spaced(TIME, TRUE.modulus(TIME), per_decade=10)
    assert time[0] == 0
    assert modulus[0] == TRUE.modulus(0.0)
    assert 20 < len(time) < 45
    np.testing.assert_allclose(modulus, TRUE.modulus(time), rtol=2e-3)


def test_mean_hold_is_over_the_times_all_have():
    short = TIME[TIME <= 900]
    time, modulus = mean_hold(
        [(TIME + 7.0, TRUE.modulus(TIME)), (short, 3 * TRUE.modulus(short))]
    )
    assert time[-1] <= 900
    np.testing.assert_allclose(modulus, 2 * TRUE.modulus(time), rtol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: three_points([0, 1, 2], [1.0, 2.0, 3.0]), "one that falls"),
        (lambda: three_points([0, 1], [1.0, 0.5]), "n at least 3"),
        (lambda: three_points([0, 1, 2], [1.0, np.nan, 0.5]), "missing value"),
        (lambda: three_points([0, 2, 1], [1.0, 0.7, 0.5]), "must increase"),
        (lambda: collocation([0, 1, 2], [3.0, 2, 1], 0), "branches"),
        (lambda: collocation([0, 1, 2], [3.0, 2, 1], 2, first_s=5.0), "first_s"),
        (lambda: non_negative([0, 1, 2], [3.0, 2, 1], 2, times_s=[1.0]), "times"),
        (lambda: mean_hold([]), "no holds"),
        (lambda: held_out_branches([]), "no holds"),
    ],
)
def test_bad_holds_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()
