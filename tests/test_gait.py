"""Section 3.2: the query of the thesis, and the same asked of tables of one's own."""

import json
import math

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.study.ranges import (
    Area,
    Query,
    inwards,
    outline,
    published,
    studies_of,
    supported,
)
from studies import gait


def test_ages_50_to_70_by_three_studies_are_served_by_5_to_63_degrees():
    (found,) = supported(published(), Query(50, 70, 3))
    assert inwards(*found) == (5, 63)  # thesis section 3.2
    assert found == (4.5, 63.5)


def test_a_study_counts_once():
    twice = [Area(0, 9, 0, 60, "a"), Area(0, 9, 20, 80, "a")]
    assert supported(twice, Query(30, 50, 2)) == []
    assert supported(twice, Query(0, 80, 1)) == [(0, 9)]


def test_agrees_with_counting_point_by_point():
    rng = np.random.default_rng(7)
    for _ in range(40):
        areas = [
            Area(*sorted(rng.uniform(0, 10, 2)), *sorted(rng.uniform(0, 10, 2)), name)
            for name in "aabbcd"
        ]
        query = Query(*sorted(rng.uniform(1, 9, 2)), int(rng.integers(1, 4)))
        ranges = supported(areas, query)
        ends = [e for a in areas for e in (a.group_low, a.group_high)]
        ends = np.sort(np.clip([*ends, query.low, query.high], query.low, query.high))
        groups = (ends[1:] + ends[:-1])[np.diff(ends) > 0] / 2
        for value in rng.uniform(0, 10, 40):
            least = min(len(studies_of(areas, g, value)) for g in groups)
            inside = any(a < value < b for a, b in ranges)
            assert inside == (least >= query.studies)


def test_outline_of_one_area_is_its_frame():
    edges = outline([Area(1, 3, 10, 20, "a")], 1)
    length = sum(abs(x[1] - x[0]) + abs(y[1] - y[0]) for x, y in edges)
    assert length == pytest.approx(2 * 10 + 2 * 2)


def test_strain_of_a_strip():
    one = gait.strip((0.0, 180.0), 50.0, 10.0)
    assert one["strain_range"] == pytest.approx(math.pi * 10 / 50)
    assert one["rate_at_50_rpm_per_s"] == pytest.approx(10 * 50 / 60 * math.tau / 50)
    assert gait.strip((4.5, 63.5), 33, None)["strain_range"] == pytest.approx(0.5)


def test_a_table_of_ones_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "torque.csv"
    file.write_text(
        "low,high,group_low,group_high,study\n-20,30,50,80,a\n-10,40,40,90,b\n"
    )
    arguments = ["--smoke", "--table", str(file), "--group", "60", "70"]
    assert gait.main([*arguments, "--studies", "2"]) == 0
    made = json.loads((tmp_path / "mlruns/smoke/results/gait-own.json").read_text())
    assert (made["headline"]["low"], made["headline"]["high"]) == (-10, 30)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.csv", "low,high\n1,2\n", "area 1 is none"),
        ("a.csv", "low,high,group_low,group_high,study\n5,1,0,9,x\n", "no extent"),
        ("a.csv", "low,high,group_low,group_high,study\nnan,1,0,9,x\n", "no extent"),
        ("a.toml", "rows = 3", "not a table of areas"),
        ("a.toml", "rows = [", "not a table of areas"),
        ("a.csv", "", "no areas"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path, name, text, says):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=says):
        gait.read_areas(tmp_path / name)
