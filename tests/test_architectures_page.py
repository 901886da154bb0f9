"""The page of architectures says what the result files say, and nothing else."""

import json
import re

import pytest
from smoke import smoked

from bench.architectures.page import ROOT, make


def row(inputs, neurons, random, unseen):
    return {
        "inputs": inputs,
        "neurons": neurons,
        "regularisation": "bayesian",
        "lag_s": None,
        "stopped_after": None,
        "random": sum(random) / len(random),
        "unseen": sum(unseen) / len(unseen),
        "folds_random": random,
        "folds_unseen": {str(i): v for i, v in enumerate(unseen)},
    }


def result(data, material, unseen):
    """A network of these errors at unseen rates; PL-SLS has 0.2 and 0.3 there."""
    best = row("FFRI1", 3, [0.05, 0.07], unseen)
    chosen = {"words": "FFRI1, 3 neurons, bayesian", "anew": best}
    return {
        "settings": {"data": data, "folds": 2, "samples": 200, "cycles": False},
        "machine": "m, 2 cores",
        "made": "2026-01-01",
        "headline": {"study_s": 12.0},
        "left_out": {"putty": "one recording only"},
        "materials": [
            {
                "material": material,
                "label": f"{material}, {data}",
                "unseen": "rate",
                "headline": {"trials_stopped": 1},
                "trials": [best, best],
                "choices": {"random": chosen, "unseen": chosen},
                "front": [best],
                "baselines": [
                    {"model": "PL-SLS", "random": [0.2, 0.3], "unseen": [0.2, 0.3]},
                    {"model": "gradient-boosted trees", "random": [0.1, 0.1],
                     "unseen": [0.9, 0.9]},
                    {"model": "PL-Wiechert", "random": "no hold", "unseen": "no hold"},
                ],
            }
        ],
    }  # fmt: skip


@pytest.fixture
def written(tmp_path):
    results, home = tmp_path / "results", tmp_path / "home"
    for folder in (results, home):
        folder.mkdir()
    for name, found in {
        "architectures-all": result("virtual", "NR", [0.1, 0.12]),
        "architectures-tape": result("tape", "VHB", [0.5, 0.7]),
    }.items():
        (results / f"{name}.json").write_text(json.dumps(found))
    return results, home, make(results, home).read_text()


def test_real_recordings_come_first_and_figures_are_those_of_the_files(written):
    _, _, text = written
    assert text.index("### VHB, tape") < text.index("### NR, virtual")
    cells = [re.sub(r" +", " ", line) for line in text.splitlines()]
    one = "FFRI1, 3 neurons, bayesian"
    assert [c for c in cells if c.startswith(("| VHB", "| NR"))] == [
        f"| VHB | tape | {one} | 6.0 +- 1.0 % | gradient-boosted trees 10.0 % |",
        f"| NR | virtual | {one} | 6.0 +- 1.0 % | gradient-boosted trees 10.0 % |",
        f"| VHB | tape | rate | {one} | 60.0 +- 10.0 % | - | PL-SLS 25.0 % |",
        f"| NR | virtual | rate | {one} | 11.0 +- 1.0 % | - | PL-SLS 25.0 % |",
    ]
    assert "| PL-Wiechert | - | - |" in cells
    assert "Left out: putty: one recording only" in cells
    # Where PL is better it is said: 0.3 and 0.4 more than it.
    assert text.count("**PL-SLS predicts a rate never seen better") == 1
    assert "by 35.0 % of the stress." in text
    network = "FFRI1, 3 neurons, bayesian. NRMSE 60.0 ± 10.0 % by unseen rate. "
    assert f"- **For a rate never seen**: {network}Best other model: PL-SLS" in text
    assert "The network is worse by 35.0 ± 5.0 % of the stress." in text


def test_what_simulated_recordings_are_worth_is_said(written):
    results, home, _ = written
    row = {
        "label": "VHB, tape",
        "inputs": "FFH7",
        "unseen": "rate",
        "without": [0.5, 0.7],
        "with": [0.2, 0.2],
        "gain": 0.4,
        "gain_error": 0.1,
    }
    found = {
        "headline": {"networks": 1, "helped": 1, "harmed": 0},
        "neurons": 4,
        "networks": [row],
        "left_out": {},
    }
    (results / "augmentation.json").write_text(json.dumps(found))
    told = {
        "network": "FFRI1",
        "unseen": "0.1 /s",
        "sentence": "It lacks slack (93 %).",
    }
    lacks = {"materials": {"VHB, tape": told}}
    (results / "lacks.json").write_text(json.dumps(lacks))
    text = make(results, home).read_text()
    assert "60.0 +- 10.0 % | 20.0 +- 0.0 % | 40.0 +- 10.0 %" in re.sub(" +", " ", text)
    assert "Diagnosis of the network where it is worst, 0.1 /s (FFRI1;" in text
    assert "`python -m studies.lacks`). It lacks slack (93 %)." in text


def test_without_results_the_page_names_the_command(tmp_path):
    text = make(tmp_path, tmp_path).read_text()
    assert "Not run: `python -m studies.architectures`" in text


def test_the_page_of_the_project_is_that_of_its_results(tmp_path):
    kept = ROOT / "docs" / "architectures.md"
    assert make(ROOT / "studies" / "results", tmp_path).read_text() == kept.read_text()


@pytest.mark.slow
def test_nothing_is_said_of_a_network_that_is_chosen_no_more(tmp_path, monkeypatch):
    from softnn.study.common import results_folder

    monkeypatch.chdir(tmp_path)
    place = results_folder(smoke=True)
    place.mkdir(parents=True, exist_ok=True)
    gone = {"materials": {"a rubber": {"network": "FFRI1, 4 neurons", "sentence": "?"}}}
    (place / "lacks.json").write_text(json.dumps(gone))
    found = smoked("lacks")["lacks"]["materials"]
    assert [name.split(",")[0] for name in found] == ["NatPolR"]
    (one,) = found.values()
    assert one["sentence"].startswith("It ")
    assert sum(one["never_shown"].values()) <= 1
    assert one["error_without_factor"] <= one["error"] * (1 + 1e-9)
