"""What a diagnosis costs: what is written down, and what is read off the timings."""

from __future__ import annotations

import numpy as np
import pytest

from bench import cost
from softnn.database import Store
from softnn.mismatch import base
from softnn.mismatch.case import read_case
from softnn.mismatch.diagnosis import diagnose


@pytest.fixture(scope="module")
def offset():
    return cost.specimen("zero_offset", 3)


@pytest.mark.parametrize("samples", [100, 5000])
def test_every_recording_has_as_many_samples_as_asked_for(samples, offset, tmp_path):
    offset.write(tmp_path / "c", samples, 1)
    case = read_case(tmp_path / "c")
    assert [len(r) for r in case.recordings] == [samples] * cost.RECORDINGS
    setup, clean = offset.sampled(samples)
    sigma = cost.LEVEL * np.ptp(np.concatenate(clean))
    left = [r.stress_MPa - s for r, s in zip(case.recordings, clean, strict=True)]
    for r, c, was in zip(
        case.recordings, setup.courses, offset.setup.courses, strict=False
    ):
        np.testing.assert_allclose(r.time_s, c.time_s, rtol=1e-6)
        on = np.interp(r.time_s, was.time_s, was.strain)
        np.testing.assert_allclose(r.strain, on, atol=1e-6)
    assert np.std(np.concatenate(left)) == pytest.approx(sigma, rel=0.1)


@pytest.mark.slow
def test_only_the_pool_is_chosen_from(offset, tmp_path):
    offset.write(tmp_path / "c", 150, 1)
    case = read_case(tmp_path / "c")
    assert "zero_offset" in diagnose(case).result["selected"]
    with cost.pool_of(["gain_error"]):
        found = diagnose(case).result
    assert {c["effect"] for c in found["candidates"]} <= {None, "gain_error"}
    assert "zero_offset" not in found["selected"]
    choices = cost.pools(offset, tmp_path / "c", (1, 4, 99))
    assert choices[0] == ["zero_offset"]
    assert choices[1][:1] == choices[0]
    assert choices[2][:4] == choices[1]
    assert 10 < len(choices[2]) == len(set(choices[2])) <= 19


def test_unthinned_is_undone():
    before = base.SEARCH, base.REPORT
    with cost.unthinned():
        assert min(base.SEARCH, base.REPORT) == cost.EVERY
    assert (base.SEARCH, base.REPORT) == before


def test_curve_by_hand():
    rows = [
        {
            "curve": "samples",
            "planted": name,
            "count": n,
            "read_s": 0.001 * n,
            "seconds": factor * (0.5 + 0.01 * n),
        }
        for name, factor in (("", 1), ("slack", 3))
        for n in (10, 100, 1000)
    ]
    # A count that one of them lacks is no mean.
    rows.append({**rows[0], "count": 20})
    curve = cost.curve_of(rows, "samples")
    assert curve["counts"] == [10, 100, 1000]
    assert curve["seconds"] == pytest.approx([1.2, 3.0, 21.0])
    assert curve["seconds_for_one_more"] == pytest.approx(0.02)
    assert curve["seconds_once"] == pytest.approx(1.0)
    assert curve["slope"] == pytest.approx(np.log10(21 / 1.2) / 2)
    assert curve["slope_upper_half"] == pytest.approx(np.log10(7))
    assert cost.slope([10], [1.0]) is None


def test_refusals(capsys):
    assert cost.main(["--effects", "magic"]) == 2
    assert "no effect is called 'magic'" in capsys.readouterr().err
    assert cost.main(["--sizes", "10"]) == 2
    assert "sizes start at 50" in capsys.readouterr().err


def test_what_is_timed_is_not_timed_again(monkeypatch, tmp_path):
    a = cost.make_parser().parse_args(["--sizes", "60", "70", "--unthinned", "60"])
    a.effects, a.pools, a.usual, a.repeats = ["zero_offset"], [1], 60, 1
    monkeypatch.setattr(cost, "pools", lambda *_: [["zero_offset"]])
    timed: list[str] = []

    def until(most):
        def time_one(folder, _repeats):
            if len(timed) == most:
                raise KeyboardInterrupt
            timed.append(folder.name)
            return {"seconds": float(len(timed)), "read_s": 0.5}

        return time_one

    with Store(tmp_path / "cost.sqlite") as store:
        monkeypatch.setattr(cost, "timed", until(2))
        with pytest.raises(KeyboardInterrupt):
            cost.measure(a, store)
        monkeypatch.setattr(cost, "timed", until(99))
        rows = cost.measure(a, store)
    assert timed == ["60", "70", "60", "60"]
    assert [r["seconds"] for r in rows] == [1.0, 2.0, 3.0, 4.0]
    assert [r["curve"] for r in rows] == ["samples", "samples", "unthinned", "effects"]
