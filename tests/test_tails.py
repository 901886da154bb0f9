"""Samples that are off, against sums over all ways in which they could be."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.integrate import quad
from test_evidence import HOOKE, SIGMA, N, engine

from softnn.fit import Guess, fit
from softnn.mismatch import evidence
from softnn.mismatch.evidence import Linear, Weigher, gained
from softnn.mismatch.tails import RARE, STAY, WIDE, shares

ENTER = RARE * (1 - STAY) / (1 - RARE)


def by_hand(z, begins):
    """Shares, and log odds against that none is off, over all 2^n ways."""
    weights, ways = [], list(product((0, 1), repeat=len(z)))
    for way in ways:
        weight = 1.0
        for i, off in enumerate(way):
            enter = RARE if begins[i] else STAY if way[i - 1] else ENTER
            weight *= enter if off else 1 - enter
            weight *= np.exp(z[i] * (1 - WIDE**-2)) / WIDE if off else 1.0
        weights.append(weight)
    weight = np.array(weights)
    return weight @ np.array(ways) / weight.sum(), np.log(weight.sum() / weight[0])


@pytest.mark.parametrize("seed", range(4))
def test_shares_and_odds_are_sums_over_all_ways(seed):
    rng = np.random.default_rng(seed)
    z = rng.choice([0.5, 4.0, 9.0], 8) * rng.random(8)
    z[rng.integers(8)] = -np.inf  # one that cannot be
    begins = np.array([1, 0, 0, 0, 1, 0, 0, 0], bool)
    share, odds = shares(z, begins)
    expected, whole = by_hand(z, begins)
    np.testing.assert_allclose(share, expected, rtol=1e-9)
    assert odds == pytest.approx(whole, rel=1e-9)


def test_samples_that_say_nothing_are_off_once_in_a_hundred():
    """At the start of a recording, and anywhere in it: the chain has no beginning."""
    even = np.log(WIDE) / (1 - WIDE**-2)  # as likely off as not
    share, odds = shares(np.full(60, even), np.arange(60) % 20 == 0)
    np.testing.assert_allclose(share, RARE, rtol=1e-9)
    none = 3 * np.log(1 - RARE) + 57 * np.log(1 - ENTER)  # all that is not off
    assert odds == pytest.approx(-none, rel=1e-9)


def test_the_second_of_a_run_is_cheaper_than_the_first():
    begins = np.arange(100) == 0
    far = 200.0

    def cost(*off):
        z = np.full(100, -np.inf)
        z[list(off)] = far
        return far * (1 - WIDE**-2) * len(off) - shares(z, begins)[1]

    one, run, apart = cost(10), cost(10, 11, 12), cost(10, 50, 90)
    assert apart == pytest.approx(3 * one, rel=1e-3)
    assert run - one == pytest.approx(2 * np.log(WIDE * (1 - ENTER) / STAY))


def test_what_is_far_off_is_no_trouble():
    z = np.array([0.0, 1e8, 1e8, 0.0])
    share, odds = shares(z, np.arange(4) == 0)
    assert np.isfinite(odds)
    np.testing.assert_allclose(share[1:3], 1.0)


# --- in the evidence ---


def lines(seed=0, k=(3, 4), free=2, off=(7, 31)):
    """A residual, two of it off by more than noise, its columns, and what is free."""
    rng = np.random.default_rng(seed)
    residual = rng.standard_normal(N)
    residual[list(off)] += 9.0
    mine, other = (rng.standard_normal((N, n)) for n in k)
    q = np.linalg.qr(rng.standard_normal((N, free)))[0] if free else np.zeros((N, 0))
    return residual, mine, other, q


BEGINS = np.arange(N) == 0  # all of one recording


def linear(residual, mine, other, q):
    return Linear(residual, mine, other, other.T @ other, q, BEGINS)


def odds(z, off):
    """Log odds of those that are off to be so, over that none is."""
    may = np.full(N, -np.inf)
    may[off] = z
    return shares(may, BEGINS)[1]


def test_samples_that_are_off_cost_what_their_mixture_says():
    residual, *_ = lines()
    none = np.zeros((N, 0))
    line = linear(residual, none, none, none)
    plain = line.value(np.zeros(0))
    assert plain == pytest.approx(-0.5 * residual @ residual)
    assert list(line.excuse(np.zeros(0))) == [7]  # one in thirty-three may be
    z = 0.5 * residual[[7]] ** 2
    assert line.value(np.zeros(0)) == pytest.approx(plain + odds(z, [7]))


def test_nothing_is_off_in_noise():
    residual, mine, other, q = lines(off=())
    line = linear(residual, mine, other, q)
    before = line.value(np.ones(7))
    assert not len(line.excuse(np.ones(7)))
    assert line.value(np.ones(7)) == before


@pytest.mark.parametrize("seed", range(3))
def test_what_is_off_weighs_less_beside_columns_and_what_is_free(monkeypatch, seed):
    monkeypatch.setattr(evidence, "MOST", 0.05)
    residual, mine, other, q = lines(seed)
    scale = np.array([0.5, 0.0, 2.0, 1.0, 0.3, 0.0, 1.5])
    line = linear(residual, mine, other, q)
    first = line.left(scale)
    plain, live = np.hstack([mine, other]) * scale, scale > 0
    plain -= q @ (q.T @ plain)
    y = residual - q @ (q.T @ residual)
    inner = plain[:, live].T @ plain[:, live] + np.eye(live.sum())
    best = np.linalg.solve(inner, plain[:, live].T @ y)
    np.testing.assert_allclose(first, y - plain[:, live] @ best, atol=1e-6)
    off = line.excuse(scale)
    assert sorted(off) == [7, 31]
    # By hand: rows by the root of their weight, all anew.
    z = 0.5 * first[off] ** 2
    weight = np.ones(N)
    for k, i in enumerate(off):
        step = 1e-6 * z[k] * (off == i)
        weight[i] -= (odds(z + step, off) - odds(z - step, off)) / (2 * step[k])
    root = np.sqrt(weight)
    x, free = np.hstack([mine, other]) * root[:, None], q * root[:, None]
    apart = np.eye(N) - free @ np.linalg.pinv(free)
    y, x = apart @ (residual * root), apart @ x
    made = gained(x.T @ x, x.T @ y, scale) - 0.5 * y @ y
    cost = np.sum((1 - weight[off]) * z) - odds(z, off)
    assert line.value(scale) == pytest.approx(made - cost, rel=1e-6)


def test_it_is_less_than_what_the_mixture_would_make_it():
    """Of one column its weight can be integrated out as it is."""
    residual, mine, _, _ = lines(k=(1, 1))
    none = np.zeros((N, 0))
    line = linear(residual, mine, none, none)
    off = line.excuse(np.array([0.5]))
    assert len(off)

    def density(weight):
        z = 0.5 * (residual - weight * mine[:, 0]) ** 2
        prior = -0.5 * (weight / 0.5) ** 2 - np.log(0.5 * np.sqrt(2 * np.pi))
        return np.exp(odds(z[off], off) - z.sum() + prior + 60)

    exact = np.log(quad(density, -3, 3, points=[0])[0]) - 60
    assert exact - 0.1 < line.value(np.array([0.5])) <= exact + 1e-9


def test_a_spike_is_no_reason_for_a_law():
    """What a law gains by three samples that are far off, and what by all of them."""
    made = engine(memory=())
    strain = np.concatenate([c.strain for c in made.chunks])
    noise = made.target - 2 * strain

    def gains(extra):
        made.target = 2 * strain + noise + extra
        base = fit(made, Guess(HOOKE, np.array([2.0])), fixed_base=True)
        law = replace(base, stress=base.stress + extra, residual=made.whiten(noise))
        weigher = Weigher(made, base)
        before, after = weigher.weigh(base), weigher.weigh(law)
        assert before.beside > before.bare - 1
        return np.array(
            [getattr(after, k) - getattr(before, k) for k in ("bare", "alone")]
        )

    few = np.where(np.isin(np.arange(2 * N), (20, 21, 22)), 12 * SIGMA, 0.0)
    spread = few.sum() / np.sqrt(3 * 2 * N) * np.ones(2 * N)  # as large a square
    assert (gains(few) < 3 * (np.log(WIDE / RARE) + 2)).all()
    assert gains(spread)[0] > 3 * gains(few)[0]


def spiky(*off):
    """How much less likely recordings are with samples that are off, laws as they are.

    And where recordings begin, as the chain is told.
    """
    made = engine(memory=())
    strain = np.concatenate([c.strain for c in made.chunks])
    noise = made.target - 2 * strain
    noise[[20, 21, 50, N - 1]] = 0.0
    bare, told = [], []

    def listening(z, begins):
        told.append(begins)
        return shares(z, begins)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence, "shares", listening)
        for which in ((), off):
            made.target = 2 * strain + noise
            made.target[list(which)] += 12 * SIGMA
            base = fit(made, Guess(HOOKE, np.array([2.0])), fixed_base=True)
            bare.append(Weigher(made, base).weigh(base).bare)
    return bare[0] - bare[1], told


def test_what_is_off_in_a_row_is_off_together_and_in_one_recording():
    row, told = spiky(20, 21)
    assert row < spiky(20, 50)[0] - 3
    assert told
    for begins in told:
        assert np.flatnonzero(begins).tolist() == [0, N]


def test_the_last_sample_of_a_recording_may_be_off_too():
    """Where a smooth function beside the laws nearly takes it up."""
    assert spiky(N - 1)[0] < spiky(20)[0] + 3
