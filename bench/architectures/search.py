"""The search over architectures of one material, and what it gives."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from bench.architectures.baselines import baselines
from bench.architectures.choices import (
    FINALISTS,
    Again,
    Choice,
    choices,
    front,
    headline_of,
    rows_of,
)
from bench.architectures.compared import text as counts_text
from bench.architectures.report import draw, table
from bench.architectures.trials import (
    ALL_GIVEN,
    FIRST_OF,
    KEPT,
    TRAINING,
    Judge,
    by_front,
    by_halving,
    compared,
    conditions,
    never,
    space,
)
from bench.architectures.verdict import basis, sentences
from bench.architectures.verdict import table as verdict_table
from softnn import json_file
from softnn.contracts import InputError
from softnn.metrics import nrmse
from softnn.neural import StoredNetwork
from softnn.recording import Recording
from softnn.search import Finished
from softnn.study import holding
from softnn.study.baselines import MODELS, WAYS
from softnn.study.common import RESULTS, save_figure
from softnn.study.material_data import Data, recorded, unloads
from softnn.study.settings import Places, Settings
from softnn.study.sweep import Sweep
from softnn.study.trainer import Trainer

CONFIGURATION = ("inputs", "neurons", "regularisation", "lag_s")
CODE = (Path(__file__).with_name("trials.py"),)


def searched(
    data: Data,
    settings: Settings,
    places: Places,
    trials: int,
    sampler: str = "tpe",
    study: str = "architectures",
    finalists: int = FINALISTS,
    compare: bool = False,
) -> dict[str, Any] | None:
    """One material: the search, the front, the choice for each use, what to take.

    Beside the networks stand the convex network (`softnn.study.holding`) and the
    baselines, on the same folds. A grid has as many trials as it has points, whatever
    `trials`. `study` is the experiment in MLflow. With `compare` the search begins with
    a part of the grid, and trials are halved.
    """
    trainer = Trainer(data, settings, TRAINING)
    rule = by_halving if compare else never if sampler in ALL_GIVEN else by_front
    judge = Judge(trainer, places, rule)
    first = compared(settings) if compare else FIRST_OF[sampler](settings)
    if sampler in ALL_GIVEN:
        trials = len(first)
    seeds = [settings.seed, settings.seed + 1]
    differenced = any(r.test != "tensile" or not r.rate_per_s for r in data.tensile)
    about = space(settings, seeds), places, trials + 2, 2, trainer, CODE, sampler
    with Sweep(study, data, settings, *about) as sweep, judge:
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
        beside = Beside.begun(judge, seeds[1])
        best = choices(tried, once_more(judge), finalists, compare)
        anew = {
            use: sweep.run(
                judge.whole, **{**one.trial.parameters, "folds_seed": seeds[1]}
            )
            for use, one in best.items()
        }
        sweep.say("models beside the networks")
        rest = beside()
        networks = [
            network_row(use, one, anew[use], trainer, rest) for use, one in best.items()
        ]
        rows = [*networks, *rest.rows]
        every = recorded(settings, data)
        seen = "whole recordings" if data.cycles else "first loadings" if every else ""
        said, takes = sentences(
            networks, rest.convex, rest.baselines, judge.unseen, seen
        )
        kept = trainer.whole(best["random"].trial.result["configuration"])
        for_unseen = rest.network(takes)
        if every:
            networks[0]["whole"] = whole_errors(kept, every)
            if takes is rest.convex or takes["model"].startswith("PL"):
                row = next(r for r in rest.rows if r is takes)
                row["whole"] = whole_errors(for_unseen, every)
        shown = {"cycles": data.cycles, "unloads": any(map(unloads, every))}
        how = f"--data {settings.data} --cycles"
        trained_on = basis(data.material, shown, networks[0] if every else None, how)
        headline = headline_of(tried, best, anew) | {"take_unseen": takes["model"]}
        for row in rest.rows:
            sweep.beside(row, judge.unseen)
        found = sweep.entry(
            headline,
            samples=sum(map(len, data.tensile)),
            unseen=judge.unseen,
            take=said,
            trained_on=trained_on if every else "",
            choices={use: one.entry(anew[use]) for use, one in best.items()},
            front=rows_of(front(tried), folds=True),
            baselines=rest.baselines,
            convex=rest.convex,
            rows=rows,
            trials=rows_of(tried),
        )
        text = verdict_table(rows, judge.unseen)
        about_counts = counts_text(found["trials"], settings, RESULTS, data.label)
        about_front = table(found["front"], rest.baselines)
        with tempfile.TemporaryDirectory() as aside:
            pictures = save_figure(draw([found]), "front", Path(aside))
            sweep.tracker.result(
                {k: v for k, v in headline.items() if isinstance(v, int | float)}
                | figures(networks[0], takes),
                note="\n\n".join([f"**{data.label}**", *said, trained_on, text]),
                files=pictures,
                texts={
                    "front.md": about_front,
                    "table.md": text,
                    "neurons.md": about_counts,
                },
                tags={
                    "best": "; ".join(f"{k}: {one.words}" for k, one in best.items()),
                    "model": networks[0]["model"],
                    "take_unseen": takes["model"],
                },
            )
        name = sweep.register(kept, ["best-random"], f"{said[0]} {trained_on}")
        sweep.register(for_unseen, ["best-unseen-rate"], f"{said[1]} {trained_on}")
        found["registered"] = name
        from_store = sweep.from_store()
    parts = [about_counts] if compare else []
    told = [*said, *[trained_on] * bool(every)]
    print("\n" + "\n\n".join([data.label, *parts, text, *told]))
    print(
        f"\nregistered: models:/{name}@best-random and models:/{name}@best-unseen-rate "
        f"(softnn simulate 'models:/{name}@best-random' FILE --out DIR)"
    )
    if from_store:
        print(from_store)
    return found


@dataclass(frozen=True)
class Beside:
    """What networks of the search are held against, judged on the same folds.

    `splits` are the names of the folds: random, specimen if possible, unseen.
    """

    data: Data
    splits: tuple[str, ...]
    baselines: list[dict[str, Any]]
    convex: dict[str, Any] | None

    @classmethod
    def begun(cls, judge: Judge, seed: int) -> Callable[[], Beside]:
        """Judge them split by split, on folds drawn with `seed`; what waits for it."""
        trainer = judge.trainer
        kinds = {"random": "random"}
        # Recordings that name no specimen may all be of one.
        if all(r.specimen for r in trainer.data.tensile):
            with contextlib.suppress(InputError):  # one specimen only
                trainer.folds("specimen", "FFRD4", seed)
                kinds["specimen"] = "specimen"
        kinds["unseen"] = judge.unseen
        begun = [judge.apart(held_against, *kind, seed) for kind in kinds.items()]

        def ended() -> Beside:
            every = [one.result() for one in begun]
            rows: dict[str, Any] = {}
            for others, _ in every:
                for other in others:
                    row = rows.setdefault(other["model"], {"r2": {}})
                    row |= other | {"r2": row["r2"] | other["r2"]}
            convex: dict[str, Any] | None = {"r2": {}}
            for _, one in every:
                if isinstance(one, str):
                    print(f"{holding.NAME}: {one}")
                    convex = None
                    break
                assert convex is not None
                convex |= one | {"r2": convex["r2"] | one["r2"]}
            return cls(trainer.data, tuple(kinds), list(rows.values()), convex)

        return ended

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The convex network, where there is one, and the baselines."""
        return [row for row in (self.convex, *self.baselines) if row is not None]

    def network(self, takes: Mapping[str, Any]) -> StoredNetwork:
        """What is taken for the unseen, fitted to everything; else the convex one.

        A piecewise-linear model is a convex network too; trees are none.
        """
        tensile, holds = self.data.tensile, self.data.relaxation
        for model, way in product(MODELS, WAYS):
            if takes["model"] == f"{model}, {WAYS[way]}":
                every = holding.members(tensile, holds, self.data.cycles)
                return holding.stored(every[f"{model}, {way}"], tensile)
        return holding.held(tensile, holds, self.data.cycles).stored(tensile)


def held_against(
    trainer: Trainer, name: str, split: str, seed: int
) -> tuple[list[dict[str, Any]], dict[str, Any] | str]:
    """Rows of the baselines, and that of the convex network or why there is none.

    Errors by fold of this split are under `name`, R2 under "r2" by the same name.
    """
    known, folds = trainer.samples("FFRD4"), trainer.folds(split, "FFRD4", seed)
    others = baselines(trainer.data, known, {name: folds}, trainer.settings.seed)
    try:
        scores, weights = holding.errors(trainer.data, known, folds)
    except InputError as reason:
        return others, str(reason)
    return others, {
        "model": holding.NAME,
        name: scores["nrmse"],
        "r2": {name: scores["r2"]},
        "weights": dict(zip(folds.names, weights, strict=True)),
    }


def network_row(
    use: str, one: Choice, anew: Finished, trainer: Trainer, rest: Beside
) -> dict[str, Any]:
    """A choice of the search as a row of the table: folds drawn anew."""
    found = anew.result
    row: dict[str, Any] = {
        "model": one.words,
        "chosen_by": "unseen" if use == "unseen" else None,
        "random": found["nrmse"],
        "unseen": found["unseen"]["nrmse"],
        "r2": {"random": found["r2"], "unseen": found["unseen"]["r2"]},
    }
    if "specimen" in rest.splits:
        parts = {"specimen": slice(None)}
        judged = trainer.judge_parts(found["configuration"], parts)["specimen"]
        row["specimen"], row["r2"]["specimen"] = judged["nrmse"], judged["r2"]
    return row


def figures(known: Mapping[str, Any], takes: Mapping[str, Any]) -> dict[str, float]:
    """NRMSE and R2 of the network for recordings one has, as runs of trials name them.

    Those of what is taken for the unseen, another model, have names of their own.
    """
    return {
        "nrmse": float(np.mean(known["random"])),
        "r2": float(np.mean(known["r2"]["random"])),
        "nrmse_unseen": float(np.mean(known["unseen"])),
        "r2_unseen": float(np.mean(known["r2"]["unseen"])),
        "take_unseen_nrmse_unseen": float(np.mean(takes["unseen"])),
        "take_unseen_r2_unseen": float(np.mean(takes["r2"]["unseen"])),
    }


def whole_errors(
    network: StoredNetwork, recordings: Sequence[Recording]
) -> list[float]:
    """NRMSE of a network over each whole recording, as `softnn simulate` prints it."""
    stress = network.stress(
        [r.name for r in recordings],
        [r.history for r in recordings],
        [None] * len(recordings),
    )
    return [nrmse(s, r.stress_MPa) for s, r in zip(stress, recordings, strict=True)]


def once_more(judge: Judge) -> Again:
    """Judges trials with folds and starting weights that nothing else has seen."""
    seed = judge.trainer.settings.seed + 2  # the one before is for what is chosen

    def again(trials: Sequence[Finished], use: str) -> list[np.ndarray]:
        split = judge.unseen if use == "unseen" else use
        asked = [t.result["configuration"] | {"folds_seed": seed} for t in trials]
        begun = [judge.apart(errors_of, chosen, split) for chosen in asked]
        every = tqdm(begun, f"once more, {use}", unit="trial", leave=False)
        return [np.array(one.result()) for one in every]

    return again


def errors_of(trainer: Trainer, chosen: Mapping[str, Any], split: str) -> list[float]:
    """NRMSE of a configuration by fold of a split."""
    found = trainer.judge_parts(chosen, {split: slice(None)})[split]["nrmse"]
    return list(found)


def keep(
    found: Mapping[str, Any], data: Data, settings: Settings, folder: Path
) -> Path:
    """Write the networks recommended for each use to a folder, for the tests to hold.

    They are trained again by `KEPT`, since a search trains them without a grid.
    """
    source = "" if data.is_virtual else f"{data.source}-"
    path = folder / f"architectures-{source}{data.file_name}.json"
    trainer = Trainer(data, settings, KEPT)
    content = {
        "data_sha256": data.digest,
        "settings": asdict(replace(settings, material=data.material)),
        "training": asdict(KEPT),
        "unseen": found["unseen"],
        "networks": {
            use: kept(chosen["configuration"], trainer, found["unseen"])
            for use, chosen in found["choices"].items()
        },
    }
    json_file.write(path, content)
    print(f"kept: {path}")
    return path


def kept(
    configuration: Mapping[str, Any], trainer: Trainer, unseen: str
) -> dict[str, Any]:
    """A network as it is kept: its configuration, and its errors by fold."""
    chosen = {k: configuration[k] for k in CONFIGURATION}
    judged = trainer.judge_parts(chosen, {k: slice(None) for k in (unseen, "random")})
    random, never = judged["random"], judged[unseen]
    return {
        **chosen,
        "parameters": random["parameters"],
        "random": float(np.mean(random["nrmse"])),
        "unseen": float(np.mean(never["nrmse"])),
        "folds_random": random["nrmse"],
        "folds_unseen": dict(zip(never["folds"], never["nrmse"], strict=True)),
    }
