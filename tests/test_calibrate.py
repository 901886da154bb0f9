"""What constants are fitted to: lessons stacked, their score by hand, and a fit."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from test_posterior import HAND

from bench import calibrate
from bench.calibrate import (
    CLIP,
    fitted,
    kept,
    log_score,
    searching,
    stacked,
    weights,
)
from softnn.effects import EFFECTS
from softnn.mismatch.posterior import CONSTANTS, probabilities


def lesson(gain, *, cls="single", effects=("slack",), tried=("slack",)):
    """A search that tried nothing and one set, which gained so many nats."""
    nothing, found = [7.0, 7.0, 7.0, 0.0, 0.0], 7.0 + gain
    return {
        "cls": cls,
        "effects": list(effects),
        "sets": [[], list(tried)],
        "figures": [nothing, [found, found, found - 1e9, 0.0, 0.0]],
    }


def test_score_of_a_lesson_by_hand():
    known = [lesson(9.0), lesson(2.0, cls="null", effects=())]
    two = stacked(known)
    weight = np.exp([-(4 + 4 * np.log(9 / 4)), -1.0, -(4 + 4 * np.log(9 / 4)) - 3.0])
    nothing, slack, _ = weight / weight.sum()
    rest = (len(EFFECTS) - 1) * np.log(1 - CLIP)
    scores = log_score(two, HAND)
    assert scores[0] == pytest.approx(np.log(slack) + np.log(1 - nothing) + rest)
    p = probabilities(two.every[1], HAND)
    assert scores[1] == pytest.approx(np.log(1 - p[1]) + np.log(p[0]) + rest)
    # Of two effects one was tried: it counts, and the other costs what a miss does.
    (missed,) = log_score(stacked([lesson(9.0, effects=("slack", "inertia"))]), HAND)
    assert missed == pytest.approx(scores[0] + np.log(CLIP) - np.log(1 - CLIP))


def test_what_a_search_found_has_no_origin():
    far = lesson(9.0)
    far["figures"] = [[x + 500.0 for x in row[:3]] + row[3:] for row in far["figures"]]
    both = log_score(stacked([lesson(9.0), far]), HAND)
    assert both[0] == pytest.approx(both[1])


def test_a_fit_learns_what_gains_are_worth():
    rng = np.random.default_rng(0)
    right = [lesson(g) for g in rng.uniform(6, 30, 40)]
    wrong = [lesson(g, cls="null", effects=()) for g in rng.uniform(0, 12, 40)]
    known = stacked(right + wrong)
    found = fitted(known, CONSTANTS)
    assert log_score(known, found).mean() > log_score(known, CONSTANTS).mean() + 0.01
    # A gain of six to twelve is as often wrong as right.
    even = stacked([lesson(g) for g in (0.0, 9.0, 40.0)])
    low, middle, high = probabilities(even.every, found)[:, 1]
    assert low < 0.2 < middle < 0.8 < high


def test_the_constants_are_those_of_the_last_fit():
    result = Path(__file__).parents[1] / "studies" / "results" / "calibration.json"
    told = json.loads(result.read_text(encoding="utf-8"))["constants"]
    assert asdict(CONSTANTS) == pytest.approx(told, rel=0.02)


def test_each_kind_counts_alike_however_many_lessons_it_has():
    found = [lesson(9.0)] * 6 + [lesson(2.0, cls="null", effects=())] * 2
    each = weights(stacked(found).kind)
    assert each.sum() == pytest.approx(8.0)
    assert each[:6].sum() == pytest.approx(each[6:].sum())
    # More nulls of the same sort teach nothing else.
    more = stacked(found + found[6:] * 5)
    few, many = fitted(stacked(found), CONSTANTS), fitted(more, CONSTANTS)
    p = [probabilities(more.every[0], c)[1] for c in (few, many)]
    assert p[0] == pytest.approx(p[1], abs=0.01)


def test_the_judgement_is_no_part_of_the_search():
    names = {f"{f.parent.name}/{f.name}" for f in searching()}
    assert {"mismatch/accounts.py", "mismatch/evidence.py", "effects/slack.py"} <= names
    assert not names & {"mismatch/posterior.py", "mismatch/decision.py"}


def test_lessons_of_folders_of_one_name_are_apart(tmp_path):
    one, other = tmp_path / "first" / "cases", tmp_path / "second" / "cases"
    assert kept(one) != kept(other)
    assert kept(one) == kept(other / ".." / ".." / "first" / "cases")


@pytest.mark.parametrize("taught", [True, False])
def test_constants_move_only_for_what_holds_beyond_its_lessons(monkeypatch, taught):
    rng = np.random.default_rng(0)
    gains = rng.uniform(0, 30, 24)
    # Gains of six and more are right; or right and wrong have nothing to do with them.
    right = gains > 6 if taught else rng.random(24) < 0.5
    null = {"cls": "null", "effects": ()}
    known = [
        lesson(g, **({} if yes else null)) for g, yes in zip(gains, right, strict=True)
    ]
    known = [one | {"case": str(i)} for i, one in enumerate(known)]
    monkeypatch.setattr(calibrate, "lessons", lambda *_: known)
    monkeypatch.setattr(calibrate, "PULLS", (0.003,))
    monkeypatch.setattr(calibrate, "FOLDS", 3)
    far = replace(CONSTANTS, first=9.0)
    before = far if taught else fitted(stacked(known), CONSTANTS)
    monkeypatch.setattr(calibrate, "CONSTANTS", before)
    told = calibrate.run([Path("made")], 1, rng, False)
    assert told["headline"]["fitted_anew"] == taught
    assert (told["constants"] == asdict(before)) != taught
