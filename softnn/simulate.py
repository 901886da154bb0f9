"""Base simulation + effects + imposed history -> stress.

A history is a list of chunks, one a recording. Each starts on a virgin, relaxed
specimen, or goes on from the one before (`continued`). Effects act in the order given,
rig and material hooks before the model, material and sensor hooks after it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softnn.contracts import Array, Chunk, Effect, InputError, Signal
from softnn.models.base import Base


@dataclass(frozen=True)
class Term:
    """An effect with its values; those of `per_recording` parameters (recordings,)."""

    effect: Effect
    values: dict[str, Any] = field(default_factory=dict)

    def each(self, recordings: int) -> list[dict[str, Array]]:
        """Return the values for each recording, as the hooks want them, unchecked.

        A parameter that is a single number, or not `per_recording`, is equal in all.
        """
        ready = {k: np.atleast_1d(np.asarray(v, float)) for k, v in self.values.items()}
        own = [k for k in self.effect.per_recording if np.ndim(self.values[k])]
        for k in own:
            if len(ready[k]) < recordings:
                raise InputError(
                    f"{len(ready[k])} values of {k} for {recordings} recordings; "
                    "give one for each"
                )
        if not own:
            return [ready] * recordings
        return [
            ready | {k: ready[k][r : r + 1] for k in own} for r in range(recordings)
        ]


Memory = dict[tuple[int, str], Any]


def reach(
    terms: Sequence[Term],
    values: Sequence[Mapping[str, Array]],
    chunk: Chunk,
    m: Memory,
) -> Signal:
    """Return the strains that reach springs and branches, (n, sets)."""
    strain = np.asarray(chunk.strain, float)
    strain = strain[:, None] if strain.ndim == 1 else strain
    begun = float(chunk.time_s[0])
    signal = Signal(chunk.time_s, strain, strain, begun, chunk.temperature_C)
    for stage in ("rig", "material"):
        for i, term in enumerate(terms):
            if term.effect.stage == stage and term.effect.acts_before:
                key = (i, "before")
                signal, m[key] = term.effect.before(values[i], signal, m.get(key))
    return signal


def to_model(signal: Signal) -> Chunk:
    """Return the input of the model for one set: strains, and the time of branches."""
    own = signal.branch_time_s
    time = signal.time_s if own is None else own[:, 0]
    parts = tuple(
        (np.broadcast_to(w, e.shape)[:, 0], e[:, 0]) for w, e in signal.branch_parts
    )
    strain, branch_strain = signal.strain[:, 0], signal.branch_strain[:, 0]
    return Chunk(time, strain, None, branch_strain, parts)


def measured(
    terms: Sequence[Term],
    values: Sequence[Mapping[str, Array]],
    signal: Signal,
    m: Memory,
) -> Array:
    """Return the recorded stress (n, sets) from `equilibrium` and `branches`."""
    for i, term in enumerate(terms):
        if term.effect.stage != "sensor":
            key = (i, "after")
            signal, m[key] = term.effect.after(values[i], signal, m.get(key))
    assert signal.equilibrium is not None  # set by the caller
    assert signal.branches is not None
    signal = signal.having(stress=signal.equilibrium + signal.branches)
    for i, term in enumerate(terms):
        if term.effect.stage == "sensor":
            key = (i, "after")
            signal, m[key] = term.effect.after(values[i], signal, m.get(key))
    assert signal.stress is not None
    return signal.stress


def run_on(chunks: Sequence[Chunk], continued: bool) -> list[Chunk]:
    """Return the chunks with running times, if `continued` ones restart at zero.

    They continue after a typical step or the first step: holds are often recorded
    slowly.
    """
    if not continued:
        return list(chunks)
    out: list[Chunk] = []
    for chunk in chunks:
        time = chunk.time_s
        if out and time[0] < out[-1].time_s[-1]:
            steps = np.diff(time)
            step = min(np.median(steps), steps[0]) if len(steps) else 0.0
            time = time - time[0] + out[-1].time_s[-1] + step
        out.append(replace(chunk, time_s=time))
    return out


def simulate(
    units: Base,
    stiffness: ArrayLike,
    terms: Sequence[Term],
    chunks: Sequence[Chunk],
    continued: bool = False,
) -> list[Array]:
    """Return the stress [MPa] (n,) of each chunk. stiffness [MPa]: springs first.

    >>> from softnn.models.units import Units
    >>> one = Units("hooke", (0.0, 1.0))
    >>> pull = Chunk(np.array([0.0, 1.0]), np.array([0.0, 0.2]))
    >>> simulate(one, [3.0], [], [pull])[0].round(3).tolist()
    [0.0, 0.6]
    """
    k = np.asarray(stiffness, float)
    if k.shape != (units.columns,):
        raise InputError(
            f"{k.shape} stiffnesses; base {units.name} has {units.columns}"
        )
    every = []
    for term in terms:
        term.effect.prepare(term.values)  # raises on values out of range
        every.append(term.each(len(chunks)))
    out: list[Array] = []
    memory: Memory = {}
    state = None
    for r, chunk in enumerate(run_on(chunks, continued)):
        if not continued:
            memory, state = {}, None
        values = [own[r] for own in every]
        signal = reach(terms, values, chunk, memory)
        springs, branches, state = units.respond(to_model(signal), state)
        signal = signal.having(
            equilibrium=(springs @ k[: units.segments])[:, None],
            branches=(branches @ k[units.segments :])[:, None],
        )
        out.append(measured(terms, values, signal, memory)[:, 0])
    return out
