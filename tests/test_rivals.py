"""Rivals: the split against another route, names against planted terms, the scorer."""

from __future__ import annotations

import doctest
import json
import math

import numpy as np
import pytest
from rivals_made import SIGMA, cycle, write

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
    trial,
)
from bench.rivals.naming import UNMAPPED, Found, Rule, diagnosis
from bench.rivals.problem import read
from softnn.contracts import Chunk, InputError
from softnn.effects import EFFECTS
from softnn.mismatch import verify


def need(package: str) -> None:
    if not extra.present(package):
        pytest.skip(f"{package} is not installed; {extra.INSTALL} has it")


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
    left_out = verify.heldout(offset.engine, offset.base.fit)
    own = folds.squares(offset.engine, offset.folds)
    assert own == pytest.approx(left_out.errors.sum(), rel=1e-12)
    assert folds.nrmse(offset.engine, own) == pytest.approx(left_out.nrmse, rel=1e-12)


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
    level = []  # of which recordings there is a column that is the same all through
    for i in zero:
        mine = offset.engine.owner == book.own[i]
        assert (book.values[~mine, i] == 0).all()
        if np.ptp(book.values[mine, i]) < 1e-9:
            level.append(book.own[i])
    assert sorted(level) == [0, 1, 2, 3]


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
