"""What the law of an effect could be beyond the form that was fitted.

No formula is the true one. Where an effect is really there, what its form misses is a
distortion of what the effect does: the same change of stress, bent by strain, largest
strain or its own size, a little early or late. A second effect that takes up no more
than such distortions do is the form of the first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from softnn.contracts import Array
from softnn.fit import Engine, Fit, Guess, _bounded, derivative, fit, slots, span

GAP = 6.0  # typical intervals, beyond which something may have happened unseen
MOST_GAPS = 3  # of a recording, the longest, whose memory is allowed for
LAGS = (3.0, 30.0)  # of the sampling interval, by which a distortion may trail


def distortions(engine: Engine, found: Fit, which: set[str] | None = None) -> Array:
    """Changes of stress (valid, k), MPa, that other forms of the effects could make.

    `which`: ids of the effects meant, by default all but nuisances.
    """
    columns = [_slopes(engine, found, which)]
    strain, largest = _state(engine)
    interval = engine.data.scales().interval_s
    time = np.concatenate([c.time_s for c in engine.chunks])[engine.valid]
    for i, piece in enumerate(found.guess.pieces):
        if piece.nuisance or (which is not None and piece.effect.id not in which):
            continue
        rest = tuple(p for j, p in enumerate(found.guess.pieces) if j != i)
        without, _ = engine.run(replace(found.guess, pieces=rest), False)
        d = found.stress - without
        top = float(np.abs(d).max())
        if top < 1e-12 * engine.level:
            continue
        share = np.abs(d) / top
        bent = [d * strain, d * strain**2, d * largest, d * share, d * share**2]
        bent += [d * strain * largest]
        bent += [_trailing(d, time, engine.owner, lag * interval) for lag in LAGS]
        columns.append(np.stack(bent, axis=1))
    return np.concatenate(columns, axis=1)


def _slopes(engine: Engine, found: Fit, which: set[str] | None) -> Array:
    """Derivatives by all parameters of the effects, those a fit holds as well."""
    meant = [
        i
        for i, p in enumerate(found.guess.pieces)
        if not p.nuisance and (which is None or p.effect.id in which)
    ]
    pieces = tuple(
        replace(p, free=tuple(q.name for q in p.effect.parameters)) if i in meant else p
        for i, p in enumerate(found.guess.pieces)
    )
    guess = replace(found.guess, pieces=pieces)
    return derivative(
        engine, guess, [s for s in slots(guess) if s.piece in meant], found.stress
    )


def _state(engine: Engine) -> tuple[Array, Array]:
    """Strain and largest strain so far (valid,), as shares of the largest of all."""
    top = engine.data.scales().strain
    strain, largest, carried = [], [], 0.0
    for chunk in engine.chunks:
        size = np.maximum.accumulate(np.abs(chunk.strain))
        if engine.data.continued:
            size = np.maximum(size, carried)
            carried = float(size[-1])
        strain.append(chunk.strain / top)
        largest.append(size / top)
    return np.concatenate(strain)[engine.valid], np.concatenate(largest)[engine.valid]


def _trailing(x: Array, time: Array, owner: NDArray[np.integer], lag_s: float) -> Array:
    """x low-passed within each recording, at its typical interval."""
    out = np.empty_like(x)
    for r in np.unique(owner):
        own = owner == r
        step = float(np.median(np.diff(time[own]))) if own.sum() > 1 else lag_s
        keep = float(np.exp(-max(step, 1e-12) / lag_s))
        out[own] = lfilter([1 - keep], [1, -keep], x[own], zi=[keep * x[own][0]])[0]
    return out


def finer(engine: Engine, found: Fit, branches_too: bool = True) -> Fit:
    """The fit with its base on a finer grid of strain and of relaxation times.

    What a grid misses is no physics left out.
    """
    old, guess = found.guess.units, found.guess
    units = old.finer(branches_too)
    if not found.fixed_base and units != old:
        springs, branches = np.split(guess.stiffness, [old.segments])
        stiffness = np.zeros(units.columns)
        stiffness[: units.segments] = np.repeat(springs, units.segments // old.segments)
        stride = 2 if len(units.relaxation_times) > len(branches) else 1
        stiffness[units.segments :: stride] = branches
        guess = Guess(units, stiffness, guess.pieces)
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=4)


@dataclass(frozen=True)
class Memory:
    """Changes of stress (valid, k), MPa, and the multiples of each that can be."""

    columns: Array
    low: Array
    high: Array


def memories(engine: Engine, found: Fit) -> Memory:
    """Changes of stress by what happened while nobody wrote it down.

    After a gap in time a branch of the base may remember as much strain as could have
    come and gone in it; a recording that goes on from another begins after a pause of
    unknown length, in which the branches forget.
    """
    units = found.guess.units
    stiffness = found.guess.stiffness[units.segments :]
    times = np.array(units.relaxation_times)
    live = stiffness > 0
    columns, low, high = [], [], []
    ends = engine.data.starts
    state, last = None, None
    for r, chunk in enumerate(engine.chunks):
        _, branch, state = engine.columns(
            units, r, chunk, state if engine.data.continued else None
        )
        time = chunk.time_s
        step = np.diff(time)
        fastest = np.max(np.abs(np.diff(chunk.strain)) / np.maximum(step, 1e-12))
        span = float(np.ptp(chunk.strain))
        gaps = np.flatnonzero(step > GAP * np.median(step)) + 1
        shapes = []
        for gap in gaps[np.argsort(-step[gaps - 1])][:MOST_GAPS]:
            after = np.maximum(time - time[gap], 0.0)[:, None]
            begun = (time >= time[gap])[:, None]
            shapes.append(np.exp(-after / times[live]) * begun)
            most = stiffness[live] * min(fastest * step[gap - 1], span)
            low.append(-most)
            high.append(most)
        if engine.data.continued and last is not None and live.any():
            pause = np.quantile(times[live], [0.0, 0.5, 1.0])
            forgotten = np.expm1(-pause[:, None] / times) * (stiffness * last)
            shapes.append(np.exp(-(time - time[0])[:, None] / times) @ forgotten.T)
            # Of any size: it also stands for what was done before the first sample.
            low.append(np.full(len(pause), -np.inf))
            high.append(np.full(len(pause), np.inf))
        last = branch[-1]
        for shape in shapes:
            column = np.zeros((len(engine.measured), shape.shape[1]))
            column[ends[r] : ends[r + 1]] = shape
            columns.append(column[engine.valid])
    if not columns:
        none = np.zeros(0)
        return Memory(np.zeros((len(engine.target), 0)), none, none)
    return Memory(
        np.concatenate(columns, axis=1), np.concatenate(low), np.concatenate(high)
    )


def remembered(engine: Engine, found: Fit) -> float:
    """Whitened misfit of a fit that may also remember what nobody wrote down."""
    memory = memories(engine, found)
    if not memory.columns.shape[1]:
        return found.chi2
    live = free_columns(found)
    both = np.concatenate([live, engine.whiten(memory.columns)], axis=1)
    free = np.full(live.shape[1], np.inf)
    low, high = np.concatenate([-free, memory.low]), np.concatenate([free, memory.high])
    start = np.zeros(both.shape[1])
    x = _bounded(both.T @ both, both.T @ found.residual, low, high, start)
    return float(np.sum((found.residual - both @ x) ** 2))


def unforgotten(engine: Engine, found: Fit) -> tuple[Array, Array]:
    """What is left (valid,) beyond a fit and what nobody wrote down; their span."""
    memory = engine.whiten(memories(engine, found).columns)
    q = span(np.concatenate([free_columns(found), memory], axis=1))
    return found.residual - q @ (q.T @ found.residual), q


def free_columns(found: Fit) -> Array:
    """Whitened derivatives by what is free in a fit; stiffnesses at zero stay there."""
    k = len(found.guess.stiffness)
    live = np.ones(found.jacobian.shape[1], bool)
    live[:k] = (found.guess.stiffness > 0) & (not found.fixed_base)
    return found.jacobian[:, live]


def beyond(engine: Engine, found: Fit, columns: Array) -> float:
    """Whitened misfit of a fit when it may also use `columns`, linearised."""
    both = np.concatenate([free_columns(found), engine.whiten(columns)], axis=1)
    q = span(both)
    return float(found.chi2 - np.sum((q.T @ found.residual) ** 2))
