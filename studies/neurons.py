"""How many neurons does a material need, and what do its networks know of other rates?

Networks of 1 to 20 neurons are cross-validated as in the thesis (section 6.4.2). The
best count is then judged by specimen and by strain rate as well: random folds put
neighbours in time of one specimen on both sides, and so measure interpolation. Beside
the networks stand the piecewise-linear models on the same data, and Table 6.6.

Stopped at any moment and started again, it goes on where it was.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from softnn import json_file
from softnn.contracts import InputError
from softnn.json_file import plain
from softnn.search import Finished, Value
from softnn.study.baselines import piecewise_baselines
from softnn.study.choice import configuration, fewest, pick, text_of_choice
from softnn.study.common import guarded, markdown, save_figure, write_result
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
from softnn.study.sweep import Sweep, headline_of_all, trial_entry
from studies.shown.neurons import (
    CHOSEN,
    FEW,
    HEADER,
    as_csv,
    comparison,
    count_row,
    draw,
    headline_of,
    note_on,
    notes,
    printed,
)

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
    found = []
    for data in prepared(settings):
        found.append(study(data, settings, places))
        if keep_best:
            keep(found[-1], data, settings)
    headline = headline_of_all(found)
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
        networks = {CHOSEN: best}
        if (enough := fewest(grid)).parameters["neurons"] < best.parameters["neurons"]:
            networks[FEW] = enough
            sweep.expect(len(others))
        judged: dict[str, dict[str, Finished | str]] = {}
        for name, network in networks.items():
            count = network.parameters["neurons"]
            judged[name] = {settings.split: network}
            for split in others:
                judged[name][split] = sweep.possible(split) or sweep.run(
                    neurons=count, split=split
                )
        baselines = piecewise(data)
        rows = comparison(data, judged, baselines)
        figure_of = save_figure(
            draw(data, settings, grid, best),
            f"{settings.file_name('neurons')}-{data.file_name}",
            places.results,
        )
        text = markdown(HEADER, [printed(row) for row in rows])
        headline = headline_of(judged, baselines)
        sweep.tracker.curve(
            {
                "r2_by_neurons": [
                    (t.parameters["neurons"], t.result["r2_mean"]) for t in grid
                ],
                "nrmse_by_neurons": [(t.parameters["neurons"], t.value) for t in grid],
            },
            sweep.ended,
        )
        sweep.tracker.result(
            {k: v for k, v in headline.items() if isinstance(v, int | float)}
            | {"nrmse": best.value, "r2": best.result["r2_mean"]},
            note=f"**{data.label}**\n\n{text}\n\n{note_on(data)}",
            files=figure_of,
            texts={
                "comparison.csv": as_csv(rows),
                "neurons.csv": as_csv([count_row(t) for t in grid]),
                "best.json": json.dumps(plain(configuration(best, settings)), indent=1),
                "network.json": json.dumps(
                    sweep.trainer.whole(best.parameters).source, indent=1
                ),
            },
            tags={"best": f"{best.parameters['neurons']} neurons"},
        )
        sweep.register(sweep.trainer.whole(best.parameters), ["best-random"])
        stored, seconds = sum(t.stored for t in sweep.trials), sweep.seconds
    print(f"\n{data.label}: {text_of_choice(best)}\n\n{text}\n\n{note_on(data)}")
    for note in filter(None, [sweep.from_store(), *notes(judged, baselines)]):
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
        "note": note_on(data),
        "grid": [trial_entry(t) for t in grid],
        "networks": {
            name: {
                split: {"not_possible": trial}
                if isinstance(trial, str)
                else trial_entry(trial)
                for split, trial in splits.items()
            }
            for name, splits in judged.items()
        },
        "baselines": baselines,
        "trials_from_store": stored,
        "seconds": seconds,
        "study_key": sweep.key,
    }


def piecewise(data: Data) -> dict[str, Any]:
    """The piecewise-linear models on the same data, or why they cannot be fitted."""
    try:
        return plain(piecewise_baselines(data.tensile, data.relaxation))
    except InputError as reason:
        return {"not_possible": str(reason)}


def keep(found: dict[str, Any], data: Data, settings: Settings) -> Path:
    """Write the best configuration to `studies/best`, for the tests to hold."""
    BEST.mkdir(parents=True, exist_ok=True)
    path = BEST / f"{data.file_name}.json"
    best = found["best"]
    best["settings"]["material"] = data.material
    content = {"data_sha256": data.digest, **best}
    json_file.write(path, content)
    print(f"kept: {path}")
    return path


if __name__ == "__main__":
    sys.exit(main())
