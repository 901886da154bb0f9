"""Which physics was left out: one effect and several, forward, swapped and backward.

A later effect must explain what no other form of the earlier ones could: what it may
take up is what is left beyond their distortions (`forms`).
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, field, replace

import numpy as np

from softnn.contracts import Effect
from softnn.effects import effect
from softnn.fit import Engine, Fit, Guess, Piece, fit
from softnn.metrics import nrmse
from softnn.mismatch.base import Baseline, weigh
from softnn.mismatch.contest import (
    ENTRY,
    Rival,
    at_best,
    bent,
    candidates,
    formless,
    lookalikes,
    names,
    prune,
    refine,
    rivals,
    score,
    simplest,
    sponge,
    strangers,
)
from softnn.mismatch.forms import distortions, finer
from softnn.mismatch.gates import LEFT, adds, admitted, enough
from softnn.mismatch.screen import Screen, shown
from softnn.mismatch.siblings import odd_ones
from softnn.mismatch.verify import heldout
from softnn.noise import Noise

MOST_EFFECTS = 3
CLOSE = 1.0  # excess, up to which what is found is the better witness than any sign
ROUGH = 0.08  # of the stress, from which what is left is no noise of a channel
COARSE = 1.5  # misfit over noise, a sample, from which a finer spring may help
FAR = 8.0  # excess of misfit over noise, a sample, that no form here comes near
TRIED = 5  # first effects that are tried against what they leave as noise
SOME = 0.3  # excess that one effect in any form leaves, if there may be two others
PROMISE = 0.3  # of what an effect gains, from which its twins are fitted beside it
TELLING = 4.0  # of score, by which what is mistaken for an effect must be better
TIED = 0.97  # of the gain of the best first effect, from which another is as good
SPONGY = 6  # first effects tried where the best has values in most recordings
STAYS = 0.75  # of what it takes to come in, from which an effect stays
STRANGER_LEAVES = 0.5  # at most, of the excess that the effects leave
KNOWN_TO = 0.05  # or this excess, which coloured noise may be
TEMPER = 10.0  # of a difference of score: no form is true, so it counts a fifth


@dataclass
class Step:
    """One effect taken in: its rivals then, what it gained, the fit with it."""

    rivals: list[Rival]
    gain: float  # of `score`
    fit: Fit


@dataclass
class Explanation:
    """What was found: the effects taken in, and how much is left."""

    base: Baseline
    steps: list[Step]
    final: Fit
    noise: list[Noise]
    threshold: float
    excess_before: float  # whitened misfit over the noise, a sample: base
    excess_after: float  # the same with the effects
    excess_bent: float  # the same with the effects in any form
    first: list[Rival]  # all rivals for the first effect, best first
    strangers: list[Rival]  # laws that are on no list, best first
    beside: dict[str, list[Rival]] = field(default_factory=dict)  # see `twins`
    line: float = 0.0  # of what is left, at one period, over what noise may show there
    shown: Set[str] = frozenset()  # what recordings show by themselves, of the selected

    @property
    def selected(self) -> list[str]:
        return names(self.final)

    @property
    def left(self) -> float:
        """Share of the excess that the effects do not explain."""
        return max(self.excess_after, 0.0) / max(self.excess_before, 1e-9)

    @property
    def likely_strangers(self) -> list[Rival]:
        """Laws on no list that leave little themselves; else they are wrong as well."""
        n = len(self.final.residual)
        much = max(STRANGER_LEAVES * self.excess_after, KNOWN_TO)
        return [s for s in self.strangers if s.fit.chi2 / n - 1 < much]

    @property
    def odds_of_strangers(self) -> float:
        """Weight of what is on no list against the effects taken in, tempered."""
        apart = [score(s.fit) - score(self.final) for s in self.likely_strangers]
        return float(sum(np.exp(np.clip(-x / TEMPER, -50, 50)) for x in apart))


def explain(base: Baseline, rng: np.random.Generator) -> Explanation:
    """Effects that account for what the base misses; none, one or several.

    Where the best account stays far above the noise in any form, none here is close,
    and the noise is not what to weigh by: the search is done again with all samples
    alike. Where it stays above the noise, or what is left is no noise of a channel,
    what recordings show by themselves is there, whatever else is.
    """
    found = search(base, rng)
    engine = base.engine
    signs: list[Piece] = []
    if found.excess_after > CLOSE or rough(engine, found.final):
        signs = shown(engine, candidates(engine, base.name, base.fixed))
    found = beside_signs(base, rng, found, signs)
    found.shown = {p.effect.id for p in signs} & set(found.selected)
    return found


def rough(engine: Engine, found: Fit) -> bool:
    """Whether what is left is more of the stress than a channel's noise ever is.

    Read as noise it is noise of long memory, which would excuse any account.
    """
    return nrmse(found.stress, engine.target) > ROUGH


def beside_signs(
    base: Baseline,
    rng: np.random.Generator,
    found: Explanation,
    signs: Sequence[Piece],
) -> Explanation:
    """The account, made again where something is known or the noise is no measure."""
    engine = base.engine
    if found.excess_bent > FAR and not engine.body:
        engine.body = True
        base.noise = weigh(engine, found.final)
        base.fit = fit(engine, base.fit.guess, fixed_base=base.fixed)
        if not signs:
            found = search(base, rng)
            if odd := apart(base, found):
                again = search(base, rng, [odd], found.first)
                if again.excess_after < LEFT * found.excess_after:
                    found = again
            return found
    elif {p.effect.id for p in signs} <= set(found.selected):
        return found
    return search(base, rng, [*taken(engine, base.fit, signs)], found.first)


def shown_alone(found: Explanation) -> Explanation:
    """The account with what recordings show by themselves, and nothing else."""
    engine, final = found.base.engine, found.final
    pieces = (p for p in final.guess.pieces if p.nuisance or p.effect.id in found.shown)
    guess = replace(final.guess, pieces=tuple(pieces))
    final = fit(engine, guess, fixed_base=found.base.fixed, iterations=8)
    excess = final.chi2 / len(engine.target) - 1
    steps = [s for s in found.steps if s.rivals[0].effect in found.shown]
    return replace(
        found,
        steps=steps or found.steps,
        final=final,
        excess_after=excess,
        excess_bent=excess,
        strangers=[],
    )


def apart(base: Baseline, found: Explanation) -> Rival | None:
    """What sets some recordings apart from others of their programme."""
    engine, final = base.engine, found.final
    shared = tuple(
        p for p in final.guess.pieces if p.nuisance or not p.effect.per_recording
    )
    guess, fixed = replace(final.guess, pieces=shared), base.fixed
    pool = candidates(engine, base.name, fixed)
    odd = odd_ones(engine, fit(engine, guess, fixed_base=fixed, iterations=8), pool)
    if odd is None:
        return None
    clock = time.perf_counter()
    return Rival(
        odd.effect.id, refine(engine, base.fit, odd), time.perf_counter() - clock
    )


def taken(engine: Engine, found: Fit, pieces: Sequence[Piece]) -> Iterator[Rival]:
    """One effect after the other taken in, as they are."""
    for piece in pieces:
        clock = time.perf_counter()
        found = refine(engine, found, piece)
        yield Rival(piece.effect.id, found, time.perf_counter() - clock)


def search(
    base: Baseline,
    rng: np.random.Generator,
    known: Sequence[Rival] = (),
    first: Sequence[Rival] = (),
) -> Explanation:
    """Forward from the base, one effect at a time, then swaps and backward.

    `known` are effects that are there for sure, each fitted with those before it;
    `first` is what competed without them.
    """
    engine, noise = base.engine, base.noise
    pool = candidates(engine, base.name, base.fixed)
    current = base.fit
    steps: list[Step] = []
    first = list(first)
    threshold = ENTRY
    for rival in known:
        steps.append(Step([rival], score(current) - score(rival.fit), rival.fit))
        current = rival.fit
    sure = {rival.effect for rival in known}
    while len(steps) < MOST_EFFECTS + len(sure):
        if not steps:
            first, threshold = rivals(engine, current, pool, rng)
            found = simplest(engine, current, first)
            if not found or not enough(engine, current, found[0].fit, threshold):
                found = reweighed(base, found, threshold)
            if not found:
                break
            current = base.fit
            found[0] = replace(found[0], fit=reformed(engine, found[0].fit))
        else:
            found, limit = further(engine, current, pool, rng)
            if len(steps) == 1 and not known:
                found = beam(engine, base.fit, current, first, found, pool, rng)
            found = admitted(engine, base.fit, current, found, max(limit, threshold))
            if not found:
                break
        gain = score(current) - score(found[0].fit)
        steps.append(Step(found, gain, found[0].fit))
        current = found[0].fit
        if len(steps) == 2:
            current = swap(engine, base.fit, steps)
        if len(steps) > 1:
            current = exchange(engine, current, pool, rng, sure)
        # Better explained is better weighed: the noise is read off what is left.
        noise = weigh(engine, current)
        current = fit(engine, current.guess, fixed_base=base.fixed, iterations=4)
        steps[-1].fit = current
        base.fit = fit(engine, base.fit.guess, fixed_base=base.fixed, iterations=4)
    if len(steps) > 1:
        current = reformed(engine, current)
    current = backward(engine, base.fit, current, threshold, sure)
    current, beside = twins(engine, current, pool, sure)
    if current.chi2 / len(engine.target) > COARSE:
        current = resolved(engine, base, current)
    n = len(engine.target)
    return Explanation(
        base,
        steps,
        current,
        noise,
        threshold,
        base.fit.chi2 / n - 1,
        current.chi2 / n - 1,
        (bent(engine, current) if steps else base.fit.chi2) / n - 1,
        first,
        strangers(engine, base.fit, base.fit.chi2 - current.chi2) if steps else [],
        beside,
    )


def resolved(engine: Engine, base: Baseline, current: Fit) -> Fit:
    """Base and explanation with as many spring segments as the stress asks for."""
    for _ in range(2):
        finest = finer(engine, current, branches_too=False)
        if not score(finest) < score(current) - 20:
            break
        if heldout(engine, finest)[0].sum() > heldout(engine, current)[0].sum():
            break
        current = finest
        base.fit = finer(engine, base.fit, branches_too=False)
    return current


def reweighed(base: Baseline, found: list[Rival], threshold: float) -> list[Rival]:
    """The rivals that do gain enough when the noise is read off what they leave.

    What is missing adds to the noise that a base seems to have, its colour above all,
    and so hides itself; in noise alone a rival changes next to nothing of it.
    """
    engine = base.engine
    for rival in found[:TRIED]:
        if base.fit.chi2 - rival.fit.chi2 < threshold:
            continue
        weigh(engine, rival.fit)
        before = fit(engine, base.fit.guess, fixed_base=base.fixed, iterations=4)
        after = fit(engine, rival.fit.guess, fixed_base=base.fixed, iterations=4)
        if enough(engine, before, after, threshold):
            base.fit = before
            others = [
                replace(
                    r, fit=fit(engine, r.fit.guess, fixed_base=base.fixed, iterations=4)
                )
                for r in found
                if r is not rival
            ]
            return [replace(rival, fit=after), *others]
    weigh(engine, base.fit)
    return []


def further(
    engine: Engine,
    current: Fit,
    pool: Sequence[Effect],
    rng: np.random.Generator,
    most: int = 5,
) -> tuple[list[Rival], float]:
    """Rivals for a further effect, by what no form of the present ones takes up.

    The present effects are held, their distortions projected out of everything; the
    best rivals are then refitted with all of it free. Where no form comes near, there
    is no telling form from effect, and they are judged by the plain misfit.
    """
    if engine.body:
        return rivals(engine, current, pool, rng)
    blind = distortions(engine, current)
    held = tuple(p if p.nuisance else replace(p, free=()) for p in current.guess.pieces)
    free = {p.effect.id: p.free for p in current.guess.pieces if not p.nuisance}
    with engine.blind(blind):
        guess = replace(current.guess, pieces=held)
        start = fit(engine, guess, fixed_base=current.fixed_base, iterations=4)
        found, threshold = rivals(engine, start, pool, rng, most)
    out = []
    for rival in found[:3]:
        clock = time.perf_counter()
        pieces = tuple(
            p if p.nuisance else replace(p, free=free.get(p.effect.id, p.free))
            for p in rival.fit.guess.pieces
        )
        guess = replace(rival.fit.guess, pieces=pieces)
        joint = fit(engine, guess, fixed_base=current.fixed_base, iterations=12)
        joint = prune(engine, joint)
        seconds = rival.seconds + time.perf_counter() - clock
        out.append(Rival(rival.effect, joint, seconds))
    ranked = sorted(out, key=lambda r: formless(engine, r.fit, set(free)))
    return simplest(engine, current, ranked), threshold


def swap(engine: Engine, base: Fit, steps: list[Step]) -> Fit:
    """The last pair, or a rival of the earlier effect with the later one, if better."""
    best = steps[-1].fit
    later = steps[-1].rivals[0].effect
    own = next(p for p in best.guess.pieces if p.effect.id == later and not p.nuisance)
    earlier = steps[-2]
    for rival in earlier.rivals[1:4]:
        if rival.effect == later or rival.fit.chi2 > base.chi2:
            continue
        trial = refine(engine, rival.fit, own, 10)
        # A simpler law may stand for a richer one at a small price: no form is true.
        price = 0.01 * steps[-1].gain if trial.parameters < best.parameters else -6.0
        if score(trial) < score(best) + price:
            best = trial
    return best


def mostly(engine: Engine, base: Fit, found: Fit) -> bool:
    """Whether next to nothing is left of what the base missed, and less by any form."""
    n = len(base.residual)
    little = found.chi2 / n - 1 < 0.1 * (base.chi2 / n - 1)
    return little and bent(engine, found) / n - 1 < SOME


def beam(
    engine: Engine,
    base: Fit,
    current: Fit,
    first: list[Rival],
    found: list[Rival],
    pool: Sequence[Effect],
    rng: np.random.Generator,
) -> list[Rival]:
    """Later effects on top of the next best first ones, where those lead further.

    Two effects together can look like a third, which then comes first alone; and a
    value of its own in most recordings can stand for anything.
    """
    top = score(base) - score(first[0].fit)
    if any(sponge(engine, p) for p in current.guess.pieces):
        others = first[1:SPONGY]
    else:
        near = TIED if mostly(engine, base, current) else 0.3
        others = [r for r in first[1:3] if score(base) - score(r.fit) >= near * top]
    best = found
    price = np.log(len(base.residual))
    for rival in others:
        other, _ = further(engine, rival.fit, pool, rng)
        if not other:
            continue
        new, old = other[0].fit, best[0].fit if best else None
        if old is None or (
            score(new) < score(old) - 20
            and bent(engine, new) + new.parameters * price
            < bent(engine, old) + old.parameters * price
        ):
            best = other
    return best


def exchange(
    engine: Engine,
    found: Fit,
    pool: Sequence[Effect],
    rng: np.random.Generator,
    sure: Set[str],
) -> Fit:
    """Several effects with each in turn given up for what would then come instead."""
    best = found
    for name in names(found):
        if name in sure:
            continue
        kept = tuple(p for p in best.guess.pieces if p.effect.id != name or p.nuisance)
        if len(kept) == len(best.guess.pieces):
            continue
        guess = Guess(best.guess.units, best.guess.stiffness, kept)
        rest = fit(engine, guess, fixed_base=best.fixed_base, iterations=6)
        others, _ = further(engine, rest, pool, rng)
        which = set(names(rest))
        if others and others[0].effect != name:
            new = others[0].fit
            if formless(engine, new, which) < formless(engine, best, which) - 20:
                best = new
    return best


def backward(
    engine: Engine, base: Fit, found: Fit, threshold: float, sure: Set[str]
) -> Fit:
    """The fit without the effects that the others, in any form, can do without."""
    named = names(found)
    spared: list[Fit] = []
    for name in named if len(named) > 1 else []:
        if name in sure:
            continue
        rest = without(engine, found, name)
        if not adds(engine, base, rest, found, threshold, STAYS):
            spared.append(rest)
    if not spared:
        return found
    return backward(engine, base, min(spared, key=score), threshold, sure)


def twins(
    engine: Engine, found: Fit, pool: Sequence[Effect], sure: Set[str]
) -> tuple[Fit, dict[str, list[Rival]]]:
    """The effects with each as what it could be mistaken for, if that fits better.

    The best, and of each effect in it the rivals that were tried in its place.
    """
    best = found
    beside: dict[str, list[Rival]] = {}
    for name in names(found):
        others = lookalikes(name) - set(names(best)) - sure
        if name in sure or not others:
            continue
        rest = without(engine, best, name)
        screen, least = Screen(engine, rest), PROMISE * (rest.chi2 - best.chi2)
        tried = [Rival(name, best, 0.0)]
        for other in pool:
            # A law that contains this one fits no worse, and says no more.
            if other.id not in others or name in other.contains:
                continue
            clock = time.perf_counter()
            laws = (other, *other.second_forms)
            forms = [at_best(engine, screen, law, least) for law in laws]
            if fits := [f for f in forms if f]:
                seconds = time.perf_counter() - clock
                tried.append(Rival(other.id, min(fits, key=score), seconds))
        tried.sort(key=lambda r: score(r.fit))
        ranked = simplest(engine, rest, tried)
        new = ranked[0].fit
        # What fits better and yet needs other forms more is no better account, but for
        # a law that the one there contains.
        simpler = ranked[0] is not tried[0] or ranked[0].effect in effect(name).contains
        if not simpler and (
            score(new) > score(best) - TELLING or bent(engine, new) > bent(engine, best)
        ):
            ranked = sorted(tried, key=lambda r: r.effect != name)
        tried = ranked
        best = tried[0].fit
        if len(names(best)) > 1 or tried[0].effect != name:
            beside[tried[0].effect] = tried
    return best, beside


def reformed(engine: Engine, found: Fit) -> Fit:
    """The same effects, each in the one of its forms that suits it best.

    Where no form here comes near, the one they have.
    """
    if engine.body:
        return found
    for name in names(found):
        own = {p.effect.form for p in found.guess.pieces if p.effect.id == name}
        law = effect(name)
        others = [x for x in (law, *law.second_forms) if x.form not in own]
        if not others:
            continue
        screen = Screen(engine, without(engine, found, name))
        tried = [at_best(engine, screen, x) for x in others]
        best = min((x for x in tried if x), key=score, default=found)
        if score(best) < score(found) - TELLING:
            found = best
    return found


def without(engine: Engine, found: Fit, name: str) -> Fit:
    """The fit with the effect `name` taken out."""
    kept = tuple(p for p in found.guess.pieces if p.effect.id != name or p.nuisance)
    guess = replace(found.guess, pieces=kept)
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=8)
