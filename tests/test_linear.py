"""Linear models against closed forms, reductions and an ODE solver."""

from __future__ import annotations

import time as clock

import numpy as np
import pytest
from linear_made import BURGERS, SLS, defaults, wander, with_a_modulus
from scipy.integrate import solve_ivp
from scipy.signal import TransferFunction, lsim

from softnn.contracts import Chunk, InputError
from softnn.models import (
    MODELS,
    PLSLS,
    Burgers,
    Hooke,
    KelvinVoigt,
    Maxwell,
    PLWiechert,
    StandardLinearSolid,
    Wiechert,
)
from softnn.models.branches import evenly

MODEL_NAMES = [type(m).__name__ for m in MODELS]


def by_hand(k, tau, chunk):
    """Each branch in a plain loop over samples, from rest."""
    stress, q = np.zeros(len(chunk.time_s)), np.zeros(len(k))
    last_time, last_strain = chunk.time_s[0], 0.0
    for i, (now, strain) in enumerate(zip(chunk.time_s, chunk.strain, strict=True)):
        for j in range(len(k)):
            x = (now - last_time) / tau[j]
            gain = -np.expm1(-x) / x if x > 0 else 1.0
            q[j] = np.exp(-x) * q[j] + gain * k[j] * (strain - last_strain)
        stress[i] = q.sum()
        last_time, last_strain = now, strain
    return stress


@pytest.mark.parametrize("irregular", [False, True])
@pytest.mark.parametrize("n", [1, 2, 5, 6, 333])
def test_all_routes_equal_a_plain_loop(n, irregular):
    whole = wander(700, irregular)
    chunk = Chunk(whole.time_s[:n], whole.strain[:n])
    k, tau = np.array([1.0, 2.5, 0.3]), np.array([1e-3, 0.4, 80.0])
    parameters = {"equilibrium_stiffness": 0.0}
    for j in range(3):
        parameters |= {f"stiffness_{j + 1}": k[j], f"relaxation_time_{j + 1}": tau[j]}
    stress, _ = Wiechert(3).apply(parameters, chunk)
    expected = by_hand(k, tau, chunk)
    np.testing.assert_allclose(stress, expected, atol=1e-13 * abs(expected).max())


def test_a_long_hold_stays_fast_and_right():
    # Stress far below the smallest normal number must not slow the recursion down.
    n = 200_000
    chunk = Chunk(np.arange(n) * 0.01, np.ones(n))
    uneven = Chunk(chunk.time_s + 1e-4 * (np.arange(n) % 2), chunk.strain)
    model, parameters = Maxwell(), {"stiffness": 1.0, "relaxation_time": 1.0}
    model.apply(parameters, Chunk(uneven.time_s[:9], uneven.strain[:9]))  # compile
    for history in (chunk, uneven):
        start = clock.perf_counter()
        stress, _ = model.apply(parameters, history)
        assert clock.perf_counter() - start < 0.5
        np.testing.assert_allclose(stress[100], np.exp(-history.time_s[100]), 1e-12)
        assert stress[-1] < 1e-290


def test_wiechert_agrees_with_an_ode_solver():
    k_e, k, tau = 0.5, np.array([1.2, 0.7]), np.array([0.3, 4.0])
    rate = 0.2

    def flow(t, q):
        return k * (rate if t < 2 else -rate / 2) - q / tau

    time = np.linspace(0, 5, 501)
    solved = solve_ivp(
        flow, (0, 5), np.zeros(2), t_eval=time, rtol=1e-10, atol=1e-12, max_step=0.01
    )
    strain = np.where(time < 2, rate * time, 2 * rate - rate / 2 * (time - 2))
    parameters = {
        "equilibrium_stiffness": k_e,
        "stiffness_1": k[0],
        "relaxation_time_1": tau[0],
        "stiffness_2": k[1],
        "relaxation_time_2": tau[1],
    }
    stress, _ = Wiechert(2).apply(parameters, Chunk(time, strain))
    np.testing.assert_allclose(stress, k_e * strain + solved.y.sum(axis=0), atol=1e-7)


def test_standard_linear_solid_agrees_with_its_transfer_function():
    # Thesis eq. 5.4 with one branch: k_e + k s / (s + 1 / tau).
    k_e, k, tau = SLS.values()
    chunk = wander()
    strain = chunk.strain - chunk.strain[0]
    system = TransferFunction([(k_e + k) * tau, k_e], [tau, 1.0])
    _, expected, _ = lsim(system, strain, chunk.time_s)
    stress, _ = StandardLinearSolid().apply(SLS, Chunk(chunk.time_s, strain))
    np.testing.assert_allclose(stress, expected, atol=1e-12)


def test_burgers_agrees_with_its_series_of_elements():
    # Strain of the series: spring + dashpot + Kelvin-Voigt element, thesis Fig. 5.1e.
    k, tau, k_r, tau_r = BURGERS.values()
    rate = 0.3

    def flow(t, y):
        flowed, retarded = y
        stress = k * (rate * t - flowed - retarded)
        return [stress / (k * tau), (stress / k_r - retarded) / tau_r]

    time = np.linspace(0, 4, 401)
    y = solve_ivp(flow, (0, 4), [0, 0], t_eval=time, rtol=1e-10, atol=1e-12).y
    stress, _ = Burgers().apply(BURGERS, Chunk(time, rate * time))
    np.testing.assert_allclose(stress, k * (rate * time - y.sum(axis=0)), atol=1e-8)


def test_burgers_is_two_maxwell_branches():
    (k,), (tau,) = Burgers().prony(BURGERS)
    equivalent = {
        "equilibrium_stiffness": 0.0,
        "stiffness_1": k[0],
        "relaxation_time_1": tau[0],
        "stiffness_2": k[1],
        "relaxation_time_2": tau[1],
    }
    chunk = wander()
    left, right = (
        m.apply(p, chunk)[0]
        for m, p in [(Burgers(), BURGERS), (Wiechert(2), equivalent)]
    )
    np.testing.assert_allclose(left, right, atol=1e-14)
    assert k.sum() == pytest.approx(BURGERS["stiffness"], rel=1e-14)
    # Steady flow: the summed viscosity of the branches is the series dashpot's.
    assert (k * tau).sum() == pytest.approx(6.0, rel=1e-14)


def sls_numbered(k_e, k, tau):
    return {
        "equilibrium_stiffness": k_e,
        "stiffness_1": k,
        "relaxation_time_1": tau,
    }


REDUCTIONS = [
    ("wiechert(1) is sls", Wiechert(1), sls_numbered(*SLS.values()),
     StandardLinearSolid(), SLS),
    ("wiechert(0) is hooke", Wiechert(0), {"equilibrium_stiffness": 0.8},
     Hooke(), {"equilibrium_stiffness": 0.8}),
    ("sls without its branch is hooke", StandardLinearSolid(),
     SLS | {"stiffness": 0.0}, Hooke(), {"equilibrium_stiffness": 0.8}),
    ("sls without its spring is maxwell", StandardLinearSolid(),
     SLS | {"equilibrium_stiffness": 0.0}, Maxwell(),
     {"stiffness": 1.7, "relaxation_time": 0.6}),
    ("kelvin-voigt without its dashpot is hooke", KelvinVoigt(),
     {"equilibrium_stiffness": 0.8, "viscosity": 0.0}, Hooke(),
     {"equilibrium_stiffness": 0.8}),
    ("pl-sls with one segment is sls", PLSLS([0.0]),
     {"spring_1": 0.8, "stiffness": 1.7, "relaxation_time": 0.6},
     StandardLinearSolid(), SLS),
    ("pl-wiechert with one segment is wiechert", PLWiechert([0.0], 1),
     {"spring_1": 0.8, "stiffness_1": 1.7, "relaxation_time_1": 0.6},
     Wiechert(1), sls_numbered(*SLS.values())),
    ("pl-sls with its second spring off is sls", PLSLS([0.0, 0.1]),
     {"spring_1": 0.8, "spring_2": 0.0, "stiffness": 1.7, "relaxation_time": 0.6},
     StandardLinearSolid(), SLS),
]  # fmt: skip


@pytest.mark.parametrize("update", ["exact", "euler"])
@pytest.mark.parametrize(
    ("left", "p", "right", "q"),
    [r[1:] for r in REDUCTIONS],
    ids=[r[0] for r in REDUCTIONS],
)
def test_reductions_hold_to_rounding(left, p, right, q, update, monkeypatch):
    for model in (left, right):
        monkeypatch.setattr(model, "update", update, raising=False)
    for irregular in (False, True):
        chunk = wander(irregular=irregular)
        a, b = left.apply(p, chunk)[0], right.apply(q, chunk)[0]
        np.testing.assert_allclose(a, b, atol=1e-15)


@pytest.mark.parametrize("model", MODELS, ids=MODEL_NAMES)
@pytest.mark.parametrize("irregular", [False, True])
def test_chunked_equals_whole(model, irregular):
    chunk = wander(irregular=irregular)
    parameters = defaults(model)
    whole, end = model.apply(parameters, chunk)
    for cuts in ([1, 2, 3, 10, 11, 300, 301], range(1, len(whole))):
        state, parts = None, []
        for piece in np.split(np.arange(len(whole)), list(cuts)):
            stress, state = model.apply(
                parameters, Chunk(chunk.time_s[piece], chunk.strain[piece]), state
            )
            parts.append(stress)
        joined = np.concatenate(parts)
        scale = np.abs(whole).max()
        # A dashpot differentiates: it sees the rounding of every time and strain.
        tight = 1e-13 if not isinstance(model, KelvinVoigt) else 1e-12
        np.testing.assert_allclose(joined, whole, atol=tight * scale)
    again = model.apply(parameters, Chunk(chunk.time_s[-1:], chunk.strain[-1:]), end)
    np.testing.assert_allclose(
        again[0][-1],
        whole[-1] if not isinstance(model, KelvinVoigt) else chunk.strain[-1],
    )


@pytest.mark.parametrize("model", MODELS, ids=MODEL_NAMES)
def test_sets_equal_a_loop_over_sets(model):
    rng = np.random.default_rng(1)
    sets = {n: v * rng.uniform(0.5, 2, 5) for n, v in defaults(model).items()}
    for irregular in (False, True):
        chunk = wander(irregular=irregular)
        together, _ = model.apply(sets, chunk)
        assert together.shape == (len(chunk.strain), 5)
        wide = Chunk(chunk.time_s, chunk.strain[:, None] * np.array([1, 2, 0, -1, 0.5]))
        columns, _ = model.apply(sets, wide)
        shared, _ = model.apply(defaults(model), wide)
        for s in range(5):
            one = {n: float(v[s]) for n, v in sets.items()}
            alone, _ = model.apply(one, chunk)
            scale = abs(alone).max()
            np.testing.assert_allclose(together[:, s], alone, atol=1e-13 * scale)
            single = Chunk(chunk.time_s, wide.strain[:, s])
            np.testing.assert_allclose(
                columns[:, s], model.apply(one, single)[0], atol=1e-12 * scale
            )
            np.testing.assert_allclose(
                shared[:, s],
                model.apply(defaults(model), single)[0],
                atol=1e-12 * scale,
            )


@pytest.mark.parametrize("model", MODELS, ids=MODEL_NAMES)
def test_stress_is_linear_in_the_parameters_said_to_be(model):
    chunk, base = wander(), defaults(model)
    off = base | dict.fromkeys(model.linear, 0.0)
    if not model.linear:
        assert isinstance(model, Burgers)
        return
    parts = [model.apply(off | {name: base[name]}, chunk)[0] for name in model.linear]
    whole = model.apply(base, chunk)[0]
    np.testing.assert_allclose(sum(parts), whole, atol=1e-13 * abs(whole).max())


@pytest.mark.parametrize("model", MODELS, ids=MODEL_NAMES)
def test_causal_and_at_rest(model):
    chunk = wander()
    later = Chunk(chunk.time_s, np.where(np.arange(700) < 400, chunk.strain, 9.0))
    a, b = (model.apply(defaults(model), c)[0] for c in (chunk, later))
    np.testing.assert_allclose(a[:400], b[:400], atol=1e-13)
    still = Chunk(chunk.time_s, np.zeros(700))
    assert not model.apply(defaults(model), still)[0].any()


@with_a_modulus
def test_a_step_of_strain_gives_the_relaxation_modulus(model):
    parameters = BURGERS if isinstance(model, Burgers) else defaults(model)
    time = np.linspace(0, 30, 1001)
    stress, _ = model.apply(parameters, Chunk(time, np.full_like(time, 0.2)))
    np.testing.assert_allclose(
        stress, 0.2 * model.relaxation(parameters, time), rtol=1e-11, atol=1e-15
    )


@pytest.mark.parametrize("model", MODELS, ids=MODEL_NAMES)
def test_bad_values_are_refused(model):
    good, chunk = defaults(model), wander(3)
    for parameter in model.parameters:
        low = parameter.allowed[0]
        for value in (np.nan, np.inf, low - abs(low) - 1):
            with pytest.raises(InputError, match=parameter.name):
                model.apply(good | {parameter.name: value}, chunk)
        with pytest.raises(InputError, match="needs"):
            model.apply({n: v for n, v in good.items() if n != parameter.name}, chunk)


def test_bad_settings_are_refused():
    with pytest.raises(InputError, match="allowed is one of"):
        Wiechert(2, update="midpoint")
    with pytest.raises(InputError, match="branches"):
        Wiechert(-1)


def test_constant_steps_are_told_from_others():
    assert evenly(np.arange(1000) * 0.01)
    assert evenly(17.3 + np.arange(1000) * 0.02)
    assert not evenly(np.cumsum(np.full(1000, 0.01)) + 1e-6 * (np.arange(1000) == 500))
    assert not evenly(np.zeros(5))
