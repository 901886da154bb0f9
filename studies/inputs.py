"""Which inputs let a network predict the stress: strain, past strains, strain rate?

The four architectures of Table 6.3 are cross-validated with 20 neurons on a tenth of
the samples, as in Table 6.4 and Figs 6.2 and 6.3 of the thesis, and by strain rate.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from softnn.neural import PUBLISHED
from softnn.search import Finished, Range, Value
from softnn.study.common import guarded, markdown, percent, save_figure
from softnn.study.material_data import Data, prepared
from softnn.study.settings import (
    SPLITS,
    Places,
    Settings,
    of_one_count,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from softnn.study.sweep import WHAT, Sweep, trial_entry, write_all
from studies.shown.inputs import draw

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
        settings = of_one_count(settings_of(arguments, DEFAULTS))
        usual = replace(DEFAULTS, material=settings.material, data=settings.data)
        places = places_of(arguments, published=settings == usual)
        run(smoked(settings) if arguments.smoke else settings, places)

    return guarded(work)


def run(settings: Settings, places: Places) -> dict[str, Any]:
    """The study of every material asked for; returns what was written."""
    found = [study(data, settings, places) for data in prepared(settings)]
    files = save_figure(
        draw(found, settings), settings.file_name("inputs"), places.results
    )
    print(f"{NOTE}\nfigure: {files[0]}")
    return write_all("inputs", settings, places, found, note=NOTE)


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
        entries = [trial_entry(t) for of in trials.values() for t in of.values()]
        told = sweep.entry(headline, trials=entries)
    print(f"\n{data.label}: best {best}\n\n{text}\n")
    if sweep.from_store():
        print(sweep.from_store())
    return told


if __name__ == "__main__":
    sys.exit(main())
