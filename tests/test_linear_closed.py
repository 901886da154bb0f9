"""Linear models against closed forms and other routes."""

from __future__ import annotations

import numpy as np
import pytest
from linear_made import BURGERS, SLS, defaults, wander, with_a_modulus

from softnn.contracts import Chunk, InputError
from softnn.models import (
    Burgers,
    KelvinVoigt,
    Maxwell,
    StandardLinearSolid,
    Wiechert,
)


@with_a_modulus
def test_creep_and_relaxation_are_each_others_inverse(model):
    # Strain that creeps under a constant stress, imposed, gives that stress back.
    parameters = BURGERS if isinstance(model, Burgers) else defaults(model)
    time = np.linspace(0, 5, 20001)
    strain = model.creep(parameters, time)
    stress, _ = model.apply(parameters, Chunk(time, strain))
    np.testing.assert_allclose(stress[1:], 1.0, atol=2e-4)


def test_creep_closed_forms():
    t = np.array([0.0, 0.1, 1.0, 10.0])
    k, tau, k_r, tau_r = BURGERS.values()
    expected = 1 / k + t / (k * tau) - np.expm1(-t / tau_r) / k_r
    np.testing.assert_allclose(Burgers().creep(BURGERS, t), expected, rtol=1e-12)
    k_e, k, tau = SLS.values()
    slow = tau * (k_e + k) / k_e
    expected = 1 / k_e - k / (k_e * (k_e + k)) * np.exp(-t / slow)
    found = StandardLinearSolid().creep(SLS, t)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    fluid = Maxwell().creep({"stiffness": 2.0, "relaxation_time": 3.0}, t)
    np.testing.assert_allclose(fluid, 0.5 + t / 6, rtol=1e-12)


def test_implicit_euler_is_thesis_eq_5_6_and_first_order():
    k_e, k, tau = SLS.values()

    def ramp(n, update):
        time = np.linspace(0, 3, n + 1)
        stress, _ = StandardLinearSolid(update).apply(SLS, Chunk(time, 0.5 * time))
        return time, stress

    time, stress = ramp(4, "euler")
    q = 0.0
    for i in range(1, 5):
        q = (k * 0.5 * 0.75 + q) / (1 + 0.75 / tau)
        assert stress[i] == pytest.approx(k_e * 0.5 * time[i] + q, rel=1e-14)

    errors = []
    for n in (100, 200, 400, 800):
        time, euler = ramp(n, "euler")
        closed = k_e * 0.5 * time - k * tau * 0.5 * np.expm1(-time / tau)
        _, exact = ramp(n, "exact")
        np.testing.assert_allclose(exact, closed, atol=1e-13)
        errors.append(np.abs(euler - closed).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 1.0, atol=0.02)


def test_exact_update_does_not_depend_on_the_steps():
    k = defaults(Wiechert(3))
    coarse = np.array([0.0, 1.0, 4.0])
    strain = np.array([0.0, 0.4, 0.1])
    fine = np.sort(np.unique(np.concatenate([coarse, np.linspace(0, 4, 777)])))
    a, _ = Wiechert(3).apply(k, Chunk(coarse, strain))
    b, _ = Wiechert(3).apply(k, Chunk(fine, np.interp(fine, coarse, strain)))
    np.testing.assert_allclose(a, b[np.isin(fine, coarse)], rtol=1e-12)


def test_branches_see_branch_strain():
    chunk = wander()
    both = Chunk(chunk.time_s, chunk.strain, branch_strain=2 * chunk.strain)
    plain, _ = StandardLinearSolid().respond(SLS, chunk)
    split, _ = StandardLinearSolid().respond(SLS, both)
    np.testing.assert_allclose(split.equilibrium, plain.equilibrium)
    np.testing.assert_allclose(split.branches, 2 * plain.branches)


@pytest.mark.parametrize(
    ("chunk", "message"),
    [
        (Chunk(np.array([0.0, 1.0]), np.array([0.0, np.nan])), "sample 1 is no number"),
        (Chunk(np.array([0.0, -1.0]), np.zeros(2)), "time goes backwards"),
        (Chunk(np.array([0.0, np.nan]), np.zeros(2)), "time goes backwards"),
        (Chunk(np.arange(3.0), np.zeros(2)), "allowed is"),
        (Chunk(np.zeros(0), np.zeros(0)), "no samples"),
    ],
)
@pytest.mark.parametrize("model", [KelvinVoigt(), Wiechert(2)])
def test_a_bad_history_is_refused(model, chunk, message):
    with pytest.raises(InputError, match=message):
        model.apply(defaults(model), chunk)
