"""What networks are held against: piecewise models and boosted trees, same folds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softnn.contracts import Array, InputError
from softnn.crossval import Folds, Scores, score
from softnn.models.fit_piecewise import PiecewiseFit
from softnn.neural import Samples
from softnn.recording import Recording
from softnn.study.baselines import MODELS, WAYS, cyclic_fits, training_fits
from softnn.study.material_data import Data

TREES = "gradient-boosted trees"


def baselines(
    data: Data, known: Samples, folds: Mapping[str, Folds], seed: int
) -> list[dict[str, Any]]:
    """Each model with its NRMSE by fold under each name of `folds`, or why not.

    R2 by fold is under "r2", by the same names. `known` are samples of FFRD4, which the
    folds split. Everything is fitted without the held-out samples, and chosen without
    them.
    """
    found: dict[str, dict[str, Any]] = {}
    for name, split in folds.items():
        for model, scores in (
            piecewise(data, known, split) | trees(known, split, seed)
        ).items():
            row = found.setdefault(model, {"r2": {}})
            if isinstance(scores, str):
                row[name] = scores
            else:
                row[name], row["r2"][name] = scores.nrmse.tolist(), scores.r2.tolist()
    return [{"model": model, **errors} for model, errors in found.items()]


def trees(known: Samples, folds: Folds, seed: int) -> dict[str, Scores]:
    """scikit-learn's histogram gradient boosting, as it comes, on strain and rate."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    rows = np.full(folds.test.shape, np.nan)
    for row, test in zip(rows, folds.test, strict=True):
        model = HistGradientBoostingRegressor(early_stopping=False, random_state=seed)
        model.fit(known.inputs[~test], known.target[~test])
        row[test] = model.predict(known.inputs[test])
    return {TREES: score(folds, rows, known.target)}


def piecewise(data: Data, known: Samples, folds: Folds) -> dict[str, Scores | str]:
    """PL-SLS and PL-Wiechert in all ways: see `softnn.study.baselines`.

    A recording that is held out in part is fitted on the rest of its samples; its hold
    is used only where none of it is held out or the folds are random.
    """
    rows: dict[tuple[str, str], list[Array]] = {}
    reasons: dict[tuple[str, str], str] = {}
    for test in folds.test:
        names = {data.tensile[i].name for i in _whole(known, test)}
        holds = [r for r in data.relaxation if r.name not in names]
        train = _without(data.tensile, known, test)
        fit_all = cyclic_fits if data.cycles else training_fits
        try:
            fits = fit_all(train, holds, reasons)
        except InputError as reason:  # holds that cannot be read; curves may do
            fits = fit_all(train, [], reasons)
            reasons |= {key: str(reason) for key in reasons}
        for key, fit in fits.items():
            rows.setdefault(key, []).append(_predicted(fit, data, known, test))
    found: dict[str, Scores | str] = {}
    for model in MODELS:
        for way, words in WAYS.items():
            done = rows.get((model, way), [])
            if len(done) < len(folds.test):
                found[f"{model}, {words}"] = reasons.get((model, way), "not possible")
            else:
                found[f"{model}, {words}"] = score(folds, np.stack(done), known.target)
    return found


def _whole(known: Samples, test: np.ndarray) -> set[int]:
    """Recordings of which every sample is held out."""
    left = set(known.recording[~test].tolist())
    return set(known.recording[test].tolist()) - left


def _without(
    recordings: Sequence[Recording], known: Samples, test: np.ndarray
) -> list[Recording]:
    kept = []
    for i, recording in enumerate(recordings):
        rows = known.position[(known.recording == i) & ~test]
        if len(rows):
            kept.append(recording.take(rows))
    return kept


def _predicted(
    fit: PiecewiseFit, data: Data, known: Samples, test: np.ndarray
) -> Array:
    out = np.full(len(test), np.nan)
    for i in np.unique(known.recording[test]):
        mine = test & (known.recording == i)
        out[mine] = fit.predict(data.tensile[i])[known.position[mine]]
    return out
