"""Folds partition the samples and keep together what must stay together."""

import numpy as np
import pytest
from sklearn.metrics import r2_score

from softnn.contracts import InputError
from softnn.crossval import make_folds, rate_groups, score
from softnn.recording import Recording


def recordings(specimens="aabbc", rates=(0.1, 0.1, 0.2, 0.2, 0.2), n=6):
    time = np.arange(n, dtype=float)
    return [
        Recording(time, time, time, name=f"r{i}", specimen=s, rate_per_s=r)
        for i, (s, r) in enumerate(zip(specimens, rates, strict=True))
    ]


INDEX = np.repeat(np.arange(5), 6)


@pytest.mark.parametrize("split", ["random", "specimen", "rate", "recording"])
def test_every_sample_is_held_out_once(split):
    folds = make_folds(recordings(), INDEX, split, number=10, seed=3)
    np.testing.assert_array_equal(folds.test.sum(axis=0), 1)
    np.testing.assert_array_equal(folds.train, ~folds.test)


def test_random_folds_are_equal_and_repeatable():
    folds = make_folds(recordings(), INDEX, number=7, seed=3)
    sizes = folds.test.sum(axis=1)
    assert sizes.max() - sizes.min() <= 1
    again = make_folds(recordings(), INDEX, number=7, seed=3)
    other = make_folds(recordings(), INDEX, number=7, seed=4)
    np.testing.assert_array_equal(folds.test, again.test)
    assert (folds.test != other.test).any()


@pytest.mark.parametrize(("split", "many"), [("specimen", 3), ("rate", 2)])
def test_groups_stay_whole(split, many):
    rec = recordings()
    folds = make_folds(rec, INDEX, split)
    assert len(folds.test) == many
    key = [r.specimen if split == "specimen" else r.rate_per_s for r in rec]
    for test in folds.test:
        held = {key[i] for i in INDEX[test]}
        assert held.isdisjoint({key[i] for i in INDEX[~test]})


def test_more_specimens_than_folds_share_folds():
    rec = recordings("abcde")
    folds = make_folds(rec, INDEX, "specimen", number=2, seed=0)
    assert len(folds.test) == 2
    for test in folds.test:
        assert set(INDEX[test]).isdisjoint(INDEX[~test])


def test_specimens_not_told_apart_are_said_to_be():
    folds = make_folds(recordings("sssss"), INDEX, "specimen")
    assert len(folds.test) == 5
    assert "name no specimens" in folds.note


def test_rates_measured_twice_are_one():
    # The nominal rates of 18 compression tests, three rates over two decades.
    measured = [0.000635, 0.000678, 0.006348, 0.00669, 0.063979, 0.067834]
    assert len(set(rate_groups(measured))) == 3
    assert len(set(rate_groups([0.01, 0.03, 0.05]))) == 3
    assert rate_groups([-0.2, 0.2, None, 0.0]) == [0.2, 0.2, None, None]


def test_scores_are_those_of_the_held_out_samples_alone():
    rng = np.random.default_rng(0)
    target = rng.uniform(1, 2, 30)
    folds = make_folds(recordings(), INDEX, number=3, seed=0)
    predictions = target + 0.1 * rng.standard_normal((3, 30))
    spoilt = np.where(folds.test, predictions, 1e6)
    scores = score(folds, spoilt, target)
    for k, test in enumerate(folds.test):
        assert scores.r2[k] == pytest.approx(
            r2_score(target[test], predictions[k, test])
        )
    assert scores.generalisation_error == pytest.approx(np.mean(scores.nrmse))
    assert scores.mean_r2 == pytest.approx(np.mean(scores.r2))


@pytest.mark.parametrize(
    ("how", "match"),
    [
        ({"split": "fold"}, "allowed is random, specimen, rate, recording"),
        ({"number": 1}, "at least 2"),
        ({"number": 31}, "31 folds of 30 samples"),
    ],
)
def test_bad_folds_are_refused(how, match):
    with pytest.raises(InputError, match=match):
        make_folds(recordings(), INDEX, **how)


def test_one_rate_cannot_be_held_out():
    with pytest.raises(InputError, match=r"one rate only \(0.1 /s\)"):
        make_folds(recordings(rates=[0.1] * 5), INDEX, "rate")
