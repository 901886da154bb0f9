"""Recordings of one split as every rival gets them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.recordings.groups import Group, Split, alike, amplitude, distinct, rate
from bench.recordings.predict import misses_of, usable
from softnn.contracts import Array, Chunk
from softnn.fit import Data, Engine, Fit, Guess, Piece, fit
from softnn.mismatch import prediction
from softnn.mismatch.base import SEARCH, nuisance, units_for
from softnn.mismatch.case import to_data
from softnn.models.base import Base

MOST_FOLDS = 4
STRETCHES = 4  # of a single recording, left out one at a time
SIGMA = 0.01  # of the largest stress, alike for all samples: least squares in stress

Predict = Callable[[Sequence[Chunk]], list[Array]]
"""Stress (n,) of each history in MPa."""
Mask = tuple[NDArray[np.bool], ...]


@dataclass(frozen=True)
class Problem:
    """Recordings to fit and recordings to predict.

    The stress of `known` is divided by the scale of its specimen. `folds` are the inner
    folds: samples (n,) of each recording to leave out. `scaled`: the stress of a
    recording is met up to a factor, as it is for softnn (`bench.recordings.predict`).
    """

    known: Data
    unseen: Data
    folds: tuple[Mask, ...]
    scaled: bool

    def error(self, predict: Predict, seen: Data, only: Mask | None = None) -> Array:
        """Sums of squared errors and of squared stress over samples, (2,)."""
        stress = predict(seen.chunks)
        found = misses_of({"rival": stress}, seen, self.scaled, only)
        return np.array([found["rival"].sum(), found["squares"].sum()])


def nrmse(sums: Array) -> float:
    """The NRMSE of sums of squares (2,); infinite where a prediction is no number."""
    value = float(np.sqrt(sums[0] / max(sums[1], 1e-300)))
    return value if np.isfinite(value) else float("inf")


def problem_of(group: Group, split: Split, samples: int) -> Problem:
    """The split as softnn gets it: the search's samples, and `samples` to predict."""
    case = usable(group.case(split.fit), samples)
    known = to_data(usable(case, SEARCH))
    unseen = to_data(usable(group.case(split.unseen), samples))
    if group.specimens:
        scales = specimen_scales(known, case.groups())
        stress = [s / k for s, k in zip(known.stress_MPa, scales, strict=True)]
        known = replace(known, stress_MPa=tuple(stress))
    folds = tuple(inner_folds([group.recordings[i] for i in split.fit], split, known))
    return Problem(known, unseen, folds, group.specimens)


def specimen_scales(data: Data, groups: Sequence[tuple[int, ...]]) -> list[float]:
    """A factor for each recording, from the piecewise-linear base fitted to all."""
    pieces = nuisance(data, groups)
    if not pieces:
        return [1.0] * len(data.chunks)
    found = least_squares(data, units_for("pl-wiechert", data), pieces)
    errors = np.asarray(found.guess.pieces[0].values["error"], float)
    return [float(1 + e) for e in errors]


def least_squares(
    data: Data, units: Base, pieces: Sequence[Piece] = (), iterations: int = 12
) -> Fit:
    """Springs, branches and pieces by least squares, weighed as an error is."""
    engine = prediction.alike(Engine(data), SIGMA)
    guess = Guess(units, np.zeros(units.columns), tuple(pieces))
    return fit(engine, guess, iterations=iterations)


def inner_folds(recordings: Sequence, split: Split, data: Data) -> list[Mask]:
    """Recordings to leave out together; stretches where there is but one.

    A split by rate or amplitude is judged by levels of that kind, so that a replicate
    of the recording left out does not stay among the others.
    """
    none = [np.zeros(len(s), bool) for s in data.stress_MPa]
    if len(recordings) == 1:
        known = np.flatnonzero(np.isfinite(data.stress_MPa[0]))
        parts = np.array_split(known, STRETCHES)
        return [(np.isin(np.arange(len(none[0])), part),) for part in parts]
    out = []
    for members in together(recordings, split.by):
        out.append(
            tuple(np.ones_like(m) if i in members else m for i, m in enumerate(none))
        )
    return out


def together(recordings: Sequence, by: str) -> list[list[int]]:
    """Indices of recordings that are left out together, in `MOST_FOLDS` at most."""
    every = list(range(len(recordings)))
    sets = [[i] for i in every]
    if by in ("rate", "amplitude"):
        values = [rate(r) if by == "rate" else amplitude(r) for r in recordings]
        levels = distinct(values)
        by_level = [[i for i in every if alike(values[i], v)] for v in levels]
        if len(by_level) > 1:
            sets = by_level
    count = min(len(sets), MOST_FOLDS)
    return [sorted({i for s in sets[k::count] for i in s}) for k in range(count)]


def without(data: Data, fold: Mask) -> Data:
    """The data without the stress of a fold; its strain histories stay."""
    stress = [
        np.where(m, np.nan, s) for s, m in zip(data.stress_MPa, fold, strict=True)
    ]
    return replace(data, stress_MPa=tuple(stress))
