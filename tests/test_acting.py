"""Where what was concealed acts, and the gain on held recordings, by other routes."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bench.concealed import acting, details
from bench.concealed.unseen import held_errors
from bench.hands import forging
from bench.hands.drawing import draw
from softnn.fit import Guess
from softnn.model_file import to_dict
from softnn.models.units import Units

OTHERS = Path(os.environ.get("SOFTNN_DATA", "")) / "concealed-by-others"


def forged(tmp_path: Path, cls: str, springs: tuple[str, ...]):
    """The first case of a forge that knows nothing of `acting`, of such a spring."""
    for index in range(40):
        case = draw(5, index, cls, "development")
        if case.setup.material.skeleton in springs:
            forging.write(case, "c", tmp_path, [5, index])
            truth = json.loads((tmp_path / "truth/c/truth.json").read_text())
            names = [r["name"] for r in truth["recordings"]]
            folder = tmp_path / "cases/c/recordings"
            return case, truth, {n: pd.read_csv(folder / f"{n}.csv") for n in names}
    raise AssertionError("no such case")


def test_the_bare_stress_is_that_of_the_forge(tmp_path):
    case, truth, tables = forged(tmp_path, "null", ("neo_hooke", "fung"))
    found = acting.bare(truth, tables)
    for mine, clean in zip(found, case.stress(), strict=True):
        known = np.isfinite(mine)
        assert known.any()
        # The forge integrates on a finer clock; strains are written in 7 digits.
        peak = np.abs(clean).max()
        np.testing.assert_allclose(mine[known], clean[known], atol=2e-3 * peak)


def test_what_acts_is_what_was_added(tmp_path):
    _, truth, tables = forged(tmp_path, "null", ("neo_hooke", "fung"))
    counts = sum(b - a for spans in acting.acts(truth, tables) for a, b in spans)
    assert counts < 0.05 * sum(map(len, tables.values()))  # noise with a memory
    name = truth["recordings"][1]["name"]
    sigma = float(np.broadcast_to(truth["noise"]["sigma_MPa"], len(tables))[1])
    tables[name].loc[60:159, "stress_MPa"] += 6 * sigma
    spans = acting.acts(truth, tables)[1]
    mask = np.zeros(len(tables[name]), bool)
    for a, b in spans:
        mask[a:b] = True
    assert mask[64:156].all()
    # A mean over nine samples reaches four beyond.
    assert mask[:50].mean() + mask[170:].mean() < 0.1


def test_a_spring_that_is_not_known_has_no_location(tmp_path):
    _, truth, tables = forged(tmp_path, "null", ("neo_hooke", "fung"))
    truth["material"]["skeleton"] = "other"
    assert acting.bare(truth, tables) == []
    assert acting.f1(truth, {"mismatch": []}, tmp_path / "cases/c") is None
    assert acting.f1({}, {"mismatch": []}, tmp_path) is None


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
    assert details.gain({"held": found}) == pytest.approx(0, abs=1e-9)


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
    found = details.located(rows)
    assert found["region_f1"] == pytest.approx(0.8)
    assert found["region_f1_of"] == 2
    assert found["held_ratio"] == pytest.approx((0.1 + 1.2) / 2)
    parts = found["located"]
    assert parts["shared"]["held_ratio"] == pytest.approx(0.1)
    assert (parts["all"]["held_harmed"], parts["all"]["held_of"]) == (1, 2)
    assert parts["null"]["held_ratio"] == pytest.approx(1)
    assert parts["pair"]["held_ratio"] is None
