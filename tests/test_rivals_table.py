"""What is said of rivals: tuning, scores, the table, the command."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rivals_made import said, write

from bench import scoring
from bench.concealed import sealing
from bench.rivals import (
    methods,
    table,
    trial,
    tuning,
)
from bench.rivals.naming import Found, Rule

# --- tuning and table -----------------------------------------------------------------


def test_best_rule_parts_what_can_be_parted():
    def looked(group, effects, **found):
        return {"group": group, "effects": effects}, Found(**found)

    cases = [
        looked("single", ["slack"], shares={"slack": 0.8}, gain=0.6, explained=0.92),
        looked("null", [], shares={"slack": 0.8}, gain=0.15, explained=0.92),
        looked("unlisted", ["hum"], shares={"slack": 0.8}, gain=0.6, explained=0.45),
    ]
    rule, value, rates = tuning.best_rule(cases)
    assert value == 1.0
    assert rates == {"single": 1.0, "null": 1.0, "unlisted": 1.0}
    assert 0.15 <= rule.least < 0.6
    assert 0.45 < rule.enough <= 0.92
    assert rule.share <= 0.8


def test_tuning_is_for_development_seeds(capsys):
    assert tuning.main(["--seed", "10000"]) == 2
    assert "below 10000" in capsys.readouterr().err


def test_tuned_settings_fit_their_methods():
    for one in methods.METHODS:
        options, rule = methods.settings(one)
        assert options in [dict(o) for o in one.options]
        assert isinstance(rule, Rule)
    assert set(methods.tuned()) <= {m.name for m in methods.METHODS if m.tuned}


KEYS = [
    {"case": "a", "group": "single", "effects": ["slack"], "noise_nrmse": 0.01},
    {"case": "b", "group": "single", "effects": ["inertia"], "noise_nrmse": 0.01},
    {"case": "c", "group": "null", "effects": [], "noise_nrmse": 0.01},
    {"case": "d", "group": "unlisted", "effects": ["hum"], "noise_nrmse": 0.01},
]


def test_scores_counted_by_hand():
    given = {
        "a": said(["slack"]),
        "b": said(["slack", "inertia"], heldout=0.04),
        "c": said([], verdict="unexplained"),
        "d": said(["slack"], seconds=4.0),
    }
    row = table.scores(KEYS, given, {"a": False, "b": True, "c": True, "d": True})
    counts = {k: (row[k]["right"], row[k]["of"]) for k in ("right", "accepted")}
    assert counts == {"right": (1, 2), "accepted": (0, 1)}
    # To find something where nothing is missing is an alarm, named or not.
    assert (row["alarms"]["right"], row["named_nulls"]["right"]) == (1, 0)
    assert row["wrong"]["right"] == 1
    assert row["heldout_nrmse"] == pytest.approx(0.03)
    assert row["over_floor"] == pytest.approx(3.0)
    assert row["seconds"] == 2.0
    assert (row["right"]["low"], row["right"]["high"]) == scoring.wilson(1, 2)
    mute = table.scores(KEYS, given, dict.fromkeys("abcd", True), names=False)
    assert mute["right"] is None
    assert mute["heldout_nrmse"] == pytest.approx(0.03)


def test_the_table_says_where_a_rival_wins():
    good = {
        k["case"]: said(k["effects"] if k["group"] == "single" else []) for k in KEYS
    }
    poor = good | {"a": said([], heldout=0.015), "b": said([], heldout=0.015)}
    flags = dict.fromkeys("abcd", True)
    rows = {
        "softnn": table.scores(KEYS, good, flags),
        "omp": table.scores(KEYS, poor, flags),
    }
    found = {w["column"]: w for w in table.wins(rows)}
    assert set(found) == {"heldout_nrmse", "over_floor"}
    text = table.as_markdown(rows, {"omp": "OMP"})
    assert "OMP beats softnn on held-out NRMSE: 0.015 against 0.02" in text
    assert "100 % (34 % to 100 %) *" in text  # Wilson interval of 2 of 2
    assert "No rival beats softnn" in table.as_markdown({"softnn": rows["softnn"]}, {})


def test_held_out_errors_are_compared_case_by_case():
    own = {"a": said(["slack"], 0.02), "b": said([], 0.04), "c": said([], 9.0)}
    other = {"a": said([], 0.01), "b": said([], 0.04), "c": said([], 1.0)}
    found = table.paired(KEYS[:3], own, other)
    assert found["of"] == 2  # a null is nobody's effect
    assert found["ratio"] == pytest.approx(2**0.5)
    # Two cases drawn with replacement: each alone one time in four.
    assert (found["low"], found["high"]) == pytest.approx((1.0, 2.0))
    mute = {key: {"verdict": "no diagnosis"} for key in "abc"}
    assert table.paired(KEYS[:3], own, mute) is None


@pytest.mark.parametrize(("errors", "apart"), [((1.5, 1.6), True), ((0.8, 4), False)])
def test_a_better_median_may_be_within_the_intervals(errors, apart):
    own = {k["case"]: said(k["effects"][:1], 0.02) for k in KEYS}
    other = {
        k["case"]: said(k["effects"][:1], 0.02 / e)
        for k, e in zip(KEYS, [*errors, 1, 1], strict=True)
    }
    flags = dict.fromkeys("abcd", True)
    rows = {
        n: table.scores(KEYS, g, flags) for n, g in (("softnn", own), ("bic", other))
    }
    rows["bic"]["paired"] = table.paired(KEYS, own, other)
    (won,) = [w for w in table.wins(rows) if w["column"] == "over_floor"]
    assert won["apart"] is apart
    text = table.as_markdown(rows, {})
    assert ("within the intervals" in text) is not apart
    assert f"{rows['bic']['paired']['ratio']:.2f} (" in text


def test_figure_shows_those_that_name():
    flags = dict.fromkeys("abcd", True)
    given = {k["case"]: said(k["effects"]) for k in KEYS}
    rows = {
        "softnn": table.scores(KEYS, given, flags),
        "black_box": table.scores(KEYS, given, flags, names=False),
    }
    (axes,) = table.figure(rows, {}).axes
    assert [t.get_text() for t in axes.texts] == ["softnn"]


# --- the command ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--methods", "oracle"], "no rival is called 'oracle'"),
        (["--only", "gravity"], "no effect is called 'gravity'"),
        (["--strength", "0"], "it must be above 0"),
        (["--resume", "nowhere"], "holds no record.json"),
        (["--jobs", "0"], "at least 1 is needed"),
    ],
)
def test_refused_in_one_line(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert trial.main(arguments) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "mlruns").exists()


def test_a_rival_that_fails_is_not_answered(tmp_path, monkeypatch):
    case = write(tmp_path / "cases" / "case-1", lambda i, e, w: 0 * e)

    def broken(*_):
        raise np.linalg.LinAlgError("singular")

    monkeypatch.setattr(methods, "answer", broken)
    trial.answer_case(str(tmp_path), str(case), ["omp"], 0, None)
    kept = json.loads(trial.answer_file(tmp_path, "omp", case).read_text())
    assert kept["verdict"] == "no diagnosis"
    assert "singular" in kept["error"]
    before = trial.seal_answers(tmp_path)
    trial.answer_file(tmp_path, "omp", case).write_text("{}")
    assert trial.seal_answers(tmp_path) != before


def test_answers_are_scored_and_written(tmp_path, monkeypatch, capsys):
    """The whole way with one quick rival, softnn's answers and MLflow stood in for."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "trial"

    def diagnose(where, record, jobs, timed):
        for case in (where / "cases").iterdir():
            out = where / "diagnoses" / case.name
            out.mkdir(parents=True)
            (out / "diagnosis.json").write_text(json.dumps(said(["zero_offset"])))

    tracked = []
    monkeypatch.setattr(trial, "diagnose_rest", diagnose)
    monkeypatch.setattr(table, "track", lambda *a: tracked.append(a))
    run = ["--smoke", "--jobs", "1", "--out", str(folder), "--methods", "softnn", "omp"]
    assert trial.main(run) == 0
    result = json.loads((folder / "rivals.json").read_text())
    rows = result["trials"]["strength-1"]["table"]
    # It always says zero offset: right where that was planted, wrong on the rest.
    counts = {k: rows["softnn"][k]["right"] for k in ("right", "alarms", "wrong")}
    assert counts == {"right": 1, "alarms": 1, "wrong": 1}
    assert rows["omp"]["failed"] == 0
    assert rows["omp"]["seconds"] > 0
    assert (folder / "rivals-strength-1.png").exists()
    assert "held-out NRMSE" in capsys.readouterr().out
    assert tracked[0][0]["answers_sha256"] == trial.seal_answers(folder)


@pytest.mark.slow
def test_smoke_seals_answers_before_the_key_is_opened(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "trial"
    wanted = ["softnn", "omp", "gaussian_process"]
    opened = []
    open_as_it_is = sealing.open_key

    def open_key(where):
        record = json.loads((where / "record.json").read_text())
        answers = list((where / "answers").rglob("*.json"))
        assert len(answers) == 3 * 2
        assert record["answers_sha256"] == trial.seal_answers(where)
        opened.append(where)
        return open_as_it_is(where)

    monkeypatch.setattr(sealing, "open_key", open_key)
    run = ["--smoke", "--jobs", "1", "--out", str(folder), "--methods", *wanted]
    assert trial.main(run) == 0
    assert opened == [folder]
    result = json.loads((folder / "rivals.json").read_text())
    rows = result["trials"]["strength-1"]["table"]
    assert list(rows) == wanted
    assert rows["gaussian_process"]["right"] is None
    assert rows["omp"]["heldout_nrmse"] > 0
    assert (
        result["headline"]["strength-1/softnn/right"] == rows["softnn"]["right"]["rate"]
    )

    # Resumed, only what is missing is answered again.
    answers = sorted((folder / "answers").rglob("*.json"))
    answers[0].unlink()
    times = [f.stat().st_mtime_ns for f in answers[1:]]
    assert trial.main(["--resume", str(folder), "--jobs", "1"]) == 0
    assert answers[0].exists()
    assert [f.stat().st_mtime_ns for f in answers[1:]] == times
