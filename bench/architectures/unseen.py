"""Every model on the rates that its training leaves out: figures, verdicts, table."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bench.architectures.baselines import TREES, baselines
from bench.architectures.choices import paired
from bench.architectures.trials import TRAINING, unseen_split
from bench.architectures.verdict import best_of, mean, pm
from softnn.contracts import Array
from softnn.crossval import Folds, score
from softnn.neural import Samples
from softnn.study import common, holding
from softnn.study.material_data import Data
from softnn.study.settings import Settings
from softnn.study.trainer import Trainer

# Sets that no choice about the convex network has seen.
CONFIRM = (
    "hnbr50-stuttgart",
    "fungi-steak-double-compression",
    "silicone30a-instron",
    "oca-shear-ladder",
    "foam-tpe-compression-cyclic",
)
FREE = {
    "FFRD4, 4 neurons": {"inputs": "FFRD4", "neurons": 4, "regularisation": "bayesian"},
    "FFRI2, 4 neurons": {"inputs": "FFRI2", "neurons": 4, "regularisation": "bayesian"},
    "GRU, 8 neurons": {"inputs": "GRU", "neurons": 8, "regularisation": "l2=1e-5"},
}
PROCESS, MOST = "Gaussian process", 300  # samples it is given


def judged(data: Data, seed: int, samples: int, free: bool = True) -> dict[str, Any]:
    """Every model on what is held out of a material; `InputError` if nothing can be."""
    settings = Settings(data=data.source, samples=samples, seed=seed)
    trainer = Trainer(data, settings, TRAINING, threads=1)
    split = unseen_split(trainer)
    known = trainer.samples("FFRD4")
    folds = trainer.folds(split, "FFRD4", seed)
    scores, weights = holding.errors(data, known, folds)
    rows = [{"model": holding.NAME, "unseen": scores["nrmse"]}]
    rivals: list[dict[str, Any]] = []
    if free:
        for name, chosen in FREE.items():
            errors = trainer.judge({**chosen, "split": split, "lag_s": None})["nrmse"]
            rivals.append({"model": name, "unseen": errors})
        rivals.append({"model": PROCESS, "unseen": gaussian(known, folds, seed)})
    others = baselines(data, known, {"unseen": folds}, seed)
    best = best_of(others, "unseen")
    entry = {
        "material": data.material,
        "label": data.label,
        "source": data.source,
        "cycles": data.cycles,
        "confirms": data.source in CONFIRM,
        "unseen": split,
        "folds": list(folds.names),
        "convex": scores["nrmse"],
        "weights": dict(zip(folds.names, weights, strict=True)),
        "models": [
            *rows,
            *rivals,
            *({k: r[k] for k in ("model", "unseen")} for r in others),
        ],
        "best_baseline": None if best is None else best["model"],
    }
    if best is not None:
        gap, error = paired(np.array(scores["nrmse"]), np.array(best["unseen"]))
        entry |= {
            "gap": gap,
            "gap_error": error,
            "baseline": float(np.mean(best["unseen"])),
        }
        entry["verdict"] = verdict(gap, error)
    return entry


def some(row: dict[str, Any]) -> dict[str, Any]:
    return {key: row[key] for key in ("model", "unseen")}


def gaussian(known: Samples, folds: Folds, seed: int) -> list[float]:
    """A Gaussian process over strain and the logarithm of its rate, as it comes."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    rate = np.abs(known.inputs[:, 1])
    least = rate[rate > 0].min() if (rate > 0).any() else 1.0
    inputs = np.column_stack([known.inputs[:, 0], np.log10(np.maximum(rate, least))])
    kernel = ConstantKernel(1.0) * RBF([1.0, 1.0]) + WhiteKernel(1e-2)
    predicted: Array = np.full(folds.test.shape, np.nan)
    for row, test in zip(predicted, folds.test, strict=True):
        rows = np.flatnonzero(~test)
        rng = np.random.default_rng([seed, 11])
        rows = np.sort(rng.choice(rows, min(MOST, len(rows)), replace=False))
        size = inputs[rows].std(axis=0)
        scaled = inputs / np.where(size > 0, size, 1.0)
        model = GaussianProcessRegressor(kernel, normalize_y=True, random_state=seed)
        with warnings.catch_warnings():  # of bounds that are met: one rate, say
            warnings.simplefilter("ignore", ConvergenceWarning)
            model.fit(scaled[rows], known.target[rows])
        row[test] = model.predict(scaled[test])
    return score(folds, predicted, known.target).nrmse.tolist()


def verdict(gap: float, error: float) -> str:
    """How the convex network stands to the best baseline, by one standard error."""
    if gap < -error:
        return "better"
    return "no worse" if gap <= error else "worse"


def headline(found: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """How many of the sets it was made on, and of those that confirm."""
    out: dict[str, int] = {}
    for end, mine in (
        ("", [one for one in found if not one["confirms"]]),
        ("_confirm", [one for one in found if one["confirms"]]),
    ):
        judged = [one["verdict"] for one in mine if "verdict" in one]
        out[f"materials{end}"] = len(judged)
        for word in ("better", "no worse", "worse"):
            out[f"{word.replace(' ', '_')}{end}"] = judged.count(word)
    return out


def sentence(found: Sequence[Mapping[str, Any]]) -> str:
    """The headline in words."""
    said = headline(found)
    text = (
        f"The {holding.NAME} was made on {said['materials']} materials: it is better "
        f"than the best baseline on {said['better']}, no worse on "
        f"{said['no_worse']}, worse on {said['worse']}"
    )
    if said["materials_confirm"]:
        text += (
            f". No choice about it has seen {said['materials_confirm']} others: it is "
            f"better on {said['better_confirm']}, no worse on "
            f"{said['no_worse_confirm']}, worse on {said['worse_confirm']}"
        )
    return text + "."


def line(one: Mapping[str, Any]) -> str:
    """A material in a line."""
    error = mean(one["convex"])
    if "verdict" not in one:
        return f"{one['label']}: {error}; no baseline"
    return (
        f"{one['label']}: {error}; {one['best_baseline']} "
        f"{common.percent(one['baseline'])}: {one['verdict']} "
        f"({pm(one['gap'], one['gap_error'])})"
    )


def table(found: Sequence[Mapping[str, Any]]) -> str:
    """NRMSE at what is unseen, a row a material."""
    names = [holding.NAME, *FREE, PROCESS, TREES]
    rows = []
    for one in found:
        by_name = {row["model"]: row["unseen"] for row in one["models"]}
        rows.append(
            [one["label"], *(mean(by_name.get(name)) for name in names)]
            + [one["best_baseline"], common.percent(one.get("baseline"))]
            + [one.get("verdict")]
        )
    return common.markdown(["material", *names, "best baseline", "its NRMSE", ""], rows)
