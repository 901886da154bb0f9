"""Rivals: the split against another route, names against planted terms, the scorer."""

from __future__ import annotations

import doctest
import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench import scoring
from bench.concealed import sealing
from bench.rivals import (
    classifier,
    columns,
    criteria,
    equations,
    extra,
    folds,
    methods,
    prediction,
    sparse,
    table,
    trial,
    tuning,
)
from bench.rivals.naming import UNMAPPED, Found, Rule, diagnosis
from bench.rivals.problem import read
from softnn.contracts import Chunk, InputError
from softnn.effects import EFFECTS
from softnn.mismatch import verify

SIGMA = 0.002  # MPa, of a stress that reaches 1 MPa
RATES = (0.02, 0.05, 0.1, 0.3)


def need(package: str) -> None:
    if not extra.present(package):
        pytest.skip(f"{package} is not installed; {extra.INSTALL} has it")


def cycle(rate: float, peak: float) -> tuple[np.ndarray, np.ndarray]:
    up = np.linspace(0, peak, 80)
    strain = np.concatenate([up, up[-2::-1], up[1:] * 0.8, 0.8 * up[-2::-1]])
    return np.cumsum(np.abs(np.diff(strain, prepend=0))) / rate, strain


def write(folder: Path, extra_MPa) -> Path:
    """Hooke specimens of 1 MPa, and what `extra_MPa(i, strain, way)` adds to them."""
    rng = np.random.default_rng(3)
    (folder / "recordings").mkdir(parents=True)
    (folder / "case.toml").write_text('model = "hooke"\n')
    for i, rate in enumerate(RATES):
        time, strain = cycle(rate, 1.0 - 0.1 * i)
        way = np.sign(np.gradient(strain))
        stress = strain + extra_MPa(i, strain, way)
        pd.DataFrame(
            {
                "time_s": time,
                "strain": strain,
                "stress_MPa": stress + SIGMA * rng.standard_normal(len(time)),
            }
        ).to_csv(folder / "recordings" / f"r{i}.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def null(tmp_path_factory):
    return read(write(tmp_path_factory.mktemp("null"), lambda i, e, w: 0 * e))


@pytest.fixture(scope="module")
def offset(tmp_path_factory):
    """One recording is 0.05 MPa too high."""
    made = write(tmp_path_factory.mktemp("offset"), lambda i, e, w: 0.05 * (i == 1))
    return read(made)


@pytest.fixture(scope="module")
def friction(tmp_path_factory):
    """0.04 MPa against the motion, whatever the strain."""
    return read(write(tmp_path_factory.mktemp("friction"), lambda i, e, w: 0.04 * w))


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """A spring that stiffens with the square of strain."""
    return read(write(tmp_path_factory.mktemp("bent"), lambda i, e, w: 0.4 * e**3))


def floor(problem) -> float:
    """NRMSE of the planted noise."""
    rms = math.sqrt(float(np.mean(problem.engine.target**2)))
    return SIGMA / rms


# --- the split ------------------------------------------------------------------------


def test_without_columns_the_split_is_that_of_the_diagnosis(offset):
    errors, squares = verify.heldout(offset.engine, offset.base.fit)
    own = folds.squares(offset.engine, offset.folds)
    assert own == pytest.approx(errors.sum(), rel=1e-12)
    assert folds.nrmse(offset.engine, own) == pytest.approx(
        verify.nrmse_of(errors, squares), rel=1e-12
    )


def test_a_column_is_refitted_without_the_recording_left_out(bent):
    strain = np.concatenate([c.strain for c in bent.engine.chunks])
    made = folds.of(bent.engine, bent.base.fit, strain[:, None] ** 3)
    # Second route: least squares over the other recordings, no non-negative bounds.
    for r, fold in enumerate(made):
        train = bent.engine.owner != r
        assert (fold.test == ~train).all()
        x = np.stack([strain, strain**3], axis=1) / bent.engine.sigma[:, None]
        y = bent.engine.target / bent.engine.sigma
        best, *_ = np.linalg.lstsq(x[train], y[train], rcond=None)
        expected = best @ np.stack([strain, strain**3])
        np.testing.assert_allclose(
            fold.stress[fold.test], expected[fold.test], atol=2e-3
        )


def test_what_a_recording_has_alone_comes_from_its_alternate_tenths(offset):
    one = np.ones((len(offset.engine.target), 1)) * (offset.engine.owner == 1)[:, None]
    alone = folds.of(offset.engine, offset.base.fit, one, np.array([1]))
    shared = folds.of(offset.engine, offset.base.fit, one, np.array([folds.SHARED]))
    error = folds.nrmse(offset.engine, folds.squares(offset.engine, alone))
    assert error == pytest.approx(floor(offset), rel=0.15)
    # As a column of all it is unknown without the one recording that has it.
    missed = folds.squares(offset.engine, shared)
    count = int((offset.engine.owner == 1).sum())
    assert missed > 0.8 * count * 0.05**2


# --- features and names ---------------------------------------------------------------


def test_doctests():
    for module in (columns, equations):
        assert doctest.testmod(module).failed == 0


def test_memory_of_a_step_fades_as_the_closed_form():
    time = np.linspace(0, 20, 401)
    strain = np.where(time > 0, 1.0, 0.0)
    lags = columns.memory(Chunk(time, strain))
    for j, tau in enumerate(columns.MEMORIES_S):
        np.testing.assert_allclose(lags[1:, j], 1 - np.exp(-time[1:] / tau), atol=1e-12)


def test_state_of_two_cycles():
    time, strain = cycle(0.1, 1.0)
    table = columns.state(Chunk(time, strain))
    assert table["largest_strain"][-1] == 1.0
    np.testing.assert_allclose(np.abs(table["rate"][1:]), 0.1, rtol=1e-9)
    assert set(table["direction"]) == {-1.0, 1.0}
    # Three reversals have been seen by the end: one and a half cycles.
    assert table["cycles"][-1] == pytest.approx(math.log10(2.5))


def test_rules_name_effects_that_exist():
    known = {e.id for e in EFFECTS}
    assert set(columns.RULES.values()) <= known
    assert (
        columns.meaning(["largest_strain", "direction"], known) == "mullins_softening"
    )
    assert columns.meaning(["simulated", "cycles"], known) == "cyclic_softening"
    assert columns.meaning(["simulated"], known) == "gain_error"
    assert columns.meaning(["direction"], []) == UNMAPPED


def test_shares_are_what_is_lost_without_a_name():
    x = np.eye(5)[:, [0, 1, 2]]
    target = np.array([3.0, 1.0, 2.0, 7.0, 0.0])
    shares = columns.shares(x, target, ["a", "a", "b"])
    assert shares == pytest.approx({"a": 10 / 14, "b": 4 / 14})
    # A copy under another name takes the loss away from both.
    twice = columns.shares(x[:, [0, 0, 2]], target, ["a", "c", "b"])
    assert twice["b"] == pytest.approx(1.0, abs=1e-6)
    assert columns.shares(np.zeros((5, 0)), target, []) == {}


@pytest.mark.parametrize(
    ("found", "verdict", "names"),
    [
        (Found({"slack": 1.0}, 0.04, 1.0), "nothing_missing", []),
        (Found({"slack": 0.9, "inertia": 0.1}, 0.9, 0.9), "explained", ["slack"]),
        (Found({"slack": 1.0}, 0.9, 0.4), "unexplained", []),
        (Found({"slack": 0.4, UNMAPPED: 0.6}, 0.9, 0.9), "unexplained", []),
        (Found({"slack": 0.7, UNMAPPED: 0.3}, 0.9, 0.9), "explained", ["slack"]),
    ],
)
def test_rule(found, verdict, names):
    assert Rule(0.2, 0.05, 0.5).verdict(found) == (verdict, names)
    said = diagnosis(found, Rule(0.2, 0.05, 0.5), 0.1, 1.0)
    assert said["selected"] == names
    assert diagnosis(found, Rule(), 0.1, 1.0, names=False)["verdict"] == "undetermined"


# --- methods --------------------------------------------------------------------------


def test_criterion_is_that_of_the_books(null):
    _, base = null.plain
    n = len(base.residual)
    gaussian = n * math.log(float(base.residual @ base.residual) / n)
    assert criteria.criterion(base, criteria.akaike(n)) == pytest.approx(gaussian + 2)
    assert criteria.criterion(base, criteria.schwarz(n)) == pytest.approx(
        gaussian + math.log(n)
    )


def test_bic_names_a_planted_offset_and_nothing_in_white_noise(offset, null):
    rng = np.random.default_rng(0)
    found = criteria.bic(offset, rng)
    assert list(found.shares) == ["zero_offset"]
    assert found.heldout_nrmse == pytest.approx(floor(offset), rel=0.15)
    assert criteria.bic(null, rng).shares == {}


@pytest.mark.parametrize("whitened", [False, True])
@pytest.mark.parametrize("name", ["lars", "omp", "abess"])
def test_columns_of_the_planted_effect_are_picked(name, whitened, offset):
    one = methods.method(name)
    if one.package:
        need(one.package)
    found = one.run(offset, np.random.default_rng(0), whitened=whitened)
    assert max(found.shares, key=found.shares.get) == "zero_offset"
    assert found.shares["zero_offset"] > 0.8
    assert found.heldout_nrmse == pytest.approx(floor(offset), rel=0.2)


def test_dictionary_says_whose_each_column_is(offset):
    book = offset.dictionary
    np.testing.assert_allclose(np.sqrt(np.mean(book.values**2, axis=0)), 1, rtol=1e-9)
    zero = [i for i, e in enumerate(book.effects) if e == "zero_offset"]
    assert sorted(book.own[zero]) == [0, 1, 2, 3]
    for i in zero:
        mine = offset.engine.owner == book.own[i]
        assert np.ptp(book.values[mine, i]) == pytest.approx(0, abs=1e-9)
        assert (book.values[~mine, i] == 0).all()


def test_nothing_selected_is_the_base():
    book = columns.Dictionary(np.ones((3, 2)), ("a", "b"), np.array([-1, -1]))
    kept = book.take(np.array([1]))
    assert kept.effects == ("b",)
    assert kept.values.shape == (3, 1)
    assert sparse.explained(2.0, 1.0, 1.0) == 1.0
    assert sparse.explained(4.0, 3.0, 0.0) == 0.25


def test_pysindy_finds_the_sign_of_the_rate(friction):
    need("pysindy")
    found = equations.pysindy(friction, np.random.default_rng(0))
    assert max(found.shares, key=found.shares.get) == "friction_hysteresis"
    before = folds.nrmse(
        friction.engine, folds.squares(friction.engine, friction.folds)
    )
    assert found.heldout_nrmse < 0.5 * before  # the corners are a sample off
    assert found.note.startswith(equations.optimiser_name())


def test_symbolic_regression_finds_the_sign_of_the_rate(friction):
    need("pyoperon")
    found = equations.symbolic(friction, np.random.default_rng(0), length=10)
    assert found.shares == {"friction_hysteresis": 1.0}
    assert found.gain > 0.75


def test_evidence_prefers_fewer_terms():
    left = np.full(100, 0.5)
    gap = equations.schwarz(left, 3) - equations.schwarz(left, 1)
    assert gap == pytest.approx(2 * math.log(100))


def test_gaussian_process_predicts_a_smooth_residual(bent):
    found = prediction.gaussian_process(bent, np.random.default_rng(0))
    before = folds.nrmse(bent.engine, folds.squares(bent.engine, bent.folds))
    # Inside the strains of the others it comes down to the noise; the largest
    # recording reaches a tenth beyond them.
    assert found.heldout_nrmse < 0.25 * before
    assert found.heldout_nrmse > 0.9 * floor(bent)
    assert found.shares == {}


@pytest.mark.slow
@pytest.mark.parametrize("run", [prediction.black_box, prediction.grey_box])
def test_network_of_history_learns_a_bent_spring(bent, run):
    found = run(bent, np.random.default_rng(0))
    before = folds.nrmse(bent.engine, folds.squares(bent.engine, bent.folds))
    assert found.heldout_nrmse < 0.5 * before


def test_classifier_answers_from_its_lessons_and_may_refuse(offset, null, tmp_path):
    seen = {
        "zero_offset": classifier.residual_features(offset),
        classifier.NOTHING: classifier.residual_features(null),
    }
    assert all(np.isfinite(v).all() for v in seen.values())
    index = [e.id for e in EFFECTS].index("zero_offset")
    # The columns of one recording of four take nearly all of what it misses.
    assert seen["zero_offset"][index] > 0.9 > 0.2 > seen[classifier.NOTHING][index]
    rng = np.random.default_rng(0)
    rows = [
        {"truth": t, "seen": (v + 0.01 * rng.standard_normal(len(v))).tolist()}
        for t, v in seen.items()
        for _ in range(20)
    ]
    path = tmp_path / "lessons.json"
    path.write_text(json.dumps(rows))
    sure = classifier.classifier(offset, rng, path)
    assert sure.shares == {"zero_offset": 1.0}
    assert sure.gain > 0.9
    assert classifier.classifier(null, rng, path).gain < 0.1
    assert Rule(0.0, 0.95, 0.0).verdict(Found({"slack": 1.0}, 0.9, 1.0))[1] == []


def test_a_missing_package_is_said_and_skipped(monkeypatch):
    def absent(package):
        return package != "pysindy"

    monkeypatch.setattr(methods, "present", absent)
    monkeypatch.setattr(extra, "present", absent)
    present, missing = trial.available(["softnn", "pysindy", "omp"])
    assert [m.name for m in present] == ["omp"]
    assert missing == {"pysindy": "pysindy"}
    with pytest.raises(InputError, match=r"pip install 'softnn\[rivals\]'"):
        extra.load("pysindy.optimizers")
    with pytest.raises(InputError, match="no rival is called 'oracle'"):
        trial.available(["oracle"])


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


def said(names, heldout=0.02, verdict=None, seconds=2.0):
    known = verdict or ("explained" if names else "nothing_missing")
    return {
        "verdict": known,
        "selected": names,
        "explanations": [],
        "mismatch": [],
        "fit": {"before": {"nrmse": 0.04}, "after": {"heldout_nrmse": heldout}},
        "seconds": seconds,
    }


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
