"""Input architectures of Table 6.3 on histories whose inputs are known."""

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.neural import ARCHITECTURES, PUBLISHED, samples
from softnn.recording import Recording


def ramp(rate=0.1, step=0.5, n=20, **about):
    time = step * np.arange(n)
    return Recording(time, rate * time, 3 * rate * time, **about)


def test_the_table_is_that_of_the_thesis():
    columns = {name: samples([ramp()], name).names for name in PUBLISHED}
    assert columns == {
        "FFRI1": ("strain",),
        "FFRI2": ("strain", "strain[t-1]"),
        "FFRI3": ("strain", "strain[t-1]", "strain[t-2]"),
        "FFRD4": ("strain", "strain_rate_per_s"),
    }


def test_lag_is_one_sample_by_default_and_a_time_if_given():
    recording = ramp()
    default = samples([recording], "FFRI3").inputs
    np.testing.assert_allclose(default[2:, 1], recording.strain[1:-1])
    np.testing.assert_allclose(default[2:, 2], recording.strain[:-2])
    np.testing.assert_allclose(default[0], recording.strain[0])  # at rest before
    timed = samples([recording], "FFRI2", lag_s=0.75).inputs
    np.testing.assert_allclose(timed[2:, 1], recording.strain[2:] - 0.1 * 0.75)


def test_rate_of_a_ramp_is_its_slope_whatever_the_sampling():
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0, 10, 50))
    time[7] = time[6]  # a repeated time stamp, as machines write them
    recording = Recording(time, 0.2 * time, time)
    np.testing.assert_allclose(samples([recording]).inputs[:, 1], 0.2, rtol=1e-9)
    np.testing.assert_allclose(
        samples([recording], lag_s=1.5).inputs[time > time[0] + 1.5, 1], 0.2, rtol=1e-9
    )


def test_nothing_looks_ahead():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.1, 0.3, 40))
    strain = rng.uniform(0, 1, 40)
    changed = strain.copy()
    changed[25:] += 1
    for name in ARCHITECTURES:
        for lag in (None, 0.4):
            one = samples([Recording(time, strain, strain)], name, lag).inputs
            two = samples([Recording(time, changed, changed)], name, lag).inputs
            np.testing.assert_array_equal(one[:25], two[:25])


def test_a_tensile_test_has_its_nominal_rate():
    recording = ramp(rate=0.1, test="tensile", rate_per_s=0.126)
    np.testing.assert_array_equal(samples([recording]).inputs[:, 1], 0.126)


def test_missing_values_are_left_out_and_owners_kept():
    first, second = ramp(n=5), ramp(n=4)
    stress = first.stress_MPa.copy()
    stress[2] = np.nan
    first = Recording(first.time_s, first.strain, stress)
    got = samples([first, second], "FFRI1")
    assert got.recording.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
    assert len(got.target) == 8


@pytest.mark.parametrize(
    ("how", "match"),
    [
        ({"architecture": "FFRI4"}, "allowed is FFRI1, FFRI2, FFRI3, FFRD4"),
        ({"lag_s": 0.0}, "above 0"),
    ],
)
def test_bad_choices_are_refused(how, match):
    with pytest.raises(InputError, match=match):
        samples([ramp()], **how)
    with pytest.raises(InputError, match="at least one"):
        samples([])
