"""The split: leave one recording out, the base and some columns refitted without it.

The arithmetic is that of `softnn.mismatch.verify.heldout`, with columns of stress
beside those of the base; without columns the two agree.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Engine, Fit, _bounded, get
from softnn.mismatch.verify import BLOCKS, DAMPING, _low, nrmse_of, parts, predict

SHARED = -1  # a column that all recordings share


@dataclass(frozen=True)
class Fold:
    """One part left out: where it is (valid,), and stress (valid,) without its help."""

    test: NDArray[np.bool]
    stress: Array


def of(
    engine: Engine,
    found: Fit,
    extra: Array | None = None,
    own: NDArray[np.integer] | None = None,
) -> list[Fold]:
    """Folds of a fit with columns `extra` (valid, m), MPa, beside it.

    `own` (m,) is the recording that a column belongs to alone, or `SHARED`.
    """
    part = parts(engine)
    several = len(engine.chunks) > 1
    guess, where = found.guess, found.slots
    base = 0 if found.fixed_base else len(guess.stiffness)
    skipped = 0 if base else len(guess.stiffness)
    known = base + len(where)
    columns = np.zeros((len(part), 0)) if extra is None else extra
    owner = np.full(columns.shape[1], SHARED) if own is None else own
    slope = np.concatenate(
        [found.jacobian[:, skipped:], engine.whiten(columns)], axis=1
    )
    if slope.shape[1] == 0:
        return [Fold(part == g, found.stress) for g in np.unique(part)]
    start = np.concatenate(
        [
            guess.stiffness if base else [],
            [s.inside(get(guess, s)) for s in where],
            np.zeros(columns.shape[1]),
        ]
    )
    free = np.full(columns.shape[1], np.inf)
    low = np.concatenate([np.zeros(base), [_low(s) for s in where], -free])
    high = np.concatenate(
        [np.full(base, np.inf), [s.inside(s.high) for s in where], free]
    )
    target = found.residual + slope @ start
    grams = {g: slope[part == g].T @ slope[part == g] for g in np.unique(part)}
    rights = {g: slope[part == g].T @ target[part == g] for g in grams}
    gram, right = sum(grams.values()), sum(rights.values())
    pull = DAMPING * np.diag(gram) + 1e-12 * np.diag(gram).max()

    def stress(x: Array) -> Array:
        plain = predict(engine, guess, where, x[:known], base)
        return plain + columns @ x[known:]

    out = []
    for g in grams:
        alone = np.array(
            [base + j for j, s in enumerate(where) if s.recordings == (g,)]
            + [known + j for j, o in enumerate(owner) if o == g],
            int,
        )
        x = _bounded(
            gram - grams[g] + np.diag(pull),
            right - rights[g] + pull * start,
            low,
            high,
            start,
        )
        test = part == g
        found_stress = stress(x)
        if several and len(alone):
            index = np.flatnonzero(test)
            block = np.arange(len(index)) * BLOCKS // max(len(index), 1)
            for side in (0, 1):
                learn, rest = index[block % 2 == side], index[block % 2 != side]
                a = slope[np.ix_(learn, alone)]
                missed = target[learn] - slope[learn] @ x + a @ x[alone]
                h = a.T @ a
                h = h + np.diag(1e-9 * np.diag(h) + 1e-300)
                y = x.copy()
                y[alone] = _bounded(h, a.T @ missed, low[alone], high[alone], x[alone])
                found_stress[rest] = stress(y)[rest]
        out.append(Fold(test, found_stress))
    return out


def squares(engine: Engine, made: Iterable[Fold]) -> float:
    """Squared error on what was left out, summed over the folds, MPa^2."""
    return float(
        sum(np.sum((engine.target[f.test] - f.stress[f.test]) ** 2) for f in made)
    )


def nrmse(engine: Engine, error: float) -> float:
    return nrmse_of(np.array([error]), np.array([float(np.sum(engine.target**2))]))
