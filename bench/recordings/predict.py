"""A diagnosis held against recordings that it has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Data
from softnn.mismatch.case import Case, mask_failure, mask_gaps, thin, to_data
from softnn.model_file import from_dict

BLOCKS = 8  # stretches a recording is cut into for the bootstrap
DRAWS = 2000


def usable(case: Case, samples: int) -> Case:
    """The case as a diagnosis takes it: no stress after failure, not too many samples.

    Not few either: the noise is read off neighbouring samples, and between samples far
    apart the specimen moves.
    """
    return thin(mask_failure(mask_gaps(case)), samples)


def misses(
    models: Mapping[str, Mapping[str, Any]],
    case: Case,
    scale: bool,
    only: Sequence[NDArray[np.bool]] | None = None,
) -> dict[str, Array]:
    """Squared error of each model, and `squares` of the stress: (recordings, blocks).

    `scale`: each recording is a specimen of its own, whose stress is met up to a factor
    (least squares, for each model its own). `only` are the samples (n,) to count.
    """
    data = to_data(case)
    none = [None] * len(data.chunks)
    stress = {
        name: from_dict(dict(model)).stress(data.names, data.chunks, none)
        for name, model in models.items()
    }
    return misses_of(stress, data, scale, only)


def misses_of(
    stress: Mapping[str, Sequence[Array]],
    data: Data,
    scale: bool,
    only: Sequence[NDArray[np.bool]] | None = None,
) -> dict[str, Array]:
    """The same of stress (n,) that was predicted for each recording, by name."""
    out: dict[str, list[Array]] = {name: [] for name in (*stress, "squares")}
    for r, measured in enumerate(data.stress_MPa):
        good = np.isfinite(measured)
        if only is not None:
            good &= only[r]
        y, share = measured[good], data.weights[r][good]
        cuts = np.linspace(0, len(y), BLOCKS + 1).astype(int)[:-1]
        for name, made in stress.items():
            s = made[r][good]
            best = float(share * s @ y) / max(float(share * s @ s), 1e-300)
            factor = best if scale else 1.0
            out[name].append(_sums(share * (y - factor * s) ** 2, cuts))
        out["squares"].append(_sums(share * y**2, cuts))
    return {name: np.array(rows) for name, rows in out.items()}


def _sums(x: Array, cuts: NDArray[np.intp]) -> Array:
    if len(x) < BLOCKS:
        return np.full(BLOCKS, x.sum() / BLOCKS)
    return np.add.reduceat(x, cuts)


def summary(
    found: Mapping[str, Array], rng: np.random.Generator
) -> dict[str, float | list[float]]:
    """NRMSE before and after and their ratio, with 95 % bootstrap intervals.

    Recordings are drawn, then stretches within each: there are often two or three
    recordings only, and samples next to each other say the same thing.
    """
    before, after, squares = found["before"], found["after"], found["squares"]
    count, blocks = squares.shape
    pick = rng.integers(0, count, (DRAWS, count))[:, :, None]
    part = rng.integers(0, blocks, (DRAWS, count, blocks))

    def total(x: Array) -> Array:
        return x[pick, part].sum(axis=(1, 2))

    def interval(top: Array, bottom: Array) -> list[float]:
        drawn = np.sqrt(total(top) / np.maximum(total(bottom), 1e-300))
        low, high = np.quantile(drawn, [0.025, 0.975])
        return [float(low), float(high)]

    def root(top: Array, bottom: Array) -> float:
        return float(np.sqrt(top.sum() / max(bottom.sum(), 1e-300)))

    state = rng.bit_generator.state
    out: dict[str, float | list[float]] = {}
    for name, top, bottom in (
        ("before", before, squares),
        ("after", after, squares),
        ("ratio", after, before),
    ):
        rng.bit_generator.state = state  # the same draws for all three
        out[name] = root(top, bottom)
        out[f"{name}_95"] = interval(top, bottom)
    return out
