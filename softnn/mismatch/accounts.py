"""Sets of effects that could account for a mismatch, found and weighed.

The base is given one effect, the best of those accounts another, and so on while it
pays: a beam that is wide at first and narrow later.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from softnn.contracts import Effect
from softnn.fit import Fit, fit
from softnn.mismatch.base import Baseline, scatter, weigh, weigh_by
from softnn.mismatch.candidates import FIRST, LATER, candidates, expand, names, refine
from softnn.mismatch.evidence import Evidence, Weigher
from softnn.noise import Noise

EXPANDED = (3, 1, 1)  # accounts of one, two, three effects that are given one more
PRICE = 5.0  # of an effect, in log evidence, while searching
ALIKE = 8.0  # of log evidence, by which a form of an effect is as good as another
FAR = 60.0  # of log evidence, by which an account of several effects is out of it
TOLD = 0.02  # of log density a sample, by which a noise is another
NEAR = 10.0  # of log evidence, by which specimens may be behind and yet be tried
FEWEST = 3  # recordings, to speak of scatter
TRIED = 6  # accounts, the best, by which one of two noises is chosen
REFITTED = 4  # iterations, where only the noise has changed


@dataclass
class Account:
    """A set of effects at its best, and its evidence."""

    fit: Fit
    evidence: Evidence
    seconds: float = 0.0

    @property
    def effects(self) -> frozenset[str]:
        return frozenset(names(self.fit))


def value(account: Account) -> float:
    """Evidence less a price for numbers and effects: what to go on with."""
    n = len(account.fit.residual)
    price = 0.5 * account.evidence.numbers * np.log(n) + PRICE * len(account.effects)
    return float(account.evidence.alone - price)


@dataclass
class Search:
    """What was tried, under one noise; the first account is the base alone."""

    base: Baseline
    noise: list[Noise]
    accounts: list[Account]


def search(base: Baseline) -> Search:
    """All accounts tried, refitted and weighed under the noise that the best leaves."""
    engine = base.engine
    pool = candidates(engine, base.name, base.fixed)
    base.fit, first = _first(base, pool)
    weigher = Weigher(engine, base.fit)
    found = [Account(base.fit, weigher.weigh(base.fit, whole=False))]
    found += _weighed(weigher, first)
    found += _as_specimens(base, weigher, found)
    for size, count in enumerate(EXPANDED, start=1):
        ranked = sorted((a for a in found if len(a.effects) == size), key=value)
        done: set[frozenset[str]] = set()
        bar = max(value(a) for a in found if len(a.effects) < size)
        while ranked and len(done) < count:
            best = ranked.pop()
            if value(best) < bar:
                break
            if best.effects not in done:
                done.add(best.effects)
                found += _weighed(weigher, expand(engine, best.fit, pool, LATER))
    found += _without(weigher, found)
    noise, accounts = _settled(base, weigher, found)
    base.fit = accounts[0].fit
    return Search(base, noise, accounts)


def _without(weigher: Weigher, found: Sequence[Account]) -> list[Account]:
    """The accounts with one effect less, where that set has not been tried.

    What leads beside another may not lead alone, and what came first may be needless.
    """
    known = {a.effects for a in found}
    out: list[Account] = []
    queue = sorted(_worth(found), key=value, reverse=True)
    for account in queue:  # grows by what is found
        pieces = account.fit.guess.pieces
        for i, piece in enumerate(pieces):
            left = account.effects - {piece.effect.id}
            if piece.nuisance or left in known:
                continue
            known.add(left)
            guess = replace(account.fit.guess, pieces=pieces[:i] + pieces[i + 1 :])
            fewer = fit(weigher.engine, guess, fixed_base=account.fit.fixed_base)
            out += _weighed(weigher, [fewer])
            queue.append(out[-1])
    return out


def _as_specimens(
    base: Baseline, weigher: Weigher, found: Sequence[Account]
) -> list[Account]:
    """The accounts with a scale for each recording, if the best is better for it.

    Replicates are different specimens until somebody says otherwise; where nobody did,
    a scale error in most recordings is what specimens differ by.
    """
    count = len(base.engine.chunks)
    if count < FEWEST or any(p.nuisance for p in base.fit.guess.pieces):
        return []
    piece = scatter(count, [(r,) for r in range(1, count)], unsaid=True)
    rest = [a for a in found if piece.effect.id not in a.effects]

    def apart(account: Account) -> Account:
        clock = time.perf_counter()
        new = refine(base.engine, account.fit, piece, REFITTED)
        evidence = weigher.weigh(new, whole=False)
        return Account(new, evidence, account.seconds + time.perf_counter() - clock)

    trials = [apart(rest[0]), apart(max(rest, key=value))]
    if max(map(value, trials)) < max(map(value, found)) - NEAR:
        return []
    return trials[:1] + [apart(a) for a in _worth(rest) if a.effects]


def _settled(
    base: Baseline, weigher: Weigher, found: Sequence[Account]
) -> tuple[list[Noise], list[Account]]:
    """All accounts under one noise: the one under which the best is likelier.

    That which the best leaves by windows of any length, or by short ones alone: of an
    account that misses something, long ones take what it misses for noise.
    """
    engine = base.engine
    ranked = sorted(_worth(found), key=value, reverse=True)
    best, tried = ranked[0], []
    for long in (False, True):
        noise = weigh(engine, best.fit, long=long)
        few = [_again(base, weigher, a) for a in ranked[:TRIED]]
        tried.append((max(map(value, few)), long, noise, few))
    _, long, noise, few = max(tried, key=lambda t: t[0])
    if not long:
        weigh_by(engine, noise)
    rest = [_again(base, weigher, a) for a in ranked[TRIED:]]
    accounts = [*few, *rest]
    # The base alone goes first; of its two, with and without scatter, the better.
    bare = next(i for i, a in enumerate(ranked) if not a.effects)
    return noise, [accounts[bare], *accounts[:bare], *accounts[bare + 1 :]]


def _again(base: Baseline, weigher: Weigher, account: Account) -> Account:
    """An account under the noise now in force."""
    clock = time.perf_counter()
    guess, fixed = account.fit.guess, base.fixed
    again = fit(base.engine, guess, fixed_base=fixed, iterations=REFITTED)
    evidence = weigher.weigh(again)
    return Account(again, evidence, account.seconds + time.perf_counter() - clock)


def _worth(found: Sequence[Account]) -> list[Account]:
    """The best forms of each set of effects, and no several far from the best."""
    top = max(map(value, found))
    best: dict[frozenset[str], float] = {}
    for account in found:
        best[account.effects] = max(value(account), best.get(account.effects, -np.inf))
    return [
        a
        for a in found
        if not value(a) < best[a.effects] - ALIKE  # the base stays, come what may
        and (len(a.effects) < 2 or value(a) > top - FAR)
    ]


def _first(base: Baseline, pool: Sequence[Effect]) -> tuple[Fit, list[Fit]]:
    """The base and all accounts of one effect, under noise that the best leaves.

    What is missing adds to the noise that a base seems to have, and so hides itself.
    """
    engine = base.engine
    first = expand(engine, base.fit, pool, FIRST)
    if not first:
        return base.fit, first
    before = engine.log_norm
    best = min(first, key=lambda f: f.chi2)
    base.noise = weigh(engine, best)
    fixed = base.fixed
    again = fit(engine, base.fit.guess, fixed_base=fixed, iterations=REFITTED)
    if engine.log_norm - before > TOLD * len(engine.target):
        return again, expand(engine, again, pool, FIRST)
    refitted = [
        fit(engine, f.guess, fixed_base=fixed, iterations=REFITTED) for f in first
    ]
    return again, refitted


def _weighed(weigher: Weigher, fits: Iterable[Fit]) -> list[Account]:
    out = []
    for one in fits:
        clock = time.perf_counter()
        evidence = weigher.weigh(one, whole=False)
        out.append(Account(one, evidence, time.perf_counter() - clock))
    return out
