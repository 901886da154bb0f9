"""Piecewise-linear models: known curves, second routes, brute force."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from softnn.contracts import Chunk, InputError
from softnn.metrics import nrmse
from softnn.models import PLSLS, PLWiechert, SecondOrderExponential
from softnn.models.fit_piecewise import (
    branch_stress,
    fit,
    fit_exponential,
    fit_jointly,
    fit_std_lin_sds,
    sweep,
)
from softnn.models.piecewise import engaged
from softnn.models.relaxation import Relaxation
from softnn.models.segments import Equal, Optimal, Tolerance, line_errors
from softnn.models.skeleton import joint_slopes, segment_slopes, skeleton

ONE = Relaxation(0.0, (0.6,), (4.0,), "given")
TWO = Relaxation(0.0, (0.4, 0.2), (1.0, 30.0), "given")
NOTHING = Relaxation(0.0, (0.0,), (1.0,), "given")
KNOTS, SPRINGS = np.array([0.0, 0.3, 1.2]), np.array([3.0, -2.0, 0.7])


@dataclass
class Curve:
    time_s: np.ndarray
    strain: np.ndarray
    stress_MPa: np.ndarray


def made(relaxation=ONE, rate=0.25, knots=KNOTS, springs=SPRINGS, n=401, end=2.0):
    """A tensile curve of a PL model, at equal strain steps that hit the knots."""
    strain = np.linspace(0, end, n)
    curve = Curve(strain / rate, strain, np.zeros(n))
    elastic = engaged(knots, springs[None, :], strain[:, None])[:, 0]
    curve.stress_MPa = elastic + branch_stress(relaxation, curve)
    return curve


def heaviside(knots, springs, strain):
    """Thesis eq. 5.7 as it is printed."""
    total = 0.0
    for knot, k in zip(knots, springs, strict=True):
        total = total + k * np.heaviside(strain - knot, 0.5) * (strain - knot)
    return total


def test_springs_are_the_printed_sum():
    strain = np.linspace(0, 2, 333)
    found = engaged(KNOTS, SPRINGS[None, :], strain[:, None])[:, 0]
    np.testing.assert_allclose(found, heaviside(KNOTS, SPRINGS, strain), atol=1e-14)


def test_springs_in_compression_mirror_those_in_tension():
    strain = np.linspace(-2, 2, 401)[:, None]
    pull = engaged(KNOTS, SPRINGS[None, :], strain)
    push = engaged(-KNOTS, SPRINGS[None, :], -strain)
    np.testing.assert_allclose(push, -pull, atol=1e-14)
    # On the far side of zero only the spring that is always there acts.
    np.testing.assert_allclose(pull[:200, 0], 3.0 * strain[:200, 0], atol=1e-14)
    both = engaged(np.array([0.0, 0.5, -0.5]), np.array([[1.0, 2, 4]]), strain)[:, 0]
    expected = strain[:, 0] + 2 * np.maximum(strain[:, 0] - 0.5, 0)
    expected += 4 * np.minimum(strain[:, 0] + 0.5, 0)
    np.testing.assert_allclose(both, expected, atol=1e-14)


def test_without_a_knot_at_zero_nothing_carries_before_the_first():
    strain = np.array([[0.0], [0.1], [0.2], [0.4]])
    found = engaged(np.array([0.2]), np.array([[5.0]]), strain)[:, 0]
    np.testing.assert_allclose(found, [0, 0, 0, 1.0], atol=1e-15)


def test_tolerance_criterion_step_by_step():
    # Fig. 5.7 walked through by hand: slopes 10, 9, 7.9, 7, 5.5, 5.4, 8.
    slopes = np.array([10, 9, 7.9, 7, 5.5, 5.4, 8.0])
    strain = np.arange(8.0)
    stress = np.concatenate([[0], np.cumsum(slopes)])
    # 20 %: 7.9 is the first off 10 by more than 2, then 5.5 off 7.9, then 8 off 5.5.
    np.testing.assert_array_equal(Tolerance(0.2)(strain, stress), [0, 2, 4, 6])
    np.testing.assert_array_equal(Tolerance(0.4)(strain, stress), [0, 4, 6])
    np.testing.assert_array_equal(Tolerance(1.0)(strain, stress), [0])


def test_a_smaller_tolerance_never_gives_fewer_segments_on_a_smooth_curve():
    strain = np.linspace(0, 3, 500)
    counts = [
        len(Tolerance(t / 100)(strain, np.tanh(2 * strain) + 0.1 * strain))
        for t in range(10, 101, 10)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 10


@pytest.mark.parametrize("regression", ["segment", "joint"])
@pytest.mark.parametrize("relaxation", [ONE, TWO])
def test_a_planted_model_comes_back(relaxation, regression):
    curve = made(relaxation)
    found = fit([curve], relaxation, Tolerance(0.05), regression=regression)
    kinds = {1: PLSLS, 2: PLWiechert}
    assert type(found.model) is kinds[relaxation.branches]
    np.testing.assert_allclose(found.model.knots, KNOTS, atol=1e-12)
    springs = [found.parameters[f"spring_{i}"] for i in (1, 2, 3)]
    np.testing.assert_allclose(springs, SPRINGS, atol=1e-9)
    assert nrmse(found.predict(curve), curve.stress_MPa) < 1e-12
    # And at a rate it has not seen, as the planted branches say.
    other = made(relaxation, rate=0.025)
    assert nrmse(found.predict(other), other.stress_MPa) < 1e-12
    assert (found.segments, found.branches) == (3, relaxation.branches)
    # The model of the contract says the same.
    chunk = Chunk(curve.time_s, curve.strain)
    stress, _ = found.model.apply(found.parameters, chunk)
    np.testing.assert_allclose(stress, found.predict(curve), atol=1e-14)


def test_compression_is_tension_with_the_signs_turned():
    pulled = made()
    pushed = Curve(pulled.time_s, -pulled.strain, -pulled.stress_MPa)
    a, b = (fit([c], ONE, Tolerance(0.05)) for c in (pulled, pushed))
    np.testing.assert_allclose(b.predict(pushed), -a.predict(pulled), atol=1e-12)
    np.testing.assert_allclose(b.model.knots, -a.model.knots)


def test_one_segment_is_the_standard_linear_solid_nearest_to_the_curve():
    curve = made()
    found = fit([curve], ONE, Equal(1), regression="joint")
    left = curve.stress_MPa - branch_stress(ONE, curve)
    expected = (left @ curve.strain) / (curve.strain @ curve.strain)
    assert found.parameters["spring_1"] == pytest.approx(expected, rel=1e-12)


def noisy(seed=0, n=300):
    rng = np.random.default_rng(seed)
    strain = np.linspace(0, 2, n)
    return strain, np.tanh(4 * strain) + 0.2 * strain + rng.normal(0, 0.02, n)


def test_segment_slopes_are_numpys_regressions():
    curve = skeleton(*noisy())
    knots = Equal(7)(curve.strain, curve.stress)
    edges = np.append(knots, curve.strain[-1])
    for i, slope in enumerate(segment_slopes(curve, knots)):
        inside = (curve.strain >= edges[i]) & (curve.strain <= edges[i + 1])
        expected = np.polyfit(curve.strain[inside], curve.stress[inside], 1)[0]
        assert slope == pytest.approx(expected, rel=1e-9)


def test_joint_slopes_are_the_least_squares_springs():
    curve = skeleton(*noisy())
    knots = Optimal(9)(curve.strain, curve.stress)
    design = np.maximum(curve.strain[:, None] - knots, 0)
    springs = np.linalg.lstsq(design, curve.stress, rcond=None)[0]
    np.testing.assert_allclose(
        np.diff(joint_slopes(curve, knots), prepend=0.0), springs, rtol=1e-7, atol=1e-9
    )


def test_joint_regression_is_never_worse():
    strain, stress = noisy()
    curve = Curve(strain / 0.25, strain, stress)
    for knots in (Tolerance(0.3), Equal(12), Optimal(12)):
        errors = [
            nrmse(fit([curve], NOTHING, knots, regression=r).predict(curve), stress)
            for r in ("joint", "segment")
        ]
        assert errors[0] <= errors[1]


def test_optimal_segments_are_the_best_of_all():
    strain, stress = noisy(1, 13)
    inner = range(1, 12)

    def error(cuts):
        total = 0.0
        for a, b in itertools.pairwise([0, *cuts, 12]):
            x, y = strain[a : b + 1], stress[a : b + 1]
            total += np.sum((np.polyval(np.polyfit(x, y, 1), x) - y) ** 2)
        return total

    for segments in (2, 3, 4):
        best = min(itertools.combinations(inner, segments - 1), key=error)
        found = Optimal(segments)(strain, stress)
        np.testing.assert_allclose(found, strain[[0, *best]])
        at = np.arange(13)
        costs = line_errors(strain, stress, at)
        chain = [0, *best, 12]
        summed = sum(costs[a, b] for a, b in itertools.pairwise(chain))
        assert summed == pytest.approx(error(best), rel=1e-8)


def test_optimal_finds_planted_knots():
    strain = np.linspace(0, 2, 201)
    stress = heaviside(KNOTS, SPRINGS, strain)
    np.testing.assert_allclose(Optimal(3)(strain, stress), KNOTS, atol=1e-12)


def test_optimal_beats_equal_spacing_where_the_curve_is_bent_at_one_end():
    strain, stress = noisy()
    curve = Curve(strain / 0.25, strain, stress)
    equal, optimal = (
        nrmse(
            fit([curve], NOTHING, k, regression="joint").predict(curve),
            np.tanh(4 * strain) + 0.2 * strain,
        )
        for k in (Equal(4), Optimal(4))
    )
    assert optimal < 0.6 * equal


def test_skeleton_averages_what_does_not_rise():
    up = np.linspace(0, 1, 500)
    strain = np.concatenate([up, up[::-1]])
    stress = np.concatenate([2 * up + 0.1, 2 * up[::-1] - 0.1])
    curve = skeleton(strain, stress, points=50)
    np.testing.assert_allclose(curve.stress, 2 * curve.strain, atol=2e-3)
    assert curve.weight.sum() == 1000
    assert len(curve.strain) == 50


def test_skeleton_leaves_out_what_is_missing():
    strain = np.linspace(0, 1, 11)
    stress = np.where(np.arange(11) == 4, np.nan, strain)
    curve = skeleton(strain, stress)
    assert len(curve.strain) == 10
    assert curve.side == 1


def test_rates_share_one_set_of_springs():
    slow, fast = made(rate=0.025), made(rate=0.25)
    found = fit([slow, fast], ONE, Tolerance(0.05), regression="joint")
    for curve in (slow, fast):
        assert nrmse(found.predict(curve), curve.stress_MPa) < 0.01
    refit = sweep([slow], [ONE, TWO], [Tolerance(0.05), Tolerance(0.5)])
    assert [len(row) for row in refit] == [2, 2]
    single = fit([slow], ONE, Tolerance(0.05))
    np.testing.assert_array_equal(refit[0][0].predict(slow), single.predict(slow))


def test_joint_fit_finds_springs_and_branches_without_a_hold():
    curves = [made(TWO, rate) for rate in (0.0025, 0.025, 0.25)]
    times = [0.1, 1.0, 5.0, 30.0, 300.0]
    found = fit_jointly(curves, 2, Tolerance(0.05), times)
    (k,), (tau,) = found.model.prony(found.parameters)
    # The knots come from the mean of whole stresses, so the planted ones are near.
    np.testing.assert_allclose(tau, TWO.relaxation_time)
    np.testing.assert_allclose(k, TWO.stiffness, rtol=0.05)
    for curve in (*curves, made(TWO, 0.08)):
        assert nrmse(found.predict(curve), curve.stress_MPa) < 2e-3


def test_joint_fit_is_the_bounded_least_squares_optimum():
    rng = np.random.default_rng(4)
    curves = [made(TWO, rate) for rate in (0.025, 0.25)]
    for curve in curves:
        curve.stress_MPa = curve.stress_MPa + rng.normal(0, 0.02, 401)
    times = np.array([0.5, 4.0, 50.0])
    found = fit_jointly(curves, 3, Equal(6), times)
    knots = found.model.knots
    design, target = [], []
    for curve in curves:
        size = np.linalg.norm(curve.stress_MPa)
        units = [branch_stress(Relaxation(0, (1.0,), (t,), ""), curve) for t in times]
        springs = np.maximum(curve.strain[:, None] - knots, 0)
        design.append(np.column_stack([springs, *units]) / size)
        target.append(curve.stress_MPa / size)
    low = np.concatenate([np.full(len(knots), -np.inf), np.zeros(3)])
    best = lsq_linear(np.vstack(design), np.concatenate(target), (low, np.inf))
    errors = [nrmse(found.predict(c), c.stress_MPa) for c in curves]
    assert np.sum(np.square(errors)) == pytest.approx(2 * best.cost, rel=1e-8)


def test_joint_fit_in_compression():
    curves = [made(TWO, rate) for rate in (0.025, 0.25)]
    pushed = [Curve(c.time_s, -c.strain, -c.stress_MPa) for c in curves]
    a, b = (fit_jointly(c, 2, Equal(8)) for c in (curves, pushed))
    np.testing.assert_allclose(b.predict(pushed[0]), -a.predict(curves[0]), atol=1e-9)


def test_std_lin_sds_counts_the_branch_twice():
    curve = made()
    sds = fit_std_lin_sds([curve], ONE, Equal(20))
    over = sds.predict(curve) - curve.stress_MPa
    np.testing.assert_allclose(over, branch_stress(ONE, curve), atol=0.05)
    ours = fit([curve], ONE, Equal(20))
    errors = [nrmse(m.predict(curve), curve.stress_MPa) for m in (ours, sds)]
    assert errors[1] > 5 * errors[0]


def test_second_order_exponential_comes_back_on_its_own_curve():
    given = {
        "amplitude_1": -1.3,
        "exponent_1": -4.0,
        "amplitude_2": 0.2,
        "exponent_2": 0.8,
    }
    strain = np.linspace(0, 2, 200)
    model = SecondOrderExponential()
    stress, _ = model.apply(given, Chunk(strain, strain))
    expected = -1.3 * (np.exp(-4 * strain) - 1) + 0.2 * (np.exp(0.8 * strain) - 1)
    np.testing.assert_allclose(stress, expected, atol=1e-14)
    found = fit_exponential([Curve(strain, strain, stress)])
    assert nrmse(found.predict(Curve(strain, strain, stress)), stress) < 1e-6
    exponents = sorted(found.parameters[f"exponent_{i}"] for i in (1, 2))
    np.testing.assert_allclose(exponents, [-4.0, 0.8], rtol=1e-3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: PLSLS([0.1, 0.1]), "distinct"),
        (lambda: PLWiechert([]), "knots"),
        (lambda: PLWiechert([np.nan]), "knots"),
        (lambda: Tolerance(0.0), "tolerance"),
        (lambda: Equal(400)(*noisy()), "segments"),
        (lambda: Optimal(0)(*noisy()), "segments"),
        (lambda: fit([], ONE), "no curves"),
        (lambda: fit([made()], ONE, regression="spline"), "allowed is"),
        (lambda: fit_jointly([made()], 0), "one or more"),
        (lambda: fit_jointly([made()], 3, times_s=[1.0]), "relaxation times"),
        (lambda: skeleton(np.zeros(5), np.ones(5)), "never leaves zero"),
        (lambda: skeleton(np.ones(5), np.full(5, np.nan)), "no sample"),
    ],
)
def test_bad_requests_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call()
