"""The rule of every trial against cases counted by hand, and published intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench import scoring
from bench.scoring import Truth
from bench.trials import located


@pytest.mark.parametrize(
    ("right", "of", "low", "high"),
    # Newcombe (1998), doi:10.1002/(SICI)1097-0258(19980430)17:8<857::AID-SIM777>3.0
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_intervals_as_published(right, of, low, high):
    assert scoring.wilson(right, of) == pytest.approx((low, high), abs=5e-5)


def said(verdict: str, *selected: str, chance: float = 0.95, ranked=()) -> dict:
    """A diagnosis, its candidates in the order `ranked`, the base among them."""
    return {
        "verdict": verdict,
        "selected": list(selected),
        "explanations": [{"effect": s, "probability": chance} for s in selected],
        "candidates": [{"effect": e} for e in (None, *(ranked or selected))],
        "mismatch": [],
    }


PAIR = ("slack", "inertia")
BOTH = {"slack": 900.0, "inertia": 900.0}
TABLE = [  # truth, diagnosis, whether right
    (Truth("a", "null"), said("nothing_missing"), True),
    (Truth("b", "null"), said("undetermined"), False),
    (Truth("c", "null"), said("nothing_missing", "slack", chance=0.1), False),
    (Truth("d", "single", ("slack",), 900), said("explained", "slack"), True),
    (Truth("e", "single", ("slack",), 900), said("undetermined", "slack"), True),
    (Truth("f", "single", ("slack",), 900), said("explained", *PAIR), False),
    (Truth("g", "single", ("slack",), 39), said("explained", "inertia"), False),
    (Truth("h", "pair", PAIR, 900, BOTH), said("explained", *PAIR[::-1]), True),
    (Truth("i", "pair", PAIR, 900, BOTH), said("explained", "inertia"), False),
    (Truth("j", "pair", PAIR, 900, BOTH | {"slack": 39}), scoring.ABSENT, False),
    (Truth("k", "alien", (), 900), said("unexplained", ranked=PAIR), True),
    (Truth("l", "alien", (), 900), said("explained", "slack", chance=0.6), False),
    (Truth("m", "alien", (), 900), said("explained", "slack"), False),
    (Truth("n", "mixed", ("slack",), 900), said("partly_explained", "slack"), True),
    (Truth("o", "mixed", ("slack",), 900), said("explained", *PAIR), False),
    (Truth("p", "mixed", ("slack",), 900), said("unexplained", ranked=PAIR), False),
]


def test_one_rule_for_all_classes():
    for truth, diagnosis, right in TABLE:
        assert scoring.right(truth, diagnosis) is right, truth
        assert not scoring.right(truth, scoring.ABSENT)


def test_laws_that_are_wrong_stand_apart():
    three = ("slack", "inertia", "sensor_lag")
    some = [
        (Truth("a", "bent", three, 9000), said("partly_explained", *three)),
        (Truth("b", "bent", ("slack",), 9000), said("explained", *PAIR)),
    ]
    found = scoring.summary([scoring.row(t, d) for t, d in some])["visible"]
    assert counts(found["naming"]) == {"bent": (1, 2)}
    assert counts(found["ranking"]) == {"bent": (2, 2), "all": (0, 0)}


def counts(rates: dict) -> dict:
    return {k: (v["right"], v["of"]) for k, v in rates.items()}


def test_a_score_table_counted_by_hand():
    found = scoring.summary([scoring.row(t, d) for t, d, _ in TABLE])
    seen, others = found["visible"], found["others"]
    naming = {"null": (1, 3), "single": (2, 3), "pair": (1, 2), "alien": (1, 3)}
    naming["mixed"] = (1, 3)
    assert counts(seen["naming"]) == naming
    assert counts(others["naming"]) == {"single": (0, 1), "pair": (0, 1)}
    assert seen["naming"]["pair"]["low"] == scoring.wilson(1, 2)[0]
    # The base is no candidate for a true effect; k, on no list, is not ranked.
    ranking = {"single": (3, 3), "pair": (2, 2), "mixed": (3, 3), "all": (5, 5)}
    assert counts(seen["ranking"]) == ranking  # of all, without those beside strangers
    assert counts(others["ranking"])["all"] == (0, 2)
    assert counts(seen["unsure"])["alien"] == (2, 3)
    assert seen["verdict"]["single"] == {"explained": 2, "undetermined": 1}
    slack, inertia = (found["all"]["effects"][e] for e in PAIR)
    assert (slack["right"], slack["of"]) == (2, 4)
    assert (slack["named"]["right"], slack["named"]["of"]) == (6, 10)
    assert (inertia["of"], inertia["named"]["right"]) == (0, 2)
    confusion = {"slack": 2, scoring.AND_MORE: 1, "inertia": 1}
    assert found["confusion"]["slack"] == confusion
    assert found["confusion"]["alien"] == {"unexplained": 1, "slack": 2}
    assert {m["case"] for m in found["misses"]} == set("bcfgijlmop")


def test_calibration_by_hand():
    told = [(0.95, True), (0.95, True), (0.9, False), (0.4, True), (0.4, False)]
    found = scoring.calibration([*told, (0.0, False), (1.0, True)])
    ends = [(round(10 * d["from"]), d["right"], d["of"]) for d in found["deciles"]]
    assert ends == [(0, 0, 1), (4, 1, 2), (9, 3, 4)]
    assert (found["sure"]["right"], found["sure"]["of"]) == (3, 4)
    squares = [0.05**2, 0.05**2, 0.9**2, 0.6**2, 0.4**2, 0, 0]
    assert found["brier"] == pytest.approx(np.mean(squares))
    logs = [math.log(p) for p in (0.95, 0.95, 0.1, 0.4, 0.6, 1, 1)]
    assert found["log_score"] == pytest.approx(np.mean(logs))
    # Right: 1, .95, .95, .4; wrong: .9, .4, 0. Of 12 pairs 10 in order, one tied.
    assert found["auc"] == pytest.approx(10.5 / 12)
    # Each decile's share against its mean: |.5 - .4| twice, |.75 - .95| four times.
    assert found["gap"] == pytest.approx((2 * 0.1 + 4 * 0.2) / 7)
    assert scoring.calibration([(0.3, False)])["auc"] is None
    # One sure error costs a finite score.
    assert scoring.calibration([(1.0, False)])["log_score"] == math.log(scoring.CLIP)


def test_an_explanation_has_the_last_word_on_a_probability():
    told = said("undetermined", "slack", chance=0.6)
    told["candidates"] += [
        {"effect": "slack", "probability": 0.5},
        {"effect": "inertia", "probability": 0.3},
    ]
    assert scoring.chances(told) == {"slack": 0.6, "inertia": 0.3}


@pytest.mark.parametrize(
    ("row", "cause"),
    [
        ({}, "one of two found"),
        ({"beside": {"slack": 0.3}}, "one of two, in whose forms"),
        ({"oracle": 0.2}, "hardly visible"),
        ({"selected": ["inertia", "grip_slip"]}, "one of two found, and more"),
        ({"selected": []}, "nothing named, though it leads"),
        ({"selected": [], "first": "grip_slip"}, "nothing named"),
        ({"equivalent": ["slack"]}, "listed as equivalent"),
        ({"cls": "alien", "over_noise": 1.005}, "on no list, but"),
        ({"cls": "alien"}, "a name for something on no list"),
    ],
)
def test_a_miss_says_why(row, cause):
    one = scoring.row(Truth("c", "pair", PAIR, 900, BOTH), said("explained", "inertia"))
    assert scoring.cause(one | row).startswith(cause)


# --- what only the key of the forge can tell ------------------------------------------


TIMES = {"recording-01": np.arange(10.0)}


def test_region_f1_by_hand():
    answer = {"recordings": [{"name": "recording-01"}], "acts": [[[2, 6]]]}
    # Truth is samples 2-5; found is 4-8: two shared, two missed, three too many.
    region = {"recording": "recording-01", "start_s": 3.5, "end_s": 8.0}
    d = said("explained", "slack") | {"mismatch": [region]}
    assert located.region_f1(answer, d, TIMES) == pytest.approx(4 / 9)
    assert located.region_f1(answer | {"acts": [[]]}, d, TIMES) is None
