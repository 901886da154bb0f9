"""Effects that compete: which could be meant, joint refits of those that lead.

The score tests point to a few effects (`screen`); those are refitted jointly with the
base, each in the forms it has, and ranked by what they leave and what they cost.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from softnn import effects
from softnn.contracts import Array, Effect
from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Guess, Piece, fit
from softnn.mismatch.forms import beyond, distortions
from softnn.mismatch.locate import held_only
from softnn.mismatch.screen import Lead, Screen, null_threshold, start_pieces
from softnn.mismatch.strangers import STRANGERS
from softnn.mismatch.verify import intervals

PROMISING = 0.7  # of the threshold: a fit may gain more than a straight line says
ENTRY = 15.0  # of chi2, below which a recording does not enter an effect of its own
NEAR = 0.8  # of the gain of a richer law, from which a simpler one may stand for it
CLOSE = 0.01  # of the gain of a law: no form is true, and by so much it may be ahead
ALIKE = 0.02  # the same where it has values of its own, and a law for all has none
MOST = 0.6  # of the recordings
SOUGHT = 0.2  # of what effects gain, from which a law on no list is fitted
TWO = 2  # recordings, of which any number is most
END = 0.05  # of the way from what is usual to the end of a range, left at that end

# What a base has of its own, so that it cannot be missing from it.
INCLUDED = {
    "hooke": (),
    "sls": (),
    "wiechert": ("relaxation_branch",),
    "pl-sls": ("nonlinear_elasticity",),
    "pl-wiechert": ("relaxation_branch", "nonlinear_elasticity"),
}


def candidates(engine: Engine, base: str, fixed: bool) -> list[Effect]:
    """Effects that these recordings and this base could show."""
    scales = engine.data.scales()
    warm = all(c.temperature_C is not None for c in engine.chunks)
    held = held_only(engine)
    out = []
    for effect in EFFECTS:
        if effect.needs_temperature and not (warm and scales.temperature_C > 0.5):
            continue
        if effect.on_return and held:
            continue
        if not fixed and effect.id in INCLUDED.get(base, ()):
            continue
        if effect.id == "gain_error" and not fixed and len(engine.chunks) < 2:
            continue
        out.append(effect)
    return out


@dataclass
class Rival:
    """An effect tried on top of a fit, at its best form."""

    effect: str
    fit: Fit
    seconds: float


def rivals(
    engine: Engine,
    base: Fit,
    pool: Sequence[Effect],
    rng: np.random.Generator,
    most: int = 8,
) -> tuple[list[Rival], float]:
    """Effects of the pool that pass the score test, refitted, best first; threshold.

    Core parameters first; the few that come near the best then get their second forms
    and their shape parameters.
    """
    screen = Screen(engine, base)
    leads: dict[str, Lead] = {}
    atoms: list[Array] = []
    for effect in pool:
        if any(p.effect.id == effect.id and not p.nuisance for p in base.guess.pieces):
            continue
        for law in (effect, *effect.second_forms):
            own, seen = screen.lead(law, ENTRY)
            atoms += seen
            for lead in own:
                shared = any(len(g) > 1 for g in lead.piece.groups)
                key = f"{effect.id}/{law.form}/{shared}"
                if key not in leads or lead.gain > leads[key].gain:
                    leads[key] = lead
    if not atoms:
        return [], ENTRY
    threshold = null_threshold(screen, atoms, rng)
    passed = sorted(leads.items(), key=lambda kv: -kv[1].gain)
    passed = [kv for kv in passed if kv[1].gain > PROMISING * threshold]
    if not passed:
        return [], threshold
    top = passed[0][1].gain
    found: list[Rival] = []
    tried: set[str] = set()
    for key, lead in passed:
        name = key.split("/")[0]
        # A form may be far from its start, where a score test sees little of it.
        weak = name not in tried and lead.gain < 0.05 * top
        if weak or (name not in tried and len(tried) >= most):
            continue
        tried.add(name)
        clock = time.perf_counter()
        trial = refine(engine, base, lead.piece, 6)
        found.append(Rival(name, trial, time.perf_counter() - clock))
    found = firm(engine, found)
    if not found:
        return [], threshold
    found.sort(key=lambda r: r.fit.chi2)
    best = found[0].fit.chi2
    out: dict[str, Rival] = {}
    for rank, rival in enumerate(found):
        # Within reach of the best: half the way from the base, or among the first.
        near = rival.fit.chi2 < base.chi2 - 0.5 * (base.chi2 - best)
        if rank < 3 or near:
            clock = time.perf_counter()
            index = next(
                i
                for i, p in enumerate(rival.fit.guess.pieces)
                if p.effect.id == rival.effect and not p.nuisance
            )
            if rank < 3:
                law = rival.fit.guess.pieces[index].effect
                rival.fit = min([rival.fit, *closer(engine, screen, law)], key=score)
            for inside in (False, True) if rank < 3 else (False,):
                better = release(engine, rival.fit, index, inside)
                rival.fit = min(rival.fit, better, key=score)
            rival.fit = min(rival.fit, lifted(engine, rival.fit, index), key=score)
            rival.seconds += time.perf_counter() - clock
        if rival.effect not in out or score(rival.fit) < score(out[rival.effect].fit):
            out[rival.effect] = rival
    return sorted(out.values(), key=lambda r: score(r.fit)), threshold


def closer(engine: Engine, screen: Screen, law: Effect) -> list[Fit]:
    """The joint refit of a suspected law from the best of its closer starts."""
    leads = screen.closer(law, ENTRY)
    lead = max(leads, key=lambda x: x.gain, default=None)
    return [refine(engine, screen.base, lead.piece, 6)] if lead else []


def firm(engine: Engine, found: list[Rival]) -> list[Rival]:
    """The rivals without values of their own in most recordings, if no form is near.

    With a number for each recording much is explained, whatever it is that they are of.
    """
    if not engine.body or len(engine.chunks) <= TWO:
        return found
    return [r for r in found if not any(in_most(engine, p) for p in r.fit.guess.pieces)]


def sponge(engine: Engine, piece: Piece, least: float = 0.0) -> bool:
    """Whether an error of some recordings has a value of its own in most of them.

    An error of mounting or zeroing is there in some recordings; what takes a little of
    all of them makes up for the form of another effect. `least`: of the largest value,
    from which a recording counts.
    """
    return piece.effect.some and in_most(engine, piece, least)


def in_most(engine: Engine, piece: Piece, least: float = 0.0) -> bool:
    """Whether an effect has a value of its own in most recordings; see `sponge`."""
    law = piece.effect
    if law.amplitude not in law.per_recording or piece.nuisance or not piece.groups:
        return False
    values = np.abs(np.asarray(piece.values[law.amplitude]) - law.off[law.amplitude])
    many = sum(values[list(g)].max() > least * values.max() for g in piece.groups)
    return bool(many > MOST * len(engine.chunks))


def refine(engine: Engine, base: Fit, piece: Piece, iterations: int = 10) -> Fit:
    """The joint refit with one more piece, recordings it does not touch taken out."""
    pieces = sorted(base.guess.pieces + (piece,), key=lambda p: turn(p.effect))
    guess = Guess(base.guess.units, base.guess.stiffness, tuple(pieces))
    found = fit(engine, guess, fixed_base=base.fixed_base, iterations=iterations)
    return prune(engine, found)


def turn(law: Effect) -> int:
    """When an effect acts; one that is on no list, as the last of the material."""
    for i, known in enumerate(EFFECTS):
        if known.id == law.id or (known.stage == "sensor" and law.stage != "sensor"):
            return i
    return len(EFFECTS)


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
            if abs(middle - off) > 3.5 * sd:
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


def simplest(engine: Engine, before: Fit, found: list[Rival]) -> list[Rival]:
    """The rivals with a simpler law first where a richer one is hardly better.

    A law that contains another (a flow law a linear dashpot) fits what the other makes
    at least as well, and better still whatever else is there. So the simpler one goes
    first where, both distorted, it does as well.
    """
    if not found:
        return found
    best = found[0]
    ahead = score(before) - score(best.fit)
    gain = before.chi2 - best.fit.chi2
    for i, rival in enumerate(found[1:3], start=1):
        close = score(rival.fit) < score(best.fit) + allowance(best, rival) * ahead
        inner = rival.effect in effects.effect(best.effect).contains
        near = before.chi2 - rival.fit.chi2 > NEAR * gain
        if close or (
            inner
            and rival.fit.parameters < best.fit.parameters
            and near
            and bent(engine, rival.fit)
            < bent(engine, best.fit) + (1 - NEAR) * gain / 50
        ):
            return [rival, *found[:i], *found[i + 1 :]]
    return found


def allowance(best: Rival, rival: Rival) -> float:
    """Share of what `best` gains by which `rival` may be behind and yet go first.

    It may where it is the simpler: by numbers, as a law for all recordings beside one
    with values of its own in each, or as it stays within what it can be.
    """
    mine, other = _piece(best), _piece(rival)
    if bool(mine.effect.per_recording) != bool(other.effect.per_recording):
        return ALIKE if mine.effect.per_recording else 0.0
    fewer = len(rival.fit.slots) < len(best.fit.slots)
    return CLOSE if (fewer or ended(mine)) and not ended(other) else 0.0


def ended(piece: Piece) -> bool:
    """Whether the shape of a law went to an end of its range, which is not usual."""
    for p in piece.effect.parameters:
        if p.name not in piece.effect.shape or p.name not in piece.free:
            continue
        low, high, value = p.low, p.high, np.asarray(piece.values[p.name], float)
        if (low, high) == (0, 1):  # a share may well be none or all
            continue
        usual = p.default
        if p.scale == "log":
            low, high, usual = np.log(low), np.log(high), np.log(usual)
            value = np.log(value)
        at_low = value.min() - low < END * (usual - low)
        at_high = high - value.max() < END * (high - usual)
        if at_low or at_high:
            return True
    return False


def _piece(rival: Rival) -> Piece:
    """The piece of a fit that is the rival's own."""
    pieces = rival.fit.guess.pieces
    return next(p for p in pieces if p.effect.id == rival.effect and not p.nuisance)


def at_best(
    engine: Engine, screen: Screen, law: Effect, least: float = 0.0
) -> Fit | None:
    """The joint refit of one more law, its shape freed.

    None where no start promises a gain of `least`.
    """
    leads, _ = screen.lead(law, ENTRY)
    lead = max(leads, key=lambda x: x.gain, default=None)
    if lead is None or lead.gain < least:
        return None
    best = refine(engine, screen.base, lead.piece, 8)
    best = min([best, *closer(engine, screen, law)], key=score)
    own = (p.effect.id == law.id and not p.nuisance for p in best.guess.pieces)
    index = next((i for i, is_it in enumerate(own) if is_it), None)
    if index is None:
        return None
    better = [release(engine, best, index, inside) for inside in (False, True)]
    return min(*better, best, lifted(engine, best, index), key=score)


def strangers(engine: Engine, base: Fit, gain: float = 0.0) -> list[Rival]:
    """What laws on no list make of what a base misses, best first.

    Those that promise at least a share of `gain`, what the effects take up of chi2.
    """
    screen = Screen(engine, base)
    out = []
    for law in STRANGERS:
        clock = time.perf_counter()
        trial = at_best(engine, screen, law, SOUGHT * gain)
        if trial is None:
            continue
        piece = next(p for p in trial.guess.pieces if p.effect.id == law.id)
        if law.strange(piece.values, engine.data.scales()):
            out.append(Rival(law.id, trial, time.perf_counter() - clock))
    return sorted(out, key=lambda r: score(r.fit))


def score(found: Fit) -> float:
    """Whitened misfit and a price for each parameter (Schwarz); less is better."""
    n = len(found.residual)
    return n * np.log(found.chi2 / n) + found.parameters * np.log(n)


def names(found: Fit) -> list[str]:
    return [p.effect.id for p in found.guess.pieces if not p.nuisance]


def bent(engine: Engine, found: Fit) -> float:
    """Misfit of a fit whose effects may all take any form."""
    return beyond(engine, found, distortions(engine, found))


def without_form(
    engine: Engine, found: Fit, which: set[str], flowing: bool = False
) -> float:
    """Misfit of a fit that may also distort the effects named; see `distortions`."""
    return beyond(engine, found, distortions(engine, found, which, flowing))


def formless(engine: Engine, found: Fit, which: set[str]) -> float:
    """`score` of a fit that may also distort the effects named."""
    n = len(found.residual)
    misfit = without_form(engine, found, which)
    return float(n * np.log(misfit / n) + found.parameters * np.log(n))


def lookalikes(name: str) -> set[str]:
    """Effects that the one called `name` is mistaken for, or that are for it."""
    return set(effects.effect(name).twins) | {e.id for e in EFFECTS if name in e.twins}
