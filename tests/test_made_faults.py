"""Faults made in real recordings: what each is, and how it is scored."""

from dataclasses import replace

import numpy as np
import pytest
from recordings_made import SPRING, STIFFNESS, triangle
from scipy import stats

from bench.recordings import faults, groups, oracle, sets, slip, trial
from bench.recordings.rows import Row, fault_scores, rate
from softnn import Recording
from softnn.contracts import Chunk, InputError
from softnn.effects import effect
from softnn.fit import Guess, Piece
from softnn.mismatch.case import Case
from softnn.model_file import to_dict
from softnn.models.units import Units, build
from softnn.simulate import Term, simulate


def second_route(name, recording, **values):
    law = effect(name)
    term = Term(law, law.defaults() | values)
    chunk = Chunk(recording.time_s - recording.time_s[0], recording.strain)
    return simulate(SPRING, [STIFFNESS], [term], [chunk])[0]


# --- made faults ----------------------------------------------------------------------


def made(name, recording=None, size=1.0):
    recording = triangle() if recording is None else recording
    rig = faults.Rig((recording,))
    return faults.FAULTS[name].make(recording, size, rig)


def test_made_slack_is_a_gap_closed_at_the_speed_of_the_loading():
    loose, values = made("slack")
    assert loose.strain.max() == pytest.approx(0.5 * 1.05)
    assert values["gap"] == pytest.approx(0.025)
    np.testing.assert_allclose(
        np.gradient(loose.strain, loose.time_s)[:50], 0.1, rtol=1e-6
    )
    np.testing.assert_allclose(
        loose.stress_MPa, second_route("slack", loose, **values), atol=1e-9
    )


def test_the_cell_shows_its_noise_while_a_gap_is_closed():
    plain = triangle(step=0.002)
    noise = 0.01 * np.random.default_rng(0).standard_normal(len(plain))
    noisy = plain.with_step("noise", stress_MPa=plain.stress_MPa + noise)
    loose, _ = made("slack", noisy)
    lead = loose.stress_MPa[: len(loose) - len(plain)]
    assert np.std(lead) == pytest.approx(0.01, rel=0.2)


def test_a_slip_is_a_fall_of_force_at_a_steady_crosshead():
    plain = triangle(step=0.01)
    slid, values = made("slip", plain)
    np.testing.assert_array_equal(slid.strain, plain.strain)
    moment, end = values["moment_s"], values["moment_s"] + values["duration_s"]
    assert plain.strain[plain.time_s >= moment][0] == pytest.approx(0.35, abs=1e-9)
    before = slid.time_s < moment
    np.testing.assert_array_equal(slid.stress_MPa[before], plain.stress_MPa[before])
    during = slid.stress_MPa[(slid.time_s >= moment) & (slid.time_s < end)]
    assert len(during) > 5
    assert (np.diff(during) < 0).all()
    # From then on a spring bears what it bore at a strain smaller by 0.05.
    after = (slid.time_s > end) & (slid.strain > 0.05)
    np.testing.assert_allclose(
        slid.stress_MPa[after], STIFFNESS * (slid.strain[after] - 0.05), atol=1e-9
    )
    told = second_route("grip_slip", slid, **values)
    np.testing.assert_allclose(slid.stress_MPa[after], told[after], atol=1e-9)
    # Then it hangs loose.
    assert slid.stress_MPa.min() == 0


def test_a_slip_in_a_test_that_relaxes_lags_behind_on_its_own_branch():
    # A Maxwell branch: the second route is the same material at the strain it sees.
    time = np.arange(0, 60, 0.02)
    strain = np.interp(time, [0, 5, 30, 35], [0, 0.5, 0.5, 0.0])
    law = Units("sls", (0.0, 1.0), (8.0,))

    def stress(seen):
        return simulate(law, [1.0, 2.0], [], [Chunk(time, seen)])[0]

    plain = Recording(time, strain, stress(strain), name="r")
    slid, values = made("slip", plain)
    gone = (time - values["moment_s"]) / values["duration_s"]
    true = stress(strain - values["slip"] * np.clip(gone, 0, 1))
    taut = time < 33
    fallen = np.abs(true - plain.stress_MPa).max()
    assert fallen > 0.1 * plain.stress_MPa.max()
    # It slides faster than it was ever pulled, which no branch of it has seen.
    assert np.abs(slid.stress_MPa - true)[taut].max() < 0.3 * fallen


def test_a_slip_is_made_only_where_the_recording_tells_what_it_does():
    can = faults.FAULTS["slip"].can
    assert can(triangle())
    assert can(triangle(side=-1.0))
    assert not can(triangle(step=0.5))  # too few samples
    time = np.arange(0, 20, 0.05)
    both = 0.5 * np.sin(2 * np.pi * time / 20)
    assert not can(Recording(time, both, STIFFNESS * both))  # slides back
    sliding = triangle()
    flat = np.minimum(sliding.stress_MPa, 0.2)
    assert not can(sliding.with_step("slides", stress_MPa=flat))
    fault = faults.FAULTS["slip"]
    mixed = (Recording(time, both, STIFFNESS * both, name="b"), triangle())
    copy = faults.faulty(Case("c", mixed), fault, 1.0, np.random.default_rng(0))
    assert copy.recordings == (1,)


def test_ramps_and_holds_are_told_apart():
    time = np.arange(0, 60, 0.1)
    strain = np.interp(time, [0, 5, 25, 30, 50, 55], [0, 0.2, 0.2, 0.5, 0.5, 0.0])
    parts = slip.segments(time, strain)
    assert [p.held for p in parts if p.last - p.first > 3] == [
        False, True, False, True, False, True,
    ]  # fmt: skip


def test_made_lag_is_one_filter_that_machines_have():
    fast = triangle(step=0.005)
    lagging, values = made("lag", fast)
    told = second_route("sensor_lag", lagging, **values)
    np.testing.assert_allclose(lagging.stress_MPa, told, atol=1e-4)
    # A filter far faster than the samples changes nothing.
    np.testing.assert_allclose(
        made("lag", triangle(), 1e-4)[0].stress_MPa, triangle().stress_MPa, atol=1e-4
    )
    assert values["time_constant_s"] == pytest.approx(0.05 * 5.0, rel=0.01)
    slow = triangle(rate=0.001, step=1.0)
    rig = faults.Rig((fast, slow))
    each = [faults.lag(r, 1.0, rig)[1]["time_constant_s"] for r in (fast, slow)]
    assert each == pytest.approx([0.25, 0.25], rel=0.01)
    assert faults.lag(slow, 1.0, faults.Rig((slow,)))[1]["time_constant_s"] == 1.0


def test_a_drift_is_of_the_cell_and_the_same_in_all_recordings():
    short, long = triangle(), triangle(rate=0.01)
    rig = faults.Rig((short, long))
    each = [faults.drift(r, 1.0, rig) for r in (short, long)]
    rates = {v["drift_MPa_per_s"] for _, v in each}
    assert len(rates) == 1
    # 8 % of the peak by the end would be faster than a peak in ten minutes allows.
    assert rates.pop() == pytest.approx(rig.top / max(long.time_s[-1] / 0.08, 600))
    added = each[1][0].stress_MPa - long.stress_MPa
    assert added[-1] == pytest.approx(0.08 * rig.top, rel=0.01)


def test_made_errors_of_the_channel_have_their_sizes():
    plain = triangle()  # peak 1 MPa
    peak = faults.peak(plain)
    offset = made("offset", plain)[0].stress_MPa - plain.stress_MPa
    np.testing.assert_allclose(offset, 0.055 * peak)
    gain = made("gain", plain)[0].stress_MPa
    np.testing.assert_allclose(gain, 1.105 * plain.stress_MPa)
    clipped = made("clip", plain)[0].stress_MPa
    assert clipped.max() == pytest.approx(0.78 * peak)
    np.testing.assert_array_equal(
        clipped[plain.stress_MPa < 0.7], plain.stress_MPa[plain.stress_MPa < 0.7]
    )


def test_a_section_typed_wrong_is_one_specimen_among_its_siblings():
    five = tuple(triangle(name=str(i)) for i in range(5))
    fault = faults.FAULTS["section"]
    copy = faults.faulty(Case("c", five), fault, 1.0, np.random.default_rng(0))
    ratios = [
        r.stress_MPa.max() / five[0].stress_MPa.max() for r in copy.case.recordings
    ]
    assert len(copy.recordings) == 1
    assert ratios[copy.recordings[0]] == pytest.approx(2)
    assert sorted(ratios) == pytest.approx([1, 1, 1, 1, 2])
    assert fault.shows(five, specimens=True)
    assert not fault.shows(five, specimens=False)  # one specimen has one section
    assert not fault.shows(five[:3], specimens=True)


def test_drying_makes_a_held_stress_rise():
    time = np.linspace(0, 50, 501)
    strain = np.interp(time, [0, 1], [0, 0.5])
    held = Recording(time, strain, STIFFNESS * strain, name="held")
    dry = made("drying", held)[0].stress_MPa
    after = time > 1
    assert (np.diff(dry[after]) > 0).all()
    assert dry[-1] == pytest.approx(1.25 * held.stress_MPa[-1])
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
    copy = faults.faulty(case, faults.FAULTS["offset"], 1.0, rng)
    changed = [
        i
        for i, (a, b) in enumerate(
            zip(case.recordings, copy.case.recordings, strict=True)
        )
        if not np.array_equal(a.stress_MPa, b.stress_MPa)
    ]
    assert len(changed) == 2  # a third of six
    assert tuple(changed) == copy.recordings
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


def test_a_class_counts_as_a_name():
    viscous = {"name": "viscosity", "members": ["finite_strain", "nonlinear_viscosity"]}
    plain = Row("s", "g", "fault", "b", classes=[{**viscous, "probability": 0.95}])
    lag = {"fault": "lag", "expected": "sensor_lag"}
    either = {"name": "", "members": ["sensor_lag", "inertia"], "probability": 0.93}
    rows = [
        plain,
        # One of the class is no news; the right class is found, the wrong one false.
        Row("s", "g", "fault", "b", **lag, selected=["finite_strain"],
            classes=[either]),
        Row("s", "g", "fault", "b", **lag, selected=["sensor_lag", "slack"],
            probability={"sensor_lag": 0.95, "slack": 0.6}),
        Row("s", "g", "fault", "b", **lag,
            classes=[{"name": "", "members": ["slack", "permanent_set"],
                      "probability": 0.92}]),
    ]  # fmt: skip
    scores = fault_scores(rows)
    assert [c["found"] for c in scores["copies"]] == [True, True, False]
    assert [c["false"] for c in scores["copies"]] == [
        [], ["slack"], ["permanent_set or slack"]
    ]  # fmt: skip
    # Slack at 0.6 is no sure name.
    assert scores["with_a_false_name"]["right"] == 2
    assert scores["with_a_sure_false_name"]["right"] == 1


def test_what_no_oracle_sees_is_counted_apart():
    lag = {"fault": "lag", "expected": "sensor_lag"}
    rows = [
        Row("s", "g", "fault", "b"),
        Row("s", "g", "fault", "b", **lag, selected=["sensor_lag"],
            oracle={"seen": True}),
        Row("s", "g", "fault", "b", **lag, oracle={"seen": False}),
        Row("s", "g", "fault", "b", **lag),
    ]  # fmt: skip
    scores = fault_scores(rows)
    assert (scores["seen_by_oracle"]["right"], scores["seen_by_oracle"]["of"]) == (1, 2)
    assert (scores["found_of_seen"]["right"], scores["found_of_seen"]["of"]) == (1, 1)
    assert scores["found"]["of"] == 3
    assert scores["by_fault_seen"]["lag"]["of"] == 2


# --- the oracle -----------------------------------------------------------------------


def bent_case(count=4):
    """Springs that stiffen, each a little in its own way, so that the base errs."""
    rng = np.random.default_rng(3)
    out = []
    for i in range(count):
        plain = triangle(name=f"r{i}", step=0.1, top=0.5 + 0.02 * i)
        bent = STIFFNESS * plain.strain * (1 + (0.3 + 0.05 * i) * plain.strain)
        wave = 0.01 * np.sin(9 * plain.strain + i)
        noise = 0.002 * rng.standard_normal(len(plain))
        out.append(plain.with_step("bent", stress_MPa=bent + wave + noise))
    return Case("bent", tuple(out))


@pytest.mark.parametrize("name", ["offset", "lag", "slip", "slack", "clip"])
def test_the_oracle_sees_a_large_fault_and_not_a_hundredth_of_one(name):
    case, fault = bent_case(), faults.FAULTS[name]
    units = build("pl-sls", 0.0, 0.6, 0.1, 10.0)
    model = to_dict(Guess(units, np.ones(units.columns)), [], "fresh", False)
    seen = []
    for size in (0.01, 3.0):
        copy = faults.faulty(case, fault, size, np.random.default_rng(1))
        told = oracle.asked(copy, fault, "pl-sls", model)
        seen.append(told["seen"])
    assert seen == [False, True]
    assert told["after"] < told["before"]


def test_readings_at_one_limit_need_no_law_to_be_seen():
    # A base of many segments bends in place of the limit.
    case, fault = bent_case(), faults.FAULTS["clip"]
    copy = faults.faulty(case, fault, 1.0, np.random.default_rng(1))
    assert oracle.flat(case) < oracle.FLAT <= oracle.flat(copy.case)
    units = build("pl-sls", 0.0, 0.6, 0.1, 10.0)
    model = to_dict(Guess(units, np.ones(units.columns)), [], "fresh", False)
    told = oracle.asked(copy, fault, "pl-sls", model)
    assert told["chance"] > oracle.CHANCE
    assert told["seen"]


def test_the_oracle_takes_a_section_as_an_outlier_among_siblings():
    case, fault = bent_case(5), faults.FAULTS["section"]
    case = replace(case, specimen={r.name: r.name for r in case.recordings})
    model = to_dict(Guess(SPRING, np.array([STIFFNESS])), [], "fresh", False)
    seen = [
        oracle.asked(
            faults.faulty(case, fault, size, np.random.default_rng(1)),
            fault, "hooke", model,
        )["seen"]
        for size in (0.01, 3.0)
    ]  # fmt: skip
    assert seen == [False, True]


def test_the_oracle_is_not_asked_for_what_the_original_has():
    case, fault = bent_case(), faults.FAULTS["lag"]
    there = Guess(SPRING, np.array([STIFFNESS]))
    law = effect("sensor_lag")
    piece = Piece(law, law.defaults() | {"time_constant_s": 0.1}, ())
    model = to_dict(replace(there, pieces=(piece,)), [], "fresh", False)
    copy = faults.faulty(case, fault, 1.0, np.random.default_rng(1))
    assert oracle.asked(copy, fault, "hooke", model) == {}


def test_a_gain_is_held_against_the_scatter_of_its_folds():
    ones = np.ones(5)
    better = np.array([0.5, 0.8, 0.6, 0.9, 0.7]) ** 2
    found = oracle.paired(
        np.column_stack([ones, ones]), np.column_stack([better, ones])
    )
    apart = -np.log(np.sqrt(better) + 1e-3) + np.log(1 + 1e-3)
    assert found.gain == pytest.approx(apart.mean())
    same = stats.ttest_1samp(apart, 0.0, alternative="greater")
    assert found.chance == pytest.approx(same.pvalue)
    assert found.seen
    assert not found.beyond(found).seen  # the original gains as much


def test_wilson_interval():
    # Wilson 1927: the middle is drawn to a half, by z^2 more trials.
    w = rate(48, 50)
    z = 1.959964
    centre = (0.96 + z**2 / 100) / (1 + z**2 / 50)
    assert (w["low"] + w["high"]) / 2 == pytest.approx(centre)
    assert rate(0, 0)["rate"] is None
    assert rate(0, 5)["low"] == 0
