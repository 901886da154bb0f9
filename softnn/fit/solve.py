"""The best point near a guess: stiffnesses exactly, the other parameters by steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softnn import progress
from softnn.bounded import bounded
from softnn.contracts import Array
from softnn.fit.engine import Engine
from softnn.fit.point import Guess, Slot, get, put, slots

RIDGE = 1e-11  # of each diagonal entry: keeps collinear branches solvable
UNEVEN = 10.0  # of the mean stiffness: standard deviation between one segment and next


@dataclass
class Fit:
    """A guess at its best, with the normal equations there (whitened, by recording)."""

    guess: Guess
    stress: Array  # (valid,)
    chi2: float
    slots: list[Slot]
    jacobian: Array  # (valid, stiffnesses + slots), whitened
    residual: Array  # (valid,), whitened, measured minus simulated
    fixed_base: bool
    iterations: int = 0

    @property
    def parameters(self) -> int:
        """Free numbers: slots, and stiffnesses, those at zero too.

        Which of them end at zero is luck, and no credit to an effect.
        """
        return (0 if self.fixed_base else len(self.guess.stiffness)) + len(self.slots)

    @property
    def free_columns(self) -> Array:
        """Whitened derivatives by what is free; stiffnesses at zero stay there."""
        k = len(self.guess.stiffness)
        live = np.ones(self.jacobian.shape[1], bool)
        live[:k] = (self.guess.stiffness > 0) & (not self.fixed_base)
        return self.jacobian[:, live]


def solve_base(
    engine: Engine, guess: Guess, fixed: bool
) -> tuple[Guess, Array, Array, Array, float]:
    """The guess with its best stiffnesses; stress, whitened slope, residual, chi2."""
    stress, slope = engine.run(guess, True)
    assert slope is not None
    a = engine.whiten(slope)
    residual = engine.whiten(engine.target - stress)
    if fixed:
        return guess, stress, a, residual, float(residual @ residual)
    x = guess.stiffness
    target = residual + a @ x
    gram = a.T @ a + uneven(engine, guess)
    new = _bounded(gram, a.T @ target, np.zeros(len(x)), np.full(len(x), np.inf), x)
    guess = replace(guess, stiffness=new)
    # Not the linearised stress: a clipped or one-sided effect bends between the two.
    stress, _ = engine.run(guess, False)
    residual = engine.whiten(engine.target - stress)
    return (
        guess,
        stress,
        a,
        residual,
        float(residual @ residual),
    )


def uneven(engine: Engine, guess: Guess) -> Array:
    """Precision (stiffnesses, stiffnesses) of segments, each like the one beside it.

    So wide that it speaks only where the recordings do not: of what lies beyond the
    limit of a load cell, or is slack, a fit would otherwise take any stiffness at all.
    """
    units = guess.units
    reach = max(float(np.abs(c.strain).max(initial=0.0)) for c in engine.chunks)
    out = np.zeros((units.columns, units.columns))
    step = np.diff(np.eye(units.segments), axis=0)
    sd = UNEVEN * engine.level / max(reach, 1e-300)
    out[: units.segments, : units.segments] = step.T @ step / sd**2
    return out


def _bounded(gram: Array, right: Array, low: Array, high: Array, start: Array) -> Array:
    d = np.sqrt(np.diag(gram))
    d = np.where(d > 0, d, 1.0)
    scaled = gram / np.outer(d, d)
    scaled[np.diag_indices_from(scaled)] += RIDGE
    return bounded(scaled, right / d, low * d, high * d, start * d) / d


def derivative(engine: Engine, guess: Guess, where: list[Slot], stress: Array) -> Array:
    """Change of stress (valid, slots) with each slot, one-sided into the bounds."""
    out = np.zeros((len(stress), len(where)))
    apart = not engine.data.continued
    # Recordings do not see each other: all own values move in one pass.
    groups: dict[Any, list[int]] = {}
    for j, slot in enumerate(where):
        alone = slot.recordings is None or not apart
        groups.setdefault(j if alone else (slot.piece, slot.name), []).append(j)
    moves, steps = [], np.empty(len(where))
    for together in groups.values():
        moved = []
        for k in together:
            z = where[k].inside(get(guess, where[k]))
            up = z + 1e-3 <= where[k].inside(where[k].high)
            steps[k] = 1e-3 if up else -1e-3
            moved.append((where[k], where[k].outside(z + steps[k])))
        moves.append(moved)
    changes = passes(engine, guess, moves, stress)
    for together, change in zip(groups.values(), changes, strict=True):
        for k in together:
            of = where[k].recordings
            own = slice(None) if of is None or not apart else engine.within(of)
            out[own, k] = change[own] / steps[k]
    return out


def passes(
    engine: Engine,
    guess: Guess,
    moves: Sequence[Sequence[tuple[Slot, float]]],
    stress: Array,
) -> list[Array]:
    """Change of stress (valid,) with each move, those of one kind made together."""
    out: list[Array | None] = [None] * len(moves)
    kinds: dict[bool, list[int]] = {}
    for i, moved in enumerate(moves):
        piece = moved[0][0].piece
        if piece < 0:
            places, values = zip(*moved, strict=True)
            out[i] = engine.run(put(guess, places, values), False)[0] - stress
        else:
            front = guess.pieces[piece].effect.acts_before
            kinds.setdefault(front, []).append(i)
    for mine in kinds.values():
        made = engine.beside(guess, [moves[i] for i in mine])
        for i, one in zip(mine, made.T, strict=True):
            out[i] = one
    return [one for one in out if one is not None]


def fit(
    engine: Engine,
    guess: Guess,
    *,
    fixed_base: bool = False,
    iterations: int = 12,
    tolerance: float = 1e-4,
) -> Fit:
    """The best point near `guess`; `tolerance` is of chi2, relative, to stop at."""
    progress.step()
    guess, stress, a, residual, chi2 = solve_base(engine, guess, fixed_base)
    where = slots(guess)
    damping, count = 1e-3, 0
    jacobian = np.zeros((len(stress), 0))
    fresh = settled = False
    while where and count < iterations:
        count += 1
        progress.step()
        jacobian = engine.whiten(derivative(engine, guess, where, stress))
        fresh = True
        z = np.array([s.inside(get(guess, s)) for s in where])
        low = np.array(
            [s.inside(s.low) if s.low > 0 or not s.logarithmic else -40 for s in where]
        )
        high = np.array([s.inside(s.high) for s in where])
        base = a.shape[1] if not fixed_base else 0
        joint = np.concatenate([a, jacobian], axis=1) if base else jacobian
        gram = joint.T @ joint
        if base:
            gram[:base, :base] += uneven(engine, guess)
        target = residual + (a @ guess.stiffness if base else 0)
        right = joint.T @ target
        better = False
        for _ in range(6):
            damped = gram.copy()
            i = np.arange(base, len(gram))
            damped[i, i] += damping * np.maximum(gram[i, i], 1e-12 * gram.max()) + 1e-30
            step = _bounded(
                damped,
                right,
                np.concatenate([np.zeros(base), low - z]),
                np.concatenate([np.full(base, np.inf), high - z]),
                np.concatenate([guess.stiffness if base else [], np.zeros(len(z))]),
            )
            dz = np.clip(step[base:], -2.0, 2.0) if len(z) else step[base:]
            dz = np.where([s.logarithmic for s in where], dz, step[base:])
            trial = put(
                guess, where, [s.outside(v) for s, v in zip(where, z + dz, strict=True)]
            )
            if base:
                trial = replace(trial, stiffness=step[:base])
            new = solve_base(engine, trial, fixed_base)
            if new[4] < chi2:
                better = True
                break
            damping = max(damping * 8, 1e-4)
        if not better:
            break
        gained = (chi2 - new[4]) / max(chi2, 1e-300)
        guess, stress, a, residual, chi2 = new
        fresh = False
        damping = max(damping / 5, 1e-7)
        if gained < tolerance:
            settled = True  # derivatives are as good as those of a step before
            break
    if not settled:
        stress, slope = engine.run(guess, True)  # not the linearised one
        assert slope is not None
        a = engine.whiten(slope)
        residual = engine.whiten(engine.target - stress)
    if where and not (fresh or settled):
        jacobian = engine.whiten(derivative(engine, guess, where, stress))
    return Fit(
        guess,
        stress,
        float(residual @ residual),
        where,
        np.concatenate([a, jacobian], axis=1),
        residual,
        fixed_base,
        count,
    )
