"""Cross-validation: which samples are held out together, and their prediction errors.

Random folds, the thesis's, put neighbours in time of one specimen on both sides: they
measure interpolation. Folds by specimen and by rate hold out all of one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from softnn.contracts import Array, InputError
from softnn.metrics import generalisation_error, nrmse, r2
from softnn.recording import Recording

SPLITS = ("random", "specimen", "rate", "recording")
RATE_RATIO = 1.25  # nominal rates closer than this are one rate, measured twice


@dataclass(frozen=True)
class Folds:
    """The samples held out in each of k folds, as `test` (k, n), with their names (k,).

    `note` says in words why a split differs from the one asked for.
    """

    test: np.ndarray
    names: tuple[str, ...]
    split: str
    note: str = ""

    @property
    def train(self) -> np.ndarray:
        return ~self.test


@dataclass(frozen=True)
class Scores:
    """NRMSE and R2 of the held-out samples, fold by fold (k,), and their means."""

    nrmse: Array
    r2: Array

    @property
    def generalisation_error(self) -> float:
        return generalisation_error(self.nrmse.tolist())

    @property
    def mean_r2(self) -> float:
        return float(np.mean(self.r2))


@dataclass(frozen=True)
class RecordingFolds:
    """The same folds over whole recordings, as scikit-learn's `cv` takes them.

    `split_by`: specimen, rate, recording or random; `number` folds at most. Raises
    `InputError` where there is nothing to hold out.
    """

    split_by: str = "specimen"
    number: int = 10
    seed: int = 0

    def split(
        self, recordings: Sequence[Recording], y: object = None, groups: object = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Indices of the recordings to train on and to test on, fold by fold."""
        for test in self._folds(recordings).test:
            yield np.flatnonzero(~test), np.flatnonzero(test)

    def get_n_splits(
        self,
        recordings: Sequence[Recording],
        y: object = None,
        groups: object = None,
    ) -> int:
        """Number of folds."""
        return len(self._folds(recordings).names)

    def _folds(self, recordings: Sequence[Recording]) -> Folds:
        index = np.arange(len(recordings))
        return make_folds(recordings, index, self.split_by, self.number, self.seed)


def make_folds(
    recordings: Sequence[Recording],
    recording_index: np.ndarray,
    split: str = "random",
    number: int = 10,
    seed: int = 0,
) -> Folds:
    """Folds over samples of which `recording_index` (n,) says whose they are.

    `number` is that of the random folds, and at most that of the others: where there
    are more specimens or rates, several share a fold. Raises `InputError` where there
    is nothing to hold out.
    """
    index = np.asarray(recording_index)
    if split not in SPLITS:
        raise InputError(f"split is {split!r}; allowed is {', '.join(SPLITS)}")
    if number < 2:
        raise InputError(f"{number} folds; at least 2 are needed")
    if split == "random":
        if number > len(index):
            raise InputError(f"{number} folds of {len(index)} samples; use fewer folds")
        order = np.random.default_rng(seed).permutation(len(index))
        fold = np.empty(len(index), int)
        fold[order] = np.arange(len(index)) % number
        test = fold == np.arange(number)[:, None]
        return Folds(test, tuple(f"fold {k + 1}" for k in range(number)), split)
    labels, note = _labels(recordings, split)
    present = sorted({labels[i] for i in np.unique(index)}, key=_natural(labels))
    if len(present) < 2:
        raise InputError(
            f"one {split} only ({present[0]}); folds by {split} need two or more"
        )
    if len(present) > number:
        order = np.random.default_rng(seed).permutation(len(present))
        groups = [[present[i] for i in order[k::number]] for k in range(number)]
    else:
        groups = [[name] for name in present]
    of_sample = np.array(labels, dtype=object)[index]
    test = np.stack([np.isin(of_sample, group) for group in groups])
    return Folds(test, tuple(", ".join(map(str, g)) for g in groups), split, note)


def score(folds: Folds, predictions: Array, target: Array) -> Scores:
    """Scores of predictions (k, n), row k made without the samples of fold k."""
    predictions = np.asarray(predictions, float)
    if predictions.shape != folds.test.shape:
        raise InputError(
            f"predictions have shape {predictions.shape}; needed {folds.test.shape}"
        )
    pairs = [(p[t], target[t]) for p, t in zip(predictions, folds.test, strict=True)]
    return Scores(
        np.array([nrmse(p, m) for p, m in pairs]),
        np.array([r2(p, m) for p, m in pairs]),
    )


def rate_groups(rates: Sequence[float | None]) -> list[float | None]:
    """The rate each one counts as: rates within `RATE_RATIO` of a neighbour are one.

    >>> rate_groups([0.000635, 0.000678, 0.0063, None])
    [0.000656, 0.000656, 0.0063, None]
    """
    known = sorted({abs(r) for r in rates if r})
    group: dict[float, float] = {}
    start = 0
    for i in range(1, len(known) + 1):
        if i == len(known) or known[i] > known[i - 1] * RATE_RATIO:
            middle = float(np.exp(np.mean(np.log(known[start:i]))))
            group.update({rate: float(f"{middle:.3g}") for rate in known[start:i]})
            start = i
    return [group[abs(r)] if r else None for r in rates]


def _labels(recordings: Sequence[Recording], split: str) -> tuple[list[str], str]:
    if split == "recording":
        return [r.name or str(i) for i, r in enumerate(recordings)], ""
    if split == "rate":
        rates = rate_groups([r.rate_per_s for r in recordings])
        return [f"{r:g} /s" if r is not None else "rate not given" for r in rates], ""
    names = [r.specimen for r in recordings]
    if len(set(names)) > 1 or len(recordings) == 1:
        return names, ""
    note = "these data name no specimens; each recording counts as one"
    return [r.name or str(i) for i, r in enumerate(recordings)], note


def _natural(labels: Sequence[str]):
    order = {name: i for i, name in reversed(list(enumerate(labels)))}
    return order.__getitem__
