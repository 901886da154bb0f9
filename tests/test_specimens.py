"""Recordings that share a specimen nobody named: priors, densities, who is whose."""

from itertools import combinations
from math import exp, factorial

import numpy as np
import pytest
from made import STIFFNESS, UNITS, histories
from scipy.stats import multivariate_normal

from softnn.fit import Data
from softnn.mismatch.accounts import search
from softnn.mismatch.base import baseline, scatter
from softnn.mismatch.candidates import refine
from softnn.mismatch.evidence import SCATTER
from softnn.mismatch.posterior import posterior
from softnn.mismatch.specimens import UNSAID, cost, marginal, picked, shared, sizes
from softnn.simulate import simulate


def partitions(items):
    if not items:
        yield []
        return
    first, *rest = items
    for parts in partitions(rest):
        yield [(first,), *parts]
        for i, part in enumerate(parts):
            yield [*parts[:i], (first, *part), *parts[i + 1 :]]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_who_shares_a_specimen_is_a_distribution(count):
    several = [p for p in partitions(list(range(count))) if len(p) < count]
    total = sum(exp(UNSAID - cost([len(g) for g in p])) for p in several)
    assert total == pytest.approx(1 - 1 / factorial(count))  # without one each
    assert cost([1] * count) == UNSAID


@pytest.mark.parametrize("count", [2, 3, 7])
def test_which_recordings_are_wrong_is_a_distribution(count):
    some = [s for n in range(1, count) for s in combinations(range(count), n)]
    assert sum(exp(-picked(count, len(s))) for s in some) == pytest.approx(1)
    number = {len(s): exp(-picked(count, len(s))) for s in some}
    shares = [number[n] * sum(len(s) == n for s in some) for n in number]
    np.testing.assert_allclose(shares, 1 / (count - 1))


def test_recordings_in_no_group_are_of_the_first_specimen():
    assert sizes(6, [(2, 3), (5,)]) == [3, 2, 1]


def test_scales_of_specimens_are_integrated_out():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((4, 4))
    known, at = root @ root.T, rng.standard_normal(4)

    def density(weights):
        cov = np.linalg.inv(known) + weights @ weights.T
        return multivariate_normal.logpdf(at, cov=cov)

    one, other = rng.standard_normal((4, 3)), rng.standard_normal((4, 2))
    found = marginal(at, known, one) - marginal(at, known, other)
    assert found == pytest.approx(density(one) - density(other))


def recorded(factors, seed=0):
    """The five histories of `made`, a quarter of the samples, each of a specimen."""
    rng = np.random.default_rng(seed)
    chunks = [replaced(c) for c in histories()]
    stress = simulate(UNITS, STIFFNESS, [], chunks)
    noisy = [
        f * s + 0.002 * rng.standard_normal(len(s))
        for f, s in zip(factors, stress, strict=True)
    ]
    return Data(tuple(f"r{i}" for i in range(5)), tuple(chunks), tuple(noisy))


def replaced(chunk):
    return type(chunk)(chunk.time_s[::4], chunk.strain[::4])


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ((1, 1, 1.04, 1, 1.04), [(0, 1, 3), (2, 4)]),
        ((0.97, 1.03, 1.03, 0.97, 1.03), [(0, 3), (1, 2, 4)]),
        ((1.0, 1.03, 0.98, 1.05, 0.96), [(0,), (1,), (2,), (3,), (4,)]),
    ],
)
def test_scales_that_agree_are_of_one_specimen(factors, expected):
    base = baseline(recorded(factors), "pl-wiechert")
    each = scatter(5, [(r,) for r in range(1, 5)], unsaid=True)
    found = refine(base.engine, base.fit, each)
    assert shared(found, SCATTER) == expected


def told(factors):
    return posterior(search(baseline(recorded(factors), "pl-wiechert")).accounts)


def test_two_specimens_nobody_named_are_no_mistake():
    found = told((1, 1, 1.03, 1, 1.03))
    assert found.selected == frozenset()
    (piece,) = found.hypotheses[0].account.fit.guess.pieces
    assert piece.unsaid
    assert piece.groups == ((2, 4),)


def test_a_scale_far_from_what_specimens_differ_by_is_a_mistake():
    assert told((1, 1, 1.3, 1, 1)).selected == {"gain_error"}
