"""The picture of docs/architectures.md: `python -m studies.pictures`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bench.architectures.page import PANELS
from softnn.study.common import COLOURS, FAINT, RESULTS, new_figure

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "docs" / "figures"
JUDGED = ("random folds", "by specimen", "by rate")
SHOWN = "NatPolR"
MARKS = {
    "network": (COLOURS[1], "o"),
    "network, fewest needed": (COLOURS[4], "o"),
    "PL-SLS, fitted jointly": (COLOURS[0], "s"),
    "PL-Wiechert, fitted jointly": (COLOURS[2], "D"),
}


def judged() -> None:
    """What random folds claim, and what a new specimen or a new rate shows."""
    figure = new_figure(7.6, 2.4)
    panels = figure.subplots(1, len(PANELS), sharey=True)
    for axes, (name, title) in zip(panels, PANELS.items(), strict=True):
        for i, (model, (colour, mark)) in enumerate(MARKS.items()):
            for row, error in errors(name, model).items():
                height = row + 0.14 * (i - (len(MARKS) - 1) / 2)  # none hides another
                axes.plot(100 * error, height, mark, color=colour, markersize=5.5)
        axes.set_xscale("log")
        axes.set_xlim(1, 500)
        axes.set_xticks([1, 10, 100], ["1", "10", "100"])
        axes.set_title(title)
        axes.set_xlabel("NRMSE [%]")
        axes.set_ylim(len(JUDGED) - 0.5, -0.5)
        axes.grid(axis="x", color=FAINT, alpha=0.3, linewidth=0.6)
    panels[0].set_yticks(range(len(JUDGED)), JUDGED)
    for model, (colour, mark) in MARKS.items():
        panels[0].plot([], [], mark, color=colour, label=model)
    figure.legend(loc="outside lower center", ncols=len(MARKS), fontsize=8)
    FIGURES.mkdir(parents=True, exist_ok=True)
    figure.savefig(FIGURES / "judged.png", dpi=110)


def errors(panel: str, model: str) -> dict[int, float]:
    """Error of a model by the row it is drawn on; of several materials, of `SHOWN`."""
    every = result(panel)["materials"]
    one = next((m for m in every if m["material"] == SHOWN), every[0])
    return {
        JUDGED.index(row["judged_on"]): row["nrmse"]
        for row in one["comparison"]
        if row["model"] == model and row["judged_on"] in JUDGED
    }


def result(name: str) -> dict[str, Any]:
    """What studies/results/NAME.json holds."""
    return dict(json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8")))


if __name__ == "__main__":
    judged()
