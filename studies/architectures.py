"""Which network for which use: inputs, neurons, regularisation and lag in one search?

One search a material over input architectures (those of Table 6.3, with the stress fed
back as in section 6.4.1, with filtered strains and Gaussian units as in 8.3), 1 to 20
neurons, three ways of regularisation, and the lag of past inputs as a time. There are
two objectives: the error by random folds, as published, and the error at strain rates
never seen (by recording where a set has one rate). The answer is their Pareto front,
with piecewise-linear models and gradient-boosted trees on the same folds beside it.

Optuna prunes for one objective only, so folds are stopped by a rule of this study: the
unseen rates are judged whole, then random folds four at a time, until a network on the
present front is better at unseen rates and, by Wilcoxon's signed ranks over the folds
so far (one-sided, 0.1), by random folds too. A stopped trial keeps the mean of its
folds for the search and is never on the front.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from softnn.contracts import InputError
from softnn.search import Finished, Range, Result, Value
from softnn.study.common import guarded, plain, save_figure, write_result
from softnn.study.material_data import Data, prepared
from softnn.study.settings import (
    Places,
    Settings,
    add_worker,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from softnn.study.sweep import Sweep, headline_of_all
from softnn.study.trainer import Trainer
from studies.architectures_baselines import baselines
from studies.architectures_report import (
    Choice,
    choices,
    draw,
    front,
    rows_of,
    sentence,
    table,
)
from studies.architectures_trials import (
    A_TIME,
    INPUTS,
    LAGS,
    ONE_SAMPLE,
    TRAINING,
    WEIGHTS,
    Ahead,
    Judge,
    conditions,
    judged,
    opening,
    unseen_split,
)

DEFAULTS = Settings(samples=100)  # neighbours in time say the same thing twice
TRIALS = 300
BEST = Path(__file__).with_name("best")
CODE = (Path(__file__).with_name("architectures_trials.py"),)


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.architectures`; returns the exit code."""
    made = study_parser(
        "architectures", __doc__, DEFAULTS, omit="inputs split regularisation lag-s"
    )
    made.add_argument("--trials", type=int, default=TRIALS, help=f"({TRIALS})")
    made.add_argument(
        "--keep-best",
        action="store_true",
        help="write the ends of each front to studies/best, for the tests to hold",
    )
    add_worker(made)
    arguments = made.parse_args(argv)

    def work() -> None:
        settings = settings_of(arguments, DEFAULTS)
        if arguments.trials < 1:
            raise InputError(f"trials is {arguments.trials}; at least 1 is needed")
        usual = replace(
            DEFAULTS,
            material=settings.material,
            data=settings.data,
            cycles=settings.cycles,
        )
        places = places_of(arguments, published=settings == usual)
        if arguments.smoke:
            run(smoked(settings), places, min(arguments.trials, 6))
        else:
            run(settings, places, arguments.trials, arguments.keep_best)

    return guarded(work)


def run(
    settings: Settings, places: Places, trials: int, keep_best: bool = False
) -> dict[str, Any]:
    """The study of every material asked for; returns what was written."""
    found, skipped = [], {}
    materials = prepared(settings)
    for data in materials:
        try:
            told = study(data, settings, places, trials)
            if told is None:
                continue
            found.append(told)
            if keep_best:
                keep(told, data, settings)
        except InputError as reason:
            if len(materials) == 1:
                raise
            skipped[data.label] = str(reason)
            print(f"\n{data.label}: left out: {reason}")
    if places.worker:
        return {}
    if not found:
        raise InputError(f"no material can be judged: {'; '.join(skipped.values())}")
    name = settings.file_name("architectures")
    files = save_figure(draw(found), name, places.results)
    headline = headline_of_all(found)
    path = write_result(
        name,
        headline,
        {
            "settings": asdict(settings),
            "training": asdict(TRAINING),
            "materials": found,
            "left_out": skipped,
        },
        seed=settings.seed,
        data={one["label"]: one["data_sha256"] for one in found},
        folder=places.results,
    )
    print(f"\nresult: {path}; figure: {files[0]}; runs: {places.tracking}")
    return {"headline": headline, "materials": found}


def study(
    data: Data, settings: Settings, places: Places, trials: int
) -> dict[str, Any] | None:
    """One material: the search, the front, the choice for each use, the sentence."""
    trainer = Trainer(data, settings, TRAINING)
    unseen = unseen_split(trainer)
    seeds = [settings.seed, settings.seed + 1]
    space: dict[str, Sequence[Value] | Range] = {
        "inputs": list(INPUTS),
        "neurons": settings.neurons,
        "regularisation": ["bayesian", "early-stopping", "l2"],
        "closed_form": ["bayesian", "l2"],
        "weight": WEIGHTS,
        "lag": [ONE_SAMPLE, A_TIME],
        "lag_s": LAGS,
        "folds_seed": seeds,
    }
    differenced = any(r.test != "tensile" or not r.rate_per_s for r in data.tensile)
    with (
        Sweep(
            "architectures", data, settings, space, places, trials + 2, 2, trainer, CODE
        ) as sweep,
        judge_of(trainer, unseen, places) as judge,
    ):
        tried = list(
            sweep.explore(
                judge.submit,
                trials,
                first=opening(settings),
                when=conditions(differenced),
            )
        )
        if places.worker:
            return None
        best = choices(tried)
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
                "unseen": trainer.folds(unseen, "FFRD4", seeds[0]),
            },
            settings.seed,
        )
        said = sentence(data.label, unseen, best, anew, beside)
        headline = headline_of(tried, best, anew)
        found = {
            "material": data.material,
            "label": data.label,
            "data_sha256": data.digest,
            "samples": sum(map(len, data.tensile)),
            "unseen": unseen,
            "headline": headline,
            "sentence": said,
            "choices": {use: one.entry(anew[use]) for use, one in best.items()},
            "front": rows_of(front(tried), folds=True),
            "baselines": beside,
            "trials": rows_of(tried),
            "trials_from_store": sum(t.stored for t in sweep.trials),
            "seconds": sweep.seconds,
            "study_key": sweep.key,
        }
        with tempfile.TemporaryDirectory() as aside:
            pictures = save_figure(draw([found]), "front", Path(aside))
            sweep.tracker.result(
                {k: v for k, v in headline.items() if isinstance(v, int | float)},
                note=f"{said}\n\n{table(tried, beside)}",
                files=pictures,
                texts={"front.md": table(tried, beside)},
                tags={"best": sweep_name(best)},
            )
        for use, one in best.items():
            alias = "best-random" if use == "random" else "best-unseen-rate"
            chosen = one.trial.result["configuration"]
            sweep.register(trainer.whole(chosen), [alias])
        from_store = sweep.from_store()
    print(f"\n{said}\n\n{table(tried, beside)}")
    if from_store:
        print(from_store)
    return found


class OneByOne(Judge):
    """Trials in this process: others on the same search have cores of their own."""

    def __enter__(self) -> OneByOne:
        return self

    def _submit(self, chosen: dict[str, Any], ahead: Ahead) -> Future[Result]:
        done: Future[Result] = Future()
        about = self.trainer.data, self.trainer.settings, self.unseen
        done.set_result(judged(*about, chosen, ahead))
        return done


def judge_of(trainer: Trainer, unseen: str, places: Places) -> Judge:
    """Side by side where the search is this process's alone."""
    kind = Judge if places.storage.startswith("sqlite") else OneByOne
    return kind(trainer, unseen)


def keep(found: Mapping[str, Any], data: Data, settings: Settings) -> Path:
    """Write both ends of the front to `studies/best`, for the tests to hold."""
    source = "" if data.is_virtual else f"{data.source}-"
    path = BEST / f"architectures-{source}{data.file_name}.json"
    content = {
        "data_sha256": data.digest,
        "settings": asdict(replace(settings, material=data.material)),
        "training": asdict(TRAINING),
        "unseen": found["unseen"],
        "ends": {"random": found["front"][0], "unseen": found["front"][-1]},
    }
    path.write_text(json.dumps(plain(content), indent=1) + "\n", encoding="utf-8")
    print(f"kept: {path}")
    return path


def sweep_name(best: Mapping[str, Choice]) -> str:
    """The choices in a few words."""
    return "; ".join(f"{use}: {one.words}" for use, one in best.items())


def headline_of(
    tried: Sequence[Finished],
    best: Mapping[str, Choice],
    anew: Mapping[str, Finished],
) -> dict[str, Any]:
    """Named figures, flat: errors as fractions."""
    found: dict[str, Any] = {
        "trials": len(tried),
        "trials_stopped": sum(t.result["stopped_after"] is not None for t in tried),
        "front": len(front(tried)),
    }
    for use, one in best.items():
        found[f"{use}_configuration"] = one.words
        found[f"{use}_ties"] = one.ties
        for name, value in zip(("random", "unseen"), anew[use].values, strict=True):
            found[f"{use}_nrmse_{name}"] = value
    return found


if __name__ == "__main__":
    sys.exit(main())
