"""Whole cycles in the network studies: which recordings, samples and models."""

import numpy as np
import pytest

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
