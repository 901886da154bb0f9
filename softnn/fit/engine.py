"""Simulation of recordings for many points of a search, whitened by their noise."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.bounded import innovations, whitened
from softnn.contracts import Array, Chunk, Effect, Signal, increments
from softnn.fit.point import Data, Guess, Piece, Slot, apart
from softnn.models.base import Base
from softnn.simulate import Memory, Term, measured, reach, run_on, to_model

KEPT = 6  # most cached entries of strains that reached the model
ROOM = 3e7  # most numbers in that cache, where recordings are many

HIGHEST = 0.995, 1 - 1e-5  # correlation of samples at one time, of neighbouring ones
Memory_s = Sequence[tuple[float, float]]  # (share of the variance, time in s), parts
Input = tuple[Signal, Array, Array]  # strains; columns of springs, of branches
# State of branches: the time of each set; its last strain and unit stresses.
Part = tuple[Array, tuple[Array, Array] | None]
Carried = tuple[Part, ...] | None


def span(columns: Array) -> Array:
    """Return an orthonormal basis (n, rank) of the space that columns (n, k) span.

    Columns that depend on others are left out: directions with an eigenvalue of the
    normalised Gram matrix below 1e-10 of the largest.
    """
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0] / norm[norm > 0]
    # The Gram matrix takes a tenth of the time of a decomposition of the columns. Its
    # lower accuracy suffices: columns are few and only clear directions are kept.
    size, turn = np.linalg.eigh(columns.T @ columns)
    clear = size > 1e-10 * size.max(initial=0.0)
    return columns @ (turn[:, clear] / np.sqrt(size[clear]))


class Engine:
    """Simulates the data for many points of a search; caches what does not change.

    Samples are the finite measured stresses of all recordings, one after the other:
    (valid,). Stresses are in MPa.
    """

    def __init__(
        self,
        data: Data,
        sigma_MPa: Sequence[Array] | None = None,
        memory: Sequence[Memory_s] | None = None,
        remainder: Sequence[Array] | None = None,
        fine: Engine | None = None,
    ) -> None:
        """Take the data and the noise of each recording (`softnn.noise`).

        `sigma_MPa` is the standard deviation (n,) of each recording, 1 by default;
        `memory` its first-order parts. `remainder` (n,) of each recording is added to
        the equilibrium stress: the difference between a fixed simulation and the model
        that stands in for it. `fine` has the same recordings with more samples.
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
        self._rows = np.flatnonzero(self.valid)
        self.target = self.measured[self.valid]
        self.level = float(np.abs(self.target).max(initial=0.0)) + 1e-30
        self._fine = fine
        self._cache: dict[Any, Any] = {}
        self._inputs: dict[Any, list[Input]] = {}
        self.noises = 0  # number of noises set so far, which identifies the present one
        self.set_noise(sigma_MPa, memory)

    @property
    def fine(self) -> Engine:
        """The same recordings with more samples; this engine if there are none."""
        return self._fine or self

    @cached_property
    def share(self) -> Array:
        """Weight (valid,) of each sample in an error: `Data.weights`."""
        return np.concatenate(self.data.weights)[self.valid]

    def under(
        self, sigma_MPa: Sequence[Array] | None, memory: Sequence[Memory_s] | None
    ) -> Engine:
        """Return an engine of the same recordings that weighs by another noise.

        It shares the simulations that this one has kept.
        """
        other = copy(self)
        other.set_noise(sigma_MPa, memory)
        return other

    def set_noise(
        self,
        sigma_MPa: Sequence[Array] | None,
        memory: Sequence[Memory_s] | None,
    ) -> None:
        """Weigh by another noise: standard deviation (n,) and memory of each recording.

        `sigma_MPa` is in MPa. `memory` holds pairs of share of the variance and
        correlation time [s]; the rest of the variance is white. The method also sets
        `log_norm`, the log of the whitening determinant.
        """
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
        step = increments(time, time[:1])[:, None]
        self.begins = np.diff(self.owner, prepend=-1) != 0  # first of a recording
        decay = np.exp(-np.maximum(step, 0.0) / tau[self.owner])
        # Two samples at one time still differ, so their correlation stays below 1.
        self._decay = np.minimum(decay, np.where(step > 0, HIGHEST[1], HIGHEST[0]))
        own_share = share[self.owner]
        self._gain, self._scale = innovations(
            self._decay,
            own_share,
            np.maximum(1 - own_share.sum(axis=1), 0.0),
            self.begins,
        )
        # Part of the log density, so that fits under different noises are comparable.
        self.log_norm = float(np.sum(np.log(self._scale / self.sigma)))
        self.noises += 1

    def whiten(self, x: Array) -> Array:
        """Whiten rows (valid, ...): pure noise becomes independent, of variance 1.

        The noise in force is that of `set_noise`. Stresses and their derivatives are
        whitened in the same way, so the product of whitened rows is a likelihood.
        """
        rows = np.ascontiguousarray(x if x.ndim == 2 else x[:, None], float)
        out = whitened(
            rows, self.sigma, self._decay, self._gain, self._scale, self.begins
        )
        return out if x.ndim == 2 else out[:, 0]

    def columns(self, units: Base, r: int, chunk: Chunk, state: Any) -> Any:
        """Spring columns, branch columns and the state at the end of recording r.

        Columns are stresses per unit stiffness, (n, segments) and (n, branches). They
        are cached when no effect has changed the commanded strain.
        """
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
        branch, inner = units.followed(decays, chunk, inner)
        out = (units.springs(chunk.strain), branch, (float(chunk.time_s[-1]), inner))
        if plain:
            self._keep(key, out)
        return out

    def _keep(self, key: Any, value: Any) -> None:
        """Cache a value; bases with parameters of their own would fill it for ever."""
        if len(self._cache) > 400:
            self._cache.clear()
        self._cache[key] = value

    def decays(
        self, units: Base, r: int, time_s: Array, last: float | None = None
    ) -> tuple[Array, Array]:
        """Return decay and gain of the branches in recording r, each (n, branches).

        `last` is the time [s] at which the recording before ended, if this one goes on.
        Results are cached by family of bases, relaxation times and recording.
        """
        key = (type(units), units.relaxation_times, r)
        if key not in self._cache:
            self._keep(key, units.decays(time_s, last))
        found: tuple[Array, Array] = self._cache[key]
        return found

    def inputs(self, units: Base, terms: Sequence[Term], every: Any) -> list[Input]:
        """Signal that reaches the model in each recording, and its unit columns.

        `every` (terms, recordings) holds the values of the terms. The last few results
        are cached, because stiffnesses and effects behind the model do not change them.
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
        """Stress (valid,) [MPa] of a guess; with `columns`, its derivative too.

        The derivative (valid, stiffnesses) is a finite difference through the effects,
        exact for effects that are linear in stress. Where all effects act pointwise,
        one step of the springs and one of the branches serve all columns; otherwise
        each column has its own step.
        """
        terms = guess.terms()
        x, segments = guess.stiffness, guess.units.segments
        plain = all(type(t.effect).after is Effect.after for t in terms)
        # The solver stays within bounds and calls too often for a check each time.
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
        """Return a mask (valid,) of the samples that belong to these recordings.

        `recordings` are indices into the data. The mask selects rows of stress and
        derivatives.
        """
        mine = np.zeros(len(self.chunks), bool)
        mine[list(recordings)] = True
        return mine[self.owner]

    def _seen(self, whole: Array) -> Array:
        return whole if self.complete else whole.take(self._rows, axis=0)

    def beside(
        self, guess: Guess, moves: Sequence[Sequence[tuple[Slot, float]]]
    ) -> Array:
        """Change of stress (valid, moves), MPa, as slots of the guess are moved.

        One pass simulates all moves and the guess itself as one more set. The
        difference is therefore exactly zero where a move changes nothing.
        """
        sets = len(moves) + 1
        terms, count = guess.terms(), len(self.chunks)
        every = [[dict(own) for own in t.each(count)] for t in terms]
        front, own_copy = False, set()
        for i, moved in enumerate(moves, start=1):
            for slot, value in moved:
                front = front or terms[slot.piece].effect.acts_before
                of = range(count) if slot.recordings is None else slot.recordings
                # State carried between recordings has all sets from the first one on.
                for r in range(count) if self.data.continued else of:
                    values = every[slot.piece][r]
                    if (slot.piece, r, slot.name) not in own_copy:
                        own_copy.add((slot.piece, r, slot.name))
                        values[slot.name] = np.repeat(values[slot.name], sets)
                for r in of:
                    every[slot.piece][r][slot.name][i] = value
        return self._differences(guess, terms, every, sets, front)

    def by_each(self, guess: Guess, pieces: Sequence[Piece]) -> Array:
        """Change of stress (valid, pieces), MPa, as each piece joins the guess.

        All pieces are of one form of one effect; one pass simulates them all.
        """
        law, count = pieces[0].effect, len(self.chunks)
        off = replace(pieces[0], values={**pieces[0].values, **law.off})
        terms = [*guess.terms(), off.term()]
        every = [t.each(count) for t in terms[:-1]]
        ways = [p.term().each(count) for p in (off, *pieces)]
        every.append(
            [
                {k: np.concatenate([way[r][k] for way in ways]) for k in ways[0][r]}
                for r in range(count)
            ]
        )
        sets, front = len(ways), law.acts_before
        return self._differences(guess, terms, every, sets, front)

    def _differences(
        self, guess: Guess, terms: Sequence[Term], every: Any, sets: int, front: bool
    ) -> Array:
        """Stress (valid, sets - 1) of all sets but the first, less that of the first.

        `front`: whether the sets differ in the strain that reaches the model.
        """
        x, segments = guess.stiffness, guess.units.segments
        inputs = [] if front else self.inputs(guess.units, terms, every)
        memory: Memory = {}
        carried: Carried = None
        change = np.zeros((len(self.measured), sets - 1))
        for r, chunk in enumerate(self.chunks):
            values_ = [own[r] for own in every]
            asked = np.arange(sets)
            if not self.data.continued:
                memory, carried = {}, None
                asked = apart(terms, values_, sets)
                values_ = [
                    {k: v[asked] if len(v) == sets else v for k, v in own.items()}
                    for own in values_
                ]
            if len(asked) == 1:
                continue
            if front:
                signal = reach(terms, values_, chunk, memory)
                eq = guess.units.spring_stress(signal.strain, x[:segments])
                br, carried = self._borne(guess.units, r, signal, x[segments:], carried)
            else:
                signal, springs, branch = inputs[r]
                eq = (springs @ x[:segments])[:, None]
                br = (branch @ x[segments:])[:, None]
            if self.remainder is not None:
                eq = eq + self.remainder[r][:, None]
            out = self._through(terms, values_, signal, eq, br, memory)
            rows = slice(self.data.starts[r], self.data.starts[r + 1])
            out = np.broadcast_to(out, (len(out), len(asked)))  # sets may be equal
            change[rows, asked[1:] - 1] = out[:, 1:] - out[:, :1]
        return self._seen(change)

    def _borne(
        self, units: Base, r: int, signal: Signal, stiffness: Array, carried: Carried
    ) -> tuple[Array, Carried]:
        """Stress (n, sets) of the branches, and the state of their strains."""
        parts = signal.branch_parts or ((np.ones(1), signal.branch_strain),)
        total, after = np.zeros(1), []
        for (weight, strain), own in zip(
            parts, carried or (None,) * len(parts), strict=True
        ):
            part, own = self._part(units, r, signal, strain, stiffness, own)
            total = total + weight * part
            after.append(own)
        return total, tuple(after)

    def _part(
        self,
        units: Base,
        r: int,
        signal: Signal,
        strain: Array,
        stiffness: Array,
        carried: Part | None,
    ) -> tuple[Array, Part]:
        """Stress (n, sets) of the branches, each set with its own clock; the state."""
        time = signal.branch_time_s
        before, state = (None, None) if carried is None else carried
        if time is None:
            last = None if before is None else float(before[0])
            decays = self.decays(units, r, signal.time_s, last)
            out, state = units.branch_stress(decays, strain, stiffness, state)
            return out, (signal.time_s[-1:], state)
        sets = max(strain.shape[1], time.shape[1])
        strain, time = (np.broadcast_to(a, (len(a), sets)) for a in (strain, time))
        out = np.empty(strain.shape)
        states = []
        used = np.flatnonzero(stiffness)  # decays take most of the time
        stiffness, units = stiffness[used], units.only(used)
        for j in range(sets):
            one = slice(j, j + 1)
            own = None if state is None else (state[0][one], state[1][one])
            decays = units.decays(time[:, j], None if before is None else before[j])
            part, own = units.branch_stress(decays, strain[:, one], stiffness, own)
            out[:, one] = part
            states.append(own)
        ends, inner = zip(*states, strict=True)
        return out, (time[-1], (np.concatenate(ends), np.concatenate(inner)))

    @staticmethod
    def _through(
        terms: Any, values: Any, signal: Signal, eq: Array, br: Array, memory: Memory
    ) -> Array:
        return measured(
            terms, values, signal.having(equilibrium=eq, branches=br), memory
        )

    def by_recording(self, x: Array) -> list[Array]:
        """Split values (valid,) into one array (n,) for each recording.

        Samples without a measured stress become NaN, so that the arrays match the
        recordings.
        """
        full = np.full(len(self.measured), np.nan)
        full[self.valid] = x
        return np.split(full, self.data.starts[1:-1])
