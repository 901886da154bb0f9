"""How many neurons does a material need, and what do its networks know of other rates?

Networks of 1 to 20 neurons are cross-validated as in the thesis (section 6.4.2). The
best count is then judged by specimen and by strain rate as well: random folds put
neighbours in time of one specimen on both sides, and so measure interpolation. Beside
the networks stand the piecewise-linear models on the same data, and Table 6.6.

Stopped at any moment and started again, it goes on where it was.
"""

from __future__ import annotations

import csv
import io
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.contracts import InputError
from softnn.materials import MATERIALS, table
from softnn.search import Finished, Value
from studies.baselines import piecewise_baselines
from studies.common import (
    COLOURS,
    FAINT,
    INK,
    guarded,
    markdown,
    new_figure,
    percent,
    plain,
    save_figure,
    write_result,
)
from studies.material_data import Data, prepared
from studies.settings import (
    SPLITS,
    Places,
    Settings,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from studies.sweep import WHAT, Sweep, headline_of_all, trial_entry

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ENOUGH = 0.999  # R2 above which the thesis takes the fewest neurons
BEST = Path(__file__).parent / "best"
REPORTED = ("random", "specimen", "rate")
NOTE = (
    "thesis: Table 6.6, measured on other recordings, which were never published. All "
    "else is this run on the data named. Random folds: eq. 6.7, interpolation between "
    "neighbours in time. Mean over rates: eq. 5.13, the rate fitted among them; for "
    "the network, held-out samples of random folds. By specimen, by rate: nothing of "
    "the specimen or rate was seen in training."
)


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.neurons`; returns the exit code."""
    made = study_parser("neurons", __doc__, Settings())
    made.add_argument(
        "--keep-best",
        action="store_true",
        help="write the best configuration to studies/best, for the tests to hold",
    )
    arguments = made.parse_args(argv)

    def work() -> None:
        settings = settings_of(arguments)
        # Only the published protocol may replace the project's results.
        usual = Settings(material=settings.material, data=settings.data)
        places = places_of(arguments, published=settings == usual)
        run(
            smoked(settings) if arguments.smoke else settings,
            places,
            keep_best=arguments.keep_best,
        )

    return guarded(work)


def run(settings: Settings, places: Places, keep_best: bool = False) -> dict[str, Any]:
    """The study of every material asked for; returns what was written."""
    began = time.perf_counter()
    found = []
    for data in prepared(settings):
        found.append(study(data, settings, places))
        if keep_best:
            keep(found[-1], data, settings)
    headline = headline_of_all(found, time.perf_counter() - began)
    path = write_result(
        settings.file_name("neurons"),
        headline,
        {"settings": asdict(settings), "materials": found},
        seed=settings.seed,
        data={f["label"]: f["data_sha256"] for f in found},
        folder=places.results,
    )
    print(f"result: {path}; runs: {places.tracking}")
    return {"headline": headline, "materials": found}


def study(data: Data, settings: Settings, places: Places) -> dict[str, Any]:
    """One material: every count, the best one on the other splits, the baselines."""
    others = [split for split in REPORTED if split != settings.split]
    space: dict[str, Sequence[Value]] = {
        "neurons": settings.neurons,
        "split": list(SPLITS),
    }
    total = len(settings.neurons) + len(others)
    with Sweep("neurons", data, settings, space, places, total) as sweep:
        grid = [
            sweep.run(neurons=count, split=settings.split) for count in settings.neurons
        ]
        best = pick(grid)
        judged: dict[str, Finished | str] = {settings.split: best}
        for split in others:
            judged[split] = sweep.possible(split) or sweep.run(
                neurons=best.parameters["neurons"], split=split
            )
        baselines = piecewise(data)
        rows = comparison(data, judged, baselines)
        figure_of = save_figure(
            draw(data, settings, grid, best),
            f"{settings.file_name('neurons')}-{data.file_name}",
            places.results,
        )
        text = markdown(HEADER, [printed(row) for row in rows])
        headline = headline_of(judged, baselines, best)
        sweep.tracker.curve(
            {
                "r2": [(t.parameters["neurons"], t.result["r2_mean"]) for t in grid],
                "nrmse": [(t.parameters["neurons"], t.value) for t in grid],
            },
            sweep.ended,
        )
        sweep.tracker.result(
            {k: v for k, v in headline.items() if isinstance(v, int | float)},
            note=f"**{data.label}**\n\n{text}\n\n{NOTE}",
            files=figure_of,
            texts={
                "comparison.csv": as_csv(rows),
                "neurons.csv": as_csv([count_row(t) for t in grid]),
                "best.json": json.dumps(plain(configuration(best, settings)), indent=1),
            },
            tags={"best": f"{best.parameters['neurons']} neurons"},
        )
        stored = sum(t.stored for t in sweep.trials)
    print(f"\n{data.label}: {text_of_choice(best)}\n\n{text}\n\n{NOTE}")
    for note in filter(None, [sweep.from_store(), *_notes(judged, baselines)]):
        print(note)
    return {
        "material": data.material,
        "label": data.label,
        "data_sha256": data.digest,
        "samples": sum(map(len, data.tensile)),
        "specimens": len({r.specimen or r.name for r in data.tensile}),
        "headline": headline,
        "best": configuration(best, settings),
        "comparison": rows,
        "note": NOTE,
        "not_possible": {k: v for k, v in judged.items() if isinstance(v, str)},
        "grid": [trial_entry(t) for t in grid],
        "splits": {
            k: trial_entry(v) for k, v in judged.items() if isinstance(v, Finished)
        },
        "baselines": baselines,
        "trials_from_store": stored,
        "study_key": sweep.key,
    }


def pick(grid: Sequence[Finished]) -> Finished:
    """The thesis's rule: fewest neurons with R2 above 99.9 %, else the largest R2."""
    enough = [t for t in grid if t.result["r2_mean"] > ENOUGH]
    if enough:
        return min(enough, key=lambda t: t.parameters["neurons"])
    return max(grid, key=lambda t: (t.result["r2_mean"], -t.parameters["neurons"]))


def text_of_choice(best: Finished) -> str:
    """The choice and its reason, in a line."""
    count, r2 = best.parameters["neurons"], best.result["r2_mean"]
    why = "fewest with R2 above 99.9 %" if r2 > ENOUGH else "largest R2"
    return f"{count} neurons ({why}: {percent(r2)})"


def piecewise(data: Data) -> dict[str, Any]:
    """The piecewise-linear models on the same data, or why they cannot be fitted."""
    try:
        return plain(piecewise_baselines(data.tensile, data.relaxation))
    except InputError as reason:
        return {"not_possible": str(reason)}


HEADER = ("judged on", "model", "NRMSE", "R2", "size")
OVER_RATES = "mean over rates"
WAYS = {"as_in_thesis": "", "joint": ", fitted jointly"}


def comparison(
    data: Data, judged: dict[str, Finished | str], baselines: dict[str, Any]
) -> list[dict[str, Any]]:
    """This run's network, the piecewise models on the same data, and Table 6.6.

    Rows that were judged alike stand together.
    """
    rows = []
    for split, trial in judged.items():
        if isinstance(trial, str):
            rows.append(_row(WHAT[split], "network: not possible here"))
            continue
        found = trial.result
        size = f"{trial.parameters['neurons']} neurons"
        rows.append(_row(WHAT[split], "network", trial.value, found["r2_mean"], size))
        if split == "random" and len(found["nrmse_by_rate"]) > 1:
            mean = float(np.mean(list(found["nrmse_by_rate"].values())))
            rows.append(_row(OVER_RATES, "network, random folds", mean, None, size))
    for model, fit in _fits(baselines).items():
        error, size = fit["generalisation_error"], f"{fit['segments']} segments"
        rows.append(_row(OVER_RATES, model, error, None, size))
        for split, of in fit["like_for_like"].items():
            for way, name in WAYS.items():
                if "nrmse" in of[way]:
                    found = of[way]
                    rows.append(
                        _row(WHAT[split], model + name, found["nrmse"], found["r2"])
                    )
    if data.is_virtual:
        rows += published(data.material)
    order = [*WHAT.values(), OVER_RATES]
    return sorted(rows, key=lambda row: order.index(row["judged_on"]))


def published(material: str) -> list[dict[str, Any]]:
    """Rows of Table 6.6: printed in per cent there, fractions here."""
    rows = []
    for row in table("6.6").rows:
        if row["material"] != material:
            continue
        error = row["generalisation_error"] / 100
        if row["model"] == "ANN":
            r2, size = row["r2"] / 100, f"{row['neurons']} neurons"
            rows.append(_row(WHAT["random"], "thesis: network", error, r2, size))
        else:
            size = f"tolerance {row['tolerance']} %"
            rows.append(_row(OVER_RATES, f"thesis: {row['model']}", error, None, size))
    return rows


def _row(
    judged: str,
    model: str,
    error: float | None = None,
    r2: float | None = None,
    size: str | None = None,
) -> dict[str, Any]:
    return {"judged_on": judged, "model": model, "nrmse": error, "r2": r2, "size": size}


def printed(row: dict[str, Any]) -> list[str | None]:
    """A row of the comparison as it is printed."""
    return [
        row["judged_on"],
        row["model"],
        percent(row["nrmse"]),
        percent(row["r2"]),
        row["size"],
    ]


def headline_of(
    judged: dict[str, Finished | str],
    baselines: dict[str, Any],
    best: Finished,
) -> dict[str, Any]:
    """Named figures, flat; errors and R2 as fractions."""
    figures: dict[str, Any] = {
        "neurons": best.parameters["neurons"],
        "gamma_mean": round(float(np.mean(best.result["gamma"])), 1),
        "parameters": best.result["parameters"],
        "samples": best.result["samples"],
    }
    for split, trial in judged.items():
        if isinstance(trial, Finished):
            figures[f"nrmse_{split}"] = trial.value
            figures[f"r2_{split}"] = trial.result["r2_mean"]
    for name, fit in _fits(baselines).items():
        key = name.lower().replace("-", "_")
        figures[f"nrmse_{key}_over_rates"] = fit["generalisation_error"]
        for split, of in fit["like_for_like"].items():
            figures[f"nrmse_{key}_{split}"] = of["as_in_thesis"].get("nrmse")
    return figures


def _fits(baselines: dict[str, Any]) -> dict[str, Any]:
    return {} if "not_possible" in baselines else baselines


def _notes(judged: dict[str, Finished | str], baselines: dict[str, Any]) -> list[str]:
    notes = []
    for split, trial in judged.items():
        if isinstance(trial, str):
            notes.append(f"{WHAT[split]}: not possible here: {trial}")
        elif trial.result["note"]:
            notes.append(f"{WHAT[split]}: {trial.result['note']}")
    if "not_possible" in baselines:
        notes.append(f"piecewise models: {baselines['not_possible']}")
    return notes


def count_row(trial: Finished) -> dict[str, Any]:
    """A neuron count as a row of the table that MLflow shows."""
    found = trial.result
    return {
        "neurons": trial.parameters["neurons"],
        "r2_mean": found["r2_mean"],
        "r2_least": min(found["r2"]),
        "generalisation_error": trial.value,
        "nrmse_largest": max(found["nrmse"]),
        "gamma_mean": float(np.mean(found["gamma"])),
        "parameters": found["parameters"],
        "iterations_mean": float(np.mean(found["iterations"])),
        "seconds": found["seconds"],
    }


def as_csv(rows: Sequence[dict[str, Any]]) -> str:
    """Rows of the same keys as CSV text."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


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


def keep(found: dict[str, Any], data: Data, settings: Settings) -> Path:
    """Write the best configuration to `studies/best`, for the tests to hold."""
    BEST.mkdir(parents=True, exist_ok=True)
    path = BEST / f"{data.file_name}.json"
    best = found["best"]
    best["settings"]["material"] = data.material
    content = {"data_sha256": data.digest, **best}
    path.write_text(json.dumps(plain(content), indent=1) + "\n", encoding="utf-8")
    print(f"kept: {path}")
    return path


# --- figure ---------------------------------------------------------------------------


def draw(
    data: Data, settings: Settings, grid: Sequence[Finished], best: Finished
) -> Figure:
    """R2 and generalisation error against neurons, as in Figs 6.4 to 6.6."""
    figure = new_figure()
    left, right = figure.subplots(1, 2)
    thesis = None
    if data.is_virtual and data.material in MATERIALS:
        thesis = table("6.6").row(material=data.material, model="ANN")
    for axes, key, mean, label, value in (
        (left, "r2", "r2_mean", "R\N{SUPERSCRIPT TWO} [%]", "r2"),
        (
            right,
            "nrmse",
            "generalisation_error",
            "generalisation error [%]",
            "generalisation_error",
        ),
    ):
        reference = (thesis["neurons"], thesis[value]) if thesis else None
        _panel(axes, grid, best, key, mean, reference)
        axes.set_ylabel(label)
    number = len(best.result["nrmse"])
    left.set_title(f"{data.label}, {WHAT[settings.split]}", color=INK)
    right.set_title(f"{settings.inputs}, {number} networks a count", color=INK)
    left.legend(loc="lower right", fontsize=8)
    return figure


def _panel(
    axes: Axes,
    grid: Sequence[Finished],
    best: Finished,
    key: str,
    mean: str,
    reference: tuple[int, float] | None,
) -> None:
    count = [t.parameters["neurons"] for t in grid]
    line = 100 * np.array([t.result[mean] for t in grid])
    folds = 100 * np.array([t.result[key] for t in grid])
    axes.fill_between(
        count,
        folds.min(axis=1),
        folds.max(axis=1),
        color=COLOURS[0],
        alpha=0.18,
        linewidth=0,
        label="least and largest of the folds",
    )
    axes.plot(count, line, "o-", color=COLOURS[0], markersize=3.5, label="mean")
    chosen = best.parameters["neurons"]
    value = 100 * best.result[mean]
    axes.plot(
        chosen,
        value,
        "o",
        markersize=11,
        markerfacecolor="none",
        markeredgecolor=COLOURS[1],
        markeredgewidth=1.8,
        label=f"chosen: {chosen} neurons",
    )
    if reference:
        axes.plot(
            *reference,
            "D",
            color=FAINT,
            markersize=5,
            label="thesis (other recordings)",
        )
    axes.set_xlabel("neurons in the hidden layer")
    axes.set_xlim(min(count) - 0.6, max(count) + 0.6)
    axes.locator_params(axis="x", integer=True)
    axes.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)


if __name__ == "__main__":
    sys.exit(main())
