"""The study of networks of histories: its data, its page."""

import json

import numpy as np
import pytest

from bench.survivor.data import LARGEST, cyclic
from bench.survivor.report import bars, write_page
from softnn import virtual
from softnn.contracts import InputError
from softnn.study.common import RESULTS
from softnn.taught import turns


def test_corners_keep_to_strains_and_rates():
    rng = np.random.default_rng(0)
    time, strain = turns(rng, (-0.1, 0.4), (0.01, 1.0), 300)
    assert strain.min() >= -0.1
    assert strain.max() <= 0.4
    step, rise = np.diff(time), np.abs(np.diff(strain))
    assert (step > 0).all()
    rate = (rise / step)[rise > 0]
    assert rate.min() >= 0.01 * (1 - 1e-9)
    assert rate.max() <= 1 * (1 + 1e-9)
    assert 0.02 < np.mean(rise == 0) < 0.2  # holds


def test_a_virtual_strip_goes_slack_and_is_the_law_elsewhere():
    one = cyclic(np.random.default_rng(5), "a", virtual.Specimen())
    assert one.strain.min() < 0 < one.strain.max() <= LARGEST
    calibration = virtual.calibration("NatPolR")
    taut = np.maximum(one.strain, 0)
    want = np.maximum(virtual.stress(calibration, taut, 0.02, virtual.Specimen()), 0)
    noise = one.stress_MPa - want
    assert np.sqrt(np.mean(noise**2)) < 0.01 * want.max()


def test_the_page_is_what_the_result_says(tmp_path):
    page = write_page(RESULTS, tmp_path).read_text()
    committed = RESULTS.parents[1] / "docs" / "survivor.md"
    assert page == committed.read_text()


def test_no_stress_of_the_wrong_sign_on_the_sines_or_the_virtual_recordings():
    body = json.loads((RESULTS / "survivor.json").read_text())
    assert body["headline"]["sines_negative"] == 0
    told = {row[0]: row[3] for row in bars(body)}
    assert told["sines of 7.3 with negative stress"] == "yes"
    for row in body["problems"]:
        assert row["wrong_sign"]["FFH7"] == 0


def test_no_result_is_said_in_a_line(tmp_path):
    with pytest.raises(InputError, match=r"python -m studies\.survivor makes it"):
        write_page(tmp_path, tmp_path)
