"""The front of a search, and the network it gives for each use."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softnn.neural import architecture_of
from softnn.search import Finished

USES = ("random", "unseen")  # the order of the objectives
FINALISTS = 20  # of a use; of so many trials as a search has, the best has had luck

Again = Callable[[Sequence[Finished], str], Sequence[np.ndarray]]
"""NRMSE by fold of trials for a use, folds and starting weights drawn once more."""


def front(tried: Sequence[Finished]) -> list[Finished]:
    """Whole trials that no other whole trial beats in both objectives, best first."""
    whole = [t for t in tried if t.result["stopped_after"] is None]
    kept: list[Finished] = []
    for trial in sorted(whole, key=lambda t: (t.values, t.number)):
        if not kept or trial.values[1] < kept[-1].values[1]:
            kept.append(trial)
    return kept


@dataclass(frozen=True)
class Choice:
    """The network for one use: the smallest of those that tie with the best.

    Best of the finalists, by what they were searched by and once more together;
    `ahead`: by how much the best is, its mean and standard error over folds.
    `ties` counts those, the best one too; `fewest` is their least neuron count.
    """

    use: str
    trial: Finished
    best: Finished
    ties: int
    fewest: int
    ahead: tuple[float, float]

    @property
    def words(self) -> str:
        return words(self.trial)

    def entry(self, anew: Finished) -> dict[str, Any]:
        """As the result file keeps it; `anew`: other folds, other starting weights."""
        return {
            "configuration": self.trial.result["configuration"],
            "words": self.words,
            "ties": self.ties,
            "fewest_neurons_of_ties": self.fewest,
            "best": rows_of([self.best])[0],
            "searched": rows_of([self.trial], folds=True)[0],
            "anew": rows_of([anew], folds=True)[0],
        }


def choices(
    tried: Sequence[Finished],
    again: Again,
    finalists: int = FINALISTS,
    halved: bool = False,
) -> dict[str, Choice]:
    """For each use its choice among the finalists: whole trials of least error.

    For unseen rates those that were `halved` by random folds too: there they are whole.
    """
    whole = [t for t in tried if t.result["stopped_after"] is None]
    found = {}
    for i, use in enumerate(USES):
        able = tried if halved and use == "unseen" else whole
        final = sorted(able, key=lambda t: (t.values[i], t.number))[:finalists]
        errors = {
            t.number: _together(use, folds(t, use), more)
            for t, more in zip(final, again(final, use), strict=True)
        }
        final.sort(key=lambda t: (errors[t.number].mean(), t.number))
        best = final[0]
        ties = [t for t in final if tied(errors[t.number], errors[best.number])]
        small = min(ties, key=lambda t: t.result["parameters"])
        fewest = min(t.parameters["neurons"] for t in ties)
        ahead = paired(errors[small.number], errors[best.number])
        found[use] = Choice(use, small, best, len(ties), fewest, ahead)
    return found


def _together(use: str, once: np.ndarray, more: np.ndarray) -> np.ndarray:
    """Errors of both draws: rates are the same ones again, random folds are others."""
    if use == "unseen":
        return np.mean([once, more], axis=0)
    return np.concatenate([once, more])


def folds(trial: Finished, use: str) -> np.ndarray:
    """NRMSE (k,) of a trial by fold."""
    found = trial.result["unseen"] if use == "unseen" else trial.result
    return np.array(found["nrmse"])


def tied(one: np.ndarray, best: np.ndarray) -> bool:
    """Whether an error by folds (k,) is no worse than the least beyond doubt.

    Within one standard error of the paired difference, since folds differ in
    difficulty; and of the least itself (Breiman et al. 1984), since one that fails on a
    single fold widens its own difference as much as it raises it.

    >>> best = np.array([1.0, 5.0, 9.0])
    >>> tied(best + [0.1, -0.1, 0.05], best), tied(best + 0.5, best)
    (True, False)
    >>> tied(best + [0.0, 0.0, 90.0], best)
    False
    """
    gap, within = paired(one, best)
    return gap <= min(within, standard_error(best))


def paired(one: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """Mean of one - other over folds (k,), and its standard error.

    >>> paired(np.array([2.0, 4.0]), np.array([1.0, 1.0]))
    (2.0, 1.0)
    """
    gap = one - other
    return float(gap.mean()), standard_error(gap)


def standard_error(values: np.ndarray) -> float:
    """Of the mean of values (k,) by fold."""
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def folds_of(row: Mapping[str, Any], use: str) -> np.ndarray:
    """NRMSE by fold of a row of the result file."""
    kept = row[f"folds_{use}"]
    return np.array(list(kept.values()) if isinstance(kept, Mapping) else kept)


def rival_of(
    beside: Sequence[Mapping[str, Any]], use: str, start: str = ""
) -> Mapping[str, Any] | None:
    """The baseline of least error whose name begins so, if any could be fitted."""
    able = [
        b
        for b in beside
        if b["model"].startswith(start) and not isinstance(b[use], str)
    ]
    return min(able, key=lambda b: float(np.mean(b[use])), default=None)


def worse_by(one: Mapping[str, Any]) -> tuple[str, float] | None:
    """Return the piecewise model better than the network on unseen data, and its lead.

    `one` is a material of the result file. None if no model is better by more than one
    standard error.
    """
    rival = rival_of(one["baselines"], "unseen", "PL")
    if rival is None:
        return None
    mine = folds_of(one["choices"]["unseen"]["anew"], "unseen")
    gap, within = paired(mine, np.array(rival["unseen"]))
    return (rival["model"], gap) if gap > within else None


def words(trial: Finished) -> str:
    """A configuration in a few words."""
    return described(trial.result["configuration"])


def described(chosen: Mapping[str, Any]) -> str:
    """The same of a configuration, or of a row of the result file."""
    count = chosen["neurons"]
    how = chosen["regularisation"]
    if how.startswith("l2="):
        how = f"L2 {float(how[3:]):.1e}"
    text = f"{chosen['inputs']}, {count} neuron{'s' * (count != 1)}, {how}"
    if chosen["lag_s"] is not None:
        return f"{text}, lag {chosen['lag_s']:.2g} s"
    lagged = architecture_of(chosen["inputs"]).lagged
    return f"{text}, lag one sample" if lagged else text


def rows_of(trials: Sequence[Finished], folds: bool = False) -> list[dict[str, Any]]:
    """Trials as the result file keeps them."""
    rows = []
    for trial in trials:
        found = trial.result
        row: dict[str, Any] = {
            **found["configuration"],
            "parameters": found["parameters"],
            "random": trial.values[0],
            "unseen": trial.values[1],
            "stopped_after": found["stopped_after"],
        }
        if "nrmse_measured" in found:
            row["random_measured"] = float(np.mean(found["nrmse_measured"]))
        if folds:
            row["folds_random"] = found["nrmse"]
            row["folds_unseen"] = dict(
                zip(found["unseen"]["folds"], found["unseen"]["nrmse"], strict=True)
            )
        rows.append(row)
    return rows


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
