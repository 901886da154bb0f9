"""Weights, names and readings of a posterior, by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from softnn.effects import effect
from softnn.fit import Piece
from softnn.mismatch.accounts import Account
from softnn.mismatch.evidence import Evidence
from softnn.mismatch.posterior import (
    CONSTANTS,
    Constants,
    Hypothesis,
    Posterior,
    features,
    posterior,
    probabilities,
    table,
)

N = 400
HAND = Constants(2.0, 4.0, 1.0, 3.0, 0.5, 4.0, 1.0, 2.0, 0.25, 3.0)


def account(*names, alone=0.0, beside=0.0, numbers=0, own=False):
    """An account as the posterior sees it; `own`: each effect has values of its own."""
    pieces = [Piece(effect(n), {}, (), ()) for n in names]
    pieces.append(Piece(effect("gain_error"), {}, (), ((0,), (1,)), nuisance=True))
    guess = SimpleNamespace(pieces=tuple(pieces))
    places = [(i, (0,) if own else None) for i in range(len(names))]
    places += [(len(names), (1,)), (-1, (0,))]  # specimens, and a value of the base
    slots = [SimpleNamespace(piece=i, recordings=r) for i, r in places]
    known = Evidence(alone, alone, beside, 0.0, 0.0, 0.0, 0.0, numbers)
    fit = SimpleNamespace(guess=guess, residual=np.zeros(N), slots=slots)
    return Account(fit, known)


def test_features_are_counted():
    both = account("slack", "inertia", alone=50.0, beside=70.0, numbers=3, own=True)
    price = 1.5 * np.log(N)
    row = features(Hypothesis(both))
    assert row == pytest.approx([50, 70, price, 1, 1, np.log(N), 0])
    # A scale that is a mistake pays by its prior alone.
    wrong = features(Hypothesis(account("gain_error", alone=9.0, own=True)))
    assert wrong == pytest.approx([9, 0, 0, 1, 0, 0, 0])
    # The scatter between specimens is no effect.
    row = features(Hypothesis(account(beside=5.0), True))
    assert row == pytest.approx([5, 5, 0, 0, 0, 0, 1])


TABLE = np.array(
    [
        [100.0, 0, 0, 0, 0, 0, 0],  # nothing
        [136.0, 0, 0, 0, 0, 0, 1],  # something on no list
        [165.0, 0, 1, 1, 0, 1, 0],  # an effect, one number and that its own
        [0.0, 153.0, 0, 1, 1, 0, 0],  # two, as good as surely beside something else
    ]
)
COSTS = np.array([0.0, 3.0, 1.25, 3.0])


def test_probabilities_of_a_small_table():
    # Effects gain 64 and 153 - 4 - 100: errors of 4, 4, 8 and 7.5 nats. Behind the best
    # by 64, 28, 0 and 15: by 16, 7, 0 and 2 errors.
    lost = np.array([4 + 4 * np.log(4.0), 2 + 2 * np.log(3.5), 0.0, 2.0])
    weight = np.exp(-lost - COSTS)
    found = probabilities(TABLE, HAND)
    np.testing.assert_allclose(found, weight / weight.sum(), atol=1e-12)


def test_a_law_and_something_else_share_one_evidence():
    tried = [account(), account("slack", alone=30.0, beside=36.0)]
    found = posterior(tried, HAND)  # the second is e^2 times as likely
    sum_ = [account(), account("slack", alone=30 + np.log1p(np.exp(2.0)), beside=-1e9)]
    assert found.effects == pytest.approx(posterior(sum_, HAND).effects)
    share = np.exp(2.0) / (1 + np.exp(2.0))
    assert found.beside[1] == pytest.approx(share)
    alone = found.probability[2]  # something on no list, and no effect
    assert found.nothing_named == alone
    assert found.other == pytest.approx(alone + share * found.probability[1])


def odds(gain, constants=HAND):
    """Log odds of an effect that gains so much over nothing."""
    rows = np.zeros((2, 7))
    rows[1, [0, 3]] = [gain, 1]
    rows[:, 1] = -np.inf
    nothing, effect_ = probabilities(rows, constants)
    return np.log(effect_ / nothing)


def test_odds_grow_as_a_power_of_what_is_gained():
    assert odds(16e12) == pytest.approx(4 + 4 * np.log(1e12) - 1, rel=1e-9)
    # And what gains nothing costs what it costs.
    assert odds(0.0) == pytest.approx(-1.0)


def test_the_same_lead_says_less_where_both_gain_much():
    def lead(gain):
        rows = np.zeros((3, 7))
        rows[1:, 0], rows[1:, 3] = [gain, gain + 12.0], 1.0
        rows[:, 1] = -np.inf
        _, second, first = probabilities(rows, HAND)
        return first / second

    assert lead(64.0) == pytest.approx(np.exp(12 / 8))
    assert lead(6400.0) == pytest.approx(np.exp(12 / 44))


def test_a_small_gain_counts_as_its_likelihood():
    exact = replace(HAND, noise=10.0, error=0.0)
    assert odds(7.0, exact) == pytest.approx(7.0 - 1.0)


def test_no_nat_counts_for_more_than_one():
    gains = np.geomspace(0.01, 1e6, 200)
    for constants in (CONSTANTS, HAND):
        slope = np.diff([odds(g, constants) for g in gains]) / np.diff(gains)
        assert slope.max() <= 1.0
        assert slope.min() > 0


def test_probabilities_are_those_of_the_weights_and_sum_to_one():
    tried = [
        account(alone=100.0, beside=110.0),
        account("slack", alone=140.0, beside=141.0, numbers=1),
        account("inertia", alone=130.0, beside=140.0, numbers=1),
    ]
    found = posterior(tried, HAND)
    assert len(found.hypotheses) == 4
    assert found.probability.sum() == pytest.approx(1.0)
    rows = np.array([features(h) for h in found.hypotheses])
    np.testing.assert_allclose(found.probability, probabilities(rows, HAND))
    assert found.nothing == found.probability[0]
    each = zip(found.hypotheses, found.probability, strict=True)
    by = {(h.effects, h.other): p for h, p in each}
    slack, inertia = frozenset(["slack"]), frozenset(["inertia"])
    assert found.effects == {"slack": by[slack, False], "inertia": by[inertia, False]}
    assert list(found.effects) == ["slack", "inertia"]
    assert found.nothing_named == by[frozenset(), True]


def test_all_alike_are_alike_and_evidence_beyond_floats_is_no_trouble():
    same = [account(alone=1.0, beside=1.0), account("slack", alone=1.0, beside=-1e9)]
    free = Constants(2.0, 2.0, 1.0, 3.0, 0.05, *[0.0] * 5)
    np.testing.assert_allclose(posterior(same, free).probability, 1 / 3)
    far = [account(), account("slack", alone=1e8, beside=1e8)]
    sharp = replace(HAND, share=0.0)
    assert np.isfinite(posterior(far, sharp).probability).all()
    assert posterior(far, sharp).effects["slack"] == pytest.approx(1.0)


def test_of_one_set_the_best_form_counts():
    tried = [account(), account("slack", alone=5.0), account("slack", alone=9.0)]
    rows = {(h.effects, h.other): h for h, _ in table(tried)}
    assert rows[frozenset(["slack"]), False].account is tried[2]
    assert len(rows) == 3


def made(*readings):
    """A posterior of these (names, other, probability); the first is of nothing."""
    them = [Hypothesis(account(*names), other) for names, other, _ in readings]
    p = np.array([p for *_, p in readings])
    return Posterior(tuple(them), p, np.zeros(len(p)))


def test_names_are_what_is_likelier_than_not_and_stand_on_their_own_account():
    found = made(
        ((), False, 0.05),
        (("slack",), False, 0.3),
        (("slack", "inertia"), False, 0.35),
        (("slack", "sensor_lag"), False, 0.2),
        (("inertia",), False, 0.1),
    )
    assert found.effects == pytest.approx(
        {"slack": 0.85, "inertia": 0.45, "sensor_lag": 0.2}
    )
    assert found.selected == {"slack"}
    assert found.best.effects == {"slack"}  # though another is likelier by itself
    assert found.ways()[0] == (frozenset(["slack", "inertia"]), pytest.approx(0.35))


def test_ways_are_what_comes_near_the_likeliest():
    found = made(
        ((), False, 0.02),
        (("slack",), False, 0.6),
        (("zero_offset",), False, 0.35),
        (("inertia",), False, 0.03),
    )
    assert [s for s, _ in found.ways()] == [{"slack"}, {"zero_offset"}]
    assert [p for _, p in found.ways()] == pytest.approx([0.6, 0.35])
    assert found.instead("slack") == ["zero_offset"]


def test_what_stands_in_the_place_of_one_of_two():
    found = made(
        ((), False, 0.0),
        (("slack", "inertia"), False, 0.5),
        (("slack", "sensor_lag"), False, 0.3),
        (("grip_slip", "inertia"), False, 0.2),
    )
    assert found.selected == {"slack", "inertia"}
    assert found.instead("inertia") == ["sensor_lag"]
    assert found.instead("slack") == ["grip_slip"]


def test_where_no_account_is_of_the_selected_the_nearest_is_the_best():
    found = made(
        ((), False, 0.0),
        (("slack", "inertia"), False, 0.3),
        (("slack", "sensor_lag"), False, 0.3),
        (("slack", "grip_slip", "inertia"), False, 0.4),
    )
    assert found.selected == {"slack", "inertia"}
    assert found.best.effects == {"slack", "inertia"}
    none = made(((), False, 0.4), (("slack",), False, 0.3), (("inertia",), False, 0.3))
    assert none.selected == frozenset()
    assert none.best.effects == frozenset()
