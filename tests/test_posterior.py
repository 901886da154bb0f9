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
    posterior,
    probabilities,
    table,
)

N = 400
HAND = Constants(
    tail=2.0,
    exact=4.0,
    strange=4.0,
    noise=4.0,
    number=1.0,
    left=1.0,
    share=0.0,
    both=4.0,
    further=3.0,
    loose=1.0,
    bent=0.0,
    first=1.0,
    more=2.0,
    own=0.25,
    other=3.0,
)


def account(*names, bare=None, alone=0.0, beside=0.0, numbers=0, own=False):
    """An account as the posterior sees it; `own`: each effect has values of its own."""
    pieces = [Piece(effect(n), {}, (), ()) for n in names]
    pieces.append(Piece(effect("gain_error"), {}, (), ((0,), (1,)), nuisance=True))
    guess = SimpleNamespace(pieces=tuple(pieces))
    places = [(i, (0,) if own else None) for i in range(len(names))]
    places += [(len(names), (1,)), (-1, (0,))]  # specimens, and a value of the base
    slots = [SimpleNamespace(piece=i, recordings=r) for i, r in places]
    bare = alone if bare is None else bare
    known = Evidence(bare, alone, beside, 0.0, 0.0, 0.0, numbers)
    fit = SimpleNamespace(guess=guess, residual=np.zeros(N), slots=slots)
    return Account(fit, known)


def test_figures_are_counted():
    both = account("slack", "inertia", bare=4, alone=5, beside=7, numbers=3, own=True)
    assert both.figures == pytest.approx([4, 5, 7, 1.5 * np.log(N), np.log(N)])
    # A scale that is a mistake pays by its prior alone.
    wrong = account("gain_error", alone=9.0, beside=9.0, own=True)
    assert wrong.figures == pytest.approx([9, 9, 9, 0, 0])
    # The scatter between specimens is no effect.
    assert account(beside=5.0).figures == pytest.approx([0, 0, 5, 0, 0])


NONE = -1e9  # no evidence to speak of
# As they stand, alone, beside anything; prices; effects; whether on no list.
TABLE = np.array(
    [
        [100.0, 100.0, 100.0, 0, 0, 0, 0],  # nothing
        [100.0, 136.0, 136.0, 0, 0, 0, 1],  # something on no list
        [165.0, 165.0, NONE, 1, 1, 1, 0],  # an effect, one number and that its own
        [160.0, 160.0, NONE, 0, 0, 1, 0],  # another
        [153.0, NONE, 157.0, 0, 0, 2, 0],  # two, as good as surely beside something
    ]
)


def lost(behind, tail):
    """h by hand."""
    return behind if behind < tail else tail * (1 + np.log(behind / tail))


def test_probabilities_of_a_small_table():
    # One effect has 164 at best; two have 153, less the root of the 4 that they leave
    # and the 3 that a second is to gain.
    many = np.exp([-1.0, -1.0 - 2.0 - lost(16.0, 4.0)])
    which = np.exp([-0.25, -4.0])
    each = many[0] * which / which.sum()
    rest = np.exp([-lost(64.0, 4.0), -3.0 - lost(28.0, 4.0)])
    weight = np.array([*rest, *each, many[1]])
    found = probabilities(TABLE, HAND)
    np.testing.assert_allclose(found, weight / weight.sum(), atol=1e-12)


def test_what_laws_leave_costs_its_root_and_makes_tails_heavier():
    nothing = np.array([97.0, 97.0, 97.0, 0, 0, 0, 0])
    one = TABLE[2].copy()
    one[2] = one[0] + 9.0  # what flexible terms gain beside it: 161 are left of 165
    another = np.array([156.0, 156.0, NONE, 0, 0, 1, 0])
    two = np.array([190.0, 190.0, NONE, 0, 0, 2, 0])
    rows = np.array([nothing, TABLE[1], one, another, two])
    scarce = replace(HAND, both=1e6)  # counts for D alone
    which = np.exp([-0.25, -lost(5.0, 2.0 + 2.0 / 10.0)])

    def weight(lead, tail):
        many = np.exp([-1.0 - lost(lead - 161.0, tail), -3.0])
        rest = np.exp([-lost(lead - 97.0, 4.0), -3.0 - lost(lead - 136.0, tail)])
        out = np.array([*rest, *(many[0] * which / which.sum()), many[1]])
        return out / out.sum()

    # What leads, 190 less 3, leaves nothing: what is behind is as far as it is.
    found = probabilities(rows, scarce)
    np.testing.assert_allclose(found, weight(187.0, 4.0), atol=1e-12)
    leaving = rows.copy()
    leaving[4, 2] = 199.0  # it leaves as much as the other
    again = probabilities(leaving, scarce)
    np.testing.assert_allclose(again, weight(184.0, 2.0 + 2.0 / 10.0), atol=1e-12)
    # Usual is what is a share of all that is gained: 9 of 1 + 64 / 8 is one.
    usual = probabilities(rows, replace(scarce, bent=1 / 8))
    assert usual[3] / usual[2] == pytest.approx(np.exp(0.25 - lost(5.0, 3.0)))


def test_the_same_lead_says_less_where_more_is_gained():
    wide = replace(HAND, share=0.5)

    def lead(gain):
        rows = np.array([[0.0, 0, 0, 0, 0, 0, 0]] + 2 * [[0, 0, NONE, 0, 0, 1, 0]])
        rows[1:, 0] = rows[1:, 1] = [gain, gain + 3.0]
        _, second, first = probabilities(rows, wide)
        return first / second

    for gain in (10.0, 1e4):
        scale = 1 + 0.5 * np.log(gain + 4.0)
        assert lead(gain) == pytest.approx(np.exp(3.0 / scale))


def test_many_tables_at_once_are_each_by_itself():
    short = np.full_like(TABLE, 0.0)
    short[:, 1:3] = -np.inf
    short[:3] = TABLE[:3]
    both = probabilities(np.stack([TABLE, short]), HAND)
    np.testing.assert_allclose(both[0], probabilities(TABLE, HAND))
    np.testing.assert_allclose(both[1, :3], probabilities(TABLE[:3], HAND))
    np.testing.assert_array_equal(both[1, 3:], 0.0)


def test_false_companions_do_not_crowd_out_an_effect():
    # Each further law of twelve that gains nothing: how many of them were tried is no
    # reason to believe that there are two.
    def alone(companions):
        two = [[100.0, 100.0, NONE, 0, 0, 2, 0]] * companions
        one = [[0.0, 0, 0, 0, 0, 0, 0], [100.0, 100.0, NONE, 0, 0, 1, 0]]
        return probabilities(np.array(one + two), HAND)[1]

    assert alone(12) == pytest.approx(alone(1))


def test_a_law_and_something_else_share_one_evidence():
    tried = [account(), account("slack", bare=30.0, alone=30.0, beside=36.0)]
    found = posterior(tried, HAND)  # the second is e^2 times as likely
    share = np.exp(2.0) / (1 + np.exp(2.0))
    assert found.beside[1] == pytest.approx(share)
    left = 6.0
    value = 30 + np.log1p(np.exp(2.0)) - np.sqrt(left)
    strange = lost(value, 2.0 + 2.0 / (1 + left)) + 3.0
    nothing = lost(value, 4.0)
    weight = np.exp([-nothing, -1.0, -strange])
    np.testing.assert_allclose(found.probability, weight / weight.sum())
    alone = found.probability[2]  # something on no list, and no effect
    assert found.nothing_named == alone
    assert found.other == pytest.approx(alone + share * found.probability[1])


def odds(gain, constants=HAND):
    """Log odds of an effect that gains so much over nothing."""
    rows = np.zeros((2, 7))
    rows[1, [0, 1, 5]] = [gain, gain, 1]
    rows[:, 2] = -np.inf
    nothing, effect_ = probabilities(rows, constants)
    return np.log(effect_ / nothing)


def test_odds_grow_as_a_power_of_what_is_gained():
    assert odds(4e12) == pytest.approx(4 + 4 * np.log(1e12) - 1, rel=1e-9)
    # And what gains nothing costs what it costs.
    assert odds(0.0) == pytest.approx(-1.0)
    assert odds(3.0) == pytest.approx(3.0 - 1.0)  # a small gain counts in full


def test_no_nat_counts_for_more_than_one():
    gains = np.geomspace(0.01, 1e6, 200)
    for constants in (CONSTANTS, HAND):
        slope = np.diff([odds(g, constants) for g in gains]) / np.diff(gains)
        assert slope.max() <= 1.0 + 1e-9
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
    figures = np.array([a.figures for a in tried])
    which, rows = table([a.effects for a in tried], figures)
    np.testing.assert_allclose(found.probability, probabilities(rows, HAND))
    assert [(tried[i], o) for i, o in which] == [
        (h.account, h.other) for h in found.hypotheses
    ]
    assert found.nothing == found.probability[0]
    each = zip(found.hypotheses, found.probability, strict=True)
    by = {(h.effects, h.other): p for h, p in each}
    slack, inertia = frozenset(["slack"]), frozenset(["inertia"])
    assert found.effects == {"slack": by[slack, False], "inertia": by[inertia, False]}
    assert list(found.effects) == ["slack", "inertia"]
    assert found.nothing_named == by[frozenset(), True]


def test_evidence_beyond_floats_is_no_trouble():
    far = [account(), account("slack", alone=1e8, beside=1e8)]
    assert np.isfinite(posterior(far, HAND).probability).all()
    assert posterior(far, HAND).effects["slack"] == pytest.approx(1.0)


def test_of_one_set_the_best_form_counts():
    tried = [account(), account("slack", alone=5.0), account("slack", alone=9.0)]
    found = posterior(tried).hypotheses
    assert [h.account for h in found if h.effects] == [tried[2]]
    assert len(found) == 3


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
