"""The choice of a network from a sweep, its rivals, and how to train it again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from softnn import json_file
from softnn.contracts import InputError
from softnn.json_file import plain
from softnn.neural import Settings as Training
from softnn.search import Finished
from softnn.study.baselines import piecewise_baselines
from softnn.study.common import percent
from softnn.study.material_data import Data
from softnn.study.settings import Settings
from softnn.study.sweep import Sweep, trial_entry

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


def on_splits(
    sweep: Sweep, networks: Mapping[str, Finished], others: Sequence[str]
) -> dict[str, dict[str, Finished | str]]:
    """Return networks by name on all splits; the reason if a split is impossible."""

    def trial(one: Finished, split: str) -> Finished | str:
        count = one.parameters["neurons"]
        return sweep.possible(split) or sweep.run(neurons=count, split=split)

    return {
        name: {sweep.settings.split: one, **{s: trial(one, s) for s in others}}
        for name, one in networks.items()
    }


def entries_of(
    judged: Mapping[str, Mapping[str, Finished | str]],
) -> dict[str, dict[str, Any]]:
    """Return trials by network and split, for the result file."""
    return {
        name: {
            split: {"not_possible": t} if isinstance(t, str) else trial_entry(t)
            for split, t in splits.items()
        }
        for name, splits in judged.items()
    }


def configuration(
    best: Finished, settings: Settings, training: Training
) -> dict[str, Any]:
    """Return the settings to train the best network again, and its errors."""
    wanted = replace(settings, neurons=(best.parameters["neurons"],))
    return {
        "settings": asdict(wanted),
        "training": asdict(training),
        "generalisation_error": best.value,
        "nrmse": best.result["nrmse"],
        "r2_mean": best.result["r2_mean"],
        "gamma_mean": float(np.mean(best.result["gamma"])),
    }


def piecewise(data: Data) -> dict[str, Any]:
    """Return piecewise-linear models on the same data, or why none can be fitted."""
    try:
        return plain(piecewise_baselines(data.tensile, data.relaxation))
    except InputError as reason:
        return {"not_possible": str(reason)}


def keep(found: dict[str, Any], data: Data, folder: Path) -> Path:
    """Write the best configuration to a folder, where tests read it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{data.file_name}.json"
    best = found["best"]
    best["settings"]["material"] = data.material
    content = {"data_sha256": data.digest, **best}
    json_file.write(path, content)
    print(f"kept: {path}")
    return path
