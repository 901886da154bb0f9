"""Networks taught by recordings of unlike specimens and by a model of them."""

from dataclasses import replace

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.model_file import Stored
from softnn.models.units import Units
from softnn.neural import train
from softnn.recording import Recording
from softnn.taught import LEAST, Span, alike, histories, lag_of, taught

SPRING = Stored(Units("hooke", (0.0, 1.0)), np.array([2.0]), (), (), False, "virgin")


def pull(name, factor, specimen="", peak=0.4):
    time = np.linspace(0, 10, 101)
    strain = peak * (1 - np.abs(1 - time / 5))
    stress = factor * 2.0 * strain
    return Recording(time, strain, stress, name=name, specimen=specimen, test="cyclic")


def test_specimens_become_their_geometric_mean():
    given = [pull("a", 0.8), pull("b", 1.25, "s"), pull("c", 1.25, "s"), pull("d", 1)]
    same, factor = alike(given, SPRING)
    assert factor == pytest.approx(1.0)  # (0.8 * 1.25 * 1)^(1/3)
    for r in same:
        np.testing.assert_allclose(r.stress_MPa, 2.0 * r.strain, atol=1e-12)
    _, factor = alike(given[:2], SPRING)
    assert factor == pytest.approx(1.0)
    _, factor = alike(given[1:3], SPRING)  # two recordings of one specimen
    assert factor == pytest.approx(1.25)


def test_what_is_of_another_material_is_not_made_alike():
    (same,), factor = alike([pull("a", 50.0)], SPRING)
    assert factor == 2.0  # no specimen is stiffer by more
    np.testing.assert_array_equal(same.stress_MPa, pull("a", 50.0).stress_MPa)


def test_histories_are_of_the_model_slack_and_of_all_sizes():
    made = histories(SPRING, Span((0.0, 0.5), (0.01, 1.0)), 200, 0, factor=1.5)
    sizes = np.array([np.ptp(r.strain) for r in made])
    assert sizes.max() > 0.3
    assert np.mean(sizes < 0.1) > 0.3  # as many small as large ones
    assert sizes.min() < 10 * LEAST * 0.5
    strain = np.concatenate([r.strain for r in made])
    stress = np.concatenate([r.stress_MPa for r in made])
    assert strain.min() < -0.01
    assert 0.5 < strain.max() <= 0.6
    np.testing.assert_allclose(stress, 3.0 * np.maximum(strain, 0), atol=1e-12)
    pushed = Span((-0.5, 0.0), (0.01, 1.0))
    for r in histories(SPRING, pushed, 5, 0):
        np.testing.assert_allclose(r.stress_MPa, 2 * np.minimum(r.strain, 0))


def test_span_and_lag_are_those_of_the_recordings():
    span = Span.of([pull("a", 1.0)])
    assert span.strains == (0.0, 0.4)
    assert span.rates == pytest.approx((0.08 / 3, 0.08 * 3))
    assert lag_of([pull("a", 1.0)]) == 0.01
    still = replace(pull("a", 1.0), strain=np.zeros(101))
    with pytest.raises(InputError, match="stands still"):
        Span.of([still])


def test_an_unlike_specimen_does_not_teach_what_it_is():
    """Strains tell these specimens apart; a network that learns them by heart says of
    a third what the nearer one would: 20 % off. Alike, they are 2 % off at most."""
    known = [pull("a", 0.8, peak=0.40), pull("b", 1.25, peak=0.38)]
    network = taught(known, SPRING, neurons=4, simulated=10, starts=1)
    new = pull("c", 1.0, peak=0.39)
    (stress,) = network.stress([""], [new], [None])
    assert np.abs(stress - new.stress_MPa).max() < 0.02 * new.stress_MPa.max()


def test_missing_strain_and_nothing_are_refused():
    hole = pull("a", 1.0)
    strain = hole.strain.copy()
    strain[3] = np.nan
    hole = replace(hole, strain=strain)
    with pytest.raises(InputError, match="no strain at some samples"):
        taught([hole], SPRING, neurons=2, simulated=2)
    with pytest.raises(InputError, match="no recordings"):
        taught([], SPRING)


@pytest.mark.parametrize("sign", [1, -1])
def test_what_hangs_slack_takes_no_neuron(sign):
    """A kink at zero is the bound's to make: one neuron then has the rest to itself."""
    x = np.linspace(-1, 1, 201)[:, None]
    y = sign * np.maximum(sign * x[:, 0], 0)

    def off(one_sign):
        (one,) = train(
            x,
            y,
            neurons=[1],
            train_mask=np.ones((1, 201), bool),
            seeds=[0],
            one_sign=one_sign,
            threads=1,
        )
        out = one.network.predict(x)
        return np.abs(sign * np.maximum(sign * out, 0) - y).max()

    assert off(True) < 0.01 < 0.03 < off(False)
