"""Which inputs let a network foretell the stress: strain, past strains, strain rate?

The four architectures of Table 6.3 are cross-validated with 20 neurons on a tenth of
the samples, as in Table 6.4 and Figs 6.2 and 6.3 of the thesis, and by strain rate.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.contracts import InputError
from softnn.neural import PUBLISHED
from softnn.search import Finished, Range, Value
from softnn.study.common import (
    COLOURS,
    FAINT,
    guarded,
    markdown,
    new_figure,
    percent,
    save_figure,
    write_result,
)
from softnn.study.material_data import Data, prepared
from softnn.study.settings import (
    SPLITS,
    Places,
    Settings,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from softnn.study.sweep import WHAT, Sweep, headline_of_all, trial_entry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Table 6.4 of the thesis.
DEFAULTS = Settings(neurons=(20,), fraction=0.1)
NOTE = (
    "The thesis prints no numbers for this figure; it finds FFRD4 to have the smallest "
    "error, FFRI1 close to it for EPR and NR. A lag is one sample of the recording."
)


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.inputs`; returns the exit code."""
    arguments = study_parser("inputs", __doc__, DEFAULTS, omit="inputs").parse_args(
        argv
    )

    def work() -> None:
        settings = settings_of(arguments, DEFAULTS)
        if len(settings.neurons) > 1:
            raise InputError(f"neurons are {settings.neurons}; give one count")
        usual = Settings(
            material=settings.material,
            data=settings.data,
            neurons=DEFAULTS.neurons,
            fraction=DEFAULTS.fraction,
        )
        places = places_of(arguments, published=settings == usual)
        run(smoked(settings) if arguments.smoke else settings, places)

    return guarded(work)


def run(settings: Settings, places: Places) -> dict[str, Any]:
    """The study of every material asked for; returns what was written."""
    found = [study(data, settings, places) for data in prepared(settings)]
    headline = headline_of_all(found)
    name = settings.file_name("inputs")
    files = save_figure(draw(found, settings), name, places.results)
    path = write_result(
        name,
        headline,
        {"settings": asdict(settings), "materials": found, "note": NOTE},
        seed=settings.seed,
        data={one["label"]: one["data_sha256"] for one in found},
        folder=places.results,
    )
    print(f"{NOTE}\nresult: {path}; figure: {files[0]}; runs: {places.tracking}")
    return {"headline": headline, "materials": found}


def study(data: Data, settings: Settings, places: Places) -> dict[str, Any]:
    """Every architecture on one material, on the split asked for and by rate."""
    splits = list(dict.fromkeys([settings.split, "rate"]))
    space: dict[str, Sequence[Value] | Range] = {
        "inputs": list(PUBLISHED),
        "neurons": settings.neurons,
        "split": list(SPLITS),
    }
    total = len(splits) * len(PUBLISHED)
    count = settings.neurons[0]
    with Sweep("inputs", data, settings, space, places, total) as sweep:
        possible = [s for s in splits if sweep.possible(s) is None]
        trials: dict[str, dict[str, Finished]] = {
            name: {
                split: sweep.run(inputs=name, neurons=count, split=split)
                for split in possible
            }
            for name in PUBLISHED
        }
        judged = possible[0]
        best = min(trials, key=lambda name: trials[name][judged].value)
        header = ["inputs", *(f"NRMSE, {WHAT[s]}" for s in possible), "R2"]
        rows = [
            [
                name,
                *(percent(of[s].value) for s in possible),
                percent(of[judged].result["r2_mean"]),
            ]
            for name, of in trials.items()
        ]
        text = markdown(header, rows)
        headline = {"best_inputs": best} | {
            f"nrmse_{split}_{name}": of[split].value
            for name, of in trials.items()
            for split in possible
        }
        sweep.tracker.result(
            {k: v for k, v in headline.items() if not isinstance(v, str)},
            note=f"**{data.label}**\n\n{text}\n\n{NOTE}",
            texts={"inputs.md": text},
            tags={"best": best},
        )
        seconds = sweep.seconds
    print(f"\n{data.label}: best {best}\n\n{text}\n")
    if sweep.from_store():
        print(sweep.from_store())
    return {
        "material": data.material,
        "label": data.label,
        "data_sha256": data.digest,
        "headline": headline,
        "trials": [trial_entry(t) for of in trials.values() for t in of.values()],
        "trials_from_store": sum(t.stored for t in sweep.trials),
        "seconds": seconds,
        "study_key": sweep.key,
    }


def draw(found: Sequence[dict[str, Any]], settings: Settings) -> Figure:
    """Generalisation error of each architecture, a panel a material."""
    columns = min(len(found), 4)
    rows = -(-len(found) // columns)
    figure = new_figure(max(4.8, 2.4 * columns), 2.6 * rows + 0.4)
    panels = np.atleast_1d(figure.subplots(rows, columns, squeeze=False).ravel())
    for axes in panels[len(found) :]:
        axes.set_visible(False)
    for axes, one in zip(panels, found, strict=False):
        trials = [t for t in one["trials"] if t["split"] == settings.split]
        names = [t["inputs"] for t in trials]
        height = [100 * t["generalisation_error"] for t in trials]
        best = int(np.argmin(height))
        axes.bar(
            names,
            height,
            width=0.6,
            color=[COLOURS[1] if i == best else COLOURS[0] for i in range(len(names))],
        )
        for i, t in enumerate(trials):
            folds = 100 * np.array(t["nrmse"])
            axes.plot(np.full(len(folds), i), folds, ".", color="#222222", markersize=3)
        axes.set_title(one["material"])
        axes.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
        axes.tick_params(axis="x", labelsize=7)
    panels[0].set_ylabel(f"NRMSE [%], {WHAT[settings.split]}")
    source = "virtual specimens" if settings.data == "virtual" else settings.data
    figure.suptitle(
        f"{source}: {settings.neurons[0]} neurons, {settings.fraction:.0%} of the "
        "samples; bar: mean, dots: folds",
        fontsize=9,
        x=0.01,
        ha="left",
    )
    return figure


if __name__ == "__main__":
    sys.exit(main())
