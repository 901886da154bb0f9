"""How the neurons study shows what it found: the comparison and the figure."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.json_file import plain
from softnn.materials import MATERIALS, table
from softnn.search import Finished
from softnn.study import common
from softnn.study.baselines import WAYS
from softnn.study.material_data import Data
from softnn.study.settings import Places, Settings
from softnn.study.sweep import WHAT, Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NOTE = (
    "Random folds: eq. 6.7, interpolation between neighbours in time. Mean over rates: "
    "eq. 5.13, the rate fitted among them; for networks, held-out samples of random "
    "folds. By specimen, by rate: nothing of the specimen or rate was seen in "
    "training. Fewest needed: R2 within one standard error of the largest (Breiman et "
    "al. 1984), where that is fewer neurons."
)
NOTE_ON_THESIS = (
    " Thesis: Table 6.6, measured on other recordings, which were never published; all "
    "else is this run, on virtual specimens. Their scatter was calibrated to the error "
    "of the thesis's networks (studies/calibration.py): that the two agree on random "
    "folds shows nothing."
)
HEADER = ("judged on", "model", "NRMSE", "R2", "size")
WIDE = 15  # folds as far apart as this (ratio) are drawn on a log scale
OVER_RATES = "mean over rates"
CURVES = {"r2_by_neurons": "r2_mean", "nrmse_by_neurons": "generalisation_error"}
CHOSEN, FEW = "network", "network, fewest needed"

Judged = Mapping[str, Mapping[str, Finished | str]]
"""Network by name -> split -> its trial, or why the data cannot be split so."""


def comparison(
    data: Data, judged: Judged, baselines: dict[str, Any]
) -> list[dict[str, Any]]:
    """This run's networks, the piecewise models on the same data, and Table 6.6.

    Rows that were judged alike stand together.
    """
    rows = []
    for name, splits in judged.items():
        for split, trial in splits.items():
            if isinstance(trial, str):
                rows.append(_row(WHAT[split], f"{name}: not possible here"))
                continue
            found = trial.result
            size = f"{trial.parameters['neurons']} neurons"
            rows.append(_row(WHAT[split], name, trial.value, found["r2_mean"], size))
            if split == "random" and len(found["nrmse_by_rate"]) > 1:
                mean = float(np.mean(list(found["nrmse_by_rate"].values())))
                rows.append(_row(OVER_RATES, name, mean, None, size))
    for model, fit in _fits(baselines).items():
        error, size = fit["generalisation_error"], f"{fit['segments']} segments"
        name = f"{model}, {WAYS['as_in_thesis']}"
        rows.append(_row(OVER_RATES, name, error, None, size))
        for split, of in fit["like_for_like"].items():
            for way, name in WAYS.items():
                if "nrmse" in of[way]:
                    error, r2 = of[way]["nrmse"], of[way]["r2"]
                    rows.append(_row(WHAT[split], f"{model}, {name}", error, r2))
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


def note_on(data: Data) -> str:
    """What a reader of the comparison must know."""
    return NOTE + (NOTE_ON_THESIS if data.is_virtual else "")


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
        common.percent(row["nrmse"]),
        common.percent(row["r2"]),
        row["size"],
    ]


def headline_of(judged: Judged, baselines: dict[str, Any]) -> dict[str, Any]:
    """Named figures, flat; errors and R2 as fractions."""
    figures: dict[str, Any] = {}
    for name, splits in judged.items():
        end = "" if name == CHOSEN else "_few"
        for split, trial in splits.items():
            if isinstance(trial, str):
                continue
            if f"neurons{end}" not in figures:
                figures |= {
                    f"neurons{end}": trial.parameters["neurons"],
                    f"parameters{end}": trial.result["parameters"],
                    f"gamma_mean{end}": float(np.mean(trial.result["gamma"])),
                    "samples": trial.result["samples"],
                }
            figures[f"nrmse_{split}{end}"] = trial.value
            figures[f"r2_{split}{end}"] = trial.result["r2_mean"]
    for name, fit in _fits(baselines).items():
        key = name.lower().replace("-", "_")
        figures[f"nrmse_{key}_over_rates"] = fit["generalisation_error"]
        for split, of in fit["like_for_like"].items():
            figures[f"nrmse_{key}_{split}"] = of["as_in_thesis"].get("nrmse")
    return figures


def _fits(baselines: dict[str, Any]) -> dict[str, Any]:
    return {} if "not_possible" in baselines else baselines


def notes(judged: Judged, baselines: dict[str, Any]) -> list[str]:
    """What could not be done, or not as asked for, a line each."""
    found = []
    for split, trial in judged[CHOSEN].items():
        if isinstance(trial, str):
            found.append(f"{WHAT[split]}: not possible here: {trial}")
        elif trial.result["note"]:
            found.append(f"{WHAT[split]}: {trial.result['note']}")
    if "not_possible" in baselines:
        found.append(f"piecewise models: {baselines['not_possible']}")
    return found


def track(
    sweep: Sweep,
    places: Places,
    grid: Sequence[Finished],
    best: Finished,
    rows: Sequence[dict[str, Any]],
    headline: Mapping[str, Any],
    kept: Mapping[str, Any],
) -> str:
    """Log figure, tables, curves and `kept` as the result of a sweep; text and note."""
    data, settings = sweep.data, sweep.settings
    name = f"{settings.file_name('neurons')}-{data.file_name}"
    files = common.save_figure(draw(data, settings, grid, best), name, places.results)
    text = common.markdown(HEADER, [printed(row) for row in rows])
    text = f"{text}\n\n{note_on(data)}"
    table = [count_row(t) for t in grid]
    curves = {k: [(r["neurons"], r[v]) for r in table] for k, v in CURVES.items()}
    sweep.tracker.curve(curves, sweep.ended)
    sweep.tracker.result(
        {k: v for k, v in headline.items() if isinstance(v, int | float)}
        | {"nrmse": best.value, "r2": best.result["r2_mean"]},
        note=f"**{data.label}**\n\n{text}",
        files=files,
        texts={
            "comparison.csv": as_csv(rows),
            "neurons.csv": as_csv(table),
            **{f"{k}.json": json.dumps(plain(v), indent=1) for k, v in kept.items()},
        },
        tags={"best": f"{best.parameters['neurons']} neurons"},
    )
    return text


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
    """Rows of the same keys as CSV text, six digits a number."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()}
        )
    return text.getvalue()


# --- figure ---------------------------------------------------------------------------


def draw(
    data: Data, settings: Settings, grid: Sequence[Finished], best: Finished
) -> Figure:
    """R2 and generalisation error against neurons, as in Figs 6.4 to 6.6."""
    figure = common.new_figure()
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
    figure.suptitle(
        f"{data.label}: {settings.inputs}, {WHAT[settings.split]}, {number} networks "
        "a count",
        fontsize=9,
        x=0.01,
        ha="left",
    )
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
    folds = 100 * np.array([t.result[key] for t in grid])
    missing = 100 - folds if key == "r2" else folds  # what is small when all is well
    wide = missing.max() > WIDE * missing.min() > 0
    shown = _missing if wide and key == "r2" else np.asarray
    low, high = shown(folds).min(axis=1), shown(folds).max(axis=1)
    axes.fill_between(
        count,
        low,
        high,
        color=common.COLOURS[0],
        alpha=0.18,
        linewidth=0,
        label="least and largest of the folds",
    )
    line = shown(100 * np.array([t.result[mean] for t in grid]))
    axes.plot(count, line, "o-", color=common.COLOURS[0], markersize=3.5, label="mean")
    chosen = best.parameters["neurons"]
    axes.plot(
        chosen,
        shown(100 * np.array(best.result[mean])),
        "o",
        markersize=11,
        markerfacecolor="none",
        markeredgecolor=common.COLOURS[1],
        markeredgewidth=1.8,
        label=f"chosen: {chosen} neurons",
    )
    if reference:
        axes.plot(
            reference[0],
            shown(np.array(reference[1])),
            "D",
            color=common.FAINT,
            markersize=5,
            label="thesis (other recordings)",
        )
    if wide:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        if key == "r2":
            axes.yaxis.set_major_formatter(lambda y, _: f"{100 - y:g}")
            axes.invert_yaxis()
        axes.minorticks_off()
    axes.set_xlabel("neurons in the hidden layer")
    axes.set_xlim(min(count) - 0.6, max(count) + 0.6)
    axes.locator_params(axis="x", integer=True)
    axes.grid(axis="y", color=common.FAINT, alpha=0.25, linewidth=0.6)


def _missing(r2: np.ndarray) -> np.ndarray:
    """What R2 lacks of 100 %: on a log scale, 99.9 is as far from 99 as 99 from 90."""
    return 100 - r2
