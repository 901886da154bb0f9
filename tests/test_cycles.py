"""Whole cycles in the network studies: which recordings, samples and models."""

import numpy as np
import pytest

from bench.architectures import verdict
from bench.architectures.baselines import cyclic_fits
from softnn.contracts import InputError
from softnn.metrics import nrmse
from softnn.neural.history import filtered
from softnn.recording import Recording
from softnn.study.material_data import prepared, unloads, whole
from softnn.study.settings import Settings

TIME = np.linspace(0, 20, 401)
TRIANGLE = 0.4 * (1 - np.abs(TIME / 10 - 1))


def recording(strain, stress=None, **about):
    stress = strain if stress is None else stress
    return Recording(TIME, strain, stress, test="cyclic", **about)


def test_what_comes_back_by_half_unloads():
    assert unloads(recording(TRIANGLE))
    assert unloads(recording(-TRIANGLE))
    assert not unloads(recording(0.02 * TIME))
    assert not unloads(recording(np.minimum(0.1 * TIME, 0.4)))  # a ramp and a hold
    assert not unloads(recording(np.zeros(401)))


def test_samples_lie_along_the_movement_and_the_time():
    strain = np.minimum(0.4 * TIME, 0.4)  # loaded in the first twentieth, then held
    kept = whole(recording(strain), 50)
    assert 40 <= len(kept) <= 50
    assert kept.time_s[0] == 0
    assert kept.time_s[-1] == 20
    assert 15 <= np.sum(kept.strain < 0.4) <= 30
    assert whole(recording(TRIANGLE), 1000).time_s.tolist() == TIME.tolist()


def test_cycles_at_one_rate_tell_a_branch_from_a_spring():
    branch = TRIANGLE - filtered(recording(TRIANGLE), 2.0)
    stress = TRIANGLE + 2 * branch
    pulled = recording(TRIANGLE, stress, rate_per_s=0.04, name="a")
    fits = cyclic_fits([pulled], [], {})
    found = fits["PL-SLS", "joint"].predict(pulled)
    assert nrmse(found, stress) < 0.02
    springs = np.interp(TRIANGLE, TRIANGLE[:201], stress[:201])
    assert nrmse(springs, stress) > 0.05  # what no branch leaves


def test_refusals_are_plain(tmp_path):
    with pytest.raises(InputError, match="virtual specimens do not unload"):
        prepared(Settings(cycles=True))
    rows = "\n".join(f"{t},{0.1 * t},{0.2 * t}" for t in range(20))
    (tmp_path / "a.csv").write_text(f"time_s,strain,stress_MPa\n{rows}\n")
    with pytest.raises(InputError, match="no recording unloads"):
        prepared(Settings(data=str(tmp_path), cycles=True))


def test_a_recording_without_a_geometry_is_left_out_aloud(tmp_path, capsys):
    rows = "\n".join(f"{t},{0.01 * t},{0.02 * t}" for t in range(20))
    (tmp_path / "spring.csv").write_text(f"time_s,elongation_mm,force_N\n{rows}\n")
    with pytest.raises(InputError, match="no recording has a geometry"):
        prepared(Settings(data=str(tmp_path)))
    (tmp_path / "strip.csv").write_text(f"time_s,strain,stress_MPa\n{rows}\n")
    capsys.readouterr()
    (data,) = prepared(Settings(data=str(tmp_path)))
    assert len(data.tensile) == 1
    assert "no geometry, so no stress; left out" in capsys.readouterr().err


def test_rates_that_no_file_names_are_read_off_the_strain(tmp_path, capsys):
    for name, rate in (("a", 0.02), ("b", 0.021), ("c", 0.2)):
        time = np.linspace(0, 0.8 / rate, 200)
        strain = 0.4 * (1 - np.abs(time * rate / 0.4 - 1))
        rows = np.column_stack([time, strain, 2 * strain])
        head = "time_s,strain,stress_MPa"
        np.savetxt(
            tmp_path / f"{name}.csv", rows, "%.9g", ",", header=head, comments=""
        )
    (data,) = prepared(Settings(data=str(tmp_path)))
    np.testing.assert_allclose(
        [r.rate_per_s for r in data.tensile], [0.02, 0.021, 0.2], rtol=0.02
    )
    said = capsys.readouterr().err
    assert "no rates given; read off the strain: 0.0205, 0.2 /s" in said
    about = "file,rate_per_s\na.csv,0.02\nb.csv,\nc.csv,0.2\n"  # some are given
    (tmp_path / "index.csv").write_text(about)
    (data,) = prepared(Settings(data=str(tmp_path)))
    assert [r.rate_per_s for r in data.tensile] == [0.02, None, 0.2]
    assert "no rates given" not in capsys.readouterr().err


def test_a_model_that_cannot_be_fitted_says_why_below_the_table():
    why = "a fold leaves no hold to train on"
    rows = [
        {"model": "PL-SLS", "random": why, "unseen": why},
        {"model": "trees", "random": [0.1, 0.2], "unseen": [0.2, 0.2]},
    ]
    text = verdict.table(rows, "rate")
    assert text.endswith(f"\n\n- PL-SLS: {why}")
