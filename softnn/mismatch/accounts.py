"""Search for candidate models: sets of effects that could explain a mismatch.

A beam search. The base gets one effect, the best of these candidates another, as long
as the evidence grows. The beam is wide at first and narrow later.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from softnn import progress
from softnn.contracts import Array, Effect
from softnn.fit import Engine, Fit, Guess, Piece, fit
from softnn.mismatch.base import CLASS, Baseline, each_apart, scatter, weigh, weigh_by
from softnn.mismatch.candidates import (
    FIRST,
    FORMS,
    LATER,
    SIZES,
    candidates,
    expand,
    names,
    refine,
    so_far,
)
from softnn.mismatch.evidence import SCATTER, Evidence, Weigher, mistaken
from softnn.mismatch.specimens import shared
from softnn.noise import Noise

EXPANDED = (3, 1)  # beam width: candidates of one and of two effects that get one more
PRICE = 5.0  # nats, price of each effect during the search
ALIKE = 5.0  # nats within which another form of an effect counts as equally good
FAR = 30.0  # nats behind the best, beyond which a set of several effects is dropped
ASKED = 4  # sets of several effects whose effects are each chosen again
KEPT = 12  # sets of several effects kept until the noise is settled
TOLD = 0.02  # nats a sample; a larger change means that the noise is different
NEAR = 10.0  # nats by which models with specimen scales may be behind and yet be kept
FEWEST = 3  # recordings needed before scales of specimens can be estimated
# Discrepancy gain in nats a sample: up to the first a candidate reaches the noise;
# beyond the second no further search would reach it.
LEAVES, EVIDENT = 0.03, 0.1
FINER = 2  # times that the grid of a base is halved, to see whether it was too coarse
REFITTED = 4  # iterations of a refit after a change of the noise alone


@dataclass
class Account:
    """A candidate model: a set of effects at its best fit, and its evidence."""

    fit: Fit
    evidence: Evidence
    seconds: float = 0.0

    @property
    def effects(self) -> frozenset[str]:
        return frozenset(names(self.fit))

    @property
    def log_odds(self) -> float:
        """Log evidence, nats: exact laws, or laws with small form errors."""
        return self.evidence.alone

    @property
    def figures(self) -> Array:
        """Return the five numbers (5,), in nats, that the posterior weighs.

        The first three are log evidences: with exact laws, with small discrepancies,
        and with a discrepancy of any size. The last two are (log n) / 2 for each free
        parameter, and the same for parameters of single recordings alone.
        """
        found, evidence = self.fit, self.evidence
        one, pieces = 0.5 * np.log(len(found.residual)), found.guess.pieces
        own = sum(
            s.piece >= 0
            and s.recordings is not None
            and not (pieces[s.piece].nuisance or mistaken(found, s))
            for s in found.slots
        )
        numbers = [evidence.numbers * one, own * one]
        return np.array([evidence.bare, evidence.alone, evidence.beside, *numbers])


def value(account: Account) -> float:
    """Return the score of a candidate model: evidence less a price, nats.

    The price is (log n) / 2 for each parameter and `PRICE` for each effect. The search
    goes on with the candidates of the highest score.
    """
    n = len(account.fit.residual)
    price = 0.5 * account.evidence.numbers * np.log(n) + PRICE * len(account.effects)
    return float(account.evidence.alone - price)


@dataclass
class Search:
    """All candidate models tried, under one noise; the first is the base alone.

    `reaches_noise`: whether the best candidate explains the recordings down to the
    noise.
    """

    base: Baseline
    noise: list[Noise]
    accounts: list[Account]
    reaches_noise: bool = True


def search(
    base: Baseline, unknown: frozenset[str] = frozenset(), evident: float = EVIDENT
) -> Search:
    """Return all candidate models tried, refitted under the noise of the best one.

    Forms of laws in `unknown` are not tried, so a trial can test the answer to a law
    outside softnn's list. The search ends early where the best candidate of up to three
    effects leaves a discrepancy of more than `evident` nats a sample.
    """
    engine = base.engine
    pool = candidates(engine, base.has, unknown)
    progress.part("one effect", 2)
    base.fit, first = _first(base, pool)
    weigher = Weigher(engine, base.fit)
    found = [Account(base.fit, weigher.weigh(base.fit, whole=False))]
    found += _weighed(weigher, first)
    apart = _as_specimens(base, weigher, found)
    if apart:  # scales of specimens may have hidden an effect
        found += apart[:1]
        found += _weighed(weigher, expand(engine, apart[0].fit, pool, FIRST, FORMS))
    for size, count in enumerate(EXPANDED, start=1):
        bar = max(value(a) for a in found if len(a.effects) < size)
        best = _leaders(a for a in found if len(a.effects) == size and value(a) >= bar)
        so_far(engine, max(found, key=value).fit)
        progress.part(SIZES[size], len(best[:count]))
        for account in best[:count]:
            found += _weighed(weigher, expand(engine, account.fit, pool, LATER))
            progress.piece()
    if _discrepancy(weigher, max(found, key=value)) > evident:
        return Search(base, base.noise, found, False)
    found += _finer(weigher, found[0])
    if not apart:
        found += _as_specimens(base, weigher, found)
    found += _as_mistakes(weigher, found, pool)
    noise, accounts = _settled(base, weigher, found)
    accounts += _asked_again(weigher, accounts, pool)
    base.fit = accounts[0].fit
    left = _discrepancy(weigher, max(accounts, key=value))
    return Search(base, noise, accounts, left <= LEAVES)


def _discrepancy(weigher: Weigher, account: Account) -> float:
    """Return the gain in log evidence of a free discrepancy, nats a sample."""
    evidence = weigher.weigh(account.fit)
    return (evidence.beside - evidence.bare) / len(account.fit.residual)


def _finer(weigher: Weigher, bare: Account) -> list[Account]:
    """Return the base alone on finer grids: what they explain needs no effect."""
    guess, fits = bare.fit.guess, list[Fit]()
    units = guess.units
    for _ in range(FINER * (not bare.fit.fixed_base)):
        units, last = units.finer(), units
        if units != last:
            more = replace(guess, units=units, stiffness=np.zeros(units.columns))
            fits.append(fit(weigher.engine, more))
    return _weighed(weigher, fits)


def _asked_again(
    weigher: Weigher, found: Sequence[Account], pool: Sequence[Effect]
) -> list[Account]:
    """Return refits of the best few sets, each effect chosen again beside the others.

    The form that suits an effect was chosen before the other effects were in the model.
    """
    out: list[Account] = []
    engine = weigher.engine
    best = _leaders(a for a in found if len(a.effects) > 1)[:ASKED]
    progress.part("the best again", len(best))
    for account in reversed(best):
        for law, fewer in _each_less(account):
            less = fit(engine, fewer, fixed_base=account.fit.fixed_base)
            known = [one for one in pool if one.id == law.id]
            out += _weighed(weigher, expand(engine, less, known, 1, FORMS), whole=True)
        progress.piece()
    return out


def _each_less(account: Account) -> Iterator[tuple[Effect, Guess]]:
    """Yield each effect of a candidate model, and the guess without that effect."""
    guess = account.fit.guess
    for piece in guess.pieces:
        if not piece.nuisance:
            rest = tuple(p for p in guess.pieces if p is not piece)
            yield piece.effect, replace(guess, pieces=rest)


def _leaders(found: Iterable[Account]) -> list[Account]:
    """Return the best candidate of each set of effects, the best of all first."""
    best = {a.effects: a for a in sorted(found, key=value)}
    return sorted(best.values(), key=value, reverse=True)


def _as_specimens(
    base: Baseline, weigher: Weigher, found: Sequence[Account]
) -> list[Account]:
    """Return candidate models with a scale for each specimen, if these are better.

    Replicates are taken as different specimens unless labels say otherwise. Without
    labels, scale errors in most recordings are differences between specimens. A scale
    that several recordings share belongs to the specimen that they share.
    """
    count = len(base.engine.chunks)
    if count < FEWEST or any(p.nuisance for p in base.fit.guess.pieces):
        return []
    each = each_apart(base.engine.data, unsaid=True)
    rest = [a for a in found if each.effect.id not in a.effects]

    def apart(account: Account, piece: Piece = each) -> Account:
        clock = time.perf_counter()
        new = refine(base.engine, account.fit, piece, REFITTED)
        evidence = weigher.weigh(new, whole=False)
        return Account(new, evidence, account.seconds + time.perf_counter() - clock)

    before = [rest[0], max(rest, key=value)]
    trials = list(map(apart, before))
    best = max(trials, key=value)
    groups = shared(best.fit, SCATTER)
    piece = scatter(count, groups[1:], unsaid=True)
    alike = [apart(a, piece) for a in before]
    if max(map(value, alike)) > value(best):
        trials, each = alike, piece
    if max(map(value, trials)) < max(map(value, rest)) - NEAR:
        return []
    return trials[:1] + [apart(a, each) for a in _worth(rest) if a.effects]


def _as_mistakes(
    weigher: Weigher, found: Sequence[Account], pool: Sequence[Effect]
) -> list[Account]:
    """Candidate models in which the scale of some recordings is wrong.

    If most scales agree, the outliers may be mis-scaled recordings and not specimens.
    """
    out: list[Account] = []
    unsaid = [a for a in found if any(p.unsaid for p in a.fit.guess.pieces)]
    most: dict[int, float] = {}
    for a in unsaid:
        most[len(a.effects)] = max(value(a), most.get(len(a.effects), -np.inf))
    near = [a for a in unsaid if value(a) > most[len(a.effects)] - NEAR]
    once = {a.effects: a for a in sorted(near, key=value)}  # best of each set
    for best in once.values():
        rest = tuple(p for p in best.fit.guess.pieces if not p.unsaid)
        guess = replace(best.fit.guess, pieces=rest)
        fixed = best.fit.fixed_base
        less = fit(weigher.engine, guess, fixed_base=fixed, iterations=0)
        law = [one for one in pool if one.scatter]
        out += _weighed(weigher, expand(weigher.engine, less, law, 1))
    return out


def _settled(
    base: Baseline, weigher: Weigher, found: Sequence[Account]
) -> tuple[list[Noise], list[Account]]:
    """The noise under which the best candidate is likeliest; all candidates under it.

    Try the noise left by the best model of each size, with and without long memory, and
    keep the likeliest. A model that misses an effect takes the effect for slow noise;
    under such noise a wrong candidate may lead.
    """
    engine = base.engine
    ranked = sorted(_worth(found, KEPT), key=value, reverse=True)
    leaders = list({len(a.effects): a for a in reversed(ranked)}.values())
    progress.part("the noise", 2 * len(leaders) ** 2 + len(ranked))
    tried = []
    for leader in leaders:
        for long in (False, True):
            noise = weigh(engine, leader.fit, long=long)
            if long and not believed(engine, noise):
                continue
            few = [_again(base, weigher, a, whole=False) for a in leaders]
            tried.append((max(map(value, few)), noise))
    noise = max(tried, key=lambda t: t[0])[1]
    weigh_by(engine, noise)
    accounts = [_again(base, weigher, a) for a in ranked]
    # The base alone goes first: with or without specimen scales, whichever is better.
    bare = next(i for i, a in enumerate(ranked) if not a.effects)
    return noise, [accounts[bare], *accounts[:bare], *accounts[bare + 1 :]]


def believed(engine: Engine, noise: Sequence[Noise]) -> bool:
    """Return whether a machine can have this noise; larger noise is model error."""
    sigma = zip(noise, engine.data.stress_MPa, strict=True)
    square = np.concatenate([one.sigma(s[np.isfinite(s)]) ** 2 for one, s in sigma])
    return bool(np.sqrt(square.mean()) < CLASS * np.ptp(engine.target))


def _again(
    base: Baseline, weigher: Weigher, account: Account, whole: bool = True
) -> Account:
    """Return the candidate refitted under the noise now in force."""
    clock = time.perf_counter()
    guess, fixed = account.fit.guess, base.fixed
    again = fit(base.engine, guess, fixed_base=fixed, iterations=REFITTED)
    evidence = weigher.weigh(again, whole)
    progress.piece()
    return Account(again, evidence, account.seconds + time.perf_counter() - clock)


def _worth(found: Sequence[Account], most: int = 0) -> list[Account]:
    """Return the best forms of each set of effects; drop large sets far from the best.

    At least `most` sets are kept, since the noise is not yet settled and may favour
    others.
    """
    once = {
        (
            a.effects,  # a scale may belong to an effect or to a specimen
            tuple(p.effect.form for p in a.fit.guess.pieces),
            round(value(a)),
        ): a
        for a in reversed(found)
    }
    found = list(once.values())[::-1]
    best: dict[frozenset[str], float] = {}
    for account in found:
        best[account.effects] = max(value(account), best.get(account.effects, -np.inf))
    several = sorted((v for s, v in best.items() if len(s) > 1), reverse=True)
    far = min([max(best.values()) - FAR, *several[most - 1 : most]])
    return [
        a
        for a in found
        if not value(a) < best[a.effects] - ALIKE  # the base always stays
        and (len(a.effects) < 2 or best[a.effects] >= far)
    ]


def _first(base: Baseline, pool: Sequence[Effect]) -> tuple[Fit, list[Fit]]:
    """Return the base and all candidates of one effect, under the best one's noise.

    A missing effect raises the noise estimated under the base, and so hides itself.
    """
    engine = base.engine
    first = expand(engine, base.fit, pool, FIRST, FORMS)
    progress.piece()
    if not first:
        return base.fit, first
    before = engine.log_norm
    best = min(first, key=lambda f: f.chi2)
    base.noise = weigh(engine, best)
    fixed = base.fixed
    again = fit(engine, base.fit.guess, fixed_base=fixed, iterations=REFITTED)
    if engine.log_norm - before > TOLD * len(engine.target):
        return again, expand(engine, again, pool, FIRST, FORMS)
    refitted = [
        fit(engine, f.guess, fixed_base=fixed, iterations=REFITTED) for f in first
    ]
    return again, refitted


def _weighed(
    weigher: Weigher, fits: Iterable[Fit], whole: bool = False
) -> list[Account]:
    out = []
    for one in fits:
        clock = time.perf_counter()
        evidence = weigher.weigh(one, whole)
        out.append(Account(one, evidence, time.perf_counter() - clock))
    return out
