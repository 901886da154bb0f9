"""A trial of the study of architectures: what is drawn, and how it is judged.

A `Rule` says when the random folds of a trial stop: never, by Wilcoxon's signed ranks
against the front (see `studies.architectures`), or by successive halving (see
`studies.neurons`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any, TypeVar

import numpy as np
from scipy.stats import wilcoxon

from bench.architectures.choices import front
from softnn.contracts import InputError
from softnn.neural import ARCHITECTURES, PUBLISHED, STEADY, architecture_of
from softnn.neural import Settings as Training
from softnn.search import TOGETHER, Finished, Range, Result, Value
from softnn.search.halving import RUNGS, halved
from softnn.study.material_data import Data
from softnn.study.settings import Places, Settings, one_of
from softnn.study.trainer import Trainer
from softnn.workers import workers

T = TypeVar("T")

# A gain of 3 nats on 3,000 samples is 0.1 % of the error: less than folds scatter.
TRAINING = Training(epochs=60, settled_nats=3.0)
# Kept networks have to come out alike on other processors, which round differently.
KEPT = replace(TRAINING, grid=STEADY.grid)
INPUTS = (*ARCHITECTURES, "FFH7")
# Ways of regularisation, the first for opening trials, by what a network is trained by:
# Levenberg-Marquardt; in closed form (Gaussian units); gradients (recurrent units).
WAYS = {
    "regularisation": ("bayesian", "early-stopping", "l2"),
    "closed_form": ("bayesian", "l2"),
    "by_gradient": ("early-stopping", "l2"),
}
WEIGHTS = Range(1e-8, 1.0, log=True)
LAGS = Range(0.05, 50.0, log=True)  # s
ONE_SAMPLE, A_TIME = "one sample", "time"
PART = 4  # random folds judged at a time: fewest that can reach the level below
LEVEL = 0.1
FIRST = (4, 12)  # neurons of the networks that every search begins with
COUNTS = 6  # neurons that a comparison tries, of all that are asked for
# L2 weight of a comparison and of a grid: the middle one of those that
# `studies.regularisation` finds for the seven materials. A search draws others.
WEIGHT = 2e-8


def unseen_split(trainer: Trainer) -> str:
    """By rate, by recording where there is one rate; `InputError` if neither can be."""
    seed = trainer.settings.seed
    try:
        trainer.folds("rate", "FFRD4", seed)
    except InputError:
        trainer.folds("recording", "FFRD4", seed)
        return "recording"
    return "rate"


def space(settings: Settings, seeds: list[int]) -> dict[str, Sequence[Value] | Range]:
    """What is drawn, and from what."""
    return {
        "inputs": list(INPUTS),
        "neurons": settings.neurons,
        **WAYS,
        "weight": WEIGHTS,
        "lag": [ONE_SAMPLE, A_TIME],
        "lag_s": LAGS,
        "folds_seed": seeds,
    }


def conditions(differenced: bool) -> dict[str, Any]:
    """Which parameters a configuration has, by those drawn before.

    `differenced`: some strain rate is a difference over the lag, not a nominal one.
    """

    def lagged(chosen: Mapping[str, Any]) -> bool:
        row = architecture_of(chosen["inputs"])
        return row.lagged or (row.rate and differenced)

    def l2(chosen: Mapping[str, Any]) -> bool:
        return chosen[way_of(chosen["inputs"])] == "l2"

    def trained(way: str) -> Callable[[Mapping[str, Any]], bool]:
        return lambda chosen: way_of(chosen["inputs"]) == way

    return {
        **{way: trained(way) for way in WAYS},
        "weight": l2,
        # A filter of one sample would be no filter.
        "lag": lambda c: lagged(c) and not _filtered(c["inputs"]),
        "lag_s": lambda c: c.get("lag", A_TIME) == A_TIME and lagged(c),
        "folds_seed": lambda _: False,
    }


def way_of(inputs: str) -> str:
    """Which of `WAYS` networks of these inputs have."""
    row = architecture_of(inputs)
    if row.radial:
        return "closed_form"
    return "by_gradient" if row.recurrent else "regularisation"


def opening(settings: Settings) -> list[dict[str, Value]]:
    """What a search begins with: each architecture, as published where it was."""
    counts = sorted({c for c in FIRST if c in settings.neurons} or settings.neurons[:1])
    return [
        {
            "inputs": name,
            "neurons": count,
            way_of(name): WAYS[way_of(name)][0],
            "lag": ONE_SAMPLE,
            "lag_s": 1.0,
        }
        for count in counts
        for name in INPUTS
    ]


def tabulated(settings: Settings) -> list[dict[str, Value]]:
    """All that the thesis tabulates: inputs of Table 6.3, neurons, and three ways of
    regularisation; lags are one sample."""
    return [
        _point(name, how, count)
        for name in PUBLISHED
        for how in WAYS["regularisation"]
        for count in settings.neurons
    ]


def compared(settings: Settings) -> list[dict[str, Value]]:
    """A part of `tabulated`: `COUNTS` neuron counts, in a random order.

    The other architectures follow, one network of each. The order lets trials of all
    kinds meet at every rung, or the first kind would be halved among its own.
    """
    wanted = np.geomspace(settings.neurons[0], settings.neurons[-1], COUNTS)
    every = np.array(settings.neurons)
    counts = {int(every[np.argmin(abs(every - one))]) for one in wanted}
    points = list(product(PUBLISHED, WAYS["regularisation"], sorted(counts)))
    order = np.random.default_rng(settings.seed).permutation(len(points))
    others = [o for o in opening(settings) if o["inputs"] not in PUBLISHED]
    least = min(o["neurons"] for o in others)
    return [
        *(_point(*points[i]) for i in order),
        *(o for o in others if o["neurons"] == least),
    ]


def _point(name: str, how: str, count: int) -> dict[str, Value]:
    return {
        "inputs": name,
        "neurons": count,
        "regularisation": how,
        "weight": WEIGHT,
        "lag": ONE_SAMPLE,
    }


# Samplers, and the trials each begins with; a grid has no others, and none stops early.
FIRST_OF = {"tpe": opening, "nsga2": opening, "grid": tabulated}
ALL_GIVEN = ("grid",)


def trials_of(sampler: str, asked: int | None, usual: int) -> int:
    """How many trials to draw; raises `InputError` for what cannot be asked for."""
    one_of("sampler", sampler, FIRST_OF)
    if asked is None:
        return usual
    if sampler in ALL_GIVEN:
        raise InputError(
            f"trials is {asked}; a {sampler} has as many as it has points, so leave "
            "out --trials"
        )
    if asked < 1:
        raise InputError(f"trials is {asked}; at least 1 is needed")
    return asked


def _filtered(inputs: str) -> bool:
    row = architecture_of(inputs)
    return bool(row.filters or row.branches)


def configuration(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of the search as the trainer takes them.

    >>> configuration({"inputs": "FFRI2", "neurons": 3, "regularisation": "l2",
    ...                "weight": 0.1, "lag": "one sample"})
    {'inputs': 'FFRI2', 'neurons': 3, 'regularisation': 'l2=0.1', 'lag_s': None}
    """
    how = parameters[way_of(parameters["inputs"])]
    found = {
        "inputs": parameters["inputs"],
        "neurons": parameters["neurons"],
        "regularisation": f"l2={parameters['weight']!r}" if how == "l2" else how,
        "lag_s": parameters.get("lag_s"),
    }
    if "folds_seed" in parameters:
        found["folds_seed"] = parameters["folds_seed"]
    return found


class Rule:
    """When the random folds of a trial stop: never, if it is not a kind of its own."""

    def bounds(self, number: int) -> list[int]:
        """Folds judged when it is asked, and `number` of all at the end."""
        return [*range(PART, number, PART), number]

    def stops(self, errors: Sequence[float], unseen: float) -> bool:
        """Whether the trial stops: errors of folds so far, and at unseen rates."""
        return False


Ahead = Sequence[tuple[float, Sequence[float]]]
"""Of networks on the front: error at unseen rates, errors of the random folds."""


@dataclass(frozen=True)
class Front(Rule):
    """Stops where a network on the front is better in both ways, beyond doubt."""

    ahead: Ahead

    def stops(self, errors: Sequence[float], unseen: float) -> bool:
        return beaten(errors, unseen, self.ahead)


@dataclass(frozen=True)
class Halving(Rule):
    """Stops a network that is not in the best third by random folds.

    `earlier`: errors of the random folds of networks with the same inputs, so that
    neurons and regularisation are compared for each. At unseen rates all are judged.
    """

    earlier: Sequence[Sequence[float]]

    def bounds(self, number: int) -> list[int]:
        return [*(r for r in RUNGS if r < number), number]

    def stops(self, errors: Sequence[float], unseen: float) -> bool:
        return halved(self.at_rungs(errors), [self.at_rungs(e) for e in self.earlier])

    @staticmethod
    def at_rungs(errors: Sequence[float]) -> list[float]:
        """Mean of the random folds at each rung reached."""
        return [float(np.mean(errors[:r])) for r in RUNGS if r <= len(errors)]


def never(chosen: Mapping[str, Any], done: Sequence[Finished]) -> Rule:
    """Every fold of every trial."""
    return Rule()


def by_front(chosen: Mapping[str, Any], done: Sequence[Finished]) -> Rule:
    """By the front of the trials finished before."""
    return Front([(t.values[1], t.result["nrmse"]) for t in front(done)])


def by_halving(chosen: Mapping[str, Any], done: Sequence[Finished]) -> Rule:
    """By those of them that have the same inputs."""
    mine = [t for t in done if t.parameters["inputs"] == chosen["inputs"]]
    return Halving([t.result["nrmse"] for t in mine])


class Judge:
    """Trials of one material; used as a context. `rule`: when the folds of a trial
    stop, from its configuration and the trials finished before.

    Each is in a process of its own where the search is this process's alone; where
    others are on it too, and have cores of their own, trials are in this process.
    """

    def __init__(
        self,
        trainer: Trainer,
        places: Places,
        rule: Callable[[Mapping[str, Any], Sequence[Finished]], Rule] = by_front,
    ) -> None:
        self.trainer, self.unseen = trainer, unseen_split(trainer)
        self.rule = rule
        self._alone = places.storage.startswith("sqlite")
        self._stack = ExitStack()
        self._pool: Executor | None = None

    def __enter__(self) -> Judge:
        if self._alone:
            pool = workers(min(TOGETHER, os.cpu_count() or 1))
            self._pool = self._stack.enter_context(pool)
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def submit(
        self, parameters: Mapping[str, Any], done: Sequence[Finished]
    ) -> Future[Result]:
        """A trial whose random folds stop when they are plainly not needed."""
        chosen = configuration(parameters)
        for other in done:  # the sampler may ask for the same again
            if other.result["configuration"] == chosen:
                return _known((other.values, other.result))
        return self._submit(chosen, self.rule(chosen, done))

    def whole(self, parameters: Mapping[str, Any]) -> Result:
        """Every fold, whatever went before."""
        return self._submit(configuration(parameters), Rule()).result()

    def apart(self, work: Callable[..., T], *arguments: Any) -> Future[T]:
        """Result of `work(trainer, ...)`, in a process of the search if it has some."""
        if self._pool is None:
            return _known(work(self.trainer, *arguments))
        data, settings = self.trainer.data, self.trainer.settings
        return self._pool.submit(_there, data, settings, work, *arguments)

    def _submit(self, chosen: dict[str, Any], rule: Rule) -> Future[Result]:
        about = self.trainer.data, self.trainer.settings, self.unseen
        if self._pool is None:
            return _known(judged(*about, chosen, rule))
        return self._pool.submit(judged, *about, chosen, rule)


def _there(
    data: Data, settings: Settings, work: Callable[..., T], *arguments: Any
) -> T:
    return work(_trainer(data.digest, data, settings), *arguments)


def _known(result: T) -> Future[T]:
    found: Future[T] = Future()
    found.set_result(result)
    return found


def judged(
    data: Data,
    settings: Settings,
    unseen_split: str,
    chosen: dict[str, Any],
    rule: Rule,
) -> Result:
    """One trial: unseen rates and the first random folds, then the others."""
    trainer = _trainer(data.digest, data, settings)
    bounds = rule.bounds(settings.folds)
    both = trainer.judge_parts(
        chosen, {unseen_split: slice(None), "random": slice(0, bounds[0])}
    )
    unseen, found = both[unseen_split], both["random"]
    mean = float(np.mean(unseen["nrmse"]))
    stopped = None
    for start, end in pairwise(bounds):
        if rule.stops(found["nrmse"], mean):
            stopped = start
            break
        part = slice(start, end)
        _extend(found, trainer.judge_parts(chosen, {"random": part})["random"])
    found.pop("nrmse_by_rate")  # of the folds of one part it would mean little
    error = float(np.mean(found["nrmse"]))
    return (error, mean), {
        **found,
        "generalisation_error": error,
        "r2_mean": float(np.mean(found["r2"])),
        "unseen": {k: unseen[k] for k in ("nrmse", "r2", "folds", "seconds")},
        "configuration": chosen,
        "stopped_after": stopped,
    }


_TRAINERS: dict[tuple[str, Settings], Trainer] = {}


def _trainer(digest: str, data: Data, settings: Settings) -> Trainer:
    """That of these data in this process: it keeps the inputs that it has made."""
    if (digest, settings) not in _TRAINERS:
        _TRAINERS.clear()
        _TRAINERS[digest, settings] = Trainer(data, settings, TRAINING, threads=1)
    return _TRAINERS[digest, settings]


def beaten(errors: Sequence[float], unseen: float, ahead: Ahead) -> bool:
    """Whether a network ahead is better in both ways, by the folds judged so far."""
    for far, folds in ahead:
        gap = np.array(errors) - np.array(folds[: len(errors)])
        if (
            far <= unseen
            and gap.any()
            and wilcoxon(gap, alternative="greater").pvalue <= LEVEL
        ):
            return True
    return False


def _extend(found: dict[str, Any], more: Mapping[str, Any]) -> None:
    """Add the folds of a part to those before it."""
    for key, value in more.items():
        if isinstance(value, list) or key == "seconds":
            found[key] = found[key] + value
