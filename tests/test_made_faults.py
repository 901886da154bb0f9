"""Faults made in real recordings: what each is, and how it is scored."""

from dataclasses import replace

import numpy as np
import pytest
from recordings_made import SPRING, STIFFNESS, triangle

from bench.recordings import faults, groups, sets, trial
from bench.recordings.rows import Row, fault_scores, rate
from softnn import Recording
from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.mismatch.case import Case
from softnn.simulate import Term, simulate


def second_route(name, recording, **values):
    law = effect(name)
    term = Term(law, law.defaults() | values)
    chunk = Chunk(recording.time_s - recording.time_s[0], recording.strain)
    return simulate(SPRING, [STIFFNESS], [term], [chunk])[0]


# --- made faults ----------------------------------------------------------------------


def test_made_slack_is_a_gap():
    made = faults.slack(triangle(), 1.0, 1.0)
    assert made.strain.max() == pytest.approx(0.5 * 1.05)
    np.testing.assert_allclose(
        made.stress_MPa, second_route("slack", made, gap=0.025), atol=1e-9
    )


def test_made_slip_is_a_slip():
    made = faults.slip(triangle(), 1.0, 1.0)
    moment = 0.7 * 5.0
    told = second_route(
        "grip_slip", made, slip=0.05, moment_s=moment, duration_s=0.02 * moment
    )
    np.testing.assert_allclose(made.stress_MPa, told, atol=1e-9)


def test_made_lag_is_a_lag():
    made = faults.lag(triangle(step=0.005), 1.0, 1.0)
    told = second_route("sensor_lag", made, time_constant_s=0.25, quality_squared=0.0)
    np.testing.assert_allclose(made.stress_MPa, told, atol=1e-4)


def test_made_errors_of_the_channel_have_their_sizes():
    plain = triangle()  # peak 1 MPa
    peak = faults.peak(plain)
    offset = faults.offset(plain, 1.0, peak).stress_MPa - plain.stress_MPa
    np.testing.assert_allclose(offset, 0.055 * peak)
    gain = faults.gain(plain, 1.0, peak).stress_MPa
    np.testing.assert_allclose(gain, 1.105 * plain.stress_MPa)
    drift = faults.drift(plain, 1.0, peak).stress_MPa - plain.stress_MPa
    assert drift[-1] == pytest.approx(0.08 * peak)  # 10 s, too short for 1 an hour
    clipped = faults.clip(plain, 1.0, peak).stress_MPa
    assert clipped.max() == pytest.approx(0.78 * peak)
    np.testing.assert_array_equal(
        clipped[plain.stress_MPa < 0.7], plain.stress_MPa[plain.stress_MPa < 0.7]
    )


def test_a_section_typed_wrong_is_one_specimen_among_its_siblings():
    five = tuple(triangle(name=str(i)) for i in range(5))
    fault = faults.FAULTS["section"]
    made = faults.faulty(Case("c", five), fault, 1.0, np.random.default_rng(0))
    ratios = [r.stress_MPa.max() / five[0].stress_MPa.max() for r in made.recordings]
    assert sorted(ratios) == pytest.approx([1, 1, 1, 1, 2])
    assert fault.shows(five, specimens=True)
    assert not fault.shows(five, specimens=False)  # one specimen has one section
    assert not fault.shows(five[:3], specimens=True)


def test_drying_makes_a_held_stress_rise():
    time = np.linspace(0, 50, 501)
    strain = np.interp(time, [0, 1], [0, 0.5])
    held = Recording(time, strain, STIFFNESS * strain, name="held")
    made = faults.drying(held, 1.0, 1.0).stress_MPa
    after = time > 1
    assert (np.diff(made[after]) > 0).all()
    assert made[-1] == pytest.approx(1.25 * held.stress_MPa[-1])
    assert faults.FAULTS["drying"].shows([held], specimens=False)
    assert not faults.FAULTS["drying"].shows([triangle()], specimens=False)


def test_what_is_on_no_list_is_found_where_nothing_new_is_named():
    dry = {"fault": "drying", "expected": faults.UNLISTED}
    rows = [
        Row("s", "g", "fault", "b", selected=["slack"]),
        Row("s", "g", "fault", "b", **dry, selected=["slack"]),
        Row("s", "g", "fault", "b", **dry, selected=["slack", "load_cell_drift"]),
    ]
    scores = fault_scores(rows)
    assert [c["found"] for c in scores["copies"]] == [True, False]
    assert scores["with_a_false_name"]["rate"] == 0.5


def test_faults_sit_in_their_share_and_the_original_stays():
    case = Case("c", tuple(triangle(name=str(i)) for i in range(6)))
    rng = np.random.default_rng(0)
    made = faults.faulty(case, faults.FAULTS["offset"], 1.0, rng)
    changed = [
        not np.array_equal(a.stress_MPa, b.stress_MPa)
        for a, b in zip(case.recordings, made.recordings, strict=True)
    ]
    assert sum(changed) == 2  # a third of six
    assert all(r.stress_MPa[0] == 0 for r in case.recordings)


def test_the_control_lacks_one_recording_and_has_no_fault():
    recordings = tuple(replace(triangle(), name=f"r{i}") for i in range(3))
    case = Case("c", recordings, specimen={r.name: r.name for r in recordings})
    made = faults.one_less(case, np.random.default_rng(0))
    assert len(made.recordings) == 2
    assert all(r in recordings for r in made.recordings)
    assert sorted(made.specimen) == [r.name for r in made.recordings]
    group = groups.Group("s", "g", recordings, True, sets.Material(), ())
    tasks = trial.broken(group, "hooke", 100, 0, 1.0, ["lag", "gain"])
    # Scales of specimens hide a gain.
    assert [t.fault for t in tasks] == ["", faults.CONTROL, "lag"]
    pair = replace(group, recordings=recordings[:2])
    assert [t.fault for t in trial.broken(pair, "hooke", 100, 0, 1.0, [])] == [""]


def test_the_control_is_diagnosed_without_a_recording_and_expects_nothing(monkeypatch):
    seen = []

    def diagnosed(case, base, seed):
        seen.append(len(case.recordings))
        raise InputError("that is all")

    monkeypatch.setattr(trial, "diagnose", diagnosed)
    recordings = tuple(replace(triangle(), name=f"r{i}") for i in range(3))
    group = groups.Group("s", "g", recordings, True, sets.Material(), ())
    for task in trial.broken(group, "hooke", 100, 0, 1.0, ["lag"]):
        trial.work(task)
    assert seen == [3, 2, 3]


def test_faults_are_scored_on_top_of_what_is_there():
    rows = [
        Row("s", "g", "fault", "b", selected=["mullins_softening"],
            heldout=[0.2, 0.06]),
        Row("s", "g", "fault", "b", fault="lag", expected="sensor_lag",
            selected=["mullins_softening", "sensor_lag"]),
        Row("s", "g", "fault", "b", fault="slip", expected="grip_slip",
            selected=["inertia"]),
        Row("s", "h", "fault", "b", selected=["sensor_lag"], heldout=[0.2, 0.04]),
        Row("s", "h", "fault", "b", fault="clip", expected="load_cell_saturation",
            verdict="unexplained"),
        Row("s", "h", "fault", "b", fault="lag", expected="sensor_lag",
            selected=["sensor_lag"]),
        Row("s", "g", "fault", "b", fault=faults.CONTROL,
            selected=["mullins_softening", "slack"]),
        Row("s", "h", "fault", "b", fault=faults.CONTROL, verdict="unexplained"),
    ]  # fmt: skip
    scores = fault_scores(rows)
    assert scores["found"]["of"] == 3  # a lag that was there before proves nothing
    assert scores["found"]["rate"] == pytest.approx(1 / 3)
    assert scores["with_a_false_name"]["rate"] == pytest.approx(1 / 3)
    # Slack comes although nothing was made; a name that goes is no new one.
    assert scores["new_without_a_fault"]["rate"] == 0.5
    assert scores["new_without_a_fault"]["of"] == 2
    # Of the second original alone is little left.
    assert scores["found_where_close"]["of"] == 1
    assert scores["found_where_close"]["rate"] == 0
    assert [c["left"] for c in scores["copies"]] == [0.06, 0.06, 0.04, 0.04]
    assert scores["copies"][2]["said"] == ["unexplained"]
    assert scores["copies"][1]["lost"] == ["mullins_softening"]


def test_wilson_interval():
    # Wilson 1927: the middle is drawn to a half, by z^2 more trials.
    w = rate(48, 50)
    z = 1.959964
    centre = (0.96 + z**2 / 100) / (1 + z**2 / 50)
    assert (w["low"] + w["high"]) / 2 == pytest.approx(centre)
    assert rate(0, 0)["rate"] is None
    assert rate(0, 5)["low"] == 0
