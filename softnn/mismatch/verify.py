"""Does the explanation hold on recordings it did not see?

Each recording is left out in turn: stiffnesses and effects are those of the others.
What belongs to the recording alone (its own gap, offset, scale) is taken from every
other tenth of it, and the tenths between are predicted, then the other way round. The
solution without a recording is one damped step of the joint normal equations, which
keep one part a recording; its prediction is simulated, not linearised.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Engine, Fit, Guess, Slot, _bounded, fit, get, put

BLOCKS = 10
DAMPING = 1e-4  # of each diagonal entry, for what the others cannot determine


def parts(engine: Engine) -> NDArray[np.integer]:
    """Which part (valid,) each sample belongs to when one is left out at a time.

    Recordings; for a single recording, five stretches of it.
    """
    if len(engine.chunks) > 1:
        return engine.owner
    n = len(engine.target)
    return np.minimum(np.arange(n) * 5 // max(n, 1), 4)


def heldout(engine: Engine, found: Fit) -> tuple[Array, Array]:
    """Held-out squared error and sum of squared stress, each (parts,), MPa^2."""
    part = parts(engine)
    several = len(engine.chunks) > 1
    guess, where = found.guess, found.slots
    base = 0 if found.fixed_base else len(guess.stiffness)
    jacobian = found.jacobian if base else found.jacobian[:, len(guess.stiffness) :]
    start = np.concatenate(
        [guess.stiffness if base else [], [s.inside(get(guess, s)) for s in where]]
    )
    low = np.concatenate([np.zeros(base), [_low(s) for s in where]])
    high = np.concatenate([np.full(base, np.inf), [s.inside(s.high) for s in where]])
    labels = np.unique(part)
    squares = [float(np.sum(engine.target[part == g] ** 2)) for g in labels]
    if jacobian.shape[1] == 0:
        miss = engine.target - found.stress
        return (
            np.array([float(np.sum(miss[part == g] ** 2)) for g in labels]),
            np.array(squares),
        )
    target = found.residual + jacobian @ start
    grams = {g: jacobian[part == g].T @ jacobian[part == g] for g in labels}
    rights = {g: jacobian[part == g].T @ target[part == g] for g in labels}
    gram, right = sum(grams.values()), sum(rights.values())
    errors = []
    for g in labels:
        left = gram - grams[g]
        rest = right - rights[g]
        pull = DAMPING * np.diag(gram) + 1e-12 * np.diag(gram).max()
        left = left + np.diag(pull)
        rest = rest + pull * start
        own = np.array(
            [
                base + j if several and s.recordings == (g,) else -1
                for j, s in enumerate(where)
            ]
        )
        alone = own[own >= 0]
        mask = part == g
        solution = _bounded(left, rest, low, high, start)
        halves: list[tuple[Any, Any]] = []
        if len(alone):
            index = np.flatnonzero(mask)
            block = np.arange(len(index)) * BLOCKS // max(len(index), 1)
            halves = [
                (index[block % 2 == 0], index[block % 2 == 1]),
                (index[block % 2 == 1], index[block % 2 == 0]),
            ]
        else:
            halves = [(np.array([], int), np.flatnonzero(mask))]
        error = 0.0
        for learn, test in halves:
            x = solution.copy()
            if len(learn):
                a = jacobian[np.ix_(learn, alone)]
                r = target[learn] - jacobian[learn] @ x + a @ x[alone]
                h = a.T @ a
                h = h + np.diag(1e-9 * np.diag(h) + 1e-300)
                x[alone] = _bounded(h, a.T @ r, low[alone], high[alone], x[alone])
            stress = predict(engine, guess, where, x, base)
            error += float(np.sum((engine.target[test] - stress[test]) ** 2))
        errors.append(error)
    return np.array(errors), np.array(squares)


def _low(slot: Slot) -> float:
    return (
        slot.inside(max(slot.low, 1e-12)) if slot.logarithmic else slot.inside(slot.low)
    )


def predict(
    engine: Engine, guess: Guess, where: Sequence[Slot], x: Array, base: int
) -> Array:
    """Stress (valid,) with the stiffnesses and slots of the vector x."""
    moved = put(
        guess, where, [s.outside(v) for s, v in zip(where, x[base:], strict=True)]
    )
    if base:
        moved = replace(moved, stiffness=np.maximum(x[:base], 0.0))
    return engine.run(moved, False)[0]


def nrmse_of(errors: Array, squares: Array) -> float:
    return float(np.sqrt(errors.sum() / max(squares.sum(), 1e-300)))


def ratio_interval(
    before: Array, after: Array, rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float, float]:
    """Held-out error after over before, with its 95 % bootstrap over recordings."""
    ratio = float(np.sqrt(after.sum() / max(before.sum(), 1e-300)))
    pick = rng.integers(0, len(before), (draws, len(before)))
    drawn = np.sqrt(
        after[pick].sum(axis=1) / np.maximum(before[pick].sum(axis=1), 1e-300)
    )
    low, high = np.quantile(drawn, [0.025, 0.975])
    return ratio, float(low), float(high)


def whiteness(engine: Engine, found: Fit) -> float:
    """Correlation of neighbouring whitened residuals; 0 when only noise is left."""
    r = found.residual
    same = engine.owner[1:] == engine.owner[:-1]
    top = float(np.sum((r[1:] * r[:-1])[same]))
    return top / max(float(np.sum(r**2)), 1e-300)


def intervals(found: Fit) -> dict[tuple[int, str, tuple[int, ...] | None], tuple]:
    """95 % interval of each slot from the joint normal equations.

    The curvature of the profile likelihood at its top: others free, noise scaled to
    what is left where the fit is worse than the noise.
    """
    k = len(found.guess.stiffness)
    live = np.concatenate(
        [
            (found.guess.stiffness > 0) & (not found.fixed_base),
            np.ones(len(found.slots), bool),
        ]
    )
    j = found.jacobian[:, live]
    if j.shape[1] == 0:
        return {}
    d = np.linalg.norm(j, axis=0)
    d = np.where(d > 0, d, 1.0)
    gram = (j / d).T @ (j / d)
    gram[np.diag_indices_from(gram)] += 1e-10
    inverse = np.linalg.inv(gram)
    excess = max(found.chi2 / max(len(found.residual) - j.shape[1], 1), 1.0)
    sd = np.sqrt(np.maximum(np.diag(inverse), 0) * excess) / d
    sd = sd[int(live[:k].sum()) :]
    out = {}
    for slot, s in zip(found.slots, sd, strict=True):
        z = slot.inside(get(found.guess, slot))
        s = min(float(s), 20.0)
        out[slot.piece, slot.name, slot.recordings] = (
            slot.outside(z - 1.96 * s),
            slot.outside(z + 1.96 * s),
        )
    return out


def profiled(
    engine: Engine, found: Fit, index: int, name: str, limits: Mapping[Any, tuple]
) -> tuple[float, float]:
    """95 % interval of a shared parameter of piece `index` from its profile likelihood.

    At each end of the interval by curvature everything else is fitted again; a parabola
    through what that costs gives the end where it costs 1.96^2 / 2 of log-likelihood.
    """
    piece = found.guess.pieces[index]
    value = float(piece.values[name])
    slot = next((s for s in found.slots if s.piece == index and s.name == name), None)
    if slot is None:
        return value, value
    n = len(found.residual)
    scale = max(found.chi2 / max(n - found.parameters, 1), 1.0)
    middle = slot.inside(value)
    ends = []
    for end in limits[index, name, None]:
        reach = slot.inside(end) - middle
        held = replace(
            piece,
            values=dict(piece.values) | {name: end},
            free=tuple(f for f in piece.free if f != name),
        )
        pieces = list(found.guess.pieces)
        pieces[index] = held
        guess = replace(found.guess, pieces=tuple(pieces))
        other = fit(engine, guess, fixed_base=found.fixed_base, iterations=3)
        cost = max((other.chi2 - found.chi2) / scale, 0.0)
        factor = np.clip(1.96 / np.sqrt(max(cost, 1e-12)), 0.3, 3.0)
        ends.append(slot.outside(middle + factor * reach))
    return ends[0], ends[1]
