"""Linear models against closed forms, reductions and an ODE solver."""

from __future__ import annotations

import time as clock

import numpy as np
import pytest
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
    SecondOrderExponential,
    StandardLinearSolid,
    Wiechert,
)
from softnn.models.branches import evenly

MODEL_NAMES = [type(m).__name__ for m in MODELS]
SLS = {"equilibrium_stiffness": 0.8, "stiffness": 1.7, "relaxation_time": 0.6}
BURGERS = {
    "stiffness": 2.0,
    "relaxation_time": 3.0,
    "retarded_stiffness": 0.7,
    "retardation_time": 0.4,
}


def defaults(model):
    return {p.name: p.default for p in model.parameters}


def wander(n=700, irregular=False, seed=0):
    """A strain history that goes up and down, at constant or random steps."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) * 0.01
    if irregular:
        time = np.cumsum(rng.uniform(0.0, 0.02, n))
    return Chunk(time, 0.3 * np.sin(time) + np.cumsum(rng.normal(0, 1e-3, n)))


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


@pytest.mark.parametrize(
    "model",
    [m for m in MODELS if not isinstance(m, SecondOrderExponential | PLWiechert)],
    ids=lambda m: type(m).__name__,
)
def test_a_step_of_strain_gives_the_relaxation_modulus(model):
    parameters = BURGERS if isinstance(model, Burgers) else defaults(model)
    time = np.linspace(0, 30, 1001)
    stress, _ = model.apply(parameters, Chunk(time, np.full_like(time, 0.2)))
    np.testing.assert_allclose(
        stress, 0.2 * model.relaxation(parameters, time), rtol=1e-11, atol=1e-15
    )


@pytest.mark.parametrize(
    "model",
    [m for m in MODELS if not isinstance(m, SecondOrderExponential | PLWiechert)],
    ids=lambda m: type(m).__name__,
)
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


@pytest.mark.parametrize("model", MODELS, ids=MODEL_NAMES)
def test_bad_values_are_refused(model):
    good, chunk = defaults(model), wander(3)
    for parameter in model.parameters:
        for value in (np.nan, np.inf, parameter.low - abs(parameter.low) - 1):
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
