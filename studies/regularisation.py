"""What holds overfitting off best: evidence, early stopping, or a fixed L2 weight?

Networks of 20 neurons on a tenth of the samples, where there is something to overfit.
The L2 weight is sought on a log scale by tree-structured Parzen estimators. Choosing a
weight by the folds it is judged on flatters it, so all three are judged again on folds
drawn anew.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from softnn.contracts import InputError
from softnn.search import Range, Value
from softnn.study.common import guarded, markdown, percent, save_figure
from softnn.study.material_data import Data, prepared
from softnn.study.settings import (
    Places,
    Settings,
    of_one_count,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from softnn.study.sweep import Sweep, trial_entry, write_all
from studies.shown.regularisation import _gamma, _key, _name, draw

DEFAULTS = Settings(neurons=(20,), fraction=0.1)
WEIGHTS = Range(1e-10, 1e-1, log=True)
TRIALS = 24
METHODS = ("bayesian", "early-stopping")


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.regularisation`; returns the exit code."""
    made = study_parser("regularisation", __doc__, DEFAULTS, omit="regularisation")
    made.add_argument(
        "--trials", type=int, default=TRIALS, help=f"L2 weights to try ({TRIALS})"
    )
    arguments = made.parse_args(argv)

    def work() -> None:
        settings = of_one_count(settings_of(arguments, DEFAULTS))
        if arguments.trials < 1:
            raise InputError(f"trials is {arguments.trials}; at least 1 is needed")
        usual = replace(DEFAULTS, material=settings.material, data=settings.data)
        as_usual = settings == usual and arguments.trials == TRIALS
        places = places_of(arguments, published=as_usual)
        if arguments.smoke:
            run(smoked(settings), places, min(arguments.trials, 4))
        else:
            run(settings, places, arguments.trials)

    return guarded(work)


def run(settings: Settings, places: Places, trials: int) -> dict[str, Any]:
    """The study of every material asked for; returns what was written."""
    found = [study(data, settings, places, trials) for data in prepared(settings)]
    return write_all("regularisation", settings, places, found, l2_trials=trials)


def study(
    data: Data, settings: Settings, places: Places, trials: int
) -> dict[str, Any]:
    """The three ways on one material."""
    count, split = settings.neurons[0], settings.split
    first, anew = settings.seed, settings.seed + 1
    space: dict[str, Sequence[Value] | Range] = {
        "regularisation": [*METHODS, "l2"],
        "weight": WEIGHTS,
        "folds_seed": [first, anew],
    }
    total = trials + 2 * len(METHODS) + 1
    with Sweep("regularisation", data, settings, space, places, total) as sweep:

        def trial(parameters: Mapping[str, Any]) -> tuple[float, dict[str, Any]]:
            how = dict(parameters)
            if "weight" in how:
                how["regularisation"] = f"l2={how.pop('weight')!r}"
            return sweep.trainer({**how, "neurons": count, "split": split})

        ways = {
            name: sweep.run(trial, regularisation=name, folds_seed=first)
            for name in METHODS
        }
        tried = list(
            sweep.minimise(trial, trials, regularisation="l2", folds_seed=first)
        )
        ways["l2"] = min(tried, key=lambda t: t.value)
        again = {
            name: sweep.run(trial, **{**way.parameters, "folds_seed": anew})
            for name, way in ways.items()
        }
        rows = [
            [_name(ways[n]), percent(ways[n].value), percent(t.value), _gamma(t)]
            for n, t in again.items()
        ]
        header = ["regularisation", "NRMSE", "NRMSE, folds anew", "gamma"]
        text = markdown(header, rows)
        best = min(again, key=lambda name: again[name].value)
        headline = {
            "best": best,
            "l2_weight": ways["l2"].parameters["weight"],
            **{f"nrmse_{_key(n)}": t.value for n, t in ways.items()},
            **{f"nrmse_anew_{_key(n)}": t.value for n, t in again.items()},
        }
        name = f"{settings.file_name('regularisation')}-{data.file_name}"
        files = save_figure(draw(data, settings, ways, tried), name, places.results)
        sweep.tracker.result(
            {k: v for k, v in headline.items() if not isinstance(v, str)},
            note=f"**{data.label}**, {count} neurons\n\n{text}",
            files=files,
            texts={"regularisation.md": text},
            tags={"best": best},
        )
        entries = [trial_entry(t) for t in sweep.trials]
        told = sweep.entry(headline, trials=entries)
    print(f"\n{data.label}: best on folds drawn anew {best}\n\n{text}\n")
    if sweep.from_store():
        print(sweep.from_store())
    return told


if __name__ == "__main__":
    sys.exit(main())
