"""Which network of a sweep is taken, and what it takes to train it again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from softnn.search import Finished
from softnn.study.common import (
    percent,
)
from softnn.study.settings import (
    Settings,
)

ENOUGH = 0.999  # R2 above which the thesis takes the fewest neurons


def pick(grid: Sequence[Finished]) -> Finished:
    """The thesis's rule: fewest neurons with R2 above 99.9 %, else the largest R2."""
    enough = [t for t in grid if t.result["r2_mean"] > ENOUGH]
    if enough:
        return min(enough, key=lambda t: t.parameters["neurons"])
    return max(grid, key=lambda t: (t.result["r2_mean"], -t.parameters["neurons"]))


def fewest(grid: Sequence[Finished]) -> Finished:
    """Fewest neurons with a mean R2 within one standard error of the largest."""
    largest = max(grid, key=lambda t: t.result["r2_mean"])
    spread = np.std(largest.result["r2"], ddof=1) / np.sqrt(len(largest.result["r2"]))
    enough = largest.result["r2_mean"] - spread
    able = [t for t in grid if t.result["r2_mean"] >= enough]
    return min(able, key=lambda t: t.parameters["neurons"])


def text_of_choice(best: Finished) -> str:
    """The choice and its reason, in a line."""
    count, r2 = best.parameters["neurons"], best.result["r2_mean"]
    why = "fewest with R2 above 99.9 %" if r2 > ENOUGH else "largest R2"
    return f"{count} neurons ({why}: {percent(r2, 3)})"


def configuration(best: Finished, settings: Settings) -> dict[str, Any]:
    """What is needed to train the best network again, and what it then reaches."""
    wanted = replace(settings, neurons=(best.parameters["neurons"],))
    return {
        "settings": asdict(wanted),
        "generalisation_error": best.value,
        "nrmse": best.result["nrmse"],
        "r2_mean": best.result["r2_mean"],
        "gamma_mean": float(np.mean(best.result["gamma"])),
    }
