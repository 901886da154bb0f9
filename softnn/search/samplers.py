"""Samplers that draw the trials of `explore` from earlier trials and a seed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import optuna
from optuna.distributions import BaseDistribution
from optuna.trial import FrozenTrial, TrialState

APART = 1_000_003  # seeds of two trials: a prime, so that those of two searches differ
STARTUP = 30  # trials drawn at random before a front is modelled; a generation


def estimators(seed: int, first: int) -> optuna.samplers.BaseSampler:
    """Tree-structured Parzen estimators, one for each group of parameters that occur
    together; the `first` trials are given."""
    with warnings.catch_warnings():  # `group` may change; results say the version
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        return optuna.samplers.TPESampler(
            seed=seed,
            n_startup_trials=max(STARTUP, first),
            multivariate=True,
            group=True,
        )


class Generations(optuna.samplers.NSGAIISampler):
    """NSGA-II (Deb et al. 2002, doi:10.1109/4235.996017), `STARTUP` a generation.

    A generation is so many finished trials in their order. Optuna writes it into each
    trial as it is drawn, which says which trials were under way: a search that was
    stopped would not go on as if it had not been.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(population_size=STARTUP, seed=seed)

    def get_trial_generation(self, study: optuna.Study, trial: FrozenTrial) -> int:
        return len(_complete(study)) // STARTUP

    def get_population(self, study: optuna.Study, generation: int) -> list[FrozenTrial]:
        start = generation * STARTUP
        return _complete(study)[start : start + STARTUP]

    def get_parent_population(
        self, study: optuna.Study, generation: int
    ) -> list[FrozenTrial]:
        found = super().get_parent_population(study, generation)
        return sorted(found, key=lambda trial: trial.number)


def _complete(study: optuna.Study) -> list[FrozenTrial]:
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))


SAMPLERS: Mapping[str, Callable[[int, int], optuna.samplers.BaseSampler]] = {
    "tpe": estimators,
    "nsga2": lambda seed, _: Generations(seed),
    "grid": lambda seed, _: optuna.samplers.RandomSampler(seed),  # all is given
}


def genes(
    sampler: str,
    parameters: Mapping[str, Any],
    space: Mapping[str, BaseDistribution],
    study: optuna.Study,
    seed: int,
) -> dict[str, Any]:
    """Parameters of a trial as a sampler is shown them.

    NSGA-II crosses what all trials have alone. So it is shown a value of every
    parameter, at random where the trial has none: a gene that is silent.
    """
    if sampler != "nsga2":
        return dict(parameters)
    silent = optuna.samplers.RandomSampler(seed)
    trial = optuna.trial.create_trial(state=TrialState.RUNNING)
    return {
        name: parameters[name]
        if name in parameters
        else silent.sample_independent(study, trial, name, values)
        for name, values in space.items()
    }
