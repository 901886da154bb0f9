"""Section 7.3: the inputs as the text has them, the failure, and the guard."""

import json

import numpy as np
import pytest

from softnn.contracts import Chunk, InputError
from softnn.neural import Network, Scaling, Seen, StoredNetwork, counted, stored
from softnn.recording import Recording
from softnn.study.realtime_inputs import STEP_S, law, offsets, readings, sine
from studies import realtime


def test_rates_are_differences_of_extremes_one_second_apart():
    for speed in (50.0, 100.0, 400.0, 500.0):
        strain, rate = sine(speed, 33.0, None)
        top, bottom = strain[round(0.5 / STEP_S)], strain[round(1.5 / STEP_S)]
        assert (top - bottom) * 33 * 60 == pytest.approx(speed)
        np.testing.assert_allclose(
            np.gradient(strain, STEP_S)[1:-1], rate[1:-1], atol=1e-5
        )
        assert strain.min() == pytest.approx(0, abs=1e-9)


def test_only_c_goes_below_zero():
    for scenario, speed in (("a", 100.0), ("c", 50.0)):
        lows = [
            sine(speed, 33.0, o)[0].min() for o in offsets(scenario, speed, 33).values()
        ]
        assert all((low < -1e-9) == (scenario == "c") for low in lows)


def test_twelve_bits_make_noise_of_the_rate():
    strain, rate = sine(100.0, 33.0, None)
    noisy = readings(33.0)["derivative, 12 bits"](strain, rate)
    step = 16.5 / 4096 / 33 / STEP_S  # one step of the encoder in one sample
    assert set(np.round(np.abs(noisy) / step, 6)) <= {0.0, 1.0}
    # It is the rate all the same: its sum is the strain.
    np.testing.assert_allclose(np.cumsum(noisy) * STEP_S, strain - strain[0], atol=2e-4)


def test_law_is_that_of_the_specimens_and_a_slack_strip_bears_nothing():
    assert np.all(law(sine(50.0, 33.0, -0.02)[0]) >= 0)
    from softnn import virtual

    strain = np.linspace(0, 0.4, 500)
    want = virtual.stress(
        virtual.calibration("NatPolR"), strain, STEP_S, virtual.Specimen()
    )
    np.testing.assert_allclose(law(strain), want)


def test_failures_are_counted():
    true = np.linspace(0, 1, 101)
    wrong = np.stack([true, true - 0.5, np.where(true > 0.5, true, -true)])
    flags = np.where(true < 0.25, 4, 0).astype(np.uint8)
    found = realtime.counted(wrong, true, flags)
    assert found["networks_negative"] == 2
    assert found["nrmse"] == pytest.approx(
        np.sqrt(np.mean(np.where(true > 0.5, 0, 2 * true) ** 2) / np.mean(true**2))
    )
    # 0.49 of samples are negative in both; 24 and 25 of them lie below 0.25.
    assert 0.4 < found["negative_flagged"] < 0.6
    assert found["jump"] == pytest.approx(1)


# --- the guard ------------------------------------------------------------------------


def tensile(rate, n=50):
    strain = np.linspace(0, 0.5, n)
    return Recording(strain / rate, strain, 3 * strain, test="tensile", rate_per_s=rate)


def test_what_is_seen_is_what_recordings_show():
    seen = Seen.of([tensile(0.02), tensile(0.2)])
    assert seen.strain == (0.0, 0.5)
    assert seen.rate_per_s == pytest.approx((0.02, 0.2))
    assert Seen.from_dict(json.loads(json.dumps(seen.to_dict()))) == seen


@pytest.mark.parametrize(
    "bad", [{}, {"strain": [0, 1]}, {"strain": [1, 0], "rate_per_s": None}, 3]
)
def test_ranges_that_are_none_are_refused(bad):
    with pytest.raises(InputError, match="seen is"):
        Seen.from_dict(bad)


def test_unloading_is_a_direction_never_shown_even_without_a_rate_among_the_inputs():
    scaling = (
        Scaling(np.zeros(2), np.full(2, 0.5)),
        Scaling(np.array(0.0), np.array(1.5)),
    )
    net = Network(np.ones((1, 3)), np.ones(2), *scaling)
    seen = Seen.of([tensile(0.02), tensile(0.2)])
    model = StoredNetwork(net, "FFRI2", None, seen)
    time = np.arange(0, 10.0)
    strain = np.array([0, 0.1, 0.2, 0.3, 0.4, 0.3, 0.2, 0.1, 0.9, 0.905])
    flags = model.outside(Chunk(time, strain))
    assert flags.tolist() == [0, 0, 0, 0, 0, 4, 4, 4, 3, 3]
    assert counted(flags)["outside"] == 5
    again = stored.from_dict(json.loads(json.dumps(model.source)))
    assert again.seen == seen
    old = {k: v for k, v in model.source.items() if k != "seen"}
    assert stored.from_dict(old).outside(Chunk(time, strain)).tolist()[5:8] == [0, 0, 0]
