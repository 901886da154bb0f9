"""Effects that could be meant: where score tests point, and joint refits of those.

An atom is the change of stress that an effect makes, less what the columns of the fit
absorb. Its gain says what a fit could win, without making one; so all effects are asked
from several starts, and those that lead are refitted together with the base, in each
form they have. Nothing is decided here: `evidence` weighs what is found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Effect
from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Guess, Piece, fit, span
from softnn.mismatch.locate import held_only
from softnn.mismatch.verify import intervals

ENTRY = 8.0  # of chi2, below which nothing, and no recording, is worth a refit
BESIDE = 0.02  # of the largest gain: an effect that promises less waits for it
FIRST, LATER = 10, 4  # effects refitted on top of a base, and of an account
FORMS = 4  # of an effect, that are followed where it stands alone or is asked again
WARM = 0.5  # degC, by which the temperature must change to do anything
OFF = 3.5  # standard errors, within which an effect of a recording is off


def candidates(engine: Engine, base: str, fixed: bool) -> list[Effect]:
    """Effects that these recordings and this base could show."""
    warm = all(c.temperature_C is not None for c in engine.chunks)
    warm = warm and engine.data.scales().temperature_C > WARM
    held = held_only(engine)
    return [
        effect
        for effect in EFFECTS
        if (warm or not effect.needs_temperature)
        and not (effect.on_return and held)
        and (fixed or base not in effect.part_of)
    ]


def names(found: Fit) -> list[str]:
    """Ids of the effects in a fit."""
    return [p.effect.id for p in found.guess.pieces if not p.nuisance]


def expand(
    engine: Engine, base: Fit, pool: Sequence[Effect], most: int, forms: int = 1
) -> list[Fit]:
    """Fits with one more effect of the pool each, in the forms that suit it.

    At most so many effects, and forms of each. Those that lead are refitted with their
    core parameters; the few that come near the best then with their shape parameters,
    and from closer starts.
    """
    screen = Screen(engine, base)
    leads: dict[tuple[str, str, bool], Lead] = {}
    for law in pool:
        if law.id in names(base):
            continue
        for form in (law, *law.second_forms):
            for lead in screen.lead(form, ENTRY):
                shared = any(len(g) > 1 for g in lead.piece.groups)
                key = law.id, form.form, shared
                if key not in leads or lead.gain > leads[key].gain:
                    leads[key] = lead
    ranked = sorted(leads.values(), key=lambda lead: -lead.gain)
    ranked = [x for x in ranked if x.gain > max(ENTRY, BESIDE * ranked[0].gain)]
    tried = list(dict.fromkeys(lead.piece.effect.id for lead in ranked))[:most]
    found = [
        refine(engine, base, lead.piece, 6)
        for lead in ranked
        if lead.piece.effect.id in tried
    ]
    if not names(base):
        found += [refine(engine, base, piece, 6) for piece in shown(engine, pool)]
    found = [f for f in found if len(names(f)) > len(names(base))]
    found = _best_forms(found, forms)
    out = []
    for rank, one in enumerate(found):
        near = one.chi2 < base.chi2 - 0.5 * (base.chi2 - found[0].chi2)
        out.append(shaped(engine, screen, one, rank < 3) if rank < 3 or near else one)
    return out


def _best_forms(found: Sequence[Fit], most: int) -> list[Fit]:
    """The fits in order of misfit, at most so many forms of each set of effects."""
    kept: list[Fit] = []
    for one in sorted(found, key=schwarz):
        same = [k for k in kept if names(k) == names(one)]
        twice = any(abs(k.chi2 - one.chi2) < 1e-3 * ENTRY for k in same)
        if len(same) < most and not twice:
            kept.append(one)
    return sorted(kept, key=lambda f: f.chi2)


def shaped(engine: Engine, screen: Screen, found: Fit, closely: bool) -> Fit:
    """The fit with the shape of its newest effect freed, where that is better."""
    held = set(names(screen.base))
    index = next(
        i
        for i, p in enumerate(found.guess.pieces)
        if not p.nuisance and p.effect.id not in held
    )
    tried = [found]
    if closely:
        leads = screen.closer(found.guess.pieces[index].effect, ENTRY)
        lead = max(leads, key=lambda x: x.gain, default=None)
        if lead is not None:
            tried.append(refine(engine, screen.base, lead.piece, 6))
            tried = [t for t in tried if len(names(t)) > len(held)]
    best = min(tried, key=schwarz)
    for inside in (False, True) if closely else (False,):
        best = min(best, release(engine, best, index, inside), key=schwarz)
    return min(best, lifted(engine, best, index), key=schwarz)


def schwarz(found: Fit) -> float:
    """Misfit and a price for each number: which form of one effect to go on with."""
    return found.chi2 + found.parameters * float(np.log(len(found.residual)))


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
        self.q = span(base.free_columns)
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

    def lead(self, effect: Effect, threshold: float) -> list[Lead]:
        """Leads of an effect from each of its starts.

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
            return leads
        leads = self._greedy(pieces, atoms, threshold)
        if in_all(effect) and len(self.engine.chunks) > 1:
            every = (tuple(range(len(self.engine.chunks))),)
            for piece, own in zip(pieces, atoms, strict=True):
                atom = own.sum(axis=1)
                c, gain = _signed(piece, atom, self.residual)
                if gain > 0:
                    leads.append(Lead(replace(_scaled(piece, [c]), groups=every), gain))
        return leads

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


def refine(engine: Engine, base: Fit, piece: Piece, iterations: int = 10) -> Fit:
    """The joint refit with one more piece, recordings it does not touch taken out."""
    pieces = sorted(base.guess.pieces + (piece,), key=lambda p: turn(p.effect))
    guess = Guess(base.guess.units, base.guess.stiffness, tuple(pieces))
    found = fit(engine, guess, fixed_base=base.fixed_base, iterations=iterations)
    return prune(engine, found)


def turn(law: Effect) -> int:
    """When an effect acts."""
    return next(i for i, known in enumerate(EFFECTS) if known.id == law.id)


def prune(engine: Engine, found: Fit) -> Fit:
    """The fit without recordings in which an effect is off within its error."""
    limits = intervals(found)
    pieces, changed = [], False
    for i, piece in enumerate(found.guess.pieces):
        law = piece.effect
        if piece.nuisance or law.amplitude not in law.per_recording:
            pieces.append(piece)
            continue
        off = law.off[law.amplitude]
        values = dict(piece.values)
        kept = []
        for group in piece.groups:
            low, high = limits.get((i, law.amplitude, group), (-np.inf, np.inf))
            middle = float(values[law.amplitude][group[0]])
            sd = max((high - low) / 3.92, 1e-300)
            if abs(middle - off) > OFF * sd:
                kept.append(group)
        if kept and len(kept) < len(piece.groups):
            array = np.array(values[law.amplitude], float)
            gone = [r for g in piece.groups if g not in kept for r in g]
            array[gone] = off
            values[law.amplitude] = array
            changed = True
            piece = replace(piece, values=values, groups=tuple(kept))
        pieces.append(piece)
    if not changed:
        return found
    guess = replace(found.guess, pieces=tuple(pieces))
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=4)


def release(
    engine: Engine, found: Fit, index: int, inside: bool, iterations: int = 10
) -> Fit:
    """The same with the shape parameters of piece `index` freed.

    `inside`: they start a little inside their range; at its end some laws do not move.
    """
    pieces = list(found.guess.pieces)
    piece = pieces[index]
    values = dict(piece.values)
    law = piece.effect
    ends = [p for p in law.parameters if p.name in law.shape and p.scale == "linear"]
    if inside and not ends:
        return found
    for p in ends if inside else ():
        width = 0.03 * (p.high - p.low)
        values[p.name] = float(np.clip(values[p.name], p.low + width, p.high - width))
    names = tuple(p.name for p in piece.effect.parameters)
    pieces[index] = replace(piece, values=values, free=names)
    guess = replace(found.guess, pieces=tuple(pieces))
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=iterations)


def lifted(engine: Engine, found: Fit, index: int, iterations: int = 12) -> Fit:
    """The same with piece `index` in all recordings, and in each by more, as it starts.

    What all recordings have alike of a gap the base takes up, so that the search ends
    where the least has none; only the shape of the law can tell how large it is.
    """
    pieces = list(found.guess.pieces)
    law, name = pieces[index].effect, pieces[index].effect.amplitude
    if name not in law.per_recording or law.some or not law.shape:
        return found
    start = start_pieces(engine, law)[0]
    more = np.add(start.values[name], pieces[index].values[name])
    free = tuple(p.name for p in law.parameters)
    pieces[index] = replace(start, values=start.values | {name: more}, free=free)
    guess = replace(found.guess, pieces=tuple(pieces))
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=iterations)
