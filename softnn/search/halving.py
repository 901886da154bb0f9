"""Successive halving of trials that are judged part by part: Optuna's own pruner."""

from __future__ import annotations

from collections.abc import Sequence

import optuna
from optuna.trial import TrialState

FACTOR = 3  # of the trials that come to a rung, one in so many goes on
RUNGS = (1, FACTOR, FACTOR**2)  # parts judged by then


def halved(values: Sequence[float], others: Sequence[Sequence[float]]) -> bool:
    """Whether a trial stops at the last rung that it has come to.

    `values` has its mean error at each of `RUNGS` so far, `others` have those of the
    trials before it. It goes on if it is in the best third of those that came as far
    (asynchronous successive halving: Li et al. 2020, arXiv:1810.05934).

    >>> others = [[0.1 * k] for k in range(1, 6)]
    >>> halved([0.15], others), halved([0.25], others)
    (False, True)
    """
    pruner = optuna.pruners.SuccessiveHalvingPruner(
        min_resource=RUNGS[0], reduction_factor=FACTOR
    )
    study = optuna.create_study(pruner=pruner)
    for one in others:
        study.tell(_at_rungs(study, one)[0], state=TrialState.PRUNED)
    return _at_rungs(study, values)[1]


def _at_rungs(
    study: optuna.Study, values: Sequence[float]
) -> tuple[optuna.Trial, bool]:
    """A trial with these values, and whether the pruner stops it at the last one."""
    trial, stops = study.ask(), False
    for rung, value in zip(RUNGS, values, strict=False):
        trial.report(value, rung)
        stops = trial.should_prune()  # which notes the rung for those that follow
    return trial, stops
