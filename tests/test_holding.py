"""The network for rates never seen: what it is chosen by, and what it must not use."""

from dataclasses import replace
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest

from bench.architectures.verdict import basis, best_of, pm, sentences, table
from softnn.neural import samples
from softnn.search import Finished
from softnn.study import holding
from softnn.study.holding import errors, held, stacked
from softnn.study.material_data import Data
from softnn.study.settings import Settings
from softnn.study.sweep import Sweep
from softnn.study.trainer import Trainer
from tests.test_convex import hold, ramp

RATES = (0.003, 0.03, 0.3)


def noisy(rate, number):
    one = ramp(rate, samples=40)
    rng = np.random.default_rng([number, int(1e4 * rate)])
    stress = one.stress_MPa * (1 + 0.02 * rng.standard_normal())
    name = f"{rate} {number}"
    return replace(one, stress_MPa=stress, name=name, specimen=name)


DATA = Data("made", "solid", [noisy(r, k) for r in RATES for k in range(2)], [hold()])


def judged(data):
    known = samples(data.tensile, "FFRI1")
    folds = Trainer(data, Settings()).folds("rate", "FFRI1", 0)
    return errors(data, known, folds)


def test_rates_never_seen_are_met_as_well_as_specimens_differ():
    scores, weights = judged(DATA)
    assert max(scores["nrmse"]) < 0.06  # specimens differ by 2 %
    assert min(scores["r2"]) > 0.98
    for one in weights:
        assert sum(one.values()) == pytest.approx(1)
        assert min(one.values()) > 0


def test_what_is_held_out_changes_nothing():
    known = samples(DATA.tensile, "FFRI1")
    folds = Trainer(DATA, Settings()).folds("rate", "FFRI1", 0)
    test = folds.test[0]
    out = {DATA.tensile[i].name for i in known.recording[test]}
    other = [
        replace(r, stress_MPa=7 * r.stress_MPa) if r.name in out else r
        for r in DATA.tensile
    ]
    one = holding.without(DATA, known, test)
    moved = holding.without(replace(DATA, tensile=other), known, test)
    assert one.weights == moved.weights
    np.testing.assert_array_equal(one.network.output, moved.network.output)


def test_the_hold_of_a_recording_held_out_is_not_used():
    mine = replace(hold(), name=DATA.tensile[0].name)
    data = replace(DATA, relaxation=[mine])
    known = samples(data.tensile, "FFRI1")
    folds = Trainer(data, Settings()).folds("rate", "FFRI1", 0)
    found = holding.without(data, known, folds.test[0])
    assert all("without holds" in n or "joint" in n for n in found.weights)


def test_of_one_rate_the_members_that_know_holds_count_alike():
    found = held(DATA.tensile[:2], [hold()])
    assert len(set(found.weights.values())) == 1
    assert not any("without holds" in n or "joint" in n for n in found.weights)
    assert found.chosen_by == "holds; one rate"


def test_weights_find_the_member_that_is_right():
    rng = np.random.default_rng(1)
    truth = rng.standard_normal(50)
    said = np.column_stack([truth + 0.5, truth, 2 * truth])
    np.testing.assert_allclose(stacked(said, truth), [0, 1, 0], atol=1e-6)


def test_a_single_recording_has_a_network_too():
    found = held([ramp(0.1)])
    assert sum(found.weights.values()) == pytest.approx(1)


# --- the table and the sentences ------------------------------------------------------


def row(model, random, unseen, **more):
    r2 = {"random": [0.99, 0.98], "unseen": [0.9, 0.8]}
    return {"model": model, "random": random, "unseen": unseen, "r2": r2, **more}


NETWORKS = [
    row("FFRD4, 17 neurons", [0.05, 0.06], [1.7, 1.8]),
    row("FFRI2, 4 neurons", [0.07, 0.08], [0.2, 0.22], chosen_by="unseen"),
]
CONVEX = row(holding.NAME, [0.06, 0.07], [0.10, 0.14])
NEAR = row("PL-SLS", [0.08, 0.09], [0.11, 0.12])
BETTER = row("PL-SLS", [0.08, 0.09], [0.02, 0.06])


def test_what_fails_at_unseen_rates_is_never_named_without_that_figure():
    (known, _), _ = sentences(NETWORKS, CONVEX, [NEAR], "rate")
    assert "take FFRD4, 17 neurons: 5.5" in known
    assert "175.0" in known
    assert "do not use it there" in known


def test_a_tie_with_the_best_baseline_leaves_the_network():
    (_, never), takes = sentences(NETWORKS, CONVEX, [NEAR], "rate")
    assert takes is CONVEX
    assert never.startswith(f"For a rate never seen, take the {holding.NAME}: 12.0")
    assert "PL-SLS, has 11.5" in never
    assert "a tie" in never
    assert "chosen by these very folds" in never


def test_a_baseline_that_is_better_beyond_doubt_is_taken():
    (_, never), takes = sentences(NETWORKS, CONVEX, [BETTER], "rate")
    assert takes is BETTER
    assert f"the {holding.NAME} has 12.0" in never
    assert "worse by 8.0" in never


def test_an_error_above_a_fifth_is_called_poor():
    for error, said in ((0.19, False), (0.3, True)):
        convex = {**CONVEX, "unseen": [error, error]}
        networks = [{**row, "unseen": [0.9, 0.9]} for row in NETWORKS]
        (_, never), _ = sentences(networks, convex, [], "rate")
        assert ("which is poor: record the rates that you need" in never) == said


def test_what_cannot_be_fitted_is_a_dash_and_never_the_best():
    missing = row("PL-Wiechert", "one rate", "one rate")
    assert best_of([missing, NEAR], "unseen") is NEAR
    assert best_of([missing], "unseen") is None
    text = table([*NETWORKS, missing], "rate")
    assert "21.00 %*" in text
    assert text.splitlines()[4].count(" - ") == 2
    (known, never), _ = sentences(NETWORKS, CONVEX, [missing], "rate")
    assert "no baseline can be fitted here" in known
    assert "no baseline can be fitted here" in never


def test_a_tie_below_the_last_decimal_shows_no_minus_and_no_zero():
    near = row("PL-SLS", [0.08, 0.09], [0.10004, 0.13994])
    (_, never), _ = sentences(NETWORKS, CONVEX, [near], "rate")
    assert "a tie (within 0.1 %)" in never
    assert "-0.0" not in never
    assert pm(-0.0001, 0.01) == "0.0 \N{PLUS-MINUS SIGN} 1.0 %"


def test_the_folds_are_said_to_be_of_first_loadings():
    (known, _), _ = sentences(NETWORKS, CONVEX, [NEAR], "rate", "first loadings")
    assert "by random folds of first loadings; the best baseline" in known


def test_it_is_said_what_the_networks_saw_and_how_far_off_they_are_beyond_it():
    whole = {**NETWORKS[0], "whole": [0.093, 0.099]}
    how = "--data lab --cycles"
    shown = {"cycles": False, "unloads": True}
    said = basis("rubber", shown, whole, how)
    assert "no network here has seen unloading" in said
    assert "FFRD4, 17 neurons has 9.3 to 9.9 %" in said
    assert f'make neurons ARGS="{how}"' in said
    said = basis("rubber", {"cycles": True, "unloads": True}, whole, how)
    assert "unloading included" in said
    assert "--cycles" not in said
    said = basis("rubber", {"cycles": False, "unloads": False}, whole, how)
    assert "no recording of rubber unloads" in said
    assert "as simulated" in table([whole], "rate")
    assert "9.60 %" in table([whole], "rate")


@pytest.mark.parametrize("stopped", [None, 4])
def test_a_stopped_trial_is_marked_and_has_no_figure_of_a_whole_one(stopped):
    result = {
        "generalisation_error": 0.01, "r2_mean": 0.99, "gamma": [1.0], "nrmse": [0.01],
        "r2": [0.99], "iterations": [3], "seconds": 1.0, "samples": 9, "parameters": 5,
        "folds": ["1"], "note": "", "stopped_after": stopped,
    }  # fmt: skip
    told = []
    logger = SimpleNamespace(trial=lambda *given, **more: told.append((given, more)))
    sweep = SimpleNamespace(settings=Settings(), _again=lambda trial: {})
    now = datetime(2026, 1, 1)
    trial = Finished(1, {"neurons": 2}, (0.01,), result, now, now, False)
    Sweep._log(sweep, logger, trial)
    (((_, _, metrics), more),) = told
    assert ("nrmse" in metrics) == (stopped is None)
    assert more["tags"]["stopped"] == (
        "no" if stopped is None else "after 4 of 10 random folds"
    )
