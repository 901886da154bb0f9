r"""Separable least squares: stiffnesses exactly, the few other parameters by search.

For fixed parameters of the effects the stress is linear, or nearly so, in the
non-negative stiffnesses of the base. Each step solves one bounded least-squares problem
for the stiffnesses and for the change of the other parameters together (Kaufman's form
of variable projection, 1975, doi:10.1007/BF01932995), damped as Levenberg and Marquardt
do; the new point is judged with stiffnesses solved for exactly there. Residuals are
whitened by the noise of each recording (level, and correlation in time).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.bounded import bounded, innovations, whitened
from softnn.contracts import Array, Chunk, Effect, Scales, Signal
from softnn.models.units import Units
from softnn.simulate import Memory, Term, measured, reach, run_on, to_model

RIDGE = 1e-11  # of each diagonal entry: keeps collinear branches solvable
KEPT = 6  # strains that reached the model, last asked for
ROOM = 3e7  # numbers that may be kept so, where recordings are many

HIGHEST = 0.995  # correlation of neighbouring samples
Memory_s = Sequence[tuple[float, float]]  # (share of the variance, time in s), parts
Input = tuple[Signal, Array, Array]  # of a recording: strains; columns, two parts


@dataclass(frozen=True)
class Data:
    """Recordings as a fit wants them: histories without gaps, stress with a mask."""

    names: tuple[str, ...]
    chunks: tuple[Chunk, ...]
    stress_MPa: tuple[Array, ...]
    continued: bool = False
    simulated_MPa: tuple[Array, ...] | None = None

    @property
    def starts(self) -> Array:
        """Where each recording begins among all samples, and the end of the last."""
        return np.concatenate([[0], np.cumsum([len(s) for s in self.stress_MPa])])

    def scales(self) -> Scales:
        """Sizes from which searches start; quantiles, so that spikes do not rule."""
        strain = np.concatenate([np.abs(c.strain) for c in self.chunks])
        stress = np.abs(np.concatenate(self.stress_MPa))
        steps = np.concatenate([np.diff(c.time_s) for c in self.chunks])
        warm = [c.temperature_C for c in self.chunks if c.temperature_C is not None]
        spread = np.concatenate(warm) if warm else np.zeros(1)
        return Scales(
            strain=float(strain.max()),
            stress_MPa=float(np.nanquantile(stress, 0.998)),
            interval_s=float(np.median(steps[steps > 0])),
            duration_s=np.array([c.time_s[-1] - c.time_s[0] for c in self.chunks]),
            temperature_C=float(np.nanmax(spread) - np.nanmin(spread)),
        )


@dataclass(frozen=True)
class Piece:
    """An effect in a fit: its values, which of them are free, and for which recordings.

    `groups` are the sets of recordings that share a value of the `per_recording`
    parameters; recordings in no group stay off.
    """

    effect: Effect
    values: dict[str, Any]
    free: tuple[str, ...]
    groups: tuple[tuple[int, ...], ...] = ()
    nuisance: bool = False  # always there, never news: the scatter between specimens
    unsaid: bool = False  # of specimens that nobody named

    def term(self) -> Term:
        return Term(self.effect, self.values)


@dataclass(frozen=True)
class Guess:
    """A point of the search: base, stiffnesses (columns,) in MPa, pieces."""

    units: Units
    stiffness: Array
    pieces: tuple[Piece, ...] = ()

    def terms(self) -> list[Term]:
        return [p.term() for p in self.pieces]


@dataclass(frozen=True)
class Slot:
    """One free number of a guess; piece -1 is the base."""

    piece: int
    name: str
    recordings: tuple[int, ...] | None  # None: shared by all
    logarithmic: bool
    low: float
    high: float
    typical: float

    def inside(self, value: float) -> float:
        return float(np.log(value)) if self.logarithmic else value / self.typical

    def outside(self, value: float) -> float:
        v = np.exp(value) if self.logarithmic else value * self.typical
        return float(np.clip(v, self.low, self.high))


def slots(guess: Guess) -> list[Slot]:
    """The free numbers of a guess beside the stiffnesses."""
    out = []
    for j, time in enumerate(guess.units.relaxation_times):
        if guess.units.name.endswith("sls"):
            out.append(Slot(-1, str(j), None, True, time / 1e4, time * 1e4, time))
    for i, piece in enumerate(guess.pieces):
        for p in piece.effect.parameters:
            if p.name not in piece.free:
                continue
            own = p.name in piece.effect.per_recording
            for group in piece.groups if own else [None]:
                held = np.asarray(piece.values[p.name])
                value = float(held[group[0]]) if group is not None else float(held)
                typical = abs(value) or abs(p.default) or 1.0
                out.append(
                    Slot(i, p.name, group, p.scale == "log", p.low, p.high, typical)
                )
    return out


def get(guess: Guess, slot: Slot) -> float:
    if slot.piece < 0:
        return guess.units.relaxation_times[int(slot.name)]
    value = guess.pieces[slot.piece].values[slot.name]
    return float(value if slot.recordings is None else value[slot.recordings[0]])


def put(guess: Guess, where: Sequence[Slot], values: Sequence[float]) -> Guess:
    """The guess with other values in the slots."""
    pieces = [dict(p.values) for p in guess.pieces]
    times = list(guess.units.relaxation_times)
    for slot, value in zip(where, values, strict=True):
        if slot.piece < 0:
            times[int(slot.name)] = value
        elif slot.recordings is None:
            pieces[slot.piece][slot.name] = value
        else:
            array = np.array(pieces[slot.piece][slot.name], float)
            array[list(slot.recordings)] = value
            pieces[slot.piece][slot.name] = array
    units = guess.units
    if tuple(times) != units.relaxation_times:
        units = replace(units, relaxation_times=tuple(times))
    return Guess(
        units,
        guess.stiffness,
        tuple(replace(p, values=v) for p, v in zip(guess.pieces, pieces, strict=True)),
    )


def span(columns: Array) -> Array:
    """Orthonormal basis (n, rank) of columns (n, k), those that depend left out."""
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0] / norm[norm > 0]
    # By the Gram matrix, a tenth of the time of a decomposition of the columns; columns
    # are few and only clear directions are kept, so that its lesser accuracy will do.
    size, turn = np.linalg.eigh(columns.T @ columns)
    clear = size > 1e-10 * size.max(initial=0.0)
    return columns @ (turn[:, clear] / np.sqrt(size[clear]))


class Engine:
    """Simulates the data for many guesses; keeps what does not change between them."""

    def __init__(
        self,
        data: Data,
        sigma_MPa: Sequence[Array] | None = None,
        memory: Sequence[Memory_s] | None = None,
        remainder: Sequence[Array] | None = None,
    ) -> None:
        """`sigma_MPa` (n,) and `memory` of each recording: its noise (`softnn.noise`).

        `remainder` (n,) of each recording is added to the equilibrium stress: what a
        simulation that is not refitted has beyond its stand-in.
        """
        self.data = data
        self.chunks = run_on(data.chunks, data.continued)
        self.remainder = remainder
        self.measured = np.concatenate(data.stress_MPa)
        self.valid = np.isfinite(self.measured)
        self.recording = np.repeat(
            np.arange(len(data.chunks)), [len(s) for s in data.stress_MPa]
        )
        self.owner = self.recording[self.valid]
        self.complete = bool(self.valid.all())
        self.target = self.measured[self.valid]
        self.level = float(np.abs(self.target).max(initial=0.0)) + 1e-30
        self.fine: Engine | None = None  # the same recordings with all their samples
        self.body = False  # weigh all samples alike, as if the noise were white
        self._cache: dict[Any, Any] = {}
        self._inputs: dict[Any, list[Input]] = {}
        self.noises = 0  # set so far: which one is in force
        self._blind: Array | None = None  # orthonormal, whitened: what no fit may see
        self.set_noise(sigma_MPa, memory)

    def set_noise(
        self,
        sigma_MPa: Sequence[Array] | None,
        memory: Sequence[Memory_s] | None,
    ) -> None:
        """Weigh by a noise: standard deviation (n,) and memory of each recording."""
        n = len(self.measured)
        sigma = np.ones(n) if sigma_MPa is None else np.concatenate(sigma_MPa)
        self.sigma = sigma[self.valid]
        time = np.concatenate([c.time_s for c in self.data.chunks])[self.valid]
        memory = memory or [()] * len(self.data.chunks)
        parts = max((len(m) for m in memory), default=0)
        share, tau = np.zeros((2, len(memory), parts))
        tau += 1.0
        for r, own in enumerate(memory):
            for k, (weight, seconds) in enumerate(own):
                share[r, k], tau[r, k] = weight, seconds
        step = np.diff(time, prepend=time[:1])[:, None]
        self._first = np.diff(self.owner, prepend=-1) != 0
        decay = np.exp(-np.maximum(step, 0.0) / tau[self.owner])
        # Samples at one time are not one sample.
        self._decay = np.minimum(decay, HIGHEST)
        own_share = share[self.owner]
        self._gain, self._scale = innovations(
            self._decay,
            own_share,
            np.maximum(1 - own_share.sum(axis=1), 0.0),
            self._first,
        )
        # Of the density of what is whitened, so that noises can be held against noises.
        self.log_norm = float(np.sum(np.log(self._scale / self.sigma)))
        self.noises += 1

    @contextmanager
    def blind(self, columns: Array) -> Iterator[None]:
        """Fits within do not see the changes of stress `columns` (valid, k).

        They are projected out of everything whitened, as if each were a free linear
        parameter of the fit.
        """
        white = self.whiten(columns)
        norm = np.linalg.norm(white, axis=0)
        u, s, _ = np.linalg.svd(
            white[:, norm > 0] / norm[norm > 0], full_matrices=False
        )
        self._blind = u[:, s > 1e-6 * s.max(initial=0.0)]
        try:
            yield
        finally:
            self._blind = None

    @contextmanager
    def made_by(self, stress: Array) -> Iterator[None]:
        """Fits within are to this stress (valid,) in place of what was measured."""
        measured, self.target = self.target, stress
        try:
            yield
        finally:
            self.target = measured

    def whiten(self, x: Array) -> Array:
        """Rows (valid samples, ...) as if the noise were independent, of variance 1."""
        out = self._whiten(x)
        if self._blind is not None:
            out -= self._blind @ (self._blind.T @ out)
        return out

    def _whiten(self, x: Array) -> Array:
        rows = np.ascontiguousarray(x if x.ndim == 2 else x[:, None], float)
        out = whitened(
            rows, self.sigma, self._decay, self._gain, self._scale, self._first
        )
        return out if x.ndim == 2 else out[:, 0]

    def columns(self, units: Units, r: int, chunk: Chunk, state: Any) -> Any:
        """Unit columns of recording r; kept when the strain is the commanded one."""
        plain = chunk.strain is self.chunks[r].strain or chunk.branch_strain is None
        own_time = chunk.time_s is not self.chunks[r].time_s
        key = (units, r)
        if plain and key in self._cache:
            return self._cache[key]
        last, inner = (None, None) if state is None else state
        decays = (
            units.decays(chunk.time_s, last)
            if own_time
            else self.decays(units, r, chunk.time_s, last)
        )
        seen = chunk.strain if chunk.branch_strain is None else chunk.branch_strain
        branch, inner = units.branches(decays, seen, inner)
        out = (units.springs(chunk.strain), branch, (float(chunk.time_s[-1]), inner))
        if plain:
            self._cache[key] = out
        return out

    def decays(
        self, units: Units, r: int, time_s: Array, last: float | None = None
    ) -> tuple[Array, Array]:
        """Decay and gain of the branches in recording r; kept."""
        key = (units.relaxation_times, r)
        if key not in self._cache:
            if len(self._cache) > 400:
                self._cache.clear()
            self._cache[key] = units.decays(time_s, last)
        found: tuple[Array, Array] = self._cache[key]
        return found

    def inputs(self, units: Units, terms: Sequence[Term], every: Any) -> list[Input]:
        """What reaches the model in each recording, and its unit columns there.

        Kept for the last few, as stiffnesses and what acts after the model change
        nothing of it. `every` (terms, recordings): the values of the terms.
        """
        front = [t for t in terms if t.effect.acts_before]
        values = (
            ((k, np.asarray(v).tobytes()) for k, v in t.values.items()) for t in front
        )
        key = units, *((type(t.effect), *v) for t, v in zip(front, values, strict=True))
        if key in self._inputs:
            return self._inputs[key]
        out: list[Input] = []
        memory: Memory = {}
        state = None
        for r, chunk in enumerate(self.chunks):
            if not self.data.continued:
                memory, state = {}, None
            signal = reach(terms, [own[r] for own in every], chunk, memory)
            inner = chunk
            if front:
                inner = to_model(signal)
            springs, branch, state = self.columns(units, r, inner, state)
            out.append((signal, springs, branch))
        size = sum(springs.size + branch.size for _, springs, branch in out)
        while self._inputs and len(self._inputs) >= min(KEPT, ROOM // max(size, 1)):
            del self._inputs[next(iter(self._inputs))]
        self._inputs[key] = out
        return out

    def run(self, guess: Guess, columns: bool) -> tuple[Array, Array | None]:
        """Stress (valid,) of a guess and, if asked, its derivative by each stiffness.

        The derivative is a difference over a small step, pushed through the effects;
        for effects that are linear in stress it is exact. Where they take each moment
        by itself one step of either part serves all its columns, else each has its own.
        """
        terms = guess.terms()
        x, segments = guess.stiffness, guess.units.segments
        plain = all(type(t.effect).after is Effect.after for t in terms)
        # A solver within bounds asks far too often to be checked each time.
        every = [t.each(len(self.chunks)) for t in terms]
        stress = np.empty(len(self.measured))
        slope = np.empty((len(stress), len(x))) if columns else None
        memory: Memory = {}
        inputs = self.inputs(guess.units, terms, every)
        starts = self.data.starts
        for r, (signal, springs, branch) in enumerate(inputs):
            if not self.data.continued:
                memory = {}
            rows = slice(starts[r], starts[r + 1])
            eq = springs @ x[:segments]
            if self.remainder is not None:
                eq = eq + self.remainder[r]
            br = branch @ x[segments:]
            values = [own[r] for own in every]
            if slope is None or plain:
                stress[rows] = (
                    eq + br
                    if plain
                    else self._through(
                        terms, values, signal, eq[:, None], br[:, None], memory
                    )[:, 0]
                )
                if slope is not None:
                    slope[rows, :segments], slope[rows, segments:] = springs, branch
                continue
            step = 1e-4 * max(float(np.abs(eq + br).max()), self.level)
            if all(t.effect.pointwise for t in terms):
                e = np.stack([eq, eq + step, eq], axis=1)
                b = np.stack([br, br, br + step], axis=1)
                out = self._through(terms, values, signal, e, b, memory)
                by = (out[:, 1:] - out[:, :1]) / step
                np.multiply(springs, by[:, :1], out=slope[rows, :segments])
                np.multiply(branch, by[:, 1:], out=slope[rows, segments:])
            else:
                both = (springs, branch)
                highest = np.concatenate([np.abs(c).max(axis=0) for c in both])
                h = step / np.maximum(highest, 1e-30)
                e = np.repeat(eq[:, None], len(h) + 1, axis=1)
                b = np.repeat(br[:, None], len(h) + 1, axis=1)
                e[:, 1 : 1 + segments] += springs * h[:segments]
                b[:, 1 + segments :] += branch * h[segments:]
                out = self._through(terms, values, signal, e, b, memory)
                slope[rows] = (out[:, 1:] - out[:, :1]) / h
            stress[rows] = out[:, 0]
        return self._seen(stress), None if slope is None else self._seen(slope)

    def within(self, recordings: Sequence[int]) -> NDArray[np.bool]:
        """Which valid samples are of these recordings."""
        mine = np.zeros(len(self.chunks), bool)
        mine[list(recordings)] = True
        return mine[self.owner]

    def _seen(self, whole: Array) -> Array:
        return whole if self.complete else whole[self.valid]

    def beside(
        self, guess: Guess, moves: Sequence[Sequence[tuple[Slot, float]]]
    ) -> Array:
        """Change of stress (valid, moves) as slots of the guess's pieces are moved.

        One pass for all moves; recordings must not go on from one another. The guess
        goes through it beside them, so that what changes nothing changes by nothing.
        """
        sets = len(moves) + 1
        terms, count = guess.terms(), len(self.chunks)
        every = [[dict(own) for own in t.each(count)] for t in terms]
        front, own_copy = False, set()
        for i, moved in enumerate(moves, start=1):
            for slot, value in moved:
                front = front or terms[slot.piece].effect.acts_before
                of = range(count) if slot.recordings is None else slot.recordings
                for r in of:
                    values = every[slot.piece][r]
                    if (slot.piece, r, slot.name) not in own_copy:
                        own_copy.add((slot.piece, r, slot.name))
                        values[slot.name] = np.repeat(values[slot.name], sets)
                    values[slot.name][i] = value
        x, segments = guess.stiffness, guess.units.segments
        inputs = [] if front else self.inputs(guess.units, terms, every)
        change = []
        for r, chunk in enumerate(self.chunks):
            values_ = [own[r] for own in every]
            if front:
                signal = reach(terms, values_, chunk, {})
                eq = guess.units.spring_stress(signal.strain, x[:segments])
                br = self._borne(guess.units, r, signal, x[segments:])
            else:
                signal, springs, branch = inputs[r]
                eq = (springs @ x[:segments])[:, None]
                br = (branch @ x[segments:])[:, None]
            if self.remainder is not None:
                eq = eq + self.remainder[r][:, None]
            out = self._through(terms, values_, signal, eq, br, {})
            out = np.broadcast_to(out, (len(out), sets))
            change.append(out[:, 1:] - out[:, :1])
        return self._seen(np.concatenate(change))

    def _borne(self, units: Units, r: int, signal: Signal, stiffness: Array) -> Array:
        """Stress (n, sets) of the branches, each set in its own time."""
        strain, time = signal.branch_strain, signal.branch_time_s
        if time is None:
            decays = self.decays(units, r, signal.time_s)
            return units.branch_stress(decays, strain, stiffness)
        sets = max(strain.shape[1], time.shape[1])
        strain, time = (np.broadcast_to(a, (len(a), sets)) for a in (strain, time))
        columns = [
            units.branch_stress(
                units.decays(time[:, j], None), strain[:, j : j + 1], stiffness
            )
            for j in range(sets)
        ]
        return np.concatenate(columns, axis=1)

    @staticmethod
    def _through(
        terms: Any, values: Any, signal: Signal, eq: Array, br: Array, memory: Memory
    ) -> Array:
        return measured(
            terms, values, replace(signal, equilibrium=eq, branches=br), memory
        )

    def by_recording(self, x: Array) -> list[Array]:
        """Values of valid samples, as one array with NaN elsewhere a recording."""
        full = np.full(len(self.measured), np.nan)
        full[self.valid] = x
        return np.split(full, self.data.starts[1:-1])


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
    gram = a.T @ a
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
        if piece < 0 or engine.data.continued:
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
    guess, stress, a, residual, chi2 = solve_base(engine, guess, fixed_base)
    where = slots(guess)
    damping, count = 1e-3, 0
    jacobian = np.zeros((len(stress), 0))
    fresh = False
    while where and count < iterations:
        count += 1
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
            break
    stress, slope = engine.run(guess, True)  # not the linearised one
    assert slope is not None
    a = engine.whiten(slope)
    residual = engine.whiten(engine.target - stress)
    if where and not fresh:
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
