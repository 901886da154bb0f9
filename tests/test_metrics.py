"""Metrics against scikit-learn, and the published tables against their own formulas."""

import numpy as np
import pytest
from sklearn.metrics import r2_score, root_mean_squared_error

from softnn import metrics
from softnn.contracts import InputError


def test_nrmse_and_r2_equal_second_routes():
    rng = np.random.default_rng(0)
    measured, predicted = rng.uniform(1, 2, (2, 50))
    rms = np.linalg.norm(measured) / np.sqrt(50)
    expected = root_mean_squared_error(measured, predicted) / rms
    assert metrics.nrmse(predicted, measured) == pytest.approx(expected)
    assert metrics.r2(predicted, measured) == pytest.approx(
        r2_score(measured, predicted)
    )


def test_missing_pairs_are_left_out():
    measured, predicted = (
        np.array([1.0, np.nan, 3.0, 4.0]),
        np.array([1.0, 2, np.nan, 5]),
    )
    assert metrics.nrmse(predicted, measured) == pytest.approx(np.sqrt(1 / 17))
    assert np.isnan(metrics.nrmse([np.nan], [1.0]))
    assert np.isnan(metrics.r2([1.0], [1.0]))


def test_table_5_1_follows_from_its_own_rows():
    # NR: 0.29 % against 0.35 %, 255 segments against 686; the table has 16 and -63.
    assert metrics.delta_accuracy(0.29, 0.35) == pytest.approx(17, abs=0.5)
    assert metrics.delta_complexity(255, 686) == pytest.approx(-63, abs=0.5)


def test_shapes_and_emptiness_are_refused():
    with pytest.raises(InputError, match="shape"):
        metrics.nrmse([1.0, 2.0], [1.0])
    with pytest.raises(InputError, match="at least one"):
        metrics.generalisation_error([])


def held(hold, count, noise=0.0, seed=0):
    """A ramp of 1 s, a hold, a third of the way back; where it is held."""
    time = np.linspace(0, 1 + hold + 1 / 3, count)
    strain = np.minimum(time, 1) - np.maximum(time - 1 - hold, 0)
    strain = strain + noise * np.random.default_rng(seed).normal(size=count)
    return time, strain, (time > 1) & (time < 1 + hold)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("noise", [0.0, 1e-4])
@pytest.mark.parametrize("hold", [0.3, 1.0, 10.0])  # of the time of the ramp
def test_a_hold_of_any_length_has_its_share_of_the_weight(hold, noise, seed):
    time, strain, still = held(hold, 4000, noise, seed)
    weight = metrics.weights(time, strain)
    share = hold / time[-1]
    expected = share / (1 + share)
    assert weight[still].sum() / weight.sum() == pytest.approx(expected, abs=0.02)


def test_an_error_does_not_depend_on_how_often_the_logger_wrote():
    time, strain, still = held(0.3, 4000)
    wrong = np.where(still, 0.1, 0.0)

    def error(every):
        weight = metrics.weights(time[::every], strain[::every])
        size = weight @ strain[::every] ** 2
        return np.sqrt(weight @ wrong[::every] ** 2 / size)

    for every in (2, 5, 10):
        assert error(every) == pytest.approx(error(1), rel=0.03)
