"""Candidate effects: score tests propose them, joint refits test them.

Score tests (`screen`) start from several parameter values of each effect. The leading
effects are refitted together with the base, in each form they have. `evidence` then
weighs the fits; this module decides nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn import progress
from softnn.contracts import Effect
from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Guess, Piece, fit
from softnn.mismatch.locate import held_only
from softnn.mismatch.screen import (
    Lead,
    Screen,
    clipped,
    only,
    pieces_at,
    start_pieces,
)
from softnn.mismatch.verify import intervals
from softnn.report.phrases import listed, percent, plain

ENTRY = 8.0  # of chi2; a smaller gain is not worth a refit, nor a recording of its own
BESIDE = 0.02  # of the largest gain; an effect with less is not refitted yet
FIRST, LATER = 10, 4  # effects refitted on top of the base, and of a candidate
FORMS = 4  # forms kept of a single effect, or of an effect that is chosen again
WARM = 0.5  # degC; a smaller change of temperature shows no effect of it
FINE = 11  # starting moments around the best of the coarse ones
OFF = 3.5  # standard errors; an effect of a recording within them is off


def candidates(
    engine: Engine, has: frozenset[str], unknown: frozenset[str] = frozenset()
) -> list[Effect]:
    """Return the effects that these recordings can show.

    Effects that the base `has` already (ids) and forms in `unknown` are out.
    """
    warm = all(c.temperature_C is not None for c in engine.chunks)
    warm = warm and engine.data.scales().temperature_C > WARM
    held = held_only(engine)
    out = []
    for effect in EFFECTS:
        if unknown:
            effect = copy(effect)
            effect.unknown = unknown
        if (
            (warm or not effect.needs_temperature)
            and not (effect.on_return and held)
            and effect.id not in has
        ):
            out.append(effect)
    return out


def names(found: Fit) -> list[str]:
    """Return the ids of the effects in a fit."""
    return [p.effect.id for p in found.guess.pieces if not p.nuisance]


def so_far(engine: Engine, found: Fit) -> None:
    """Tell whoever listens that this fit is the answer as it would be now."""
    missed = engine.share @ (engine.target - found.stress) ** 2
    error = percent(float(np.sqrt(missed / (engine.share @ engine.target**2))))
    effects = [plain(n) for n in dict.fromkeys(names(found))]
    what = f"with {listed(effects)} it" if effects else "the simulation"
    progress.so_far(f"{what} is {error} off")


# What a part of the search is called, by the effects of its candidates.
SIZES = ("one effect", "two effects", "three effects", "four effects")


def expand(
    engine: Engine, base: Fit, pool: Sequence[Effect], most: int, forms: int = 1
) -> list[Fit]:
    """Return fits with one more effect of the pool each, in the forms that suit it.

    `most` limits the effects and `forms` the forms of each. The leading effects are
    refitted with their core parameters. The few near the best are then refitted with
    their shape parameters, and from closer starts.
    """
    screen = Screen(engine, base)
    leads: dict[tuple[str, str, bool], Lead] = {}
    for law in pool:
        if law.id in names(base):
            continue
        for form in law.forms:
            for lead in screen.lead(form, ENTRY):
                shared = any(len(g) > 1 for g in lead.piece.groups)
                key = law.id, form.form, shared
                if key not in leads or lead.gain > leads[key].gain:
                    leads[key] = lead
    ranked = sorted(leads.values(), key=lambda lead: -lead.gain)
    ranked = [x for x in ranked if x.gain > max(ENTRY, BESIDE * ranked[0].gain)]
    of: dict[str, list[Lead]] = {}
    for lead in ranked:
        of.setdefault(lead.piece.effect.id, []).append(lead)
    picked = [
        lead
        for leads_ in list(of.values())[:most]
        for lead in leads_[: forms + 1]  # a score test may be wrong by one place
    ]
    found = []
    for k, lead in enumerate(picked):
        progress.piece(0.5 * k / len(picked))
        found.append(refine(engine, base, lead.piece, 6))
    new = [law for law in pool if law.id not in names(base)]
    found += [refine(engine, base, piece, 6) for piece in shown(engine, new)]
    found = [f for f in found if len(names(f)) > len(names(base))]
    found = _best_forms(found, forms)
    out = []
    for rank, one in enumerate(found):
        progress.piece(0.5 + 0.45 * rank / len(found))
        near = one.chi2 < base.chi2 - 0.5 * (base.chi2 - found[0].chi2)
        out.append(shaped(engine, screen, one, rank < 3) if rank < 3 or near else one)
    return out


def _best_forms(found: Sequence[Fit], most: int) -> list[Fit]:
    """Return fits in order of misfit, at most `most` forms of each set of effects."""
    kept: list[Fit] = []
    for one in sorted(found, key=schwarz):
        same = [k for k in kept if names(k) == names(one)]
        twice = any(abs(k.chi2 - one.chi2) < 1e-3 * ENTRY for k in same)
        if len(same) < most and not twice:
            kept.append(one)
    return sorted(kept, key=lambda f: f.chi2)


def shaped(engine: Engine, screen: Screen, found: Fit, closely: bool) -> Fit:
    """Return the fit with the shape of its newest effect free, if that is better."""
    held = set(names(screen.base))
    index = next(
        i
        for i, p in enumerate(found.guess.pieces)
        if not p.nuisance and p.effect.id not in held
    )
    tried = [found]
    if closely:
        leads = screen.closer(found.guess.pieces[index].effect, ENTRY)
        tried += [refine(engine, screen.base, lead.piece, 6) for lead in leads]
        tried = [t for t in tried if len(names(t)) > len(held)]
    best = min(tried, key=schwarz)
    for inside in (False, True) if closely else (False,):
        best = min(best, release(engine, best, index, inside), key=schwarz)
    best = min(best, lifted(engine, best, index), key=schwarz)
    best = min(best, merged(engine, best, index), key=schwarz)
    return moved(engine, best, index)


def schwarz(found: Fit) -> float:
    """Return misfit plus a price for each parameter; it ranks forms of an effect."""
    return found.chi2 + found.parameters * float(np.log(len(found.residual)))


def shown(engine: Engine, pool: Sequence[Effect]) -> list[Piece]:
    """Return effects that recordings show without a model, in those recordings."""
    data = engine.fine.data
    out: list[Piece] = []
    if data.continued:  # a continued recording does not begin at rest
        return out
    for law in pool:
        known = law.form not in law.unknown
        seen = law.shown(data.chunks, data.stress_MPa) if known else None
        if seen is None:
            continue
        piece = start_pieces(engine, law)[0]
        piece = replace(piece, values=clipped(piece.effect, piece.values | seen))
        name = law.amplitude
        if name in law.per_recording:
            piece = only(piece, np.flatnonzero(piece.values[name] != law.off[name]))
        out.append(piece)
    return out


def refine(engine: Engine, base: Fit, piece: Piece, iterations: int = 10) -> Fit:
    """Return the joint refit with one more piece, off in recordings without it."""
    pieces = sorted(base.guess.pieces + (piece,), key=lambda p: turn(p.effect))
    guess = Guess(base.guess.units, base.guess.stiffness, tuple(pieces))
    found = fit(engine, guess, fixed_base=base.fixed_base, iterations=iterations)
    return prune(engine, found)


def turn(law: Effect) -> int:
    """Return the place of an effect in the order in which effects act."""
    return next(i for i, known in enumerate(EFFECTS) if known.id == law.id)


def prune(engine: Engine, found: Fit) -> Fit:
    """Return the fit without recordings where an effect is zero within its error."""
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
    """Return the fit with the shape parameters of piece `index` free.

    `inside`: start a little inside the range of each; at the end of its range the
    gradient of some laws vanishes.
    """
    piece = found.guess.pieces[index]
    values = dict(piece.values)
    law = piece.effect
    ends = [p for p in law.parameters if p.name in law.shape and p.scale == "linear"]
    if inside and not ends:
        return found
    for p in ends if inside else ():
        width = 0.03 * (p.high - p.low)
        values[p.name] = float(np.clip(values[p.name], p.low + width, p.high - width))
    names = tuple(p.name for p in law.parameters)
    piece = replace(piece, values=values, free=names)
    return _refitted(engine, found, index, piece, iterations)


def lifted(engine: Engine, found: Fit, index: int, iterations: int = 12) -> Fit:
    """Refit with piece `index` in all recordings, each larger by its starting value.

    The base absorbs the gap that all recordings share, so the search ends where the
    smallest gap is zero. Only the shape of the toe reveals the shared gap.
    """
    piece = found.guess.pieces[index]
    law, name = piece.effect, piece.effect.amplitude
    if name not in law.per_recording or law.some or not law.shape:
        return found
    start = start_pieces(engine, law)[0]
    more = np.add(start.values[name], piece.values[name])
    free = tuple(p.name for p in law.parameters)
    start = replace(start, values=start.values | {name: more}, free=free)
    return _refitted(engine, found, index, start, iterations)


def merged(engine: Engine, found: Fit, index: int) -> Fit:
    """Return the fit with one common value in all recordings where a scale is wrong."""
    piece = found.guess.pieces[index]
    if not piece.effect.scatter or len(piece.groups) < 2:
        return found
    name, every = piece.effect.amplitude, np.concatenate(piece.groups)
    value = np.array(piece.values[name])
    value[every] = value[every].mean()
    groups = (tuple(int(r) for r in every),)
    piece = replace(piece, values=piece.values | {name: value}, groups=groups)
    return _refitted(engine, found, index, piece)


def moved(engine: Engine, found: Fit, index: int) -> Fit:
    """Refit with the moment in each recording searched anew, the others in place.

    Gradient descent stops at other moments that also reduce the misfit.
    """
    law, groups = found.guess.pieces[index].effect, found.guess.pieces[index].groups
    moments = [name for name in law.per_recording if name != law.amplitude]
    if not moments:
        return found
    coarse = law.closer(engine.data.scales())[0]
    apart = {m: np.subtract(coarse[1][m], coarse[0][m]) for m in moments}
    for mine in map(np.array, groups):
        now = found.guess.pieces[index]
        shape = {name: now.values[name] for name in law.shape}
        rest = np.setdiff1d(np.concatenate(now.groups), mine)
        less = _refitted(engine, found, index, only(now, rest), 4)
        screen = Screen(engine, less)
        lead = _best(screen, law, [start | shape for start in coarse], mine)
        fine = [
            coarse[0] | shape | {m: lead[m] + share * apart[m] for m in moments}
            for share in np.linspace(-1, 1, FINE)
        ]
        lead = _best(screen, law, fine, mine)
        own = np.isin(np.arange(len(engine.chunks)), mine)
        values = dict(less.guess.pieces[index].values)
        for name in law.per_recording:
            values[name] = np.where(own, lead[name], values[name])
        again = _refitted(engine, less, index, replace(now, values=values))
        found = min(found, again, key=schwarz)
    return found


def _best(
    screen: Screen,
    law: Effect,
    starts: Sequence[dict[str, Any]],
    mine: NDArray[np.integer],
) -> dict[str, Any]:
    """Return the values of the best start for an effect, in these recordings alone."""
    pieces = [only(piece, mine) for piece in pieces_at(screen.engine, law, starts)]
    leads = screen.whole(pieces)
    return max(leads, key=lambda x: x.gain).piece.values if leads else pieces[0].values


def _refitted(
    engine: Engine, found: Fit, index: int, piece: Piece, iterations: int = 10
) -> Fit:
    """Return the fit with another piece in place of piece `index`."""
    pieces = list(found.guess.pieces)
    pieces[index] = piece
    guess = replace(found.guess, pieces=tuple(pieces))
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=iterations)
