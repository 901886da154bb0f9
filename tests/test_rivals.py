"""Rivals on real recordings: fits against closed forms, fair splits, table by hand."""

from __future__ import annotations

import doctest
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.recordings.groups import Split
from bench.recordings.predict import misses, misses_of
from bench.recordings.virtual import made_up
from bench.rivals import features, laws, learners, methods, page, table, trial
from bench.rivals.choice import Method, judged, least
from bench.rivals.features import SETS, Features
from bench.rivals.network_b import BergstroemBoyce, flow
from bench.rivals.problem import (
    Problem,
    inner_folds,
    problem_of,
    specimen_scales,
    without,
)
from softnn.contracts import Chunk, InputError
from softnn.fit import Data
from softnn.mismatch.case import to_data
from softnn.model_file import from_dict, to_dict
from softnn.recording import Recording

RATES = (0.01, 0.1, 1.0)


def course(rate: float, peak: float = 0.4, samples: int = 160) -> Chunk:
    """Up at a rate, a hold of ten ramps, and down again."""
    ramp = peak / rate
    time = np.concatenate([np.linspace(0, 12 * ramp, samples), [ramp, 11 * ramp]])
    time = np.unique(time)
    return Chunk(
        time, np.interp(time, [0, ramp, 11 * ramp, 12 * ramp], [0, peak, peak, 0])
    )


def maxwell(chunk: Chunk, measure, tau: float, modulus: float, spring: float):
    """Spring and Maxwell branch on a measure of strain, summed on a fine clock."""
    fine = np.linspace(0, chunk.time_s[-1], 40001)
    e = measure(np.interp(fine, chunk.time_s, chunk.strain))
    q, out = 0.0, np.zeros(len(fine))
    keep = np.exp(-(fine[1] - fine[0]) / tau)
    for i in range(1, len(fine)):
        q = q * keep + (e[i] - e[i - 1]) * np.sqrt(keep)
        out[i] = q
    return np.interp(chunk.time_s, fine, spring * e + modulus * out)


def data_of(stress, rates=RATES) -> Data:
    chunks = tuple(course(r) for r in rates)
    made = tuple(np.asarray(stress(c)) for c in chunks)
    return Data(tuple(f"r{r}" for r in rates), chunks, made)


def error(predict, data: Data) -> float:
    pairs = zip(predict(data.chunks), data.stress_MPa, strict=True)
    top = sum(float(np.sum((s - y) ** 2)) for s, y in pairs)
    return float(np.sqrt(top / sum(float(np.sum(y**2)) for y in data.stress_MPa)))


RNG = np.random.default_rng(0)


def test_doctests():
    assert doctest.testmod(features).failed == 0


# --- fits against laws computed another way -------------------------------------------


@pytest.mark.parametrize(
    ("law", "measure"),
    [
        ("linear", lambda e: e),
        ("fung", lambda e: np.expm1(4 * e) / 4),
        ("yeoh", lambda e: laws.yeoh(e, np.array([0.4, 0.1]))),
    ],
)
def test_quasi_linear_fits_recover_an_unseen_rate(law, measure):
    every = data_of(lambda c: maxwell(c, measure, 3.0, 2.0, 1.0))
    known = without(
        every,
        (every.stress_MPa[0] < -1, every.stress_MPa[1] < 9, every.stress_MPa[2] < -1),
    )
    assert np.isnan(known.stress_MPa[1]).all()
    predict = laws.quasi_linear(known, RNG, law, 3)
    assert error(predict, every) < 0.02
    if law != "linear":  # a bent law is not a straight one
        straight = laws.quasi_linear(known, RNG, "linear", 3)
        assert error(straight, every) > 3 * error(predict, every)


def test_yeoh_is_neo_hooke_without_its_bend():
    e = np.linspace(-0.3, 1, 20)
    expected = ((1 + e) - (1 + e) ** -2) / 3
    np.testing.assert_allclose(laws.yeoh(e, np.zeros(2)), expected, rtol=1e-12)
    np.testing.assert_allclose(laws.fung(e, np.array([1e-9])), e, rtol=1e-12)


def test_ogden_roxburgh_fits_its_own_softening():
    """Softer below the largest strain: doi:10.1098/rspa.1999.0431."""
    from scipy.special import erf

    def made(chunk):
        e = chunk.strain
        top = np.maximum.accumulate(e)
        work = (top**2 - e**2) / (0.02 + 0.7 * top**2)
        return 2 * e * (1 - 0.5 * erf(np.maximum(work, 0)))

    times = [np.linspace(0, 10 * k, 200) for k in (1, 2, 3)]
    chunks = tuple(
        Chunk(t, np.interp(t / t[-1], [0, 0.25, 0.5, 0.75, 1], [0, 0.3, 0, p, 0]))
        for t, p in zip(times, (0.3, 0.5, 0.4), strict=True)
    )
    data = Data(("a", "b", "c"), chunks, tuple(made(c) for c in chunks))
    soft = laws.ogden_roxburgh(data, RNG, "piecewise", 1)
    assert error(soft, data) < 0.03
    assert error(laws.piecewise(data, RNG, "pl-wiechert", 8, 1), data) > 0.1


def test_network_b_relaxes_as_a_maxwell_element_at_small_strain():
    """With m = 1 and C = 0 flow is linear: ln(stretch) decays at the rate."""
    time = np.linspace(0, 4, 4001)
    stretch = np.full(len(time), np.exp(1e-3))
    out = np.empty(len(time))
    flow(time, stretch, 0.5, 0.0, 1.0, out)
    np.testing.assert_allclose(out, 1e-3 * np.exp(-0.5 * time), rtol=2e-3)


def test_network_b_steps_converge_in_the_first_order():
    ends = []
    for n in (200, 400, 800, 6400):
        time = np.linspace(0, 4, n + 1)
        out = np.empty(n + 1)
        flow(time, 1 + 0.5 * time / 4, 40.0, -0.5, 3.0, out)
        ends.append(out[-1])
    off = np.abs(np.array(ends[:3]) - ends[3])
    assert off[0] / off[1] == pytest.approx(2, abs=0.4)


def test_bergstroem_boyce_fits_its_own_stress():
    own = BergstroemBoyce(2.0, 1.5, 0.2, 2.0, -0.5, 0.1, 0.0)
    data = data_of(own.stress)
    predict = laws.bergstroem_boyce(data, RNG)
    assert error(predict, data) < 0.02


def test_piecewise_fit_is_the_base_of_the_diagnosis():
    """The rival PL-Wiechert by least squares, as `softnn diagnose` fits its base."""
    data = data_of(lambda c: maxwell(c, lambda e: e + e**2, 3.0, 2.0, 1.0))
    assert error(laws.piecewise(data, RNG, "pl-wiechert", 16, 3), data) < 0.03
    assert error(laws.piecewise(data, RNG, "pl-sls", 16), data) < 0.05


# --- learners -------------------------------------------------------------------------


def test_memories_are_what_a_maxwell_branch_has_lost():
    data = data_of(lambda c: c.strain)
    found = Features.of(data, SETS["state"])
    assert len(found.labels()) == found.raw(data.chunks[0]).shape[1]
    assert "temperature" not in found.names  # no recording has it
    held = Chunk(np.linspace(0, 5, 11), np.ones(11))
    tau = found.times_s[3]
    column = found.raw(held)[:, found.labels().index("memory4")]
    np.testing.assert_allclose(column, 1 - np.exp(-held.time_s / tau), atol=1e-12)


def test_features_know_nothing_of_what_comes():
    data = data_of(lambda c: c.strain)
    found, whole = Features.of(data, SETS["state"]), data.chunks[0]
    cut = Chunk(whole.time_s[:70], whole.strain[:70])
    np.testing.assert_allclose(found.at(cut), found.at(whole)[:70], atol=1e-12)


@pytest.mark.parametrize("on_base", [False, True])
@pytest.mark.parametrize(
    ("fit", "options", "enough"),
    [
        (learners.trees, {"leaves": 6}, 0.1),
        (learners.gaussian_process, {"inputs": "memory"}, 0.02),
        (learners.network, {"inputs": "memory", "neurons": 3, "starts": 1}, 0.02),
        (learners.pysindy, {"inputs": "memory", "degree": 1, "threshold": 0.0}, 0.02),
    ],
)
def test_learners_learn_a_linear_solid(fit, options, enough, on_base):
    if fit is learners.pysindy and methods.missing(methods.chosen(["pysindy"])[0]):
        pytest.skip(f"pysindy is not installed; {methods.INSTALL} has it")
    data = data_of(lambda c: maxwell(c, lambda e: e, 3.0, 2.0, 1.0), (0.05, 0.1, 0.2))
    predict = fit(data, np.random.default_rng(1), **options, on_base=on_base)
    assert error(predict, data) < enough


# --- splits and measure ---------------------------------------------------------------


def recording(rate: float, name: str, peak: float = 0.4) -> Recording:
    chunk = course(rate, peak)
    return Recording(chunk.time_s, chunk.strain, 2 * chunk.strain, name=name)


def test_replicates_are_left_out_together():
    rates = (0.01, 0.01, 0.1, 1.0)
    some = [recording(r, f"r{i}") for i, r in enumerate(rates)]
    data = Data(
        tuple(r.name for r in some),
        tuple(r.history for r in some),
        tuple(r.stress_MPa for r in some),
    )
    out = inner_folds(some, Split("rate", "", (), ()), data)
    left = [[i for i, m in enumerate(fold) if m.all()] for fold in out]
    assert left == [[0, 1], [2], [3]]
    alone = inner_folds(some, Split("specimen", "", (), ()), data)
    assert [sum(m.all() for m in fold) for fold in alone] == [1, 1, 1, 1]
    (one,) = some[:1]
    single = Data((one.name,), (one.history,), (one.stress_MPa,))
    parts = inner_folds([one], Split("rate", "", (), ()), single)
    assert np.sum([fold[0] for fold in parts], axis=0).tolist() == [1] * len(one)


def test_nothing_of_what_is_predicted_or_left_out_reaches_a_fit():
    (group,) = made_up(3)
    problem = problem_of(group, group.splits[0], 200)
    spoiled = replace(
        problem,
        unseen=replace(
            problem.unseen, stress_MPa=tuple(9 * s for s in problem.unseen.stress_MPa)
        ),
        scaled=False,
    )
    one = methods.chosen(["trees"])[0]
    a, b = (
        judged(replace(one), replace(problem, scaled=False), 0),
        judged(one, spoiled, 0),
    )
    assert a["inner_nrmse"] == b["inner_nrmse"]
    assert a["nrmse"] != b["nrmse"]
    fold = problem.folds[0]
    stress = [
        np.where(m, 77.0, s)
        for s, m in zip(problem.known.stress_MPa, fold, strict=True)
    ]
    other = replace(problem.known, stress_MPa=tuple(stress))
    pair = zip(
        without(problem.known, fold).stress_MPa,
        without(other, fold).stress_MPa,
        strict=True,
    )
    assert all(np.array_equal(x, y, equal_nan=True) for x, y in pair)


def test_specimens_are_brought_to_one_scale():
    data = data_of(lambda c: maxwell(c, lambda e: e, 3.0, 2.0, 1.0))
    factors = (1.0, 1.2, 0.8)
    scaled = replace(
        data,
        stress_MPa=tuple(k * s for k, s in zip(factors, data.stress_MPa, strict=True)),
    )
    found = specimen_scales(scaled, [(0,), (1,), (2,)])
    np.testing.assert_allclose(np.array(found) / found[0], factors, rtol=0.02)
    assert 1.0 in found  # that of the specimen to which scales refer
    assert specimen_scales(data, []) == [1.0] * 3


def test_rivals_are_measured_as_softnn_is():
    (group,) = made_up(3)
    split = group.splits[0]
    problem = problem_of(group, split, 200)
    from bench.rivals.problem import least_squares
    from softnn.mismatch.base import units_for

    found = least_squares(problem.known, units_for("pl-sls", problem.known))
    model = to_dict(found.guess, problem.known.names, "fresh", False)
    case = group.case(split.unseen)
    own = misses({"m": model}, case, True)
    none = [None] * len(problem.unseen.chunks)
    stress = from_dict(model).stress(problem.unseen.names, to_data(case).chunks, none)
    mine = misses_of({"m": stress}, to_data(case), True)
    assert all(np.array_equal(own[k], mine[k]) for k in own)
    by_hand = 0.0
    data = to_data(case)
    for s, y, share in zip(stress, data.stress_MPa, data.weights, strict=True):
        factor = (share * s @ y) / (share * s @ s)
        by_hand += float(share @ (y - factor * s) ** 2)
    assert own["m"].sum() == pytest.approx(by_hand, rel=1e-9)


def test_a_rival_that_fails_is_said_and_counts_as_the_worst():
    def broken(data, rng):
        raise ValueError("no inverse")

    (group,) = made_up(3)
    problem = problem_of(group, group.splits[0], 200)
    told = judged(Method("broken", "", broken), problem, 0)
    assert told["nrmse"] is None
    assert told["error"] == "no inverse"
    assert table.capped(None) == table.WORST
    wild = Method(
        "wild", "", lambda d, r: lambda cs: [np.full(len(c.strain), np.nan) for c in cs]
    )
    assert judged(wild, problem, 0)["nrmse"] is None


# --- table, page and command ----------------------------------------------------------


def rows_by_hand():
    errors = [
        {
            "base": 0.2,
            "softnn": 0.1,
            "a": 0.05,
            "b": 0.2,
            table.BEST_LAW: 0.2,
            table.ANY: 0.2,
        },
        {
            "base": 0.2,
            "softnn": 0.1,
            "a": 0.4,
            "b": None,
            table.BEST_LAW: 0.4,
            table.ANY: 0.4,
        },
    ]
    about = {"set": "foam", "group": "", "split": "rate", "outside": False}
    return [about | {"label": str(i), "errors": e} for i, e in enumerate(errors)]


def test_summary_by_hand():
    found = table.summary(rows_by_hand())
    assert found["a"]["ratio"] == pytest.approx(np.sqrt(0.5 * 4))
    assert found["a"]["median"] == pytest.approx(0.225)
    assert (found["a"]["ahead"], found["a"]["best"], found["a"]["of"]) == (1, 1, 2)
    assert found["b"]["ratio"] == pytest.approx(np.sqrt(2 * 10))
    assert found["b"]["failed"] == 1
    assert found["base"]["ratio"] == pytest.approx(2)
    assert (found["softnn"]["ratio"], found["softnn"]["best"]) == (1, 1)
    # Each prediction is better once and worse once: the interval holds both.
    assert found["a"]["ratio_low"] == pytest.approx(0.5)
    assert found["a"]["ratio_high"] == pytest.approx(4)
    said = table.verdict(found, {"a": "rival a"})
    assert said.startswith("No rival is ahead of softnn")
    assert "within the scatter: rival a." in said
    found["a"]["ratio"] = 0.9
    assert "Ahead of softnn by the geometric mean: rival a." in table.verdict(
        found, {"a": "rival a"}
    )


def test_no_error_counts_as_more_than_that_of_no_stress():
    (row, _) = rows_by_hand()
    row["errors"] |= {"softnn": 3.0, "a": 2.0, "b": 0.5}
    found = table.summary([row])
    assert found["a"]["ratio"] == pytest.approx(1)
    assert found["b"]["ratio"] == pytest.approx(0.5)
    # Which is better is told by the errors as they are.
    assert (found["a"]["ahead"], found["a"]["median"]) == (1, 2.0)


def test_predictions_of_both_studies_are_joined_by_what_they_predict():
    rivals = [{**r, "errors": {"a": 0.3}} for r in rows_by_hand()]
    own = [{**r, "unseen": {"before": 0.2, "after": 0.1}} for r in rows_by_hand()[:1]]
    (row,) = table.joined(rivals, own)
    assert row["errors"] == {"base": 0.2, "softnn": 0.1, "a": 0.3}


def test_the_pick_is_by_the_inner_folds_alone():
    rows = [
        {"method": "a", "nrmse": 0.5, "inner_nrmse": 0.1},
        {"method": "b", "nrmse": 0.1, "inner_nrmse": 0.2},
        {"method": "c", "nrmse": None, "inner_nrmse": 0.0},
    ]
    assert least(rows, ["a", "b", "c"])["method"] == "a"
    assert least(rows, ["c"])["nrmse"] is None


def test_the_page_tells_every_prediction(tmp_path):
    rows = rows_by_hand()
    found = {
        "predictions": rows,
        "summary": table.summary(rows),
        "methods": {"softnn": "softnn", "a": "rival a", "b": "rival b"},
        "recordings_study": {"commit": "abc1234", "made": "2026-11-28", "softnn": "1"},
    }
    from bench.proof.page import Page

    made = Page(tmp_path, tmp_path)
    page.whole(made, found)
    text = made.write("rivals.md").read_text()
    cells = [" ".join(line.split()) for line in text.splitlines()]
    assert (
        "| foam rate 0 | 20.0 % | 10.0 % | 20.0 % | 20.0 % | rival a, 5.0 % |" in cells
    )
    assert (
        "| foam rate 1 | 20.0 % | 10.0 % * | 40.0 % | 40.0 % | softnn, 10.0 % |"
        in cells
    )
    assert "| foam rate 1 | 20.0 | 10.0 | 40.0 | - |" in cells
    # Half and four times softnn's error; the set is none of development.
    assert "| error over softnn's | rate (2) | sets held back (2) |" in cells
    assert "| rival a | 1.41 | 1.41 |" in cells
    assert "at commit abc1234" in text


def test_a_wrong_name_is_refused():
    with pytest.raises(InputError, match=r"no rival is called 'tree'.*trees"):
        methods.chosen(["tree"])


def test_a_finished_error_is_not_computed_again(tmp_path, monkeypatch, capsys):
    from softnn.study import common

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(common, "RUNS", tmp_path / "mlruns")
    monkeypatch.setattr(trial, "RESULTS", tmp_path)
    monkeypatch.setattr(trial, "tracked", lambda *a, **k: None)
    arguments = ["--smoke", "--methods", "yeoh"]
    assert trial.main(arguments) == 0
    file = Path(tmp_path / "mlruns" / "smoke" / "results" / "rivals.json")
    result = json.loads(file.read_text())
    assert result["summary"]["yeoh"]["of"] == 1
    assert list(result["data"]) == ["made-up"]
    file.rename(tmp_path / "rivals.json")  # as if it were published

    def again(*a):
        raise AssertionError("computed again")

    monkeypatch.setattr(trial, "judged", again)
    assert trial.main(arguments) == 0
    assert "Yeoh alone" in capsys.readouterr().out


def test_every_option_is_one_that_its_fit_takes():
    import inspect

    for one in methods.METHODS:
        known = set(inspect.signature(one.fit).parameters) - {"data", "rng"}
        for options in one.options:
            assert set(options) | set(one.quick) <= known, one.name
    names = [m.name for m in methods.METHODS]
    assert len(names) == len(set(names))
    assert isinstance(Problem, type)
