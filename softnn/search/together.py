"""A search that many processes carry out, on any number of machines.

Its trials are numbered slots in the queue of Optuna's study, in a database server. A
process takes a slot, which the server gives to no other, and reports that it lives
while it works. If it dies or is stopped, the slot returns to the queue.

A trial is drawn with the trials known that have ended by then. So a search by several
processes differs from run to run, unlike a search by one process.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any

import optuna
from optuna.trial import TrialState

from softnn.contracts import InputError
from softnn.database import server_lock
from softnn.search.draws import Draws, Finished, Result, Value, When

if TYPE_CHECKING:
    from softnn.search import Search

SLOT = "slot"
DEATHS = 3  # of one slot; after so many the trial itself is to blame
PAUSE_S = 0.5  # between looks at what others are doing
OPEN = (TrialState.WAITING, TrialState.RUNNING, TrialState.COMPLETE)


def together(
    search: Search,
    submit: Callable[[dict[str, Any], Sequence[Finished]], Future[Result]],
    trials: int,
    first: Sequence[Mapping[str, Value]] = (),
    when: When | None = None,
) -> Iterator[Finished]:
    """See `Search.explore`; trials as they are finished, by whichever process.

    Ends when all slots are finished. Raises `InputError` for a slot that has died
    `DEATHS` times.
    """
    study, draws = search.study, Draws(search, first, when or {})
    told: set[int] = set()

    def objective(trial: optuna.Trial) -> float | Sequence[float]:
        if SLOT not in trial.user_attrs:  # others were faster: the queue is empty
            raise optuna.TrialPruned
        value, result = submit(draws.of(trial), known).result()
        trial.set_user_attr("result", result)
        return value

    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            optuna.storages.fail_stale_trials(study)
        waiting = queued(search, trials, first)
        known = [t for t in search.explored() if t.slot < trials]
        for one in known:
            if one.number not in told:
                told.add(one.number)
                yield one
        if len(known) >= trials:
            return
        if not waiting:  # what others are at may come back
            time.sleep(PAUSE_S)
            continue
        study.sampler = draws.sampler(len(told))
        study.optimize(objective, n_trials=1)


def queued(search: Search, trials: int, first: Sequence[Mapping[str, Value]]) -> int:
    """Put every slot that nobody has into the queue; the number that wait there."""
    with server_lock(search.storage, f"queue of {search.name}"):
        every = [t for t in search.study.get_trials(False) if SLOT in t.user_attrs]
        have = {t.user_attrs[SLOT] for t in every if t.state in OPEN}
        dead = Counter(t.user_attrs[SLOT] for t in every if t.state == TrialState.FAIL)
        for slot in range(trials):
            if slot in have:
                continue
            if dead[slot] >= DEATHS:
                raise InputError(
                    f"trial {slot + 1} of {search.name} was not finished {DEATHS} "
                    "times; run it alone to see why, or --fresh to start over"
                )
            given = dict(first[slot]) if slot < len(first) else {}
            search.study.enqueue_trial(given, {"explored": True, SLOT: slot})
        waiting = sum(t.state == TrialState.WAITING for t in every)
        return waiting + len(set(range(trials)) - have)
