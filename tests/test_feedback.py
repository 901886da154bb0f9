"""The studies of the inputs: stress fed back, and a tenth of the samples."""

import numpy as np
import pytest

from softnn.recording import Recording
from studies import feedback, natr


class Law:
    """Half of the stress of a sample ago, and the strain."""

    @staticmethod
    def predict(inputs):
        return 0.5 * inputs[:, -1] + inputs[:, 0]


def lawful(n=60):
    strain = np.linspace(0.0, 1.0, n) ** 2
    stress = np.zeros(n)
    for i in range(n):
        stress[i] = 0.5 * (stress[i - 1] if i else 0.0) + strain[i]
    about = {"test": "tensile", "rate_per_s": 0.1, "name": "a"}
    return Recording(np.arange(n) * 0.1, strain, stress, **about)


@pytest.mark.parametrize("steps", [1, 5, 34])
def test_a_law_goes_on_alone_as_long_as_one_wants(steps):
    assert feedback.horizon(Law, [lawful()], steps) < 1e-12


def test_what_is_fed_back_wrong_fades_by_the_gain():
    assert feedback.gain(Law, [lawful()]) == pytest.approx(0.5)


def test_a_specimen_alone_begins_at_rest():
    found = feedback.curves(Law, lawful())
    np.testing.assert_allclose(found["alone_MPa"], found["measured_MPa"], atol=1e-12)


def test_to_repeat_the_stress_errs_by_a_step_of_it():
    n = 100
    ramp = Recording(np.arange(n) * 1.0, np.arange(n) / n, np.arange(n) * 0.1)
    rms = np.sqrt(np.mean((np.arange(1, n) * 0.1) ** 2))
    assert feedback.repeated([ramp]) == pytest.approx(0.1 / rms)


def pulled(rate, factor, name):
    strain = np.linspace(0.0, 1.0, 100)
    about = {"test": "tensile", "rate_per_s": rate, "name": name, "specimen": name}
    return Recording(strain / rate, strain, factor * 2 * strain, **about)


def specimens():
    return [
        pulled(rate, factor, f"{rate}-{i}")
        for rate in (0.2, 0.1)
        for i, factor in enumerate((0.9, 1.1))
    ]


def test_scatter_alone_is_what_the_mean_of_specimens_leaves():
    ((recordings, index),) = [natr.ways(specimens(), 0)["a tenth at random"]]
    known = natr.samples(recordings, natr.INPUTS)
    # Errors of a tenth of the mean, over the rms of 0.9 and 1.1 times it.
    assert natr.scatter(known) == pytest.approx(0.1 / np.hypot(1, 0.1), rel=1e-6)
    one = known.take(np.flatnonzero(known.recording == 0))
    assert natr.scatter(one) < 1e-9
    assert len(index) == 40


def test_ways_to_a_tenth_are_what_they_say():
    every = natr.ways(specimens(), 0)
    order, first = every["the first tenth"]
    assert [r.rate_per_s for r in order] == [0.1, 0.1, 0.2, 0.2]
    known = natr.samples(order, natr.INPUTS)
    assert set(known.take(first).recording) == {0}
    assert set(known.take(every["the last tenth"][1]).recording) == {3}
    beginning = known.take(every["the first tenth of each specimen"][1])
    assert beginning.inputs[:, 0].max() < 0.1
    assert set(beginning.recording) == {0, 1, 2, 3}
    few = known.take(every["one of ten specimens of each rate"][1])
    assert set(few.recording) == {0, 2}
    mean, _ = every["mean curves"]
    assert len(mean) == 2


def test_draws_of_whole_specimens_have_one_of_each_rate():
    # One specimen at a rate leaves nothing over.
    assert max(natr.draws(specimens(), 0, 3)) < 1e-9
    many = [pulled(0.1, f, f"{f}") for f in np.linspace(0.8, 1.2, 20)]
    found = natr.draws(many, 0, 50)  # two specimens each
    assert 0 < np.median(found) < 0.2
    assert natr.spread(found)["draws_low"] <= natr.spread(found)["draws_median"]
    assert natr.spread([0.04, 0.06, 0.06, 0.06])["draws_as_published"] == 0.25
