"""Recordings hardly changed are hardly changed, and what came of it is counted."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made import write_case

from bench import stability
from softnn.database import Store
from softnn.mismatch.case import read_case
from softnn.study.common import code_of, package_files


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return read_case(write_case(tmp_path_factory.mktemp("hardly") / "case"))


@pytest.mark.parametrize(
    ("name", "longer", "unknown"),
    [("a row less", -1, 0), ("a NaN", 0, 1), ("a row twice", 1, 0)],
)
def test_a_row_is_changed_in_each_recording(case, name, longer, unknown):
    changed = stability.CHANGES[name](case, np.random.default_rng(0))
    for old, new in zip(case.recordings, changed.recordings, strict=True):
        assert len(new.time_s) - len(old.time_s) == longer
        gaps = np.isnan(new.stress_MPa).sum() - np.isnan(old.stress_MPa).sum()
        assert gaps == unknown
        assert {len(new.strain), len(new.stress_MPa)} == {len(new.time_s)}
        assert np.isin(new.time_s, old.time_s).all()


def test_rows_take_every_channel_with_them(case):
    force = [2 * r.stress_MPa for r in case.recordings]
    pairs = zip(case.recordings, force, strict=True)
    case = replace(case, recordings=tuple(replace(r, force_N=f) for r, f in pairs))
    for name in ("a row less", "a row twice"):
        for r in stability.CHANGES[name](case, np.random.default_rng(0)).recordings:
            np.testing.assert_array_equal(r.force_N, 2 * r.stress_MPa)


@pytest.mark.parametrize(("name", "up"), [("stress x 10", 10), ("stress x 1000", 1000)])
@pytest.mark.parametrize("size", [1.0, 3.0, 300.0])
def test_stress_is_as_much_larger_or_smaller_as_may_be_said(case, name, up, size):
    loud = stability.by(size)(case, np.random.default_rng(0))
    most = max(np.abs(r.stress_MPa).max() for r in loud.recordings)
    changed = stability.CHANGES[name](loud, np.random.default_rng(0))
    factor = up if up * most < 2000 else 1 / up
    for old, new in zip(loud.recordings, changed.recordings, strict=True):
        np.testing.assert_allclose(new.stress_MPa, factor * old.stress_MPa, rtol=1e-12)


def test_half_the_noise_is_half_of_what_is_not_clean(case, tmp_path):
    for r in case.recordings:
        clean = pd.DataFrame({"time_s": r.time_s, "stress_MPa": r.stress_MPa - 0.25})
        clean.to_csv(tmp_path / f"{r.name}.csv", index=False, float_format="%.12g")
    quiet = stability.quieter(case, tmp_path)
    for old, new in zip(case.recordings, quiet.recordings, strict=True):
        np.testing.assert_allclose(new.stress_MPa, old.stress_MPa - 0.125, atol=1e-9)


def named(before, after, half=None, true=("slack",)):
    names = dict.fromkeys(stability.CHANGES, before) | {"as it is": before}
    names["a NaN"] = after
    if half is not None:
        names[stability.HALF] = half
    verdict = {k: "undetermined" if v == ["inertia"] else "x" for k, v in names.items()}
    verdict["a NaN"] = verdict["as it is"]
    true = None if true is None else list(true)
    return {"case": "c", "true": true, "named": names, "verdict": verdict}


def test_names_that_change_are_counted():
    rows = [
        named(["slack"], ["slack"], half=["slack"]),
        named(["slack"], [], half=[]),  # a true name is lost to less noise
        named(["slack"], ["slack"], half=["slack", "inertia"]),  # and a false one comes
        named(["inertia"], ["slack"], true=None),
    ]
    told = stability.told(rows)
    assert (told["a NaN"]["right"], told["a NaN"]["of"]) == (2, 4)
    assert (told["a row less"]["right"], told["a row less"]["of"]) == (4, 4)
    every = 4 * len(stability.CHANGES)
    assert (told["hardly changed"]["right"], told["hardly changed"]["of"]) == (
        every - 2,
        every,
    )
    # One of the two is said to be uncertain before and after.
    assert told["the same, or uncertain"]["right"] == every - 1
    assert (told["fewer true names"]["right"], told["fewer true names"]["of"]) == (1, 3)
    assert (told["more false names"]["right"], told["more false names"]["of"]) == (1, 3)


def test_what_is_finished_is_told_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(stability, "runs_folder", lambda _: tmp_path)
    monkeypatch.setattr(stability, "results_folder", lambda *_: tmp_path / "results")
    for name in ("a", "b"):
        write_case(tmp_path / "mine" / "cases" / name)
        truth = tmp_path / "mine" / "truth" / name / "truth.json"
        truth.parent.mkdir(parents=True)
        truth.write_text('{"effects": []}')
    asked = [str(tmp_path / "mine"), "--finished"]
    assert stability.main(asked) == 2  # nothing is
    row = named(["slack"], ["slack"]) | {"of": "mine", "data": "ab"}
    code = code_of(package_files())
    with Store(tmp_path / "stability.sqlite", code) as store:
        store.add(str((tmp_path / "mine" / "cases" / "b").resolve()), row)
    assert stability.main(asked) == 0
    written = json.loads((tmp_path / "results" / "stability.json").read_text())
    assert written["rows"] == [row]
