"""Does the explanation hold on recordings it did not see?

Each recording is left out in turn; stiffnesses and effects come from the others. The
recording's own parameters (its gap, offset, scale) are fitted to every other tenth of
it, and the tenths between are predicted; then the tenths swap. The solution without a
recording is one damped step of the joint normal equations, which are a sum over
recordings. Its NRMSE comes from a simulation; the misfit is linearised.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Engine, Fit, Guess, Slot, _bounded, fit, get, put

BLOCKS = 10
MOST_EXCESS = 1e100  # a larger misfit is a fit that ran away; its square would overflow
HALVINGS = 8  # of a step that worsens the fit to the others
DAMPING = 1e-4  # of each diagonal entry, for undetermined parameters


def parts(engine: Engine) -> NDArray[np.integer]:
    """Return the part (valid,) of each sample; one part is left out at a time.

    Parts are recordings; a single recording has five stretches.
    """
    if len(engine.chunks) > 1:
        return engine.owner
    n = len(engine.target)
    return np.minimum(np.arange(n) * 5 // max(n, 1), 4)


@dataclass(frozen=True)
class Heldout:
    """Error on the parts left out, each predicted without having been seen."""

    errors: Array  # (parts,), sums of squared errors, MPa^2
    squares: Array  # (parts,), sums of squared stress, MPa^2
    misfit: float  # mean whitened square, less the uncertainty of parameters
    worst: tuple[str, float] | None = None  # kind and NRMSE of the worst fold

    @property
    def nrmse(self) -> float:
        return nrmse_of(self.errors, self.squares)


@dataclass(frozen=True)
class _Linear:
    """The fit as a linear problem in stiffnesses and inner values of the slots."""

    jacobian: Array
    target: Array
    start: Array
    low: Array
    high: Array
    base: int  # number of stiffnesses among the unknowns

    @classmethod
    def of(cls, found: Fit) -> _Linear:
        where = found.slots
        stiffness = found.guess.stiffness[: 0 if found.fixed_base else None]
        base = len(stiffness)
        low = np.concatenate([np.zeros(base), [_low(s) for s in where]])
        high = np.concatenate(
            [np.full(base, np.inf), [s.inside(s.high) for s in where]]
        )
        start = np.array([*stiffness, *(s.inside(get(found.guess, s)) for s in where)])
        jacobian = found.jacobian[:, found.jacobian.shape[1] - len(start) :]
        target = found.residual + jacobian @ start
        return cls(jacobian, target, start, low, high, base)

    def without(self, gram: Array, right: Array) -> Array:
        """Return the damped solution of the normal equations of the other samples."""
        whole = np.diag(self.jacobian.T @ self.jacobian)
        pull = DAMPING * whole + 1e-12 * whole.max(initial=0)
        right = right + pull * self.start
        return _solved(gram + np.diag(pull), right, self.low, self.high, self.start)


def without_rows(engine: Engine, found: Fit, rows: NDArray[np.bool]) -> Guess:
    """Return the guess after one damped Gauss-Newton step without samples (valid,).

    The engine must weigh samples one by one (no memory). A step that worsens the fit to
    the other samples is halved.
    """
    line, kept = _Linear.of(found), ~rows
    a, b = line.jacobian[kept], line.target[kept]
    x, before = line.without(a.T @ a, a.T @ b), found.residual[kept]
    for _ in range(HALVINGS):
        guess = moved_to(found.guess, found.slots, x, line.base)
        left = engine.whiten(engine.target - engine.run(guess, False)[0])[kept]
        if left @ left <= 1.01 * (before @ before):
            return guess
        x = (x + line.start) / 2
    return found.guess


def heldout(engine: Engine, found: Fit) -> Heldout:
    """Return the error of a fit on each part, predicted without this part."""
    part, where, line = parts(engine), found.slots, _Linear.of(found)
    jacobian, target, base = line.jacobian, line.target, line.base
    gram, right = jacobian.T @ jacobian, jacobian.T @ target
    missed, chi2, kept = np.empty(len(engine.target)), 0.0, found.residual**2
    for g in np.unique(part):
        index = np.flatnonzero(part == g)
        mine = jacobian[index]
        x = line.without(gram - mine.T @ mine, right - mine.T @ target[index])
        # Mahalanobis square of a prediction, its covariance included: the misfit of
        # all samples less that of the others.
        others = np.delete(target - jacobian @ x, index)
        chi2 += found.chi2 - float(others @ others)
        for _ in range(HALVINGS):
            stress = predict(engine, found.guess, where, x, base)
            left = np.delete(engine.whiten(engine.target - stress), index)
            if left @ left <= 1.01 * np.delete(kept, index).sum():
                break
            x = (x + line.start) / 2  # nonlinear laws end before their tangents do
        alone = [base + j for j, s in enumerate(where) if s.recordings == (g,)]
        half = np.arange(len(index)) * BLOCKS // len(index) % 2
        for side in (0, 1) if alone and len(engine.chunks) > 1 else ():
            learn, test = index[half == side], index[half != side]
            a, own = jacobian[np.ix_(learn, alone)], x.copy()
            miss = target[learn] - jacobian[learn] @ x + a @ x[alone]
            h = a.T @ a + np.diag(1e-9 * np.sum(a**2, axis=0) + 1e-300)
            ends = line.low[alone], line.high[alone]
            own[alone] = _solved(h, a.T @ miss, *ends, x[alone])
            stress[test] = predict(engine, found.guess, where, own, base)[test]
        missed[index] = (engine.target - stress)[index]
    errors, squares = (
        np.bincount(part, engine.share * x**2) for x in (missed, engine.target)
    )
    misfit = chi2 / len(missed)
    return Heldout(errors.astype(float), squares.astype(float), misfit)


def _solved(gram: Array, right: Array, low: Array, high: Array, x: Array) -> Array:
    """Return `x` (k,) that solves the normal equations within bounds."""
    return _bounded(gram, right, low, high, x) if len(x) else x


def _low(slot: Slot) -> float:
    return (
        slot.inside(max(slot.low, 1e-12)) if slot.logarithmic else slot.inside(slot.low)
    )


def predict(
    engine: Engine, guess: Guess, where: Sequence[Slot], x: Array, base: int
) -> Array:
    """Return the stress (valid,), MPa, with stiffnesses and slots of the vector x."""
    return engine.run(moved_to(guess, where, x, base), False)[0]


def moved_to(guess: Guess, where: Sequence[Slot], x: Array, base: int) -> Guess:
    """Return the guess with the stiffnesses and slots of the vector x."""
    values = [s.outside(v) for s, v in zip(where, x[base:], strict=True)]
    moved = put(guess, where, values)
    if base:
        moved = replace(moved, stiffness=np.maximum(x[:base], 0.0))
    return moved


def nrmse_of(errors: Array, squares: Array) -> float:
    return float(np.sqrt(errors.sum() / max(squares.sum(), 1e-300)))


def ratio_interval(
    before: Array, after: Array, rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float, float]:
    """Return held-out error after over before, and its 95 % bootstrap interval."""
    ratio = float(np.sqrt(after.sum() / max(before.sum(), 1e-300)))
    pick = rng.integers(0, len(before), (draws, len(before)))
    drawn = np.sqrt(
        after[pick].sum(axis=1) / np.maximum(before[pick].sum(axis=1), 1e-300)
    )
    low, high = np.quantile(drawn, [0.025, 0.975])
    return ratio, float(low), float(high)


def whiteness(engine: Engine, found: Fit) -> float:
    """Return the correlation of neighbouring whitened residuals; 0 for pure noise."""
    r = found.residual
    same = engine.owner[1:] == engine.owner[:-1]
    top = float(np.sum((r[1:] * r[:-1])[same]))
    return top / max(float(np.sum(r**2)), 1e-300)


def intervals(found: Fit) -> dict[tuple[int, str, tuple[int, ...] | None], tuple]:
    """Return the 95 % interval of each slot from the joint normal equations.

    It is the curvature of the profile likelihood at its maximum, with the other
    parameters free. If the fit is worse than the noise, its residual scales the noise.
    """
    j, k = found.free_columns, len(found.slots)
    d = np.linalg.norm(j, axis=0)
    d = np.where(d > 0, d, 1.0)
    gram = (j / d).T @ (j / d) + 1e-10 * np.eye(j.shape[1])
    excess = found.chi2 / max(len(found.residual) - j.shape[1], 1)
    excess = min(max(excess, 1.0), MOST_EXCESS)
    sd = np.sqrt(np.maximum(np.diag(np.linalg.inv(gram)), 0) * excess) / d
    out = {}
    for slot, s in zip(found.slots, sd[len(sd) - k :], strict=True):
        z, reach = slot.inside(get(found.guess, slot)), 1.96 * min(float(s), 20.0)
        out[slot.piece, slot.name, slot.recordings] = (
            slot.outside(z - reach),
            slot.outside(z + reach),
        )
    return out


def profiled(
    engine: Engine, found: Fit, index: int, name: str, limits: Mapping[Any, tuple]
) -> tuple[float, float]:
    """Return the 95 % interval of a shared parameter by its profile likelihood.

    The parameter belongs to piece `index`. At each end of the interval by curvature all
    other parameters are refitted. A parabola through the loss of log-likelihood gives
    the end where the loss is 1.96^2 / 2.
    """
    piece = found.guess.pieces[index]
    value = float(piece.values[name])
    slot = next((s for s in found.slots if s.piece == index and s.name == name), None)
    if slot is None:
        return value, value
    scale = max(found.chi2 / max(len(found.residual) - found.parameters, 1), 1.0)
    middle = slot.inside(value)
    free = tuple(f for f in piece.free if f != name)
    ends = []
    for end in limits[index, name, None]:
        pieces = list(found.guess.pieces)
        pieces[index] = replace(piece, values=piece.values | {name: end}, free=free)
        guess = replace(found.guess, pieces=tuple(pieces))
        other = fit(engine, guess, fixed_base=found.fixed_base, iterations=3)
        cost = max((other.chi2 - found.chi2) / scale, 1e-12)
        factor = np.clip(1.96 / np.sqrt(cost), 0.3, 3.0)
        ends.append(slot.outside(middle + factor * (slot.inside(end) - middle)))
    return ends[0], ends[1]
