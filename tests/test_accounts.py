"""What a search finds: planted effects, nothing in noise, the same in other units.

By order alone: which account is worth most. No constant of the weighing is asserted.
"""

from dataclasses import replace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, histories, mullins

from softnn.effects import EFFECTS, effect
from softnn.fit import Data
from softnn.mismatch import evidence
from softnn.mismatch.accounts import (
    Account,
    _as_mistakes,
    _as_specimens,
    _settled,
    _worth,
    believed,
    search,
    value,
)
from softnn.mismatch.base import baseline, scatter, weigh, weigh_by
from softnn.mismatch.candidates import LATER, candidates, expand, names, refine
from softnn.mismatch.evidence import Weigher
from softnn.mismatch.posterior import posterior
from softnn.mismatch.screen import Screen, start_pieces
from softnn.models.units import Units
from softnn.simulate import Term, simulate

NOISE = 1e-3  # of the largest stress
SPRING = Units("wiechert", (0.0, 1.0), (5.0,))


def told(law):
    """Two recordings of an effect's telltale, the second with it where it has its own
    values, on one spring and branch."""
    chunk = law.telltale()
    chunks = (chunk, replace(chunk, strain=0.8 * chunk.strain))
    stiffness = np.array([1.0, 0.4])
    plain = simulate(SPRING, stiffness, [], list(chunks))
    scales = Data(("a", "b"), chunks, tuple(plain)).scales()
    values = law.defaults() | dict(law.starts(scales)[0])
    for name in law.per_recording:
        last = np.ravel(values[name])[-1]
        values[name] = np.array([law.off.get(name, last), last])
    stress = simulate(SPRING, stiffness, [Term(law, values)], list(chunks))
    rng = np.random.default_rng(1)
    sigma = NOISE * max(float(np.abs(s).max()) for s in plain)
    noisy = tuple(s + sigma * rng.standard_normal(len(s)) for s in stress)
    return Data(("a", "b"), chunks, noisy)


ASKED = [law for law in EFFECTS if law.id not in SPRING.has]


@pytest.mark.parametrize("law", ASKED, ids=[e.id for e in ASKED])
def test_a_planted_effect_is_the_first_candidate_on_its_own_telltale(law):
    if "recover" in law.exempt:
        pytest.skip(law.exempt["recover"])
    base = baseline(told(law), "wiechert")
    pool = candidates(base.engine, base.has)
    assert law.id in {e.id for e in pool}
    found = expand(base.engine, base.fit, pool, len(pool))
    assert found, "the base takes it up"
    weigh(base.engine, found[0])
    weigher = Weigher(base.engine, base.fit)
    evidence = {}
    for one in found:
        (name,) = names(one)
        worth = weigher.weigh(one)
        fitted = worth.alone - 0.5 * worth.numbers * np.log(len(one.residual))
        evidence[name] = max(evidence.get(name, -np.inf), fitted)
    assert max(evidence, key=evidence.__getitem__) == law.id


def made(terms=(), noise=0.002, seed=0, order=None, scale=1.0):
    """The five histories of `made`, a quarter of the samples, as data."""
    rng = np.random.default_rng(seed)
    chunks = [
        replace(c, time_s=c.time_s[::4], strain=c.strain[::4]) for c in histories()
    ]
    clean = simulate(UNITS, STIFFNESS, list(terms), chunks)
    stress = [scale * (s + noise * rng.standard_normal(len(s))) for s in clean]
    order = order or range(len(chunks))
    return Data(
        tuple(f"r{i}" for i in order),
        tuple(chunks[i] for i in order),
        tuple(stress[i] for i in order),
    )


def likeliest(data):
    return posterior(search(baseline(data, "pl-wiechert")).accounts)


@pytest.fixture(scope="module")
def softened():
    return search(baseline(made([mullins()]), "pl-wiechert"))


def test_in_noise_alone_nothing_is_likelier_than_any_effect():
    found = likeliest(made())
    assert found.selected == frozenset()
    assert found.nothing > max(found.effects.values(), default=0.0)


def test_what_is_planted_is_worth_most(softened):
    best = max(softened.accounts, key=value)
    assert "mullins_softening" in best.effects
    assert softened.accounts[0].effects == frozenset()
    found = posterior(softened.accounts)
    assert next(iter(found.effects)) == "mullins_softening"
    assert found.best.effects == {"mullins_softening"}


MISTAKEN = Term(effect("gain_error"), {"error": np.array([0, 0.05, 0, -0.04, 0])})


def test_scales_that_agree_but_for_some_are_mistakes_in_these():
    base = baseline(made([MISTAKEN]), "pl-wiechert")
    weigher, pool = Weigher(base.engine, base.fit), candidates(base.engine, frozenset())
    apart = apart_from(base)
    asked = [Account(apart, weigher.weigh(apart, whole=False))]
    (found,) = _as_mistakes(weigher, asked, pool)
    (piece,) = found.fit.guess.pieces
    assert not piece.nuisance
    assert piece.groups == ((1,), (3,))
    error = piece.values["error"] - piece.values["error"][0]
    np.testing.assert_allclose(error, MISTAKEN.values["error"], atol=0.01)
    assert value(found) > value(asked[0])


def test_a_scale_of_specimens_stays_beside_a_mistake_of_the_same_worth():
    base = baseline(made([MISTAKEN]), "pl-wiechert")
    each = scatter(5, [(1,), (3,)], unsaid=True)
    apart = refine(base.engine, base.fit, each)
    weighed = Weigher(base.engine, base.fit).weigh(apart, whole=False)
    (piece,) = apart.guess.pieces
    wrong = replace(piece, nuisance=False, unsaid=False)
    mistake = replace(apart, guess=replace(apart.guess, pieces=(wrong,)))
    alike = replace(weighed, alone=weighed.alone + 5.0)  # the price of an effect
    both = [Account(apart, weighed), Account(mistake, alike)]
    assert value(both[0]) == value(both[1])
    assert {a.effects for a in _worth(both)} == {frozenset(), frozenset({"gain_error"})}


def apart_from(base, before=None):
    """The base, or that fit, with a scale of each recording that nobody wrote down."""
    each = scatter(5, [(r,) for r in range(1, 5)], unsaid=True)
    return refine(base.engine, before or base.fit, each)


def test_a_gain_error_does_not_keep_specimens_from_being_tried():
    # It explains specimens that scatter as well, and what they hide is asked with them.
    scales = Term(effect("gain_error"), {"error": np.array([0, 2, -3, 1, 2]) / 100})
    base = baseline(made([scales]), "pl-wiechert")
    weigher = Weigher(base.engine, base.fit)
    plain = Account(base.fit, weigher.weigh(base.fit, whole=False))
    (wrong,) = expand(base.engine, base.fit, [effect("gain_error")], 1)
    weighed = weigher.weigh(wrong, whole=False)
    far = replace(weighed, alone=weighed.alone + 1e3)
    tried = _as_specimens(base, weigher, [plain, Account(wrong, far)])
    assert tried
    assert all(any(p.unsaid for p in a.fit.guess.pieces) for a in tried)


def test_mistakes_are_asked_of_all_that_are_near_the_best():
    base = baseline(made([MISTAKEN]), "pl-wiechert")
    weigher = Weigher(base.engine, base.fit)
    asked = []
    for name, behind in (("cyclic_softening", 0), ("slack", 9), ("grip_slip", 11)):
        (lone,) = expand(base.engine, base.fit, [effect(name)], 1)
        found = apart_from(base, lone)
        evidence = weigher.weigh(found, whole=False)
        numbers = 0.5 * evidence.numbers * np.log(len(found.residual))
        asked.append(Account(found, replace(evidence, alone=numbers - behind)))
    found = _as_mistakes(weigher, asked, candidates(base.engine, frozenset()))
    assert {a.effects for a in found} == {
        frozenset({"gain_error", "cyclic_softening"}),
        frozenset({"gain_error", "slack"}),
    }


@pytest.mark.slow
def test_a_search_tries_scales_as_mistakes():
    found = search(baseline(made([MISTAKEN]), "pl-sls"))  # of two branches it has one
    both = {"relaxation_branch", "gain_error"}
    mistaken = [a.evidence.alone for a in found.accounts if a.effects == both]
    apart = [
        a.evidence.alone
        for a in found.accounts
        if any(p.unsaid for p in a.fit.guess.pieces)
        and a.effects == {"relaxation_branch"}
    ]
    assert max(mistaken) > max(apart)
    best = max((a for a in found.accounts if a.effects == both), key=value)
    (wrong,) = (p for p in best.fit.guess.pieces if p.effect.id == "gain_error")
    error = wrong.values["error"] - wrong.values["error"][0]
    np.testing.assert_allclose(error, MISTAKEN.values["error"], atol=0.01)


@pytest.mark.slow
def test_other_units_and_another_order_change_no_name(softened):
    plain = posterior(softened.accounts)
    for data in (
        made([mullins()], scale=1e3),
        made([mullins()], order=[4, 3, 2, 1, 0]),
    ):
        other = likeliest(data)
        assert other.selected == plain.selected
        assert next(iter(other.effects)) == next(iter(plain.effects))


@pytest.mark.slow
def test_data_that_are_more_exact_never_speak_against_the_truth():
    chance = []
    for noise in (0.02, 0.002, 0.0002):
        found = likeliest(made([mullins()], noise=noise))
        chance.append(found.effects.get("mullins_softening", 0.0))
    assert chance[0] <= chance[1] + 0.01
    assert chance[1] <= chance[2] + 0.01


def test_accounts_are_weighed_under_one_noise(monkeypatch):
    """Evidence can be held against evidence only so: made anew it is the same."""
    monkeypatch.setattr(evidence, "MOST", 0.0)  # which samples are off, functions say
    found = search(baseline(made([mullins()]), "pl-wiechert"))
    weigher = Weigher(found.base.engine, found.accounts[0].fit)
    alike = 0
    for account in found.accounts:
        again, before = weigher.weigh(account.fit, whole=False), account.evidence
        if again.scatter == before.scatter:  # its functions are of another base
            assert again.bare == pytest.approx(before.bare, rel=1e-9)
            alike += 1
    assert alike > len(found.accounts) / 2


def test_a_planted_effect_leaves_the_noise_that_was_drawn(softened):
    best = max(softened.accounts, key=value)
    engine = softened.base.engine
    left = float(np.sqrt(np.mean((engine.target - best.fit.stress) ** 2)))
    base_left = float(
        np.sqrt(np.mean((engine.target - softened.accounts[0].fit.stress) ** 2))
    )
    assert left == pytest.approx(0.002, rel=0.1)
    assert base_left > 3 * left
    depth = next(
        p.values["depth"]
        for p in best.fit.guess.pieces
        if p.effect.id == "mullins_softening"
    )
    assert depth == pytest.approx(0.4, abs=0.05)


@pytest.mark.parametrize("times", [1, 20])
def test_what_recordings_show_is_a_start_beside_other_effects(monkeypatch, times):
    """A slip that no score test points to, found by its jump, once softening is in."""
    chunks = [replace(c, strain=times * c.strain) for c in histories()]
    units = replace(UNITS, knots=tuple(times * k for k in UNITS.knots))
    slip, softening = effect("grip_slip"), mullins()
    softening.values["scale"] *= times
    gone, moment = 0.05 * times * (np.arange(5) == 1), np.full(5, 7.1)
    values = {"slip": gone, "moment_s": moment, "duration_s": 0.1}
    planted = [Term(slip, values), softening]
    rng = np.random.default_rng(2)
    stress = tuple(
        s + 0.001 * rng.standard_normal(len(s))
        for s in simulate(units, STIFFNESS / times, planted, chunks)
    )
    base = baseline(Data(tuple("abcde"), tuple(chunks), stress), "pl-wiechert")
    start = start_pieces(base.engine, effect("mullins_softening"))[0]
    beside = refine(base.engine, base.fit, start)
    monkeypatch.setattr(Screen, "lead", lambda *_: [])
    found = expand(base.engine, beside, EFFECTS, LATER)
    both = [f for f in found if set(names(f)) == {"grip_slip", "mullins_softening"}]
    assert both
    (piece,) = [p for p in both[0].guess.pieces if p.effect.id == "grip_slip"]
    assert piece.groups == ((1,),)
    assert piece.values["slip"][1] == pytest.approx(0.05 * times, rel=0.15)
    assert piece.values["moment_s"][1] == pytest.approx(7.1, abs=0.2)


def test_what_a_base_misses_is_no_noise(softened):
    engine = softened.base.engine
    best = max(softened.accounts, key=value)
    bare = next(a for a in softened.accounts if not a.effects)
    missed = np.sqrt(np.mean((engine.target - bare.fit.stress) ** 2)) / engine.level
    assert missed > 0.02
    before = softened.noise
    try:
        assert not believed(engine, weigh(engine, bare.fit, long=True))
        assert believed(engine, weigh(engine, best.fit, long=True))
    finally:
        weigh_by(engine, before)


def test_a_mistake_that_several_recordings_share_is_one_number():
    factors = np.array([0.0, 0.3, 0.0, 0.3, 0.0])
    base = baseline(
        made([Term(effect("gain_error"), {"error": factors})]), "pl-wiechert"
    )
    (found,) = expand(base.engine, base.fit, [effect("gain_error")], 1)
    (piece,) = found.guess.pieces
    assert piece.groups == ((1, 3),)
    np.testing.assert_allclose(piece.values["error"], factors, atol=0.01)


def test_a_wander_that_no_machine_has_is_not_settled_for_noise():
    chunks = histories()
    rng, clean = np.random.default_rng(1), simulate(UNITS, STIFFNESS, [], chunks)
    top = max(float(s.max()) for s in clean)
    stress = [
        s + top * (0.1 * np.sin(c.time_s / 6) + 2e-3 * rng.standard_normal(len(s)))
        for c, s in zip(chunks, clean, strict=True)
    ]
    base = baseline(Data(tuple("abcde"), tuple(chunks), tuple(stress)), "pl-wiechert")
    weigher = Weigher(base.engine, base.fit)
    bare = Account(base.fit, weigher.weigh(base.fit, whole=False))
    noise, _ = _settled(base, weigher, [bare])
    assert noise == weigh(base.engine, bare.fit, long=False)
    assert noise != weigh(base.engine, bare.fit, long=True)


def test_a_mass_is_not_negative():
    law = effect("inertia")
    chunk = law.telltale()
    kick = simulate(SPRING, np.ones(2), [Term(law, {"mass": 1e-3})], [chunk])[0]
    plain = simulate(SPRING, np.ones(2), [], [chunk])[0]
    pushed = 2 * plain - kick
    for stress, found in ((kick, True), (pushed, False)):
        base = baseline(Data(("a",), (chunk,), (stress,)), "pl-wiechert")
        fits = expand(base.engine, base.fit, [law], 1)
        better = [f for f in fits if f.chi2 < 0.5 * base.fit.chi2]
        assert bool(better) == found
