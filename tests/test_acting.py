"""Where what was concealed acts, and the gain on held recordings, by other routes."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench.hands import forging
from bench.hands.drawing import draw
from bench.trials import acting, located
from bench.trials.held import held_errors
from softnn.fit import Guess
from softnn.model_file import to_dict
from softnn.models.units import Units

OTHERS = Path(os.environ.get("SOFTNN_DATA", "")) / "concealed-by-others"


SPRINGS = ("neo_hooke", "fung")  # of the two forges alike


@pytest.fixture(scope="module")
def null():
    """A case with nothing concealed, in white noise; its forge knows no `acting`."""
    for index in range(80):
        case = draw(3, index, "null", "development")
        white = case.noise.kind == "white"
        if white and case.setup.material.skeleton in SPRINGS:
            return case, index
    raise AssertionError("no such case")


@pytest.fixture
def forged(null, tmp_path):
    """The case, its truth and its recordings as files tell them."""
    case, index = null
    forging.write(
        replace(case, rng=np.random.default_rng(1)), "c", tmp_path, [3, index]
    )
    truth = json.loads((tmp_path / "truth/c/truth.json").read_text())
    names = [r["name"] for r in truth["recordings"]]
    folder = tmp_path / "cases/c/recordings"
    return case, truth, {n: pd.read_csv(folder / f"{n}.csv") for n in names}


def test_the_bare_stress_is_that_of_the_forge(forged):
    case, truth, tables = forged
    found = acting.bare(truth, tables)
    for mine, clean in zip(found, case.stress(), strict=True):
        known = np.isfinite(mine)
        assert known.any()
        # The forge integrates on a finer clock; strains are written in 7 digits.
        peak = np.abs(clean).max()
        np.testing.assert_allclose(mine[known], clean[known], atol=2e-3 * peak)


def test_what_acts_is_what_was_added(forged):
    _, truth, tables = forged
    counts = sum(b - a for spans in acting.acts(truth, tables) for a, b in spans)
    assert counts == 0
    name = truth["recordings"][1]["name"]
    sigma = float(np.broadcast_to(truth["noise"]["sigma_MPa"], len(tables))[1])
    tables[name].loc[60:159, "stress_MPa"] += 6 * sigma
    spans = acting.acts(truth, tables)[1]
    mask = np.zeros(len(tables[name]), bool)
    for a, b in spans:
        mask[a:b] = True
    assert mask[64:156].all()
    # A mean over nine samples reaches four beyond.
    assert not mask[:55].any()
    assert not mask[165:].any()


def test_a_spring_that_is_not_known_has_no_location(forged, tmp_path):
    _, truth, tables = forged
    truth["cls"], truth["material"]["skeleton"] = "single", "other"
    assert acting.bare(truth, tables) == []
    assert acting.f1(truth, {"mismatch": []}, tmp_path / "cases/c") is None
    assert acting.f1({}, {"mismatch": []}, tmp_path) is None


def test_f1_of_regions_found_and_of_none(forged, tmp_path):
    """Regions over all of a recording in which 100 of its samples were moved."""
    _, truth, tables = forged
    name = truth["recordings"][1]["name"]
    sigma = float(np.broadcast_to(truth["noise"]["sigma_MPa"], len(tables))[1])
    tables[name].loc[60:159, "stress_MPa"] += 50 * sigma
    file = tmp_path / "cases/c/recordings" / f"{name}.csv"
    tables[name].to_csv(file, index=False)
    case = tmp_path / "cases/c"
    assert acting.f1(truth, {"mismatch": []}, case) is None  # nothing is concealed
    truth["cls"] = "single"
    assert acting.f1(truth, {"mismatch": []}, case) == 0
    time = tables[name]["time_s"]
    exact = {"recording": name, "start_s": time[60], "end_s": time[159]}
    assert acting.f1(truth, {"mismatch": [exact]}, case) > 0.9
    late = exact | {"start_s": time[110]}
    assert acting.f1(truth, {"mismatch": [late]}, case) == pytest.approx(
        2 / 3, abs=0.05
    )


@pytest.mark.skipif(not OTHERS.is_dir(), reason="SOFTNN_DATA has no others' cases")
def test_others_cases_with_nothing_concealed_are_noise():
    """Every spring of theirs, found from noise-free recordings, in noisy ones."""
    seen = set()
    for file in sorted(OTHERS.glob("truth/*/truth.json")):
        truth = json.loads(file.read_text())
        spring = truth["material"]["skeleton"]
        if truth["cls"] != "null" or spring in seen:
            continue
        seen.add(spring)
        folder = OTHERS / "cases" / truth["case"] / "recordings"
        names = [r["name"] for r in truth["recordings"]]
        tables = {n: pd.read_csv(folder / f"{n}.csv") for n in names}
        for i, mine in enumerate(acting.bare(truth, tables)):
            left = tables[names[i]]["stress_MPa"].to_numpy() - mine
            level = np.nanstd(left) / truth["noise"]["sigma_MPa"][i]
            assert 0.8 < level < 1.3, (truth["case"], names[i])
    assert len(seen) >= 5


def test_held_errors_by_hand(tmp_path):
    """Springs of 1 and 2 MPa against 2 MPa: half of the stress is missed, and none."""
    strain = np.linspace(0, 0.5, 20)
    table = {"time_s": np.arange(20.0), "strain": strain, "stress_MPa": 2 * strain}
    pd.DataFrame(table).to_csv(tmp_path / "held-ramp-07.csv", index=False)
    assert held_errors(tmp_path, tmp_path) is None  # no models
    for name, modulus in (("base", 1.0), ("model", 2.0)):
        guess = Guess(Units("hooke", (0.0, 1.0)), np.array([modulus]))
        model = to_dict(guess, [], "continued", False)
        (tmp_path / f"{name}.json").write_text(json.dumps(model))
    found = held_errors(tmp_path, tmp_path)
    assert found == {"before": pytest.approx(0.5), "after": pytest.approx(0, abs=1e-12)}
    assert located.gain({"held": found}) == pytest.approx(0, abs=1e-9)


def test_location_and_gain_counted_by_hand():
    def row(cls, effects, f1, before, after):
        held = {"before": before, "after": after}
        return {"cls": cls, "effects": effects, "f1": f1, "held": held}

    rows = [
        row("null", [], None, 0.01, 0.01),
        row("single", ["inertia"], 0.9, 0.1, 0.01),
        row("single", ["slack"], 0.7, 0.1, 0.12),
        {"cls": "pair", "effects": ["inertia", "slack"], "f1": None, "held": None},
    ]
    found = located.located(rows)
    assert found["region_f1"] == pytest.approx(0.8)
    assert found["region_f1_of"] == 2
    assert found["held_ratio"] == pytest.approx((0.1 + 1.2) / 2)
    parts = found["located"]
    assert parts["shared"]["held_ratio"] == pytest.approx(0.1)
    assert (parts["all"]["held_harmed"], parts["all"]["held_of"]) == (1, 2)
    assert parts["null"]["held_ratio"] == pytest.approx(1)
    assert parts["pair"]["held_ratio"] is None
