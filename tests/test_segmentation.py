"""Cycles, holds and their edges in programmes and in real recordings."""

from __future__ import annotations

import numpy as np
import pytest

from softnn import prepare
from softnn.contracts import InputError
from softnn.readers.tidy import read_folder
from softnn.recording import Recording

# --- cycles and holds ----------------------------------------------------------------


def programme(points, rate=0.1, hz=50.0, noise=0.0, quantum=0.0, refresh=1, sign=1):
    """Strain through `points` at `rate`; (level, seconds) in place of a level holds."""
    times, levels = [0.0], [0.0]
    for point in points:
        level, hold = point if isinstance(point, tuple) else (point, 0.0)
        times.append(times[-1] + abs(level - levels[-1]) / rate)
        levels.append(level)
        if hold:
            times.append(times[-1] + hold)
            levels.append(level)
    time = np.arange(0, times[-1], 1 / hz)
    strain = np.interp(time, times, levels)
    strain = strain + noise * np.random.default_rng(0).standard_normal(len(time))
    strain = strain[np.arange(len(time)) // refresh * refresh]
    strain = quantum * np.round(strain / quantum) if quantum else strain
    return Recording(time, sign * strain, sign * strain)


def kinds(recording, **options):
    letters = {"loading": "L", "unloading": "U", "hold": "H"}
    found = prepare.segments(recording, **options)
    edges = [0] + [s.stop for s in found]
    assert edges[:-1] == [s.start for s in found]
    assert edges[-1] == len(recording)
    return "".join(f"{letters[s.kind]}{s.cycle}" for s in found)


FAULTS = [
    {},
    {"noise": 0.001},
    {"noise": 0.004},
    {"quantum": 0.004},
    {"refresh": 5},
    {"sign": -1, "noise": 0.001},
    {"sign": -1, "refresh": 7, "quantum": 0.002},
]


@pytest.mark.parametrize("faults", FAULTS)
@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([0.5], "L1"),
        ([0.5, 0.0], "L1U1"),
        ([0.5, 0.0] * 3, "L1U1L2U2L3U3"),
        ([0.3, 0.1, 0.3, 0.1, 0.8], "L1U1L2U2L3"),
        ([(0.5, 20)], "L1H1"),
        ([(0.5, 3), 0.0, 0.5], "L1H1U1L2"),
        ([(0.1, 10), (0.2, 10), (0.3, 10), (0.2, 10), 0.1], "L1H1L1H1L1H1U1H1U1"),
        ([(0.0, 5), 0.5, (0.0, 5)], "H1L1U1H1"),
    ],
)
def test_segments_of_a_programme(points, expected, faults):
    assert kinds(programme(points, **faults)) == expected


def test_segments_begin_and_end_within_a_step_of_the_programme():
    parts = prepare.segments(programme([(0.5, 20), 0.0], noise=0.001))
    ends = np.array([p.stop for p in parts]) / 50.0
    np.testing.assert_allclose(ends, [5, 25, 30], atol=0.1)


def test_the_round_top_of_a_sine_is_not_a_hold():
    time = np.linspace(0, 40, 4000)
    strain = 0.2 * (1 - np.cos(2 * np.pi * time / 10))
    assert kinds(Recording(time, strain, strain)) == "L1U1L2U2L3U3L4U4"


def test_a_slow_ramp_is_not_a_hold():
    time = np.arange(0, 700, 0.1)
    strain = np.interp(time, [0, 10, 700], [0, 0.4, 0.8])
    assert kinds(Recording(time, strain, strain)) == "L1"


def test_nothing_but_noise_is_a_hold():
    strain = 0.1 + 1e-6 * np.random.default_rng(0).standard_normal(500)
    assert kinds(Recording(np.arange(500.0), strain, strain)) == "H1"


def test_segments_need_a_strain_everywhere():
    strain = np.array([0, 0.1, np.nan, 0.3])
    with pytest.raises(InputError, match="1 samples have no strain"):
        prepare.segments(Recording(np.arange(4.0), strain, np.arange(4.0)))


# --- real recordings: what their sources say -----------------------------------------


@pytest.mark.parametrize(
    ("name", "chosen", "cycles"),
    [
        ("foam-tpe-tension-cyclic", "leap_t", 6),
        ("foam-tpe-tension-cyclic", "turbo_t", 6),
        ("foam-tpe-tension-cyclic", "new_", 13),  # 6 to 30 %, 6 to 200 %, to failure
        ("foam-tpe-tension-cyclic", "worn_", 13),
        ("foam-tpe-compression-cyclic", "new_heel", 6),
        ("fungi-steak-double-compression", "", 2),
        ("silicone30a-instron", "", 10),
        ("vhb4910-zhao", "lu_", 1),
        ("vhb4910-zhao", "relax_", 1),
    ],
)
def test_cycles_of_real_recordings(data_folder, name, chosen, cycles):
    for recording in read_folder(data_folder / name):
        if recording.name.startswith(chosen):
            known = ~np.isnan(recording.strain)
            parts = prepare.segments(recording.take(known))
            assert parts[-1].cycle == cycles, recording.name


def test_staircase_of_real_holds(data_folder):
    """Five ramps up with a hold after each but the last; one goes down again."""
    for recording in read_folder(data_folder / "oca-shear-ladder"):
        found = kinds(recording)
        down = "H1" + "U1H1" * 4 + "U1" if recording.name.endswith("tion_raw") else ""
        assert found == "L1H1" * 4 + "L1" + down


def test_no_real_hold_or_cycle_without_failure_is_cut(data_folder):
    sets = ["vhb4910-zhao", "rubber-compression-relaxation", "silicone30a-instron"]
    sets += ["fungi-steak-double-compression", "foam-tpe-compression-cyclic"]
    for name in sets:
        for recording in read_folder(data_folder / name):
            known = ~np.isnan(recording.strain + recording.stress_MPa)
            whole = recording.take(known)
            assert len(prepare.cut_failure(whole)) == len(whole), recording.name


def test_real_pulls_are_cut_at_their_peak(data_folder):
    """Where the record goes on to 500 % the specimen fails; the peak is kept."""
    cut = {
        r.name: (r, prepare.cut_failure(r))
        for r in read_folder(data_folder / "foam-tpe-tension-cyclic")
        if r.name.startswith(("new_", "worn_"))
    }
    failed = {name for name, (r, c) in cut.items() if len(c) < len(r)}
    assert failed == {
        *("new_heel_t1", "new_toe_t2", "new_toe_t3", "new_toe_t4", "new_toe_t5"),
        "worn_heel_t4",
    }
    for recording, kept in cut.values():
        assert kept.stress_MPa.max() == recording.stress_MPa.max()
