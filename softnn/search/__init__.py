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
from itertools import product
from pathlib import Path
from types import TracebackType
from typing import Any

import optuna
from optuna.distributions import BaseDistribution
from optuna.trial import FrozenTrial, TrialState

from softnn.contracts import InputError
from softnn.database import (
    Lock,
    ServerLock,
    made_aside,
    server_lock,
    shown,
    sqlite_file,
    undisturbed,
)
from softnn.search.draws import (
    Draws,
    Finished,
    Given,
    Objective,
    Range,
    Result,
    Value,
    When,
    distribution,
)
from softnn.search.samplers import APART, SAMPLERS

optuna.logging.set_verbosity(optuna.logging.WARNING)

TOGETHER = 4  # trials under way: two long ones leave no core idle
HEARTBEAT_S = 10  # of a process at a trial, to a database server; dead after three


class Search:
    """An Optuna study of objectives to be minimised.

    Use it as a context. It is open for one process; in a database server for any number
    of others that are `worker`s, for `explore` (see `softnn.search.together`). `name`
    must change with anything that changes results (data, settings, seed): trials under
    one name are never run again. `storage` is an SQLAlchemy address; missing folders of
    an SQLite file are made.

    `space` declares every parameter: the values it can take, or a `Range`. `sampler`,
    one of `SAMPLERS`, draws the trials of `explore`.

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
        worker: bool = False,
        heartbeat_s: int = HEARTBEAT_S,
        sampler: str = "tpe",
    ) -> None:
        if sampler not in SAMPLERS:
            raise InputError(
                f"sampler is {sampler!r}; allowed is {', '.join(SAMPLERS)}"
            )
        self.name, self.space, self.seed = name, dict(space), seed
        self.sampler = sampler
        self.storage, self.worker = storage, worker
        self.on_server = not storage.startswith("sqlite")
        if worker and not self.on_server:
            raise InputError(
                f"storage {storage!r} is a file; workers share a database server, such "
                "as --storage postgresql+psycopg://user@host/softnn"
            )
        self._backend: optuna.storages.BaseStorage | None = None
        self._lock = None if worker else _lock(storage, name)
        try:
            self._backend = backend = _backend(storage, heartbeat_s)
            if fresh:
                known = optuna.get_all_study_names(backend)
                if name in known:
                    optuna.delete_study(study_name=name, storage=backend)
            self.study = optuna.create_study(
                study_name=name,
                storage=backend,
                load_if_exists=True,
                directions=["minimize"] * objectives,
            )
            self._stored = {t.number for t in self._trials(TrialState.COMPLETE)}
            # The lock is held, so whoever was running these is gone; of trials shared
            # with workers the heartbeat tells.
            for trial in self._trials(TrialState.RUNNING):
                if not (worker or (self.on_server and "slot" in trial.user_attrs)):
                    self.study.tell(trial.number, state=TrialState.FAIL)
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
        if self.on_server and isinstance(self._backend, optuna.storages.RDBStorage):
            self._backend.remove_session()
            self._backend.engine.dispose()  # connections are few, and others want them

    @property
    def finished(self) -> list[Finished]:
        """All finished trials, oldest first."""
        return [self._finished(t) for t in self._trials(TrialState.COMPLETE)]

    def remember(self, key: str, value: str) -> str:
        """The text kept with the search under `key`; `value` if there is none yet."""
        kept = self.remembered(key)
        if kept is None:
            self.study.set_user_attr(key, value)
        return value if kept is None else kept

    def remembered(self, key: str) -> str | None:
        """The text kept under `key`, if any."""
        kept = self.study.user_attrs.get(key)
        return None if kept is None else str(kept)

    def run(self, parameters: Mapping[str, Value], objective: Objective) -> Finished:
        """The trial of these parameters: as stored, else run now."""
        wanted = dict(parameters)
        for trial in self._trials(TrialState.COMPLETE):
            if trial.params == wanted:
                return self._finished(trial)
        return self._run(Given(wanted), list(wanted), objective)

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
                seed=self.seed + APART * count,
                n_startup_trials=min(8, max(2, trials // 3)),
            )
            yield self._run(Given(fixed, tpe), list(self.space), objective)

    def explore(
        self,
        submit: Callable[[dict[str, Any], Sequence[Finished]], Future[Result]],
        trials: int,
        *,
        first: Sequence[Mapping[str, Value]] = (),
        when: When | None = None,
    ) -> Iterator[Finished]:
        """Yield `trials` trials towards the front of all objectives; `first` go first.

        `TOGETHER` trials are under way at once. A trial is drawn with a fixed number of
        earlier trials known, whichever ended sooner. So a search that was stopped goes
        on as if it had not been. Each is handed to `submit`.

        Parameters are drawn in the order of the space; a parameter in `when` is drawn
        if its condition holds for the earlier ones. By default tree-structured Parzen
        estimators draw, multivariate, one for each group of parameters that occur
        together (Ozaki et al. 2022, doi:10.1613/jair.1.13188); `sampler` may change it.

        In a database server other workers take part, and the order is that of ending.
        """
        if self.on_server:
            from softnn.search.together import together

            yield from together(self, submit, trials, first, when)
            return
        done = self.explored()
        yield from done[:trials]
        draws = Draws(self, first, when or {})
        pending: deque[tuple[optuna.Trial, Future[Result]]] = deque()
        try:
            for count in range(len(done), trials):
                known = done[: max(0, count + 1 - TOGETHER)]
                parameters = draws.draw(count, known)
                self.study.sampler = Given(parameters)
                space = {n: draws.space[n] for n in parameters}
                trial = self._asked(space, explored=True)
                pending.append((trial, submit(parameters, known)))
                while len(pending) == TOGETHER or (pending and count == trials - 1):
                    done.append(self._oldest(pending))
                    yield done[-1]
        except BaseException:
            for trial, future in pending:
                future.cancel()
                self.study.tell(trial, state=TrialState.FAIL, skip_if_finished=True)
            raise

    def explored(self) -> list[Finished]:
        """Finished trials of `explore`, oldest first."""
        return [
            self._finished(trial)
            for trial in self._trials(TrialState.COMPLETE)
            if trial.user_attrs.get("explored")
        ]

    def _oldest(self, pending: deque[tuple[optuna.Trial, Future[Result]]]) -> Finished:
        trial, future = pending[0]
        told = self._told(trial, lambda _: future.result())
        pending.popleft()
        return told

    def _trials(self, state: TrialState) -> list[FrozenTrial]:
        return self.study.get_trials(deepcopy=False, states=(state,))

    def _run(
        self,
        sampler: optuna.samplers.BaseSampler,
        names: Sequence[str],
        objective: Objective,
    ) -> Finished:
        space = {name: distribution(self.space[name]) for name in names}
        self.study.sampler = sampler
        with warnings.catch_warnings():  # this process leads: nobody waits for a beat
            warnings.filterwarnings("ignore", "Heartbeat of storage")
            trial = self._asked(space)
        return self._told(trial, objective)

    def _asked(
        self, space: Mapping[str, BaseDistribution], **about: bool
    ) -> optuna.Trial:
        """Return a new trial; one that ctrl-C comes in between is not left running."""
        made: list[optuna.Trial] = []
        try:
            with undisturbed():
                made.append(self.study.ask(dict(space)))
                for key, value in about.items():
                    made[0].set_user_attr(key, value)
        except BaseException:
            for trial in made:
                self.study.tell(trial, state=TrialState.FAIL)
            raise
        return made[0]

    def _told(self, trial: optuna.Trial, objective: Objective) -> Finished:
        try:
            value, result = objective(dict(trial.params))
            with undisturbed():
                trial.set_user_attr("result", result)
                told = self.study.tell(trial, value)
        except BaseException:  # ctrl-C too: the trial is not left running
            self.study.tell(trial, state=TrialState.FAIL, skip_if_finished=True)
            raise
        return self._finished(told)

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
            trial.user_attrs.get("slot", 0),
        )


def _lock(storage: str, name: str) -> Lock | ServerLock | None:
    file = sqlite_file(storage)
    if storage.startswith("postgresql"):
        return ServerLock(storage, f"search {name}")
    if storage.startswith("sqlite") and file is None:
        return None  # in memory: nobody else can open it
    folder = file.parent if file else Path(tempfile.gettempdir())
    return Lock(folder / f".{name}.lock", f"search {name}")


def _backend(storage: str, heartbeat_s: int) -> optuna.storages.BaseStorage:
    if storage in ("sqlite://", "sqlite:///:memory:"):
        return optuna.storages.InMemoryStorage()
    try:
        file = sqlite_file(storage)
        if file is not None:
            made_aside(file, _make)
            return optuna.storages.RDBStorage(storage)
        return _on_server(storage, heartbeat_s)
    except Exception as error:  # SQLAlchemy's own, of many kinds
        raise InputError(
            f"storage {shown(storage)} cannot be opened "
            f"({str(error).splitlines()[0]}); give an address such as sqlite:///mlruns/optuna.db"
        ) from None


def _on_server(storage: str, heartbeat_s: int) -> optuna.storages.BaseStorage:
    with warnings.catch_warnings():  # heartbeats may change; results say the version
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        with server_lock(storage, "tables of searches"):  # two would make them at once
            return optuna.storages.RDBStorage(
                storage, heartbeat_interval=heartbeat_s, grace_period=3 * heartbeat_s
            )


def _make(file: Path) -> None:
    made = optuna.storages.RDBStorage(f"sqlite:///{file}")
    made.remove_session()
    made.engine.dispose()
