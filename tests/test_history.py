"""What networks know of the past, on histories with closed forms."""

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.neural import ARCHITECTURES, Network, Scaling, run, samples, train
from softnn.neural.fitting import fit_samples
from softnn.neural.history import at_lag, earlier, filtered, largest
from softnn.neural.radial import train_radial
from softnn.neural.training import Regularisation
from softnn.recording import Recording


def test_a_filter_lags_a_ramp_as_the_closed_form_says():
    """T y' = r t - y from rest: y = r (t - T (1 - exp(-t / T))), at any sampling."""
    rng = np.random.default_rng(0)
    time = np.concatenate([[0.0], np.sort(rng.uniform(0, 20, 60))])
    time[9] = time[8]  # a repeated stamp
    ramp = Recording(time, 0.1 * time, time)
    for constant in (0.01, 1.0, 30.0):
        exact = 0.1 * (time + constant * np.expm1(-time / constant))
        np.testing.assert_allclose(filtered(ramp, constant), exact, atol=1e-12)


def test_largest_strain_remembers_unloading_and_passes_over_gaps():
    strain = np.array([0.0, 0.5, np.nan, 0.2, -0.7, 0.1])
    recording = Recording(np.arange(6.0), strain, strain)
    assert largest(recording).tolist() == [0, 0.5, 0.5, 0.5, 0.7, 0.7]


def test_stress_of_a_lag_ago():
    time = np.array([0.0, 1.0, 2.0, 4.0])
    stress = np.array([3.0, 5.0, 6.0, 9.0])
    recording = Recording(time, time, stress)
    one = at_lag(stress, *earlier(recording, None))
    assert one.tolist() == [0, 3, 5, 6]
    # 1.5 s ago; at 2 s half way from 3 to 5, at 4 s no later than one sample ago
    assert at_lag(stress, *earlier(recording, 1.5)).tolist() == [0, 0, 4, 6]
    assert at_lag(stress, *earlier(recording, 0.1)).tolist() == [0, 3, 5, 6]


@pytest.mark.parametrize("lag_s", [None, 0.7])
def test_a_network_fed_its_own_stress_is_the_recursion_it_stands_for(lag_s):
    """One nearly linear neuron: s(t) = e(t) + s(t - lag) / 2, step by step."""
    scale = Scaling(np.full(3, -1.0), np.full(3, 1.0))
    tiny = 1e-4
    hidden = np.array([[tiny, 0.0, tiny / 2, 0.0]])
    net = Network(
        hidden, np.array([1 / tiny, 0.0]), scale, Scaling(np.array(-1.0), np.array(1.0))
    )
    rng = np.random.default_rng(1)
    made = []
    for count in (40, 25):
        time = np.cumsum(rng.uniform(0.1, 0.4, count))
        made.append(Recording(time, rng.uniform(-1, 1, count), np.zeros(count)))
    for recording, got in zip(made, run(net, "FFRD4S", made, lag_s), strict=True):
        want: list[float] = []
        for i, t in enumerate(recording.time_s):
            if i == 0 or (lag_s and t - lag_s < recording.time_s[0]):
                past = 0.0
            else:
                at = t if lag_s is None else t - lag_s
                past = np.interp(at, recording.time_s[:i], want)
            want.append(recording.strain[i] + past / 2)
        np.testing.assert_allclose(got, want, atol=1e-6)


def test_with_the_measured_stress_a_recursion_is_learnt_exactly():
    time = np.arange(300.0)
    rng = np.random.default_rng(2)
    strain = np.cumsum(rng.uniform(-1, 1, 300)) / 10
    stress = np.zeros(300)
    for i in range(300):
        stress[i] = strain[i] + 0.5 * (stress[i - 1] if i else 0.0)
    recording = Recording(time, strain, stress)
    known = samples([recording], "FFRD4S")
    (one,) = fit_samples(
        known, "FFRD4S", neurons=[2], train_mask=np.ones((1, 300), bool), seeds=[0]
    )
    (alone,) = run(one.network, "FFRD4S", [recording])
    assert np.sqrt(np.mean((alone - stress) ** 2)) < 0.01 * stress.std()


def test_names_and_columns_agree():
    time = np.linspace(0, 5, 30)
    recording = Recording(time, time, time)
    for name, row in ARCHITECTURES.items():
        known = samples([recording], name)
        assert known.inputs.shape[1] == len(known.names) == row.width
        assert known.position.tolist() == list(range(30))


@pytest.mark.parametrize("how", ["bayesian", "l2=1e-10"])
def test_gaussian_units_fit_their_own_kind(how):
    x = np.linspace(-1, 1, 200)[:, None]
    y = np.exp(-0.5 * ((x[:, 0] - 0.1) / 0.5) ** 2)
    (one,) = train_radial(
        x,
        y,
        neurons=[8],
        train_mask=np.ones((1, 200), bool),
        seeds=[0],
        regularisation=Regularisation.parse(how),
    )
    assert np.abs(one.network.predict(x) - y).max() < 1e-3
    again = type(one.network).from_dict(one.network.to_dict())
    np.testing.assert_array_equal(again.predict(x), one.network.predict(x))


def test_evidence_finds_the_noise():
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, (2000, 1))
    y = np.sin(3 * x[:, 0]) + 0.1 * rng.standard_normal(2000)
    about = {
        "neurons": [8],
        "train_mask": np.ones((1, 2000), bool),
        "seeds": [0],
        "regularisation": Regularisation.parse("bayesian"),
    }
    (radial,), (tanh,) = train_radial(x, y, **about), train(x, y, **about)
    for one in (radial, tanh):
        noise = float(one.network.target.half) / np.sqrt(one.beta)
        # tanh counts beta as half a squared error's weight (MacKay's 1 / 2 E_D)
        assert noise == pytest.approx(0.1 * (1 if one is radial else 2**0.5), rel=0.05)


def test_gaussian_units_do_not_stop_early():
    with pytest.raises(InputError, match="allowed is bayesian or l2=WEIGHT"):
        train_radial(
            np.zeros((4, 1)),
            np.zeros(4),
            neurons=[1],
            train_mask=np.ones((1, 4), bool),
            seeds=[0],
            regularisation=Regularisation.parse("early-stopping"),
        )
