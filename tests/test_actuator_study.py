"""Section 7.4: what the strips are, what they are taken for, what it costs."""

import shutil

import numpy as np
import pytest

from softnn import virtual

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")


def test_strips_are_the_virtual_specimens():
    from softnn.study.strips import VirtualStrip

    strain = 0.25 - 0.25 * np.cos(np.linspace(0, 9, 900))
    strip = VirtualStrip()
    got = [strip.step(0.01 if i else 0.0, e) for i, e in enumerate(strain)]
    law, one = virtual.calibration("NatPolR"), virtual.Specimen()
    want = virtual.stress(law, strain, 0.01, one)
    np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-12)


def test_reference_is_half_of_the_published_peak_over_the_range_of_the_gait_query():
    from softnn.study.strips import stride

    torque, knee = stride(2.0)
    assert torque.max() == pytest.approx(15)
    assert np.degrees([knee.min(), knee.max()]) == pytest.approx([5, 63])
    speed = np.max(np.abs(np.diff(knee))) / 1e-3 * 60 / (2 * np.pi)
    assert speed < 50  # rpm, thesis section 7.4
