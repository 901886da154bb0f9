"""Score tests: how much of a residual each effect could explain.

The score column of an effect is the change of stress that it makes, less the part that
the columns of the fit absorb. Its gain predicts the fall of chi2 without a fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Effect
from softnn.fit import Engine, Fit, Piece, span


@dataclass(frozen=True)
class Lead:
    """An effect that the score test proposes, with the start of its fit."""

    piece: Piece
    gain: float  # of chi2, linearised


def start_pieces(engine: Engine, effect: Effect) -> list[Piece]:
    """Return a piece for each start of an effect: core parameters free, all on."""
    scales = engine.data.scales()
    effect = effect.within(scales)
    return pieces_at(engine, effect, effect.starts(scales))


def pieces_at(
    engine: Engine, effect: Effect, starts: Sequence[Mapping[str, Any]]
) -> list[Piece]:
    """Return a piece for each of these starts; see `start_pieces`."""
    r = len(engine.chunks)
    out = []
    fixed = effect.defaults()
    for start in starts:
        values: dict[str, Any] = fixed | dict(start)
        for p in effect.parameters:
            inside = np.clip(values[p.name], p.low, p.high)
            if p.name in effect.per_recording:
                values[p.name] = np.broadcast_to(inside, (r,)).astype(float)
            else:
                values[p.name] = float(inside)
        on = {name for name, off in effect.off.items() if np.any(start[name] != off)}
        free = tuple(
            p.name
            for p in effect.parameters
            if p.name not in effect.shape or p.name in on
        )
        groups = tuple((i,) for i in range(r)) if effect.per_recording else ()
        out.append(Piece(effect, values, free, groups))
    return out


def in_all(effect: Effect) -> bool:
    """Return whether an effect of single recordings may be equal in all of them."""
    return len(effect.per_recording) == 1 and not effect.some


def only(piece: Piece, recordings: NDArray[np.integer]) -> Piece:
    """Return the piece in these recordings, off in the others."""
    values = dict(piece.values)
    for name, off in piece.effect.off.items():
        array = np.full(len(values[name]), off)
        array[recordings] = values[name][recordings]
        values[name] = array
    groups = tuple((int(r),) for r in sorted(recordings))
    return replace(piece, values=values, groups=groups)


class Screen:
    """Score tests at one fit: its residual, and the columns that the fit absorbs."""

    def __init__(self, engine: Engine, base: Fit) -> None:
        self.engine, self.base = engine, base
        self.q = span(base.free_columns)
        self.residual = base.residual - self.q @ (self.q.T @ base.residual)

    def project(self, atoms: Array) -> Array:
        return atoms - self.q @ (self.q.T @ atoms)

    def lead(self, effect: Effect, threshold: float) -> list[Lead]:
        """Return proposals of an effect from each of its starts.

        An effect of single recordings is tried in each recording, and with one common
        value in all: an effect too small to see in one may be visible in all.
        """
        pieces = start_pieces(self.engine, effect)
        change = self._changes(pieces)
        if not effect.per_recording:
            return self.whole(pieces, change)
        leads = self._greedy(pieces, change, threshold)
        if in_all(effect) and len(self.engine.chunks) > 1:
            every = (tuple(range(len(self.engine.chunks))),)
            for lead in self.whole(pieces, change):
                leads.append(replace(lead, piece=replace(lead.piece, groups=every)))
        return leads

    def closer(self, effect: Effect, threshold: float) -> list[Lead]:
        """Return proposals of an effect from its closer starts, one of each shape."""
        scales = self.engine.data.scales()
        effect = effect.within(scales)
        out = []
        for starts in effect.closer(scales):
            pieces = pieces_at(self.engine, effect, starts)
            out += self._greedy(pieces, self._changes(pieces), threshold)
        return out

    def _changes(self, pieces: Sequence[Piece]) -> Array:
        """Return the whitened change of stress (valid, pieces) by each piece."""
        return self.engine.whiten(self.engine.by_each(self.base.guess, pieces))

    def whole(self, pieces: Sequence[Piece], change: Array | None = None) -> list[Lead]:
        """Return a proposal from each piece, in all its recordings."""
        change = self._changes(pieces) if change is None else change
        size = (change**2).sum(axis=0) - ((self.q.T @ change) ** 2).sum(axis=0)
        c, gain = _signed(bounds(pieces), size, change.T @ self.residual)
        return [
            Lead(_scaled(piece, float(by)), float(won))
            for piece, by, won in zip(pieces, c, gain, strict=True)
            if won > 0
        ]

    def _greedy(
        self, pieces: Sequence[Piece], change: Array, threshold: float
    ) -> list[Lead]:
        """Add recordings one by one, each from the start that suits it best.

        Works on the products of all score columns; a chosen column is swept out.
        """
        starts, recordings = len(pieces), len(self.engine.chunks)
        gram = np.zeros((recordings * starts,) * 2)
        taken = np.empty((self.q.shape[1], recordings * starts))
        dot = np.empty(recordings * starts)
        for r in range(recordings):
            mine, rows = slice(r * starts, (r + 1) * starts), self.engine.owner == r
            own = change[rows]
            gram[mine, mine] = own.T @ own
            taken[:, mine] = self.q[rows].T @ own
            dot[mine] = own.T @ self.residual[rows]
        gram -= taken.T @ taken
        whole = np.maximum(np.diag(gram), 1e-300)
        ends = np.tile(bounds(pieces), recordings)
        chosen: dict[int, tuple[int, float]] = {}
        total = 0.0
        # A mistaken scale in some recordings needs others that are right.
        limit = recordings - int(pieces[0].effect.some)
        while len(chosen) < limit:
            size = np.diag(gram).copy()
            c, gain = _signed(ends, size, dot)
            # A column that the chosen ones absorb adds nothing.
            gain[size < 0.02 * whole] = 0.0
            for g in chosen:
                gain[g * starts : (g + 1) * starts] = 0.0
            best = int(np.argmax(gain))
            if gain[best] < max(threshold, 1e-300):
                break
            chosen[best // starts] = best % starts, float(c[best])
            total += float(gain[best])
            column = gram[best] / size[best]
            dot = dot - column * dot[best]
            gram -= np.outer(column, gram[best])
        if not chosen:
            return []
        effect = pieces[0].effect
        values = {
            k: np.array(v) if np.ndim(v) else v for k, v in pieces[0].values.items()
        }
        for name, off in effect.off.items():
            if name in effect.per_recording:
                values[name] = np.full(len(self.engine.chunks), off)
        for g, (s, by) in chosen.items():
            for name in effect.per_recording:
                begun = float(pieces[s].values[name][g])
                values[name][g] = begun * by if name == effect.amplitude else begun
        values = clipped(effect, values)
        groups = tuple((g,) for g in sorted(chosen))
        return [Lead(Piece(effect, values, pieces[0].free, groups), total)]


def bounds(pieces: Sequence[Piece]) -> Array:
    """Return the multiples (2, pieces) of a start that its range allows, up to 4."""
    out = []
    for piece in pieces:
        effect, low, high = piece.effect, 0.0, 1.5
        p = next(p for p in effect.parameters if p.name == effect.amplitude)
        values = np.atleast_1d(piece.values[effect.amplitude])
        if effect.off.get(effect.amplitude) == 0.0:
            ends = np.array([p.low, p.high]) / values[np.argmax(np.abs(values))]
            low, high = max(ends.min(), -4.0), min(ends.max(), 4.0)
        out.append((low, high))
    return np.array(out).T


def _signed(bounds: Array, size: Array, dot: Array) -> tuple[Array, Array]:
    """Return the best multiple of each column in its range, and its gain of chi2.

    Both are (columns,). `size` and `dot` are the products of a column with itself and
    with the residual.
    """
    there = size > 1e-12
    c = np.clip(dot / np.where(there, size, 1.0), *bounds) * there
    return c, c * (2 * dot - c * size)


def _scaled(piece: Piece, by: float) -> Piece:
    effect = piece.effect
    values = dict(piece.values)
    if effect.off.get(effect.amplitude) == 0.0:
        factor = by if abs(by) > 0.05 else np.copysign(0.05, by)
        # Some effects are off where several parameters are zero: scale all of them.
        for name in (n for n, off in effect.off.items() if off == 0.0):
            values[name] = values[name] * factor
    return replace(piece, values=clipped(effect, values))


def clipped(effect: Effect, values: dict[str, Any]) -> dict[str, Any]:
    out = dict(values)
    for p in effect.parameters:
        out[p.name] = np.clip(out[p.name], p.low, p.high)
        if np.ndim(out[p.name]) == 0:
            out[p.name] = float(out[p.name])
    return out
