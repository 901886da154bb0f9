"""The network behind scikit-learn's interface keeps scikit-learn's promises."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, cross_val_score

from softnn import InputError, Recording
from softnn.crossval import RecordingFolds
from softnn.neural import StressNetwork

STRAIN = np.linspace(0, 1, 50)


def pull(rate, name):
    return Recording(
        STRAIN / rate,
        STRAIN,
        (1 + rate) * STRAIN,
        test="tensile",
        rate_per_s=rate,
        name=name,
        specimen=name,
    )


PULLS = [pull(0.1 * (1 + i // 2), f"{i}") for i in range(6)]


def test_clone_and_parameters():
    model = StressNetwork(inputs="FFRI2", neurons=4, regularisation="l2=1e-3", lag_s=2)
    assert clone(model).get_params() == model.get_params()
    assert model.set_params(neurons=5).neurons == 5


def test_a_law_of_rate_is_learnt_and_scored_on_what_was_held_out():
    model = StressNetwork(neurons=3)
    by_specimen = cross_val_score(model, PULLS, cv=RecordingFolds("specimen"))
    assert by_specimen.shape == (6,)
    assert by_specimen.min() > 0.999
    rates = RecordingFolds("rate")
    assert rates.get_n_splits(PULLS) == 3
    for known, held_out in rates.split(PULLS):
        one = {PULLS[i].rate_per_s for i in held_out}
        assert len(one) == 1
        assert not one & {PULLS[i].rate_per_s for i in known}


def test_a_search_over_its_parameters():
    found = GridSearchCV(
        StressNetwork(neurons=2),
        {"inputs": ["FFRI1", "FFRD4"]},
        cv=RecordingFolds("specimen"),
    ).fit(PULLS)
    assert found.best_params_ == {"inputs": "FFRD4"}  # rate matters in these data


def test_the_same_seed_is_the_same_network():
    one, two = (StressNetwork(neurons=3, seed=4).fit(PULLS) for _ in range(2))
    np.testing.assert_array_equal(one.predict(PULLS[0]), two.predict(PULLS[0]))
    assert [len(p) for p in one.predict(PULLS)] == [50] * 6


def test_bad_input_is_said():
    with pytest.raises(NotFittedError):
        StressNetwork().predict(PULLS)
    with pytest.raises(InputError, match="architecture is 'FFRD9'"):
        StressNetwork(inputs="FFRD9").fit(PULLS)
    with pytest.raises(InputError, match="device is 'tpu'"):
        StressNetwork(device="tpu").fit(PULLS)
    with pytest.raises(InputError, match="recordings hold a ndarray"):
        StressNetwork().fit(np.zeros((3, 2)))  # type: ignore[arg-type]
