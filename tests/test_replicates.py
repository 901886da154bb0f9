"""What one recording has apart from its replicates, whatever laws get wrong."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, straight

from softnn import Recording
from softnn.effects import EFFECTS
from softnn.fit import Data, Engine, Guess, fit
from softnn.mismatch.accounts import search
from softnn.mismatch.apart import on
from softnn.mismatch.base import start
from softnn.mismatch.candidates import refine
from softnn.mismatch.case import Case
from softnn.mismatch.evidence import worth
from softnn.mismatch.posterior import Hypothesis, Posterior
from softnn.mismatch.replicates import POINTS, Replicates, apart
from softnn.mismatch.screen import only, start_pieces
from softnn.mismatch.specimens import UNSAID, picked

CYCLES = [0, 0.5, 0.1, 0.5, 0]
(SLACK,) = (law for law in EFFECTS if law.id == "slack")


def recordings(programmes, stress, step=0.05, rate=0.1):
    """One a programme, each of the stress that it is given for its strain."""
    chunks = [straight(p, step, rate) for p in programmes]
    values = [stress(i, c) for i, c in enumerate(chunks)]
    names = tuple(f"r{i}" for i in range(len(chunks)))
    return Engine(Data(names, tuple(chunks), tuple(values)))


def noisy(i, chunk):
    rng = np.random.default_rng(i)
    return 2 * chunk.strain + 1e-3 * rng.standard_normal(len(chunk.strain))


def test_replicates_go_through_the_same():
    def of(*programmes):
        return Replicates(recordings(programmes, noisy)).groups

    near = [0, 0.52, 0.1, 0.5, 0]
    assert of(CYCLES, CYCLES, near) == [[0, 1, 2]]
    assert of(CYCLES, [0, 0.9, 0.1, 0.9, 0]) == []  # further
    assert of(CYCLES, CYCLES[:3], CYCLES) == [[0, 2]]  # shorter
    slow = straight(CYCLES, 0.05, 0.1)
    further = replace(slow, strain=1.5 * slow.strain)  # in the same time
    for other in (straight(CYCLES, 0.01, 0.4), further):
        both = slow, other
        data = Data(("a", "b"), both, tuple(2 * c.strain for c in both))
        assert Replicates(Engine(data)).groups == []


def test_what_has_no_stress_is_no_replicate():
    def stress(i, chunk):
        return np.where(i == 1, np.nan, noisy(i, chunk))

    assert Replicates(recordings([CYCLES] * 3, stress)).groups == [[0, 2]]


def test_scales_zeros_and_what_all_have_alike_are_no_difference():
    made = recordings([CYCLES] * 3, noisy)
    told = Replicates(made)
    first = [c.time_s < c.time_s[np.argmax(c.strain)] for c in made.chunks]
    own = np.concatenate(
        [
            0.1 * i + (1 + 0.2 * i + 0.3 * i * fresh) * 2 * c.strain
            for i, (c, fresh) in enumerate(zip(made.chunks, first, strict=True))
        ]
    )
    alike = np.concatenate(
        [np.sin(30 * c.strain) + np.cos(c.time_s) for c in made.chunks]
    )
    usual, many = told.spread([0, 1, 2], np.zeros(len(made.target)))
    stretches = len(CYCLES) - 1
    assert usual == pytest.approx(2e-6 * POINTS * stretches, rel=0.5)  # the noise's
    assert many == pytest.approx(2 * POINTS * stretches, rel=0.5)  # each value its own
    for values in (own, alike, own + alike):
        assert told.spread([0, 1, 2], values)[0] == pytest.approx(usual, rel=0.02)


def gap(i, chunk):
    """Of one there is slack: a kink near zero, no scale."""
    taut = np.maximum(chunk.strain - 0.03 * (i == 2), 0)
    rng = np.random.default_rng(i)
    return 2 * taut + 2e-3 * rng.standard_normal(len(taut))


def fitted(made, *recordings):
    piece = only(start_pieces(made, SLACK)[0], np.array(recordings))
    return fit(made, Guess(UNITS, STIFFNESS, (piece,)), iterations=30)


def test_odds_are_those_of_two_regressions():
    made = recordings([CYCLES] * 4, gap)
    found, told = fitted(made, 2), Replicates(made)
    base = replace(found.guess, pieces=())
    without = fit(made, base, iterations=30).stress, made.run(base, False)[0]
    before, many = min(told.spread(range(4), stress) for stress in without)
    after, more = told.spread(range(4), found.stress)
    assert many < more  # a kink that comes again is few values, noise is many
    numbers = sum(worth(found, s) for s in found.slots if s.piece == 0)
    price = UNSAID + picked(4, 1) + numbers / 2 * np.log(many)
    expected = many / 2 * np.log(before / after) - price
    odds, piece = told.asked(found, 0)
    assert odds == pytest.approx(expected, rel=1e-3)
    assert odds > 5
    assert on(piece) == {2}
    assert told.asked(fitted(made, 1), 0)[0] < -2  # one that has none


def test_recordings_that_only_laws_put_it_in_are_taken_out():
    made = recordings([CYCLES] * 4, gap)
    piece = only(start_pieces(made, SLACK)[0], np.array([0, 2, 3]))
    values = piece.values | {"gap": np.array([0.01, 0.0, 0.03, 0.01])}
    guess = Guess(UNITS, STIFFNESS, (replace(piece, values=values),))
    bad = fit(made, guess, iterations=0)
    odds, kept = Replicates(made).asked(bad, 0)
    assert on(kept) == {2}
    assert odds > 2


def test_without_a_replicate_nothing_is_asked():
    far = [0, 0.9, 0.1, 0.9, 0]
    made = recordings([CYCLES, CYCLES, far], gap)
    assert Replicates(made).groups == [[0, 1]]
    assert Replicates(made).asked(fitted(made, 2), 0)[0] == -np.inf


@pytest.mark.parametrize("law", EFFECTS, ids=lambda law: law.id)
def test_scales_and_zeros_are_asked_elsewhere(law):
    data = recordings([CYCLES] * 3, noisy).data
    warm = (replace(c, temperature_C=20 + c.time_s / 10) for c in data.chunks)
    made = Engine(replace(data, chunks=tuple(warm)))
    for piece in start_pieces(made, law):
        found = fit(made, Guess(UNITS, STIFFNESS, (piece,)), iterations=0)
        account = SimpleNamespace(fit=found, effects=frozenset({law.id}))
        one = Posterior((Hypothesis(account),), np.ones(1), np.ones(1))
        told = apart(made, one).piece
        own = law.amplitude in law.per_recording
        assert (told is not None) == (own and not (law.scatter or law.unmoved))


@pytest.mark.parametrize("stress", [gap, noisy])
def test_replicates_tell_what_laws_leave_open(stress):
    """Accounts at odds of nine to one against slack: it is in one of four, or none."""
    c = straight(CYCLES, 0.1, 0.1)
    every = [
        Recording(c.time_s, c.strain, stress(i, c), name=f"r{i}") for i in range(4)
    ]
    found = search(start(Case("case", tuple(every))))
    base, engine = found.accounts[0], found.base.engine
    piece = only(start_pieces(engine, SLACK)[0], np.array([2]))
    slack = replace(base, fit=refine(engine, base.fit, piece))
    two = tuple(Hypothesis(a) for a in (base, slack))
    before = Posterior(two, np.array([0.9, 0.1]), np.ones(2))
    told = apart(engine, before)
    assert (told.asked(before).effects["slack"] > 0.9) == (stress is gap)
    assert (told.said(slack.fit) == {"slack"}) == (stress is gap)
