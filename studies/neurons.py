"""Which network does a material need: for recordings one has, for rates never seen?

Neurons and regularisation are compared for the four inputs of the thesis: three ways of
regularisation at six counts of neurons each, some other architectures, and a few more
networks that the search draws. Trials are pruned by successive halving on their folds
(Optuna's own pruner): after 1, 3 and 9 random folds those go on that are in the best
third of their inputs. At rates never seen all are judged. The full grid, every fold of
1 to 20 neurons, is `python -m studies.grid`.

Beside the networks, on the same folds, stand the piecewise-linear models, boosted trees
and a convex network that is made for rates never seen. It ends in one table of counts,
one of models, and a sentence for each use.

`python -m studies.architectures` searches with more trials. `--as-in-thesis` is
section 6.4.2 of the thesis: neurons alone, with FFRD4 and Bayesian regularisation, and
Table 6.6 beside them. Stopped at any moment and started again, all go on where they
were.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bench.architectures.choices import FINALISTS
from bench.architectures.trials import trials_of
from softnn.contracts import InputError
from softnn.neural import STEADY
from softnn.search import Value
from softnn.study import choice
from softnn.study.common import guarded
from softnn.study.material_data import Data, prepared
from softnn.study.settings import (
    SPLITS,
    Places,
    Settings,
    add_worker,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from softnn.study.sweep import Sweep, trial_entry, write_all
from softnn.study.trainer import Trainer
from studies import architectures
from studies.shown import neurons as shown

AS_IN_THESIS = "--as-in-thesis"
SWEPT = "inputs split regularisation lag-s"
DEFAULTS = architectures.DEFAULTS
TRIALS = 84  # two minutes on two cores
JOINT, THESIS = "neurons", "neurons-as-in-thesis"  # experiments in MLflow
FILE = "joint"  # of the search; that of the published sweep is `neurons`
BEST = Path(__file__).parent / "best"
REPORTED = ("random", "specimen", "rate")


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.neurons`; returns the exit code."""
    given = sys.argv[1:] if argv is None else argv
    return thesis(given) if AS_IN_THESIS in given else joint(given)


def joint(argv: Sequence[str]) -> int:
    """The search over inputs, neurons and regularisation."""
    made = study_parser("neurons", __doc__, DEFAULTS, omit=SWEPT)
    made.add_argument(
        AS_IN_THESIS,
        action="store_true",
        help="neurons alone, as published; --help with it lists its options",
    )
    made.add_argument(
        "--trials", type=int, default=TRIALS, help=f"of the search ({TRIALS})"
    )
    add_worker(made)
    for option in SWEPT.split():
        made.add_argument(f"--{option}", help=argparse.SUPPRESS)
    arguments = made.parse_args(argv)

    def work() -> None:
        for option in SWEPT.split():
            name = option.replace("-", "_")
            if getattr(arguments, name) is not None:
                raise InputError(
                    f"--{option} is searched over, or has one value; give it with "
                    f"{AS_IN_THESIS}"
                )
            delattr(arguments, name)
        settings = settings_of(arguments, DEFAULTS)
        trials = trials_of("tpe", arguments.trials, TRIALS)
        places = places_of(arguments, published=False)
        if arguments.smoke:
            settings, trials = smoked(settings), min(trials, 6)
        finalists = max(2, min(FINALISTS, trials // 10))
        architectures.run(
            settings,
            places,
            trials,
            study=JOINT,
            file=FILE,
            finalists=finalists,
            compare=True,
        )

    return guarded(work)


def thesis(argv: Sequence[str]) -> int:
    """The published sweep over neurons."""
    made = study_parser(f"neurons {AS_IN_THESIS}", __doc__, Settings())
    made.add_argument(AS_IN_THESIS, action="store_true", help="what is asked for here")
    made.add_argument(
        "--keep-best",
        action="store_true",
        help="write the best configuration to studies/best, for the tests to hold",
    )
    add_worker(made)
    arguments = made.parse_args(argv)

    def work() -> None:
        settings = settings_of(arguments)
        # Only the published protocol may replace the project's results.
        usual = Settings(material=settings.material, data=settings.data)
        places = places_of(arguments, published=settings == usual)
        asked = smoked(settings) if arguments.smoke else settings
        run(asked, places, arguments.keep_best)

    return guarded(work)


def run(settings: Settings, places: Places, keep_best: bool = False) -> dict[str, Any]:
    """The published sweep of every material asked for; returns the result written."""
    found = []
    for data in prepared(settings):
        told = study(data, settings, places)
        if told is None:
            continue
        found.append(told)
        if keep_best:
            choice.keep(told, data, BEST)
    if places.worker:
        return {}
    return write_all("neurons", settings, places, found, training=asdict(STEADY))


def study(data: Data, settings: Settings, places: Places) -> dict[str, Any] | None:
    """One material: every count, the best one on the other splits, the baselines."""
    others = [split for split in REPORTED if split != settings.split]
    space: dict[str, Sequence[Value]] = {
        "neurons": settings.neurons,
        "split": list(SPLITS),
    }
    total = len(settings.neurons) + len(others)
    # At rates never seen other training moves by several per cent with the processor.
    trainer = Trainer(data, settings, STEADY)
    about = space, places, total, 1, trainer
    with Sweep(THESIS, data, settings, *about, sampler="grid") as sweep:
        sweep.together(
            [{"neurons": n, "split": settings.split} for n in settings.neurons]
        )
        if places.worker:
            return None
        grid = [
            sweep.run(neurons=count, split=settings.split) for count in settings.neurons
        ]
        best = choice.pick(grid)
        networks = {shown.CHOSEN: best}
        enough = choice.fewest(grid)
        if enough.parameters["neurons"] < best.parameters["neurons"]:
            networks[shown.FEW] = enough
            sweep.expect(len(others))
        judged = choice.on_splits(sweep, networks, others)
        baselines = choice.piecewise(data)
        rows = shown.comparison(data, judged, baselines)
        headline = shown.headline_of(judged, baselines)
        network = sweep.trainer.whole(best.parameters)
        chosen = choice.configuration(best, settings, STEADY)
        kept = {"best": chosen, "network": network.source}
        text = shown.track(sweep, places, grid, best, rows, headline, kept)
        sweep.register(network, ["best-random"])
        told = sweep.entry(
            headline,
            samples=sum(map(len, data.tensile)),
            specimens=len({r.specimen or r.name for r in data.tensile}),
            best=chosen,
            comparison=rows,
            note=shown.note_on(data),
            grid=[trial_entry(t) for t in grid],
            networks=choice.entries_of(judged),
            baselines=baselines,
        )
    print(f"\n{data.label}: {choice.text_of_choice(best)}\n\n{text}")
    for note in filter(None, [sweep.from_store(), *shown.notes(judged, baselines)]):
        print(note)
    return told


if __name__ == "__main__":
    sys.exit(main())
