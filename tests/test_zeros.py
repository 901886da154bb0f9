"""What is read before anything has moved, against the textbook and in recordings."""

from types import SimpleNamespace

import numpy as np
import pytest
from made import STIFFNESS, UNITS, straight
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from softnn import Recording, diagnose
from softnn.contracts import Chunk
from softnn.effects import EFFECTS
from softnn.effects._signs import ZEROS, noise
from softnn.fit import Data, Engine, Guess
from softnn.mismatch.candidates import shown
from softnn.mismatch.decision import Shows, decide
from softnn.mismatch.evidence import MISTAKE
from softnn.mismatch.faults import named
from softnn.mismatch.screen import only, start_pieces
from softnn.mismatch.specimens import UNSAID, picked
from softnn.mismatch.zeros import SPREADS, at_rest, likely
from softnn.simulate import simulate

TOP = 2.0  # largest stress, MPa
(LAW,) = (law for law in EFFECTS if law.unmoved)


def engine(zeros=(0.0, 0.0, 0.0, 0.0), begins=0.0, continued=False):
    """Recordings that rest, go up and come back, with what is read at rest, MPa."""
    chunks, stress, rng = [], [], np.random.default_rng(0)
    for zero in zeros:
        chunk = straight([begins, begins, 1, begins], 0.1, 0.5)
        chunks.append(chunk)
        noisy = 1e-4 * rng.standard_normal(len(chunk.strain))
        stress.append(zero + TOP * chunk.strain + noisy)
    names = tuple("abcdefgh"[: len(zeros)])
    return Engine(Data(names, tuple(chunks), tuple(stress), continued))


def chance(made, *wrong):
    """That the zeros of these recordings are apart."""
    return likely(made, only(start_pieces(made, LAW)[0], np.array(wrong)))


@pytest.mark.parametrize("zeros", [(0, 0.004, -0.003, 0.1), (0.05, -0.1, 0.1, 0.2)])
def test_it_is_the_textbooks_odds_about_a_free_mean(zeros):
    made, wide = engine(zeros), 30.0
    stress = made.data.stress_MPa
    own = np.array([noise(s) for s in stress])
    read = np.array([np.median(s[:30]) for s in stress])  # a quarter of the rest
    prior = np.log(SPREADS / (1 + SPREADS**2))

    def dense(size):
        each = []
        for spread in ZEROS * SPREADS:
            scale = np.array([spread] * 3 + [spread if size is None else size])
            cov = np.diag((made.level * scale) ** 2 + own**2) + wide**2
            each.append(multivariate_normal.logpdf(read, cov=cov))
        return logsumexp(np.array(each) + prior)

    some = logsumexp([dense(s) for s in MISTAKE]) - np.log(len(MISTAKE))
    odds = some - dense(None) - UNSAID - picked(4, 1)
    assert chance(made, 3) == pytest.approx(1 / (1 + np.exp(-odds)), rel=1e-3)


def test_what_all_have_alike_is_no_news_and_one_apart_is():
    assert chance(engine([0.0] * 6), 5) < 0.05
    assert chance(engine([0.0] * 5 + [ZEROS * TOP]), 5) < 0.1
    one = chance(engine([0.0] * 5 + [0.1]), 5)
    assert one > 0.9
    assert chance(engine([0.3] * 5 + [0.4]), 5) == pytest.approx(one, rel=0.01)
    # Where all differ none is apart.
    assert chance(engine([0.0, 0.02, 0.04, 0.06, 0.08, 0.1]), 5) < 0.1


def test_only_specimens_that_have_not_moved_are_asked():
    odd = [0.0, 0.0, 0.0, 0.1]
    assert [p.groups for p in shown(engine(odd), [LAW])] == [((3,),)]
    assert not shown(engine(odd, begins=0.3), [LAW])
    assert not shown(engine(odd, continued=True), [LAW])
    assert not shown(engine([0.0, 0.1]), [LAW])  # which of the two is it?


def test_what_is_said_of_zeros_is_said_of_those_that_stand_apart():
    def said(made, *recordings):
        piece = only(start_pieces(made, LAW)[0], np.array(recordings))
        guess = Guess(UNITS, STIFFNESS, (piece,))
        return named(at_rest(made), SimpleNamespace(guess=guess))

    clear = engine([0.0] * 5 + [0.1])
    assert said(clear, 5) == said(clear, 2, 5) == {LAW.id}
    assert said(clear, 2) == frozenset()  # of another
    assert said(engine([0.0] * 6), 5) == frozenset()  # none stands apart
    # One that stands apart by eight times what a machine may be off by, of three.
    vague = engine([0.0, 0.0, 8 * ZEROS * TOP])
    assert at_rest(vague)[0].chance < 0.5
    assert said(vague, 2) == frozenset()


@pytest.mark.parametrize("law", EFFECTS, ids=lambda law: law.id)
def test_only_what_says_so_is_read_before_anything_has_moved(law):
    made = engine()
    chunks = [Chunk(c.time_s, c.strain, 20 + c.time_s / 10) for c in made.data.chunks]
    for piece in start_pieces(made, law):
        first = [s[0] for s in simulate(UNITS, STIFFNESS, [piece.term()], chunks)]
        assert (np.abs(first).min() > 0.01) == law.unmoved
        assert (np.abs(first).max() > 1e-9) == law.unmoved


@pytest.mark.parametrize("off", [True, False])
def test_a_zero_that_stands_apart_need_not_foretell_others(off):
    made = engine([0.0] * 5 + [0.1 * off])
    piece = only(start_pieces(made, LAW)[0], np.array([5]))
    fit = SimpleNamespace(guess=Guess(UNITS, STIFFNESS, (piece,)))
    bare = SimpleNamespace(guess=Guess(UNITS, STIFFNESS))
    mine = SimpleNamespace(fit=fit, effects=frozenset({LAW.id}))
    one = SimpleNamespace(account=mine, effects=mine.effects)
    probable = SimpleNamespace(
        best=mine, selected=mine.effects, effects={LAW.id: 1.0},
        hypotheses=[one], nothing=0.0, nothing_named=0.0, other=0.0, readings=list,
    )  # fmt: skip

    def names():
        return decide(
            probable,
            SimpleNamespace(effects=frozenset(), fit=bare),
            lambda account: SimpleNamespace(misfit=9.0, nrmse=0.1),  # all alike
            Shows(few=False, only_loading=False),
            lambda account: named(at_rest(made), account.fit),
            lambda account: 1.0,
        ).names

    assert names() == (LAW.id,) * off
    mine.effects |= {"mullins_softening"}  # and that is to take something from it
    probable.selected = one.effects = mine.effects
    assert names() == ()


@pytest.mark.parametrize(("size", "wrong"), [(0.0, ()), (0.055, (1, 4)), (0.055, (4,))])
def test_an_offset_at_rest_is_named_beside_a_material_that_no_law_describes(
    size, wrong
):
    """Bent by half in what nobody wrote down, so that no account is near the noise."""
    rng = np.random.default_rng(3)
    recordings = []
    for i, peak in enumerate([0.5, 0.6, 0.55, 0.45, 0.6, 0.5]):
        chunk = straight([0, 0, peak, 0.1, peak, 0], 0.05, 0.4)
        moved = np.cumsum(np.abs(np.diff(chunk.strain, prepend=0.0)))
        bent = 1 + 0.3 * np.sin(9 * moved) + 0.2 * np.cos(25 * chunk.strain)
        stress = 2 * chunk.strain * bent + 2e-4 * rng.standard_normal(len(moved))
        stress += size * (i in wrong) * np.abs(stress).max()
        time, strain = chunk.time_s[130:], chunk.strain[130:]  # eight seconds of rest
        recordings.append(Recording(time, strain, stress[130:], name=f"r{i}"))
    named = diagnose(recordings).selected
    assert ("zero_offset" in named) == (size > 0)
