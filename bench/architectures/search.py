"""The search over architectures of one material, and what it gives."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from bench.architectures.baselines import baselines
from bench.architectures.choices import Again, choices, front, headline_of, rows_of
from bench.architectures.report import draw, sentence, table
from bench.architectures.trials import (
    ALL_GIVEN,
    FIRST_OF,
    TRAINING,
    Judge,
    conditions,
    space,
)
from softnn import json_file
from softnn.search import Finished
from softnn.study.common import save_figure
from softnn.study.material_data import Data
from softnn.study.settings import Places, Settings
from softnn.study.sweep import Sweep
from softnn.study.trainer import Trainer

CODE = (Path(__file__).with_name("trials.py"),)


def searched(
    data: Data, settings: Settings, places: Places, trials: int, sampler: str = "tpe"
) -> dict[str, Any] | None:
    """One material: the search, the front, the choice for each use, the sentence.

    A grid has as many trials as it has points, whatever `trials`.
    """
    trainer = Trainer(data, settings, TRAINING)
    judge = Judge(trainer, places, stops=sampler not in ALL_GIVEN)
    first = FIRST_OF[sampler](settings)
    if sampler in ALL_GIVEN:
        trials = len(first)
    seeds = [settings.seed, settings.seed + 1]
    differenced = any(r.test != "tensile" or not r.rate_per_s for r in data.tensile)
    about = space(settings, seeds), places, trials + 2, 2, trainer, CODE, sampler
    with Sweep("architectures", data, settings, *about) as sweep, judge:
        tried = list(
            sweep.explore(
                judge.submit,
                trials,
                first=first,
                when=conditions(differenced),
            )
        )
        if places.worker:
            return None
        best = choices(tried, once_more(trainer, judge.unseen))
        anew = {
            use: sweep.run(
                judge.whole, **{**one.trial.parameters, "folds_seed": seeds[1]}
            )
            for use, one in best.items()
        }
        beside = baselines(
            data,
            trainer.samples("FFRD4"),
            {
                "random": trainer.folds("random", "FFRD4", seeds[0]),
                "unseen": trainer.folds(judge.unseen, "FFRD4", seeds[0]),
            },
            settings.seed,
        )
        said = sentence(data.label, judge.unseen, best, anew, beside)
        headline = headline_of(tried, best, anew)
        found = sweep.told(
            headline,
            samples=sum(map(len, data.tensile)),
            unseen=judge.unseen,
            sentence=said,
            choices={use: one.entry(anew[use]) for use, one in best.items()},
            front=rows_of(front(tried), folds=True),
            baselines=beside,
            trials=rows_of(tried),
        )
        text = table(found["front"], beside)
        with tempfile.TemporaryDirectory() as aside:
            pictures = save_figure(draw([found]), "front", Path(aside))
            sweep.tracker.result(
                {k: v for k, v in headline.items() if isinstance(v, int | float)},
                note=f"{said}\n\n{text}",
                files=pictures,
                texts={"front.md": text},
                tags={
                    "best": "; ".join(f"{k}: {one.words}" for k, one in best.items())
                },
            )
        for use, one in best.items():
            alias = "best-random" if use == "random" else "best-unseen-rate"
            chosen = one.trial.result["configuration"]
            sweep.register(trainer.whole(chosen), [alias])
        from_store = sweep.from_store()
    print(f"\n{said}\n\n{text}")
    if from_store:
        print(from_store)
    return found


def once_more(trainer: Trainer, unseen: str) -> Again:
    """Judges trials with folds and starting weights that nothing else has seen."""
    seed = trainer.settings.seed + 2  # the one before is for what is chosen

    def again(trials: Sequence[Finished], use: str) -> list[np.ndarray]:
        split = unseen if use == "unseen" else use
        every = tqdm(trials, f"once more, {use}", unit="trial", leave=False)
        asked = (t.result["configuration"] | {"folds_seed": seed} for t in every)
        parts = {split: slice(None)}
        return [
            np.array(trainer.judge_parts(chosen, parts)[split]["nrmse"])
            for chosen in asked
        ]

    return again


def keep(
    found: Mapping[str, Any], data: Data, settings: Settings, folder: Path
) -> Path:
    """Write both ends of the front to a folder, for the tests to hold."""
    source = "" if data.is_virtual else f"{data.source}-"
    path = folder / f"architectures-{source}{data.file_name}.json"
    content = {
        "data_sha256": data.digest,
        "settings": asdict(replace(settings, material=data.material)),
        "training": asdict(TRAINING),
        "unseen": found["unseen"],
        "ends": {"random": found["front"][0], "unseen": found["front"][-1]},
    }
    json_file.write(path, content)
    print(f"kept: {path}")
    return path
