"""What the law of an effect could be beyond the form that was fitted.

No formula is the true one. Where an effect is really there, what its form misses is a
distortion of what the effect does: the same change of stress, bent by strain, largest
strain or its own size, a little early or late. A second effect that takes up no more
than such distortions do is the form of the first.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Engine, Fit, Guess, _bounded, derivative, fit, slots, span
from softnn.models.unit_kernel import maxwell

GAP = 6.0  # typical intervals, beyond which something may have happened unseen
MOST_GAPS = 3  # of a recording, the longest, whose memory is allowed for
LENGTHS = 40  # at which the effect of a pause is worked out
SWEEPS = 50  # at most, through all pauses
SETTLED = 0.01  # of the misfit, below which a sweep is the last
ROUNDS = 4  # at most, of simulating the pauses found
LITTLE = 0.02  # of the stiffness of all branches, up to which one is none
CHANGED = 0.05  # of misfit, a sample, from which they are simulated
LAGS = (3.0, 30.0)  # of the sampling interval, by which a distortion may trail
FILTER = (1.0, 3.0, 10.0, 30.0)  # the same where a filter is all that it can be


def distortions(
    engine: Engine, found: Fit, which: set[str] | None = None, flowing: bool = False
) -> Array:
    """Changes of stress (valid, k), MPa, that other forms of the effects could make.

    `which`: ids of the effects meant, by default all but nuisances. `flowing`: those
    too by which a branch relaxes at another pace, which can stand for much else.
    """
    columns = [_slopes(engine, found, which)]
    strain, largest = _state(engine)
    interval = engine.data.scales().interval_s
    time = np.concatenate([c.time_s for c in engine.chunks])[engine.valid]
    longest = float(engine.data.scales().duration_s.max())
    clock = np.concatenate([c.time_s - c.time_s[0] for c in engine.chunks])
    clock = clock[engine.valid] / longest
    for i, piece in enumerate(found.guess.pieces):
        if piece.nuisance or (which is not None and piece.effect.id not in which):
            continue
        rest = tuple(p for j, p in enumerate(found.guess.pieces) if j != i)
        without, _ = engine.run(replace(found.guess, pieces=rest), False)
        d = found.stress - without
        top = float(np.abs(d).max())
        if top < 1e-12 * engine.level:
            continue
        by = piece.effect.bends
        by_what = {
            "strain": [strain, strain**2],
            "largest": [largest, strain * largest],
            "size": [np.abs(d) / top, (d / top) ** 2],
            "time": [clock, clock**2],
        }
        bent = [d * x for kind in by for x in by_what.get(kind, ())]
        if "lag" in by:
            lags = FILTER if by == ("lag",) else LAGS
            bent += [_trailing(d, time, engine.owner, x * interval) for x in lags]
        if flowing and "flow" in by:
            paces = _paces(found.guess)
            shapes = (d, d * np.abs(d) / top)
            bent += [_trailing(x, time, engine.owner, t) for x in shapes for t in paces]
        if bent:
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


def _paces(guess: Guess) -> list[float]:
    """Relaxation times [s] of the branches that the base has."""
    stiffness = guess.stiffness[guess.units.segments :]
    there = stiffness > LITTLE * stiffness.sum()
    return [
        t for t, is_it in zip(guess.units.relaxation_times, there, strict=True) if is_it
    ]


def _trailing(x: Array, time: Array, owner: NDArray[np.integer], lag_s: float) -> Array:
    """x low-passed within each recording, at its typical interval."""
    out = np.empty_like(x)
    for r in np.unique(owner):
        own = owner == r
        step = float(np.median(np.diff(time[own]))) if own.sum() > 1 else lag_s
        keep = float(np.exp(-max(step, 1e-12) / lag_s))
        decay, one = np.full((own.sum(), 1), keep), np.empty((own.sum(), 1))
        maxwell(decay, 1 - decay, x[own], x[own][:1], one)
        out[own] = one[:, 0]
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
    """Changes of stress, MPa, by what nobody wrote down: in gaps, and in pauses.

    `columns` (valid, k) and the multiples of each that can be, `low` and `high` (k,);
    `pauses`, of the pause before each recording but the first its effect (valid, k)
    were it of the `lengths` (k,) in s.
    """

    columns: Array
    low: Array
    high: Array
    pauses: list[Array]
    lengths: list[Array]


def memories(engine: Engine, found: Fit) -> Memory:
    """Changes of stress by what happened while nobody wrote it down.

    After a gap in time a branch of the base may remember as much strain as could have
    come and gone in it; a recording that goes on from another begins after a pause of
    unknown length, in which the branches forget: all of them for as long.
    """
    units = found.guess.units
    stiffness = found.guess.stiffness[units.segments :]
    live = stiffness > 0
    stiffness, times = stiffness[live], np.array(units.relaxation_times)[live]
    columns = [np.zeros((len(engine.target), 0))]
    low, high = [np.zeros(0)], [np.zeros(0)]
    pauses, lengths = [], []
    clock = np.concatenate([c.time_s for c in engine.chunks])[engine.valid]
    state, last, ended = None, np.zeros(0), 0.0
    for r, chunk in enumerate(engine.chunks):
        _, branch, state = engine.columns(
            units, r, chunk, state if engine.data.continued else None
        )
        time = chunk.time_s
        # What is carried on is carried through the recordings that follow, too.
        own = engine.owner >= r if engine.data.continued else engine.owner == r
        step = np.diff(time)
        fastest = np.max(np.abs(np.diff(chunk.strain)) / np.maximum(step, 1e-12))
        span = float(np.ptp(chunk.strain))
        gaps = np.flatnonzero(step > GAP * np.median(step)) + 1
        for gap in gaps[np.argsort(-step[gaps - 1])][:MOST_GAPS]:
            columns.append(_fading(clock, time[gap], own, times))
            lasted = step[gap - 1]
            # Of strain that came and went a branch holds what it had time to forget.
            most = -np.expm1(-lasted / times) * stiffness * min(fastest * lasted, span)
            low.append(-most)
            high.append(most)
        if engine.data.continued and r and live.any():
            taken = time[0] - ended
            # A clock that runs on may begin a recording with the last sample again.
            shortest = min(taken, times.min()) or times.min()
            long = np.geomspace(0.1 * shortest, 30 * times.max(), LENGTHS)
            kept = np.exp(-long[:, None] / times) - np.exp(-taken / times)
            kept *= stiffness * last
            lengths.append(long)
            pauses.append(_fading(clock, time[0], own, times) @ kept.T)
        last, ended = branch[-1][live], time[-1]
    return Memory(
        np.concatenate(columns, axis=1),
        np.concatenate(low),
        np.concatenate(high),
        pauses,
        lengths,
    )


def _fading(clock: Array, start: float, own: NDArray[np.bool], times: Array) -> Array:
    """Decays (valid, times) from `start` on, nothing before it nor elsewhere."""
    after = (clock - start)[:, None]
    return np.exp(-np.maximum(after, 0.0) / times) * ((after >= 0) & own[:, None])


def _recalled(engine: Engine, found: Fit) -> tuple[float, Array, Array]:
    """Misfit of a fit that remembers what suits it; what it does (valid, k); pauses, s.

    The base is free to adjust. Each pause is followed along the curve of its lengths,
    straight between them, in turn with the others and with the gaps.
    """
    memory = memories(engine, found)
    gaps = memory.columns.shape[1]
    if not gaps and not memory.pauses:
        return found.chi2, memory.columns, np.zeros(0)
    q = span(free_columns(found))
    left = found.residual - q @ (q.T @ found.residual)
    columns = engine.whiten(np.concatenate([memory.columns, *memory.pauses], axis=1))
    seen = q.T @ columns
    gram, right = columns.T @ columns - seen.T @ seen, columns.T @ left
    ends = gaps + LENGTHS * np.arange(len(memory.pauses) + 1)
    curves = [slice(a, b) for a, b in pairwise(ends)]
    weight = np.zeros(len(right))
    chi2 = float(left @ left)
    for _ in range(SWEEPS):
        before = chi2
        for own in curves:
            weight[own] = 0
            weight[own] = _nearest(gram[own, own], right[own] - gram[own] @ weight)
        if gaps:
            rest = right[:gaps] - gram[:gaps, gaps:] @ weight[gaps:]
            weight[:gaps] = _bounded(
                gram[:gaps, :gaps], rest, memory.low, memory.high, weight[:gaps]
            )
        chi2 = float(left @ left - 2 * right @ weight + weight @ gram @ weight)
        if not chi2 < before - SETTLED:
            break
    chosen = [columns[:, own] @ weight[own, None] for own in curves]
    pauses = [
        np.exp(np.log(length) @ weight[own])
        for length, own in zip(memory.lengths, curves, strict=True)
    ]
    both = np.concatenate([columns[:, :gaps], *chosen], axis=1)
    return chi2, both, np.array(pauses)


def _nearest(gram: Array, right: Array) -> Array:
    """Weights (k,) of the point of a line through k points that leaves least.

    `gram` (k, k) of the points, `right` (k,) their products with what is to be met.
    """
    square, ahead = np.diag(gram), np.diag(gram, 1)
    slope = ahead - square[:-1] - np.diff(right)
    bend = np.maximum(square[:-1] + square[1:] - 2 * ahead, 1e-300)
    share = np.clip(-slope / bend, 0.0, 1.0)
    left = square[:-1] - 2 * right[:-1] + share * (2 * slope + share * bend)
    k = int(np.argmin(left))
    weight = np.zeros(len(right))
    weight[k : k + 2] = 1 - share[k], share[k]
    return weight


def _settled(engine: Engine, found: Fit) -> tuple[Fit, float, Array]:
    """A fit with the pauses that suit it; misfit and columns (valid, k) of `_recalled`.

    A pause that does much is simulated: its effect is linear in no more than a small
    change of what the base and the pauses before it are.
    """
    best = None
    for _ in range(ROUNDS):
        chi2, columns, pauses = _recalled(engine, found)
        if best is None or chi2 < best[1]:
            best = found, chi2, columns
        if not len(pauses) or found.chi2 - chi2 < CHANGED * len(found.residual):
            break
        engine = _paused(engine, pauses)
        found = fit(engine, found.guess, fixed_base=found.fixed_base, iterations=4)
    assert best is not None
    return best


def remembered(engine: Engine, found: Fit) -> float:
    """Whitened misfit of a fit that may also remember what nobody wrote down."""
    return _settled(engine, found)[1]


def _paused(engine: Engine, pauses: Array) -> Engine:
    """The engine with pauses (recordings - 1,), s, between recordings."""
    chunks = [engine.chunks[0]]
    for chunk, pause in zip(engine.chunks[1:], pauses, strict=True):
        time = chunk.time_s - chunk.time_s[0] + chunks[-1].time_s[-1] + pause
        chunks.append(replace(chunk, time_s=time))
    other = copy(engine)
    other.chunks, other._cache, other._inputs = chunks, {}, {}
    return other


def unforgotten(engine: Engine, found: Fit) -> tuple[Array, Array]:
    """What is left (valid,) beyond a fit and what nobody wrote down; their span."""
    found, _, columns = _settled(engine, found)
    q = span(np.concatenate([free_columns(found), columns], axis=1))
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
