"""Score tests: how much of what is left could an effect take up?

An atom is the change of stress that an effect makes, less what the columns of the fit
absorb. Its gain says what a fit could win, without making one; so all effects are asked
from several starts, and a bootstrap of the largest gain in noise sets the threshold.
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
    """An effect that the score test points to, with where to start its fit."""

    piece: Piece
    gain: float  # of chi2, linearised


def start_pieces(engine: Engine, effect: Effect) -> list[Piece]:
    """A piece for each start of an effect: core parameters free, all recordings on."""
    scales = engine.data.scales()
    effect = effect.within(scales)
    return pieces_at(engine, effect, effect.starts(scales))


def pieces_at(
    engine: Engine, effect: Effect, starts: Sequence[Mapping[str, Any]]
) -> list[Piece]:
    """A piece for each of these starts; see `start_pieces`."""
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
        free = tuple(p.name for p in effect.parameters if p.name not in effect.shape)
        groups = tuple((i,) for i in range(r)) if effect.per_recording else ()
        out.append(Piece(effect, values, free, groups))
    return out


def in_all(effect: Effect) -> bool:
    """Whether an effect of single recordings may be one and the same in all."""
    return len(effect.per_recording) == 1 and not effect.some


def only(piece: Piece, recordings: NDArray[np.integer]) -> Piece:
    """The piece in these recordings, off in the others."""
    values = dict(piece.values)
    for name, off in piece.effect.off.items():
        array = np.full(len(values[name]), off)
        array[recordings] = values[name][recordings]
        values[name] = array
    groups = tuple((int(r),) for r in sorted(recordings))
    return replace(piece, values=values, groups=groups)


def shown(engine: Engine, pool: Sequence[Effect]) -> list[Piece]:
    """Effects that recordings show by themselves, in those that do."""
    data = (engine.fine or engine).data
    out: list[Piece] = []
    if data.continued:  # what went before is not at rest
        return out
    for law in pool:
        seen = law.shown(data.chunks, data.stress_MPa)
        if seen is None:
            continue
        piece = start_pieces(engine, law)[0]
        piece = replace(piece, values=_clipped(piece.effect, piece.values | seen))
        name = law.amplitude
        if name in law.per_recording:
            piece = only(piece, np.flatnonzero(piece.values[name] != law.off[name]))
        out.append(piece)
    return out


class Screen:
    """Score tests at one fit: the residual, and what the fit can still absorb."""

    def __init__(self, engine: Engine, base: Fit) -> None:
        self.engine, self.base = engine, base
        live = np.concatenate(
            [
                (base.guess.stiffness > 0) & (not base.fixed_base),
                np.ones(len(base.slots), bool),
            ]
        )
        columns = base.jacobian[:, live]
        self.q = span(columns)
        self.residual = base.residual - self.q @ (self.q.T @ base.residual)
        self.plain: Array | None = None  # stress of the fit, once it is asked for

    def project(self, atoms: Array) -> Array:
        return atoms - self.q @ (self.q.T @ atoms)

    def atoms(self, piece: Piece) -> Array:
        """Whitened, absorbed-free change of stress (valid, groups or 1) of a piece."""
        guess = self.base.guess
        with_it = replace(guess, pieces=guess.pieces + (piece,))
        changed, _ = self.engine.run(with_it, False)
        if self.plain is None:
            self.plain, _ = self.engine.run(guess, False)
        change = changed - self.plain
        if not piece.groups:
            return self.project(self.engine.whiten(change[:, None]))
        parts = np.stack(
            [
                np.where(np.isin(self.engine.owner, g), change, 0.0)
                for g in piece.groups
            ],
            axis=1,
        )
        return self.project(self.engine.whiten(parts))

    def lead(self, effect: Effect, threshold: float) -> tuple[list[Lead], list[Array]]:
        """Leads of an effect from each of its starts; and all atoms, for the null.

        One of single recordings is asked for in each, and as the same in all of them:
        what is too small to be seen in any may be seen in all.
        """
        pieces = start_pieces(self.engine, effect)
        atoms = [self.atoms(p) for p in pieces]
        if not effect.per_recording:
            leads = []
            for piece, atom in zip(pieces, atoms, strict=True):
                c, gain = _signed(piece, atom[:, 0], self.residual)
                if gain > 0:
                    leads.append(Lead(_scaled(piece, [c]), gain))
            return leads, atoms
        leads = self._greedy(pieces, atoms, threshold)
        if in_all(effect) and len(self.engine.chunks) > 1:
            every = (tuple(range(len(self.engine.chunks))),)
            for piece, own in zip(pieces, list(atoms), strict=True):
                atom = own.sum(axis=1)
                atoms.append(atom[:, None])
                c, gain = _signed(piece, atom, self.residual)
                if gain > 0:
                    leads.append(Lead(replace(_scaled(piece, [c]), groups=every), gain))
        return leads, atoms

    def closer(self, effect: Effect, threshold: float) -> list[Lead]:
        """Leads of an effect from its closer starts, one of each shape."""
        scales = self.engine.data.scales()
        effect = effect.within(scales)
        out = []
        for starts in effect.closer(scales):
            pieces = pieces_at(self.engine, effect, starts)
            out += self._greedy(pieces, [self.atoms(p) for p in pieces], threshold)
        return out

    def _greedy(
        self, pieces: list[Piece], atoms: list[Array], threshold: float
    ) -> list[Lead]:
        """Recordings one after the other, each from the start that suits it best."""
        residual = self.residual
        basis = np.zeros((len(residual), 0))
        chosen: dict[int, tuple[int, float]] = {}
        total = 0.0
        # A mistake in some recordings is one only beside others that are right.
        limit = len(pieces[0].groups) - int(pieces[0].effect.some)
        for _ in range(len(pieces[0].groups)):
            best = (0.0, -1, -1, 0.0)
            for s, (piece, atom) in enumerate(zip(pieces, atoms, strict=True)):
                left = atom - basis @ (basis.T @ atom)
                # What is absorbed by what is in already tells nothing new.
                share = (left**2).sum(axis=0) / np.maximum(
                    (atom**2).sum(axis=0), 1e-300
                )
                for g in range(len(piece.groups)):
                    if g in chosen or share[g] < 0.02:
                        continue
                    c, gain = _signed(piece, left[:, g], residual)
                    if gain > best[0]:
                        best = (gain, s, g, c)
            gain, s, g, c = best
            if g < 0 or gain < threshold or len(chosen) >= limit:
                break
            left = atoms[s][:, g] - basis @ (basis.T @ atoms[s][:, g])
            unit = left / np.linalg.norm(left)
            basis = np.concatenate([basis, unit[:, None]], axis=1)
            residual = residual - unit * (unit @ residual)
            chosen[g] = (s, c)
            total += gain
        if not chosen:
            return []
        effect = pieces[0].effect
        values = {
            k: np.array(v) if np.ndim(v) else v for k, v in pieces[0].values.items()
        }
        for name, off in effect.off.items():
            if name in effect.per_recording:
                values[name] = np.full(len(self.engine.chunks), off)
        for g, (s, c) in chosen.items():
            for name in effect.per_recording:
                own = float(pieces[s].values[name][g])
                values[name][g] = own * c if name == effect.amplitude else own
        values = _clipped(effect, values)
        groups = tuple(pieces[0].groups[g] for g in sorted(chosen))
        return [Lead(Piece(effect, values, pieces[0].free, groups), total)]


def _bounds(piece: Piece) -> tuple[float, float]:
    """Multiples of the start's amplitude that the parameter's range allows, up to 4."""
    effect = piece.effect
    p = next(p for p in effect.parameters if p.name == effect.amplitude)
    value = float(np.max(np.abs(piece.values[effect.amplitude])))
    if effect.off.get(effect.amplitude) != 0.0:
        return 0.0, 1.5
    return max(p.low / value, -4.0), min(p.high / value, 4.0)


def _signed(piece: Piece, atom: Array, residual: Array) -> tuple[float, float]:
    """Best multiple of an atom within its range, and the gain of chi2."""
    size = float(atom @ atom)
    if size < 1e-12:
        return 0.0, 0.0
    dot = float(atom @ residual)
    low, high = _bounds(piece)
    c = float(np.clip(dot / size, low, high))
    return c, c * (2 * dot - c * size)


def _scaled(piece: Piece, c: Sequence[float]) -> Piece:
    effect = piece.effect
    values = dict(piece.values)
    if effect.off.get(effect.amplitude) == 0.0:
        factor = c[0] if abs(c[0]) > 0.05 else np.copysign(0.05, c[0])
        values[effect.amplitude] = values[effect.amplitude] * factor
    return replace(piece, values=_clipped(effect, values))


def _clipped(effect: Effect, values: dict[str, Any]) -> dict[str, Any]:
    out = dict(values)
    for p in effect.parameters:
        out[p.name] = np.clip(out[p.name], p.low, p.high)
        if np.ndim(out[p.name]) == 0:
            out[p.name] = float(out[p.name])
    return out


def null_threshold(
    screen: Screen,
    atoms: Sequence[Array],
    rng: np.random.Generator,
    level: float = 0.99,
) -> float:
    """Quantile of the largest score of any atom when nothing but noise is left.

    The bootstrap draws whitened noise, refits the base to it (the projection), and
    takes the largest gain over all effects and starts.
    """
    s = np.concatenate(atoms, axis=1)
    norm = np.linalg.norm(s, axis=0)
    s = s[:, norm > 1e-6] / norm[norm > 1e-6]
    if s.shape[1] == 0:
        return 10.0
    largest = []
    for _ in range(8):
        noise = rng.standard_normal((s.shape[0], 25))
        largest.append(((s.T @ screen.project(noise)) ** 2).max(axis=0))
    return float(np.quantile(np.concatenate(largest), level))
