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
so far (one-sided, 0.1), by random folds too. A stopped trial keeps the mean of its folds
for the search and is never on the front.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from scipy.stats import wilcoxon

from softnn.contracts import InputError
from softnn.neural import ARCHITECTURES
from softnn.neural import Settings as Training
from softnn.search import Finished, Range, Result, Search, Value
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
from studies.common import guarded, save_figure, write_result
from studies.material_data import Data, prepared
from studies.settings import (
    Places,
    Settings,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from studies.sweep import Sweep, headline_of_all
from studies.trainer import Trainer

DEFAULTS = Settings()
TRIALS = 300
TRAINING = Training(epochs=100)  # most settle in 50; the rest gain little by 1000
WEIGHTS = Range(1e-8, 1.0, log=True)
LAGS = Range(0.05, 50.0, log=True)  # s
ONE_SAMPLE, A_TIME = "one sample", "time"
PART = 4  # random folds judged at a time: fewest that can reach the level below
LEVEL = 0.1
FIRST = (4, 12)  # neurons of the networks that every search begins with


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.architectures`; returns the exit code."""
    made = study_parser(
        "architectures", __doc__, DEFAULTS, omit="inputs split regularisation lag-s"
    )
    made.add_argument("--trials", type=int, default=TRIALS, help=f"({TRIALS})")
    arguments = made.parse_args(argv)

    def work() -> None:
        settings = settings_of(arguments, DEFAULTS)
        if arguments.trials < 1:
            raise InputError(f"trials is {arguments.trials}; at least 1 is needed")
        usual = Settings(
            material=settings.material, data=settings.data, samples=settings.samples
        )
        places = places_of(arguments, published=settings == usual)
        if arguments.smoke:
            run(smoked(settings), places, min(arguments.trials, 6))
        else:
            run(settings, places, arguments.trials)

    return guarded(work)


def run(settings: Settings, places: Places, trials: int) -> dict[str, Any]:
    """The study of every material asked for; returns what was written."""
    found, skipped = [], {}
    materials = prepared(settings)
    for data in materials:
        try:
            found.append(study(data, settings, places, trials))
        except InputError as reason:
            if len(materials) == 1:
                raise
            skipped[data.label] = str(reason)
            print(f"\n{data.label}: left out: {reason}")
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
) -> dict[str, Any]:
    """One material: the search, the front, the choice for each use, the sentence."""
    trainer = Trainer(data, settings, TRAINING)
    unseen = unseen_split(trainer)
    seeds = [settings.seed, settings.seed + 1]
    space: dict[str, Sequence[Value] | Range] = {
        "inputs": list(ARCHITECTURES),
        "neurons": settings.neurons,
        "regularisation": ["bayesian", "early-stopping", "l2"],
        "closed_form": ["bayesian", "l2"],
        "weight": WEIGHTS,
        "lag": [ONE_SAMPLE, A_TIME],
        "lag_s": LAGS,
        "folds_seed": seeds,
    }
    differenced = any(r.test != "tensile" or not r.rate_per_s for r in data.tensile)
    with Sweep(
        "architectures", data, settings, space, places, trials + 2, 2, trainer
    ) as sweep:
        judge = Judge(trainer, unseen, sweep.search)
        tried = list(
            sweep.explore(
                judge, trials, first=opening(settings), when=conditions(differenced)
            )
        )
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
        sweep.tracker.result(
            {k: v for k, v in headline.items() if isinstance(v, int | float)},
            note=f"{said}\n\n{table(tried, beside)}",
            texts={"front.md": table(tried, beside)},
            tags={"best": sweep_name(best)},
        )
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
        from_store = sweep.from_store()
    print(f"\n{said}\n\n{table(tried, beside)}")
    if from_store:
        print(from_store)
    return found


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


# --- what is tried --------------------------------------------------------------------


def unseen_split(trainer: Trainer) -> str:
    """By rate, by recording where there is one rate; `InputError` if neither can be."""
    seed = trainer.settings.seed
    try:
        trainer.folds("rate", "FFRD4", seed)
    except InputError:
        trainer.folds("recording", "FFRD4", seed)
        return "recording"
    return "rate"


def conditions(differenced: bool) -> dict[str, Any]:
    """Which parameters a configuration has, by those drawn before.

    `differenced`: some strain rate is a difference over the lag, not a nominal one.
    """

    def lagged(chosen: Mapping[str, Any]) -> bool:
        row = ARCHITECTURES[chosen["inputs"]]
        return row.lagged or (row.rate and differenced)

    def l2(chosen: Mapping[str, Any]) -> bool:
        return "l2" in (chosen.get("regularisation"), chosen.get("closed_form"))

    return {
        "regularisation": lambda c: not ARCHITECTURES[c["inputs"]].radial,
        "closed_form": lambda c: ARCHITECTURES[c["inputs"]].radial,
        "weight": l2,
        # A filter of one sample would be no filter.
        "lag": lambda c: lagged(c) and not ARCHITECTURES[c["inputs"]].filters,
        "lag_s": lambda c: c.get("lag", A_TIME) == A_TIME and lagged(c),
        "folds_seed": lambda _: False,
    }


def opening(settings: Settings) -> list[dict[str, Value]]:
    """What every search begins with: each architecture, as published where it was."""
    counts = sorted({c for c in FIRST if c in settings.neurons} or settings.neurons[:1])
    return [
        {
            "inputs": name,
            "neurons": count,
            ("closed_form" if row.radial else "regularisation"): "bayesian",
            "lag": ONE_SAMPLE,
            "lag_s": 1.0,
        }
        for count in counts
        for name, row in ARCHITECTURES.items()
    ]


def configuration(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of the search as the trainer takes them.

    >>> configuration({"inputs": "FFRI2", "neurons": 3, "regularisation": "l2",
    ...                "weight": 0.1, "lag": "one sample"})
    {'inputs': 'FFRI2', 'neurons': 3, 'regularisation': 'l2=0.1', 'lag_s': None}
    """
    how = parameters.get("regularisation") or parameters["closed_form"]
    found = {
        "inputs": parameters["inputs"],
        "neurons": parameters["neurons"],
        "regularisation": f"l2={parameters['weight']!r}" if how == "l2" else how,
        "lag_s": parameters.get("lag_s"),
    }
    if "folds_seed" in parameters:
        found["folds_seed"] = parameters["folds_seed"]
    return found


class Judge:
    """One trial: unseen rates, then random folds until they are plainly not needed."""

    def __init__(self, trainer: Trainer, unseen: str, search: Search) -> None:
        self.trainer, self.unseen, self.search = trainer, unseen, search

    def __call__(self, parameters: Mapping[str, Any]) -> Result:
        return self._judged(parameters, front(self.search.finished))

    def whole(self, parameters: Mapping[str, Any]) -> Result:
        """Every fold, whatever the front."""
        return self._judged(parameters, [])

    def _judged(
        self, parameters: Mapping[str, Any], ahead: Sequence[Finished]
    ) -> Result:
        chosen = configuration(parameters)
        unseen = self.trainer.judge(chosen | {"split": self.unseen})
        mean = float(np.mean(unseen["nrmse"]))
        number = self.trainer.settings.folds
        found: dict[str, Any] = {}
        stopped = None
        for start in range(0, number, PART):
            part = slice(start, min(start + PART, number))
            _extend(found, self.trainer.judge(chosen | {"split": "random"}, part))
            if part.stop < number and beaten(found["nrmse"], mean, ahead):
                stopped = part.stop
                break
        error = float(np.mean(found["nrmse"]))
        return (error, mean), {
            **found,
            "generalisation_error": error,
            "r2_mean": float(np.mean(found["r2"])),
            "unseen": {k: unseen[k] for k in ("nrmse", "r2", "folds", "seconds")},
            "configuration": chosen,
            "stopped_after": stopped,
        }


def beaten(errors: Sequence[float], unseen: float, ahead: Sequence[Finished]) -> bool:
    """Whether a network ahead is better in both ways, by the folds judged so far."""
    for other in ahead:
        gap = np.array(errors) - np.array(other.result["nrmse"][: len(errors)])
        if (
            other.values[1] <= unseen
            and gap.any()
            and wilcoxon(gap, alternative="greater").pvalue <= LEVEL
        ):
            return True
    return False


def _extend(found: dict[str, Any], more: Mapping[str, Any]) -> None:
    """Add the folds of a part to those before it."""
    for key, value in more.items():
        if key == "nrmse_by_rate":
            continue  # of the folds of one part it would mean little
        if isinstance(value, list) or key == "seconds":
            found[key] = found[key] + value if key in found else value
        else:
            found.setdefault(key, value)


if __name__ == "__main__":
    sys.exit(main())
