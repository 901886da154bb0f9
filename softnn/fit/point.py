"""Data types of a fit: recordings, a point of the search, its free parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Chunk, Effect, Scales
from softnn.metrics import weights
from softnn.models.base import Base
from softnn.simulate import Term

ONE_SIDED = 0.1  # share of the largest strain; less on the other side does not count


@dataclass(frozen=True)
class Data:
    """Recordings for a fit: strain without gaps, stress [MPa] with NaN as mask.

    `continued` is set where each recording goes on from the one before.
    """

    names: tuple[str, ...]
    chunks: tuple[Chunk, ...]
    stress_MPa: tuple[Array, ...]
    continued: bool = False
    simulated_MPa: tuple[Array, ...] | None = None

    @cached_property
    def starts(self) -> Array:
        """Index of the first sample of each recording, and the end of the last one."""
        return np.concatenate([[0], np.cumsum([len(s) for s in self.stress_MPa])])

    @cached_property
    def weights(self) -> tuple[Array, ...]:
        """Weight of each sample in an error (n,), by recording: `metrics.weights`.

        All recordings weigh alike, however many samples they have.
        """
        mean = self.starts[-1] / len(self.chunks)
        return tuple(
            mean / len(c.time_s) * weights(c.time_s, c.strain) for c in self.chunks
        )

    def scales(self) -> Scales:
        """Typical sizes, from which searches start; quantiles limit spikes.

        Strain is a fraction, stress in MPa, times in s; see `softnn.contracts.Scales`.
        """
        strain = np.concatenate([c.strain for c in self.chunks])
        push, pull, reach = -strain.min(), strain.max(), np.abs(strain).max()
        stress = np.abs(np.concatenate(self.stress_MPa))
        steps = np.concatenate([np.diff(c.time_s) for c in self.chunks])
        warm = [c.temperature_C for c in self.chunks if c.temperature_C is not None]
        spread = np.concatenate(warm) if warm else np.zeros(1)
        return Scales(
            strain=float(reach),
            stress_MPa=float(np.nanquantile(stress, 0.998)),
            interval_s=float(np.median(steps[steps > 0])),
            duration_s=np.array([c.time_s[-1] - c.time_s[0] for c in self.chunks]),
            temperature_C=float(np.nanmax(spread) - np.nanmin(spread)),
            side=int(push < ONE_SIDED * reach) - int(pull < ONE_SIDED * reach),
        )


@dataclass(frozen=True)
class Piece:
    """An effect instance in a fit: its values, its free parameters, its recordings.

    `groups` are the sets of recordings that share one value of each `per_recording`
    parameter; the effect stays off in recordings of no group.
    """

    effect: Effect
    values: dict[str, Any]
    free: tuple[str, ...]
    groups: tuple[tuple[int, ...], ...] = ()
    nuisance: bool = False  # a random effect of specimens, always in the model
    unsaid: bool = False  # of unlabelled specimens

    def term(self) -> Term:
        """The piece as a term of a simulation (`softnn.simulate`)."""
        return Term(self.effect, self.values)


@dataclass(frozen=True)
class Guess:
    """A point of the search: base, stiffnesses (columns,) in MPa, effect instances.

    Springs come first among the stiffnesses, then branches, in the order of `units`.
    """

    units: Base
    stiffness: Array
    pieces: tuple[Piece, ...] = ()

    def terms(self) -> list[Term]:
        return [p.term() for p in self.pieces]


def with_stress(guess: Guess, one: float) -> Guess:
    """Return the guess in MPa, if a stress of `one` MPa counted as 1 in the fit."""

    def value(piece: Piece, name: str, found: Any) -> Any:
        law = piece.effect
        power = next(p.per_stress for p in law.parameters if p.name == name)
        return found * one**-power if power else found

    pieces = (
        replace(p, values={k: value(p, k, v) for k, v in p.values.items()})
        for p in guess.pieces
    )
    return Guess(guess.units, one * guess.stiffness, tuple(pieces))


@dataclass(frozen=True)
class Slot:
    """One free parameter of a guess beside its stiffnesses; piece -1 is the base.

    `inside` maps a value to the coordinate of the search (its logarithm, or a multiple
    of `typical`), `outside` maps it back.
    """

    piece: int
    name: str
    recordings: tuple[int, ...] | None  # None: shared by all
    logarithmic: bool
    low: float
    high: float
    typical: float

    def inside(self, value: float) -> float:
        """Coordinate of the search for a value in its own unit."""
        return float(np.log(value)) if self.logarithmic else value / self.typical

    def outside(self, value: float) -> float:
        """Value in its own unit for a search coordinate, clipped to the range."""
        v = np.exp(value) if self.logarithmic else value * self.typical
        return float(np.clip(v, self.low, self.high))


def slots(guess: Guess) -> list[Slot]:
    """List the free parameters of a guess, without the stiffnesses.

    They are those of the base (`Base.nonlinear`), then the free parameters of each
    effect, one for each group of recordings where the parameter is per recording.
    """
    out = [
        Slot(-1, p.name, None, p.scale == "log", p.low, p.high, abs(p.default) or 1.0)
        for p in guess.units.nonlinear
    ]
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
    """Return the value of a slot in a guess, in the unit of its parameter."""
    if slot.piece < 0:
        return next(p.default for p in guess.units.nonlinear if p.name == slot.name)
    value = guess.pieces[slot.piece].values[slot.name]
    return float(value if slot.recordings is None else value[slot.recordings[0]])


def put(guess: Guess, where: Sequence[Slot], values: Sequence[float]) -> Guess:
    """Return a copy of the guess with other values in the slots `where`.

    Values are in the units of the parameters; ranges are not checked.
    """
    pieces = [dict(p.values) for p in guess.pieces]
    base = dict[str, float]()
    for slot, value in zip(where, values, strict=True):
        if slot.piece < 0:
            base[slot.name] = value
        elif slot.recordings is None:
            pieces[slot.piece][slot.name] = value
        else:
            array = np.array(pieces[slot.piece][slot.name], float)
            array[list(slot.recordings)] = value
            pieces[slot.piece][slot.name] = array
    return Guess(
        guess.units.having(base) if base else guess.units,
        guess.stiffness,
        tuple(replace(p, values=v) for p, v in zip(guess.pieces, pieces, strict=True)),
    )


def apart(
    terms: Sequence[Term], values: Sequence[Mapping[str, Array]], sets: int
) -> NDArray[np.intp]:
    """Return the indices of the first set and of all sets that may differ from it.

    An effect that is off does nothing, whatever its other parameters are.
    """
    differs = np.zeros(sets, bool)
    for term, own in zip(terms, values, strict=True):
        other, off = np.zeros(sets, bool), np.ones(sets, bool)
        for name, value in own.items():
            other |= value != value[0]
            if name in term.effect.off:
                off &= value == term.effect.off[name]
        differs |= other & ~(off & off[0])
    return np.append(0, np.flatnonzero(differs))
