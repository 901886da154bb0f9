"""Samples that are off, against sums over all ways in which they could be."""

from itertools import product

import numpy as np
import pytest

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


def test_one_in_a_hundred_is_off_before_anything_is_known():
    """At the start of a recording, and anywhere in it: the chain has no beginning."""
    chance = RARE
    for _ in range(50):
        chance = chance * STAY + (1 - chance) * ENTER
    assert chance == pytest.approx(RARE)


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
