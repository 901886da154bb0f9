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

RIDGE = 1e-11  # share of each diagonal entry that keeps collinear branches solvable
UNEVEN = 10.0  # prior deviation between neighbouring segments, in mean stiffnesses


@dataclass
class Fit:
    """A guess at its optimum, with the whitened derivatives and residual there.

    `chi2` is the sum of squared whitened residuals; `slots` are the free parameters
    beside the stiffnesses.
    """

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
        """Number of free parameters: slots and stiffnesses, including those at zero.

        Which stiffnesses end at zero is chance, so they give no credit to an effect.
        """
        return (0 if self.fixed_base else len(self.guess.stiffness)) + len(self.slots)

    @property
    def free_columns(self) -> Array:
        """Whitened derivatives (valid, k) of the free parameters.

        Stiffnesses at zero and those of a fixed base are left out.
        """
        k = len(self.guess.stiffness)
        live = np.ones(self.jacobian.shape[1], bool)
        live[:k] = (self.guess.stiffness > 0) & (not self.fixed_base)
        return self.jacobian[:, live]


def solve_base(
    engine: Engine, guess: Guess, fixed: bool
) -> tuple[Guess, Array, Array, Array, float]:
    """Solve for the non-negative stiffnesses of a guess, all other parameters fixed.

    Returns the guess, its stress (valid,) [MPa], the whitened slope (valid,
    stiffnesses), the whitened residual (valid,) and chi2. With `fixed` the stiffnesses
    stay.
    """
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
    # Simulate again: a clipped or one-sided effect is not linear between the points.
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
    """Return a weak prior precision (stiffnesses, stiffnesses) that evens out segments.

    Each segment is expected to resemble its neighbour. The prior is so wide that it
    matters only where the recordings say nothing, as beyond the limit of a load cell or
    in slack. Without it the fit could take any stiffness there.
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
    """Return the derivative of stress (valid, slots), in MPa per unit of the search.

    `stress` (valid,) [MPa] is that of the guess itself. Differences are one-sided, into
    the bounds of each slot. A slot of some recordings changes only their rows.
    """
    out = np.zeros((len(stress), len(where)))
    apart = not engine.data.continued
    # Recordings are independent, so all their own values move in one pass.
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
    """Return the change of stress (valid,), MPa, for each move of slots.

    Moves of one kind (in front of the model, or behind it) share one pass.
    """
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
    """Return the best point near `guess`, by damped Gauss-Newton steps.

    At most `iterations` steps are made. The search stops when a step lowers chi2 by
    less than the share `tolerance`, or when no damped step lowers it. `fixed_base`
    keeps the stiffnesses. Method: see the module `softnn.fit`.
    """
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
