"""Neurons and regularisation compared: what is tried, pruned, left out and said."""

import json
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from bench.architectures import compared
from bench.architectures.choices import choices, folds
from bench.architectures.trials import (
    COUNTS,
    WAYS,
    WEIGHT,
    Halving,
    by_halving,
    conditions,
    configuration,
)
from bench.architectures.trials import compared as points_of
from softnn.neural import PUBLISHED
from softnn.search import Finished
from softnn.search.halving import RUNGS, halved
from softnn.study.settings import Settings


def test_three_ways_at_six_counts_for_four_inputs_in_mixed_order():
    made = [p for p in points_of(Settings()) if p["inputs"] in PUBLISHED]
    counts = sorted({p["neurons"] for p in made})
    assert len(counts) == COUNTS
    assert (counts[0], counts[-1]) == (1, 20)
    wanted = set(product(PUBLISHED, WAYS["regularisation"], counts))
    found = [(p["inputs"], p["regularisation"], p["neurons"]) for p in made]
    assert len(found) == len(wanted) == 72
    assert set(found) == wanted
    assert len({name for name, *_ in found[:12]}) > 2  # not one kind after the other
    when = conditions(differenced=False)
    for p in made:  # no weight where none is used
        assert when["weight"](p) is (p["regularisation"] == "l2")
        chosen = configuration(p)
        assert chosen["lag_s"] is None
        assert chosen["regularisation"].startswith("l2=") is when["weight"](p)


@pytest.mark.parametrize(("value", "stops"), [(0.5, False), (3.5, True), (2.5, False)])
def test_one_in_three_of_those_that_came_as_far_goes_on(value, stops):
    """With five others it is one of six: the best two go on."""
    others = [[2.0], [3.0], [4.0], [5.0], [6.0]]
    assert halved([value], others) is stops
    # Those that never came to the second rung do not count at it.
    assert not halved([value, 9.0], [[2.0], [3.0], [4.0]])
    assert halved([value, 9.0], [[2.0, 8.0], [3.0], [4.0]])


def test_what_is_no_number_stops():
    assert halved([float("nan")], [])


EARLIER = [[5.0] * 10, [6.0] * 10, [7.0] * 10]


@pytest.mark.parametrize(
    ("errors", "stops"),
    [
        ([4.0], False),
        ([9.0], True),
        ([4.0, 4.0, 5.0], False),
        ([4.0, 9.0, 9.0], True),  # its mean at the second rung
    ],
)
def test_a_trial_stops_when_it_is_behind_by_random_folds(errors, stops):
    assert Halving(EARLIER).stops(errors, unseen=0.0) is stops


def test_networks_of_other_inputs_do_not_halve():
    def tried(inputs, errors):
        return SimpleNamespace(parameters={"inputs": inputs}, result={"nrmse": errors})

    done = [tried("FFRD4", e) for e in EARLIER] + [tried("FFRI1", [20.0] * 10)]
    assert by_halving({"inputs": "FFRD4"}, done) == Halving(EARLIER)
    assert by_halving({"inputs": "FFRD4"}, done).stops([9.0], 0.0)
    assert not by_halving({"inputs": "FFRI1"}, done).stops([9.0], 0.0)


def test_a_network_halved_by_random_folds_may_still_be_the_choice_for_unseen_rates():
    def trial(number, random, unseen, stopped):
        result = {"nrmse": random, "unseen": {"nrmse": unseen}, "parameters": 5}
        values = float(np.mean(random)), float(np.mean(unseen))
        result |= {"stopped_after": stopped}
        about = {"neurons": 1}, values[0], result, None, None, False, values
        return Finished(number, *about)

    tried = [
        trial(0, [0.1, 0.1], [0.9, 0.9], None),
        trial(1, [0.2], [0.3, 0.3], 1),
    ]

    def the_same(trials, use):
        return [folds(t, use) for t in trials]

    found = choices(tried, the_same, halved=True)
    assert (found["random"].trial.number, found["unseen"].trial.number) == (0, 1)
    assert choices(tried, the_same)["unseen"].trial.number == 0


def test_folds_are_judged_from_rung_to_rung():
    assert Halving([]).bounds(10) == [*RUNGS, 10]
    assert Halving([]).bounds(3) == [1, 3]


def row(name, how, count, error, stopped=None):
    return {
        "inputs": name,
        "regularisation": f"l2={WEIGHT!r}" if how == "l2" else how,
        "neurons": count,
        "lag_s": None,
        "random": error,
        "stopped_after": stopped,
    }


ROWS = [
    row("FFRD4", "bayesian", 1, 0.2),
    row("FFRD4", "bayesian", 4, 0.1),
    row("FFRD4", "l2", 4, 0.3, stopped=3),
    row("GRU", "l2", 4, 0.01),  # on no grid
    row("FFRI1", "bayesian", 4, 0.01) | {"lag_s": 2.0},  # neither
]


def test_the_table_has_what_was_tried_and_how_far():
    lines = compared.table(ROWS).splitlines()
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in lines]
    assert cells[0] == ["inputs", "regularisation", "1", "4"]
    assert cells[2:] == [
        ["FFRD4", "bayesian", "20.00 %", "10.00 %"],
        ["FFRD4", "l2", "-", "30.00 % (3)"],
    ]


def test_it_says_what_of_the_full_grid_is_left_out():
    said = compared.left_out(ROWS, Settings())
    assert "2400 networks" in said  # 4 x 3 x 20 x 10
    assert "23 were trained: 3 points at 1, 4 neurons" in said
    assert "2 of them on every fold, 1 stopped" in said
    assert "18 counts were left out" in said


def test_the_published_grid_stands_beside_where_there_is_one(tmp_path):
    label = "NatPolR, virtual specimens"
    about = ROWS, Settings(), tmp_path
    assert "published" not in compared.text(*about, label)
    grid = [row("FFRD4", "bayesian", n, 0.1 * n) for n in range(1, 6)]
    content = {"materials": [{"label": label, "trials": grid}]}
    (tmp_path / f"{compared.GRID}.json").write_text(json.dumps(content))
    beside = compared.text(*about, label).split("The published grid")[1]
    assert "40.00 %" in beside
    assert "50.00 %" not in beside  # five neurons were not compared
    assert "published" not in compared.text(*about, "PR, virtual specimens")


def whole_grid():
    """Trials of one material: each line is a multiple of the one before it."""
    kinds = product(PUBLISHED, WAYS["regularisation"])
    return [
        row(name, how, n, k * e) | {"unseen": 2 * k * e}
        for k, (name, how) in enumerate(kinds, 1)
        for n, e in enumerate((0.03, 0.01005, 0.01, 0.02), 1)
    ]


def test_least_error_and_fewest_neurons_of_every_line():
    materials = [{"material": "PR", "trials": whole_grid()}]
    found = compared.summary(materials)
    last = [c.strip() for c in found.splitlines()[-1].strip("|").split("|")]
    assert last == ["FFRD4", "l2", "12.00 % (3, 2)"]
    unseen = compared.summary(materials, compared.middle, "unseen")
    assert unseen.splitlines()[-1].split("|")[-2].strip() == "36.1 %"


def test_the_figure_of_a_grid_rings_the_least_and_can_be_read():
    materials = [{"material": "PR", "trials": whole_grid()}]
    *_, last = compared.draw(materials).axes
    ring, bar = (next(x for x in last.lines if x.get_marker() == m) for m in "o|")
    assert (ring.get_xdata()[0], bar.get_xdata()[0]) == (3, 2)
    labels = [t.get_text() for t in last.figure.axes[0].get_yticklabels()]
    assert [t for t in labels if t]
