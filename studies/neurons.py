"""How many neurons does a material need, and what do its networks know of other rates?

Networks of 1 to 20 neurons are cross-validated as in the thesis (section 6.4.2). The
best count is then judged by specimen and by strain rate as well: random folds put
neighbours in time of one specimen on both sides, and so measure interpolation. Beside
the networks stand the piecewise-linear models on the same data, and Table 6.6.

Stopped at any moment and started again, it goes on where it was. With `--inputs all
--regularisation all` it is the joint study of `python -m studies.architectures`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from softnn.contracts import InputError
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
from studies.shown import neurons as shown

BEST = Path(__file__).parent / "best"
REPORTED = ("random", "specimen", "rate")


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.neurons`; returns the exit code."""
    made = study_parser("neurons", __doc__, Settings())
    made.add_argument(
        "--keep-best",
        action="store_true",
        help="write the best configuration to studies/best, for the tests to hold",
    )
    add_worker(made)
    arguments = made.parse_args(argv)
    every = [arguments.inputs == "all", arguments.regularisation == "all"]

    def work() -> None:
        if any(every):
            raise InputError(
                "one of --inputs and --regularisation is all; the joint study seeks "
                "both, so give all to both"
            )
        settings = settings_of(arguments)
        # Only the published protocol may replace the project's results.
        usual = Settings(material=settings.material, data=settings.data)
        places = places_of(arguments, published=settings == usual)
        asked = smoked(settings) if arguments.smoke else settings
        run(asked, places, arguments.keep_best)

    return jointly(argv) if all(every) else guarded(work)


def jointly(argv: Sequence[str] | None) -> int:
    """The joint study, asked for by `--inputs all --regularisation all`."""
    from studies.architectures import main as joint

    asked = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    asked.add_argument("--inputs")
    asked.add_argument("--regularisation")
    return joint(asked.parse_known_args(argv)[1])


def run(settings: Settings, places: Places, keep_best: bool = False) -> dict[str, Any]:
    """The study of every material asked for; returns what was written."""
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
    return write_all("neurons", settings, places, found)


def study(data: Data, settings: Settings, places: Places) -> dict[str, Any] | None:
    """One material: every count, the best one on the other splits, the baselines."""
    others = [split for split in REPORTED if split != settings.split]
    space: dict[str, Sequence[Value]] = {
        "neurons": settings.neurons,
        "split": list(SPLITS),
    }
    total = len(settings.neurons) + len(others)
    with Sweep("neurons", data, settings, space, places, total) as sweep:
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
        chosen = choice.configuration(best, settings)
        kept = {"best": chosen, "network": network.source}
        text = shown.track(sweep, places, grid, best, rows, headline, kept)
        sweep.register(network, ["best-random"])
        told = sweep.told(
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
