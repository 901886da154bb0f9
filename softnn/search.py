"""Searches that survive being stopped: every finished trial is kept, none runs twice.

A trial counts once its result is stored; one that was cut short is marked as failed
and its parameters are tried again. A search started again therefore ends with the
same trials as one that was never stopped.
"""

from __future__ import annotations

import tempfile
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from datetime import datetime
from itertools import product
from pathlib import Path
from types import TracebackType
from typing import Any

import optuna
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.trial import FrozenTrial, TrialState

from softnn.contracts import InputError
from softnn.database import Lock, made_aside, sqlite_file

optuna.logging.set_verbosity(optuna.logging.WARNING)

Value = int | float | str
STARTUP = 30  # trials drawn at random before a front is modelled
TOGETHER = 4  # trials under way: two long ones leave no core idle
# What is minimised, one number or one an objective, and all there is to keep.
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

    `value` is its first objective, `values` are all of them.
    """

    number: int
    parameters: dict[str, Any]
    value: float
    result: dict[str, Any]
    started: datetime
    ended: datetime
    stored: bool
    values: tuple[float, ...] = ()


class Search:
    """An Optuna study of objectives to be minimised, open for one process.

    Use it as a context. `name` must change with anything that changes results (data,
    settings, seed): trials under one name are never run again. `storage` is an
    SQLAlchemy address; missing folders of an SQLite file are made.

    `space` declares every parameter: the values it can take, or a `Range`.

    >>> with Search("sqlite://", "square", {"x": [1, 2, 3]}) as search:
    ...     done = list(search.grid(lambda p: ((p["x"] - 2) ** 2, {})))
    >>> min(done, key=lambda trial: trial.value).parameters
    {'x': 2}
    """

    def __init__(
        self,
        storage: str,
        name: str,
        space: Mapping[str, Sequence[Value] | Range],
        *,
        seed: int = 0,
        fresh: bool = False,
        objectives: int = 1,
    ) -> None:
        self.name, self.space, self.seed = name, dict(space), seed
        self._lock = _lock(storage, name)
        try:
            backend = _backend(storage)
            if fresh:
                known = optuna.get_all_study_names(backend)
                if name in known:
                    optuna.delete_study(study_name=name, storage=backend)
            self._study = optuna.create_study(
                study_name=name,
                storage=backend,
                load_if_exists=True,
                directions=["minimize"] * objectives,
            )
            self._stored = {t.number for t in self._trials(TrialState.COMPLETE)}
            # The lock is held, so whoever was running these is gone.
            for trial in self._trials(TrialState.RUNNING):
                self._study.tell(trial.number, state=TrialState.FAIL)
        except BaseException:
            self._release()
            raise

    def __enter__(self) -> Search:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._release()

    def _release(self) -> None:
        if self._lock is not None:
            self._lock.release()

    @property
    def finished(self) -> list[Finished]:
        """All finished trials, oldest first."""
        return [self._finished(t) for t in self._trials(TrialState.COMPLETE)]

    def remember(self, key: str, value: str) -> str:
        """The text kept with the search under `key`; `value` if there is none yet."""
        kept = self.remembered(key)
        if kept is None:
            self._study.set_user_attr(key, value)
        return value if kept is None else kept

    def remembered(self, key: str) -> str | None:
        """The text kept under `key`, if any."""
        kept = self._study.user_attrs.get(key)
        return None if kept is None else str(kept)

    def run(self, parameters: Mapping[str, Value], objective: Objective) -> Finished:
        """The trial of these parameters: as stored, else run now."""
        wanted = dict(parameters)
        for trial in self._trials(TrialState.COMPLETE):
            if trial.params == wanted:
                return self._finished(trial)
        return self._run(_Given(wanted), list(wanted), objective)

    def grid(self, objective: Objective, **fixed: Value) -> Iterator[Finished]:
        """Every combination of declared values once, the last varying fastest.

        `fixed` holds parameters to one value.
        """
        axes = []
        for name, values in self.space.items():
            if name in fixed:
                values = [fixed[name]]
            if isinstance(values, Range):
                raise InputError(f"a grid needs values for {name}; {values} has none")
            axes.append(values)
        for point in product(*axes):
            yield self.run(dict(zip(self.space, point, strict=True)), objective)

    def minimise(
        self, objective: Objective, trials: int, **fixed: Value
    ) -> Iterator[Finished]:
        """`trials` trials by tree-structured Parzen estimators, `fixed` held.

        Each draw depends on the seed and the trials finished before it, and on nothing
        else: a search that was stopped goes on as if it had not been.
        """
        done = [
            trial
            for trial in self.finished
            if set(trial.parameters) == set(self.space)
            and fixed.items() <= trial.parameters.items()
        ]
        yield from done[:trials]
        for count in range(len(done), trials):
            tpe = optuna.samplers.TPESampler(
                seed=self.seed + 1_000_003 * count,  # a prime apart: seeds never meet
                n_startup_trials=min(8, max(2, trials // 3)),
            )
            yield self._run(_Given(fixed, tpe), list(self.space), objective)

    def explore(
        self,
        submit: Callable[[dict[str, Any], Sequence[Finished]], Future[Result]],
        trials: int,
        *,
        first: Sequence[Mapping[str, Value]] = (),
        when: When | None = None,
    ) -> Iterator[Finished]:
        """`trials` trials towards the front of all objectives; those of `first` first.

        `TOGETHER` trials are under way at once. Each is drawn, and handed to `submit`,
        with those that far before it known and no others, whichever ended sooner: so a
        search that was stopped goes on as if it had not been. Parameters are drawn in
        the order of the space; one named in `when` only where its condition holds for
        those before it. Tree-structured Parzen estimators, multivariate, one for each
        group of parameters that occur together (Ozaki et al.
        2022, doi:10.1613/jair.1.13188).
        """
        done = [
            self._finished(trial)
            for trial in self._trials(TrialState.COMPLETE)
            if trial.user_attrs.get("explored")
        ]
        yield from done[:trials]
        draws = _Draws(self, first, when or {})
        pending: deque[tuple[optuna.Trial, Future[Result]]] = deque()
        try:
            for count in range(len(done), trials):
                known = done[: max(0, count + 1 - TOGETHER)]
                parameters = draws.draw(count, known)
                self._study.sampler = _Given(parameters)
                trial = self._study.ask({n: draws.space[n] for n in parameters})
                trial.set_user_attr("explored", True)
                pending.append((trial, submit(parameters, known)))
                while len(pending) == TOGETHER or (pending and count == trials - 1):
                    done.append(self._oldest(pending))
                    yield done[-1]
        except BaseException:
            for trial, future in pending:
                future.cancel()
                self._study.tell(trial, state=TrialState.FAIL, skip_if_finished=True)
            raise

    def _oldest(self, pending: deque[tuple[optuna.Trial, Future[Result]]]) -> Finished:
        trial, future = pending[0]
        told = self._told(trial, lambda _: future.result())
        pending.popleft()
        return told

    def _trials(self, state: TrialState) -> list[FrozenTrial]:
        return self._study.get_trials(deepcopy=False, states=(state,))

    def _run(
        self,
        sampler: optuna.samplers.BaseSampler,
        names: Sequence[str],
        objective: Objective,
    ) -> Finished:
        space = {name: _distribution(self.space[name]) for name in names}
        self._study.sampler = sampler
        return self._told(self._study.ask(space), objective)

    def _told(self, trial: optuna.Trial, objective: Objective) -> Finished:
        try:
            value, result = objective(dict(trial.params))
            trial.set_user_attr("result", result)
        except BaseException:  # ctrl-C too: the trial is not left running
            self._study.tell(trial, state=TrialState.FAIL)
            raise
        return self._finished(self._study.tell(trial, value))

    def _finished(self, trial: FrozenTrial) -> Finished:
        assert trial.datetime_start is not None
        assert trial.datetime_complete is not None
        return Finished(
            trial.number,
            dict(trial.params),
            trial.values[0],
            trial.user_attrs["result"],
            trial.datetime_start,
            trial.datetime_complete,
            trial.number in self._stored,
            tuple(trial.values),
        )


class _Given(optuna.samplers.BaseSampler):
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


class _Draws:
    """Parameters of the trials of `explore`: those of `first`, then by the estimators.

    The estimators see a study in memory that is given the trials they may know.
    """

    def __init__(
        self, search: Search, first: Sequence[Mapping[str, Value]], when: When
    ) -> None:
        self.space = {n: _distribution(v) for n, v in search.space.items()}
        self.first, self.when, self.seed = first, when, search.seed
        self._study = optuna.create_study(directions=search._study.directions)
        self._known = 0

    def draw(self, count: int, known: Sequence[Finished]) -> dict[str, Any]:
        """Of trial `count`, by what those in `known` say."""
        if count < len(self.first):
            return self._chosen(lambda name: self.first[count][name])
        for one in known[self._known :]:
            space = {name: self.space[name] for name in one.parameters}
            self._study.add_trial(
                optuna.trial.create_trial(
                    params=one.parameters, distributions=space, values=one.values
                )
            )
        self._known = len(known)
        with warnings.catch_warnings():  # `group` may change; results say the version
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            self._study.sampler = optuna.samplers.TPESampler(
                seed=self.seed + 1_000_003 * count,
                n_startup_trials=max(STARTUP, len(self.first)),
                multivariate=True,
                group=True,
            )
        trial = self._study.ask()
        chosen = self._chosen(lambda name: _suggest(trial, name, self.space[name]))
        self._study.tell(trial, state=TrialState.FAIL)  # it is run elsewhere
        return chosen

    def _chosen(self, value: Callable[[str], Any]) -> dict[str, Any]:
        chosen: dict[str, Any] = {}
        for name in self.space:
            if name not in self.when or self.when[name](chosen):
                chosen[name] = value(name)
        return chosen


def _lock(storage: str, name: str) -> Lock | None:
    file = sqlite_file(storage)
    if storage.startswith("sqlite") and file is None:
        return None  # in memory: nobody else can open it
    folder = file.parent if file else Path(tempfile.gettempdir())
    return Lock(folder / f".{name}.lock", f"search {name}")


def _backend(storage: str) -> optuna.storages.BaseStorage:
    if storage in ("sqlite://", "sqlite:///:memory:"):
        return optuna.storages.InMemoryStorage()
    try:
        file = sqlite_file(storage)
        if file is not None:
            made_aside(file, _make)
        return optuna.storages.RDBStorage(storage)
    except Exception as error:  # SQLAlchemy's own, of many kinds
        raise InputError(
            f"storage {storage!r} cannot be opened ({str(error).splitlines()[0]}); "
            "give an address such as sqlite:///mlruns/optuna.db"
        ) from None


def _make(file: Path) -> None:
    made = optuna.storages.RDBStorage(f"sqlite:///{file}")
    made.remove_session()
    made.engine.dispose()


def _suggest(trial: optuna.Trial, name: str, values: BaseDistribution) -> Any:
    if isinstance(values, FloatDistribution):
        return trial.suggest_float(name, values.low, values.high, log=values.log)
    if isinstance(values, IntDistribution):
        return trial.suggest_int(name, values.low, values.high)
    assert isinstance(values, CategoricalDistribution)
    return trial.suggest_categorical(name, values.choices)


def _distribution(space: Sequence[Value] | Range) -> BaseDistribution:
    if isinstance(space, Range):
        return FloatDistribution(space.low, space.high, log=space.log)
    if all(type(value) is int for value in space):
        return IntDistribution(min(space), max(space))  # type: ignore[arg-type]
    return CategoricalDistribution(list(space))
