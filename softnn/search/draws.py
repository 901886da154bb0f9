"""Trials of a search: what they are, and how their parameters are drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import TrialState

from softnn.search.samplers import APART, SAMPLERS, genes

if TYPE_CHECKING:
    from softnn.search import Search

Value = int | float | str
# The objective (one number, or one for each objective), and the result to keep.
Result = tuple[float | Sequence[float], dict[str, Any]]
When = Mapping[str, Callable[[Mapping[str, Any]], bool]]
Objective = Callable[[dict[str, Any]], Result]


@dataclass(frozen=True)
class Range:
    """Numbers from low to high, both included; `log` spaces them by ratio."""

    low: float
    high: float
    log: bool = False


@dataclass(frozen=True)
class Finished:
    """One finished trial; `stored` says that it was there before this search began.

    `value` is its first objective, `values` are all of them; `slot` is its place in a
    search of several processes.
    """

    number: int
    parameters: dict[str, Any]
    value: float
    result: dict[str, Any]
    started: datetime
    ended: datetime
    stored: bool
    values: tuple[float, ...] = ()
    slot: int = 0


class Given(optuna.samplers.BaseSampler):
    """Draws what it was given, the rest from `other`.

    Optuna's own queue of given trials can lose an entry to a kill.
    """

    def __init__(
        self,
        parameters: Mapping[str, Value],
        other: optuna.samplers.BaseSampler | None = None,
    ) -> None:
        self._parameters, self._other = parameters, other

    def infer_relative_search_space(self, *_: Any) -> dict[str, BaseDistribution]:
        return {}  # parameters are drawn one by one

    def sample_relative(self, *_: Any) -> dict[str, Any]:
        return {}

    def sample_independent(
        self, study: Any, trial: Any, param_name: str, param_distribution: Any
    ) -> Any:
        if self._other is None or param_name in self._parameters:
            return self._parameters[param_name]
        return self._other.sample_independent(
            study, trial, param_name, param_distribution
        )


class Draws:
    """Parameters of the trials of `explore`: those of `first`, then by the sampler.

    The sampler sees a study in memory that is given the trials it may know.
    """

    def __init__(
        self, search: Search, first: Sequence[Mapping[str, Value]], when: When
    ) -> None:
        self.space = {n: distribution(v) for n, v in search.space.items()}
        self.first, self.when, self.seed = first, when, search.seed
        self.by = search.sampler
        self.study = optuna.create_study(directions=search.study.directions)
        self._known = 0

    def draw(self, count: int, known: Sequence[Finished]) -> dict[str, Any]:
        """Return the parameters of trial `count`, from the trials in `known`."""
        if count < len(self.first):
            return self._chosen(lambda name: self.first[count][name])
        for i, one in enumerate(known[self._known :], self._known):
            seed = self.seed + APART * i
            shown = genes(self.by, one.parameters, self.space, self.study, seed)
            space = {name: self.space[name] for name in shown}
            self.study.add_trial(
                optuna.trial.create_trial(
                    params=shown, distributions=space, values=one.values
                )
            )
        self._known = len(known)
        self.study.sampler = self.sampler(count)
        trial = self.study.ask()
        chosen = self.of(trial)
        self.study.tell(trial, state=TrialState.FAIL)  # it is run elsewhere
        return chosen

    def of(self, trial: optuna.Trial) -> dict[str, Any]:
        """Return the draw of a trial's own sampler, or the given values."""
        return self._chosen(lambda name: suggest(trial, name, self.space[name]))

    def sampler(self, count: int) -> optuna.samplers.BaseSampler:
        """Return the parameters of the trial after `count` others."""
        return SAMPLERS[self.by](self.seed + APART * count, len(self.first))

    def _chosen(self, value: Callable[[str], Any]) -> dict[str, Any]:
        chosen: dict[str, Any] = {}
        for name in self.space:
            if name not in self.when or self.when[name](chosen):
                chosen[name] = value(name)
        return chosen


def suggest(trial: optuna.Trial, name: str, values: BaseDistribution) -> Any:
    if isinstance(values, FloatDistribution):
        return trial.suggest_float(name, values.low, values.high, log=values.log)
    if isinstance(values, IntDistribution):
        return trial.suggest_int(name, values.low, values.high)
    assert isinstance(values, CategoricalDistribution)
    return trial.suggest_categorical(name, values.choices)


def distribution(space: Sequence[Value] | Range) -> BaseDistribution:
    if isinstance(space, Range):
        return FloatDistribution(space.low, space.high, log=space.log)
    if all(type(value) is int for value in space):
        return IntDistribution(min(space), max(space))  # type: ignore[arg-type]
    return CategoricalDistribution(list(space))
