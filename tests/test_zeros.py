"""What is read before anything has moved, against the textbook and in recordings."""

import numpy as np
import pytest
from made import STIFFNESS, UNITS, straight
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from softnn import Recording, diagnose
from softnn.contracts import Chunk
from softnn.effects import EFFECTS
from softnn.effects._signs import ZEROS, noise
from softnn.fit import Data, Engine
from softnn.mismatch.screen import start_pieces
from softnn.mismatch.zeros import SPREADS, Zeros
from softnn.simulate import simulate

TOP = 2.0  # largest stress, MPa


def engine(begins=(0.0, 0.0, 0.0, 0.0), continued=False):
    """Recordings that rest, go up and come back, each from where it begins."""
    chunks, stress, rng = [], [], np.random.default_rng(0)
    for at in begins:
        chunk = straight([at, at, 1, at], 0.1, 0.5)
        chunks.append(chunk)
        stress.append(
            TOP * chunk.strain + 1e-4 * rng.standard_normal(len(chunk.strain))
        )
    names = tuple("abcdefg"[: len(begins)])
    return Engine(Data(names, tuple(chunks), tuple(stress), continued))


def zeros(made, stress, effects=0.0):
    return Zeros(made).evidence(stress, effects + 0 * stress)


def off(made, values):
    """A simulation that is off by so much in each recording, MPa."""
    return made.target - np.asarray(values, float)[made.owner]


def test_it_is_the_textbooks_evidence_about_a_free_mean():
    made, wide = engine(), 30.0
    own = np.array([noise(s) for s in made.data.stress_MPa])
    prior = np.log(SPREADS / (1 + SPREADS**2))

    def dense(values):
        over = [
            multivariate_normal.logpdf(
                values, cov=np.diag((ZEROS * TOP * s) ** 2 + own**2) + wide**2
            )
            for s in SPREADS
        ]
        return logsumexp(np.array(over) + prior)

    one, other = np.array([0.003, -0.002, 0.1, 0.0]), np.array([0.0, 0.01, 0.02, -0.01])
    told = zeros(made, off(made, one)) - zeros(made, off(made, other))
    assert told == pytest.approx(dense(one) - dense(other), rel=1e-4)


def test_what_all_have_alike_is_no_news_and_one_apart_is():
    made = engine()
    zero = zeros(made, off(made, np.zeros(4)))
    assert zeros(made, off(made, np.full(4, 0.3))) == pytest.approx(zero)
    least = zeros(made, off(made, [0, 0, 0, ZEROS * TOP / 2]))
    apart = zeros(made, off(made, [0, 0, 0, 0.05 * TOP]))
    assert zero - least < 1.0
    assert zero - apart > 8.0


def test_an_account_may_set_a_zero_and_is_held_to_it_loosely():
    made = engine()
    zero = zeros(made, off(made, np.zeros(4)))
    fourth = 0.1 * (made.owner == 3)  # what an effect makes of the last recording
    assert zeros(made, off(made, np.zeros(4)), fourth) == pytest.approx(zero)
    # By how far it misses what is read there, over what a machine may err by: 2 %.
    far = zeros(made, off(made, [0, 0, 0, 0.04]), fourth)
    assert far == pytest.approx(zero - 0.5, abs=0.01)
    # A zero that it does not set is held to the others.
    assert zeros(made, off(made, [0, 0, 0.1, 0]), fourth) < zero - 8


def test_where_a_specimen_has_moved_nothing_is_known():
    moved = engine(begins=(0.0, 0.3, 0.3, 0.3))
    assert zeros(moved, off(moved, [0, 0, 0, 1.0])) == 0.0
    on = engine(continued=True)  # the first alone is fresh
    assert zeros(on, off(on, [0, 0, 0, 1.0])) == 0.0
    two = engine(begins=(0.0, 0.0, 0.3, 0.3))
    same = zeros(two, off(two, np.zeros(4)))
    assert zeros(two, off(two, [0, 0, 1.0, 0])) == pytest.approx(same)
    assert zeros(two, off(two, [0, 1.0, 0, 0])) < same - 3


@pytest.mark.parametrize("law", EFFECTS, ids=lambda law: law.id)
def test_only_an_offset_is_read_before_anything_has_moved(law):
    made = engine()
    chunks = [Chunk(c.time_s, c.strain, 20 + c.time_s / 10) for c in made.data.chunks]
    for piece in start_pieces(made, law):
        first = [s[0] for s in simulate(UNITS, STIFFNESS, [piece.term()], chunks)]
        if law.id == "zero_offset":
            assert np.abs(first).min() > 0.01
        else:
            np.testing.assert_allclose(first, 0.0, atol=1e-9)


@pytest.mark.parametrize("size", [0.0, 0.055])
def test_an_offset_at_rest_is_named_beside_a_material_that_no_law_describes(size):
    """Bent by half in what nobody wrote down, so that no account is near the noise."""
    rng = np.random.default_rng(3)
    recordings = []
    for i, peak in enumerate([0.5, 0.6, 0.55, 0.45, 0.6, 0.5]):
        chunk = straight([0, 0, peak, 0.1, peak, 0], 0.05, 0.4)
        moved = np.cumsum(np.abs(np.diff(chunk.strain, prepend=0.0)))
        bent = 1 + 0.3 * np.sin(9 * moved + i) + 0.2 * np.cos(25 * chunk.strain)
        stress = 2 * chunk.strain * bent + 2e-4 * rng.standard_normal(len(moved))
        stress += size * (i in (1, 4)) * np.abs(stress).max()
        still = chunk.time_s > 52  # eight seconds of rest are enough
        recordings.append(
            Recording(
                chunk.time_s[still] - chunk.time_s[still][0],
                chunk.strain[still], stress[still], name=f"r{i}",
            )
        )  # fmt: skip
    chance = diagnose(recordings).probability
    assert (chance.get("zero_offset", 0.0) > 0.9) == (size > 0)
