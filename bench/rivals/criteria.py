"""AIC and BIC over softnn's own effects, as a textbook would have it.

Every effect is fitted on top of what is chosen so far, the smallest criterion wins, and
the search goes on while the criterion falls. Samples count alike and as independent;
there is no threshold but the price of a parameter.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.rivals import folds
from bench.rivals.naming import Found
from bench.rivals.problem import Problem, alike
from softnn.contracts import Effect
from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Guess, Piece, fit
from softnn.mismatch.candidates import release
from softnn.mismatch.screen import Lead, Screen

MOST = 5  # effects, where AIC would go on
Price = Callable[[int], float]  # of a parameter, for a number of samples


def akaike(samples: int) -> float:
    return 2.0


def schwarz(samples: int) -> float:
    return float(np.log(samples))


def criterion(found: Fit, price: float) -> float:
    n = len(found.residual)
    return n * float(np.log(found.chi2 / n)) + price * found.parameters


def search(problem: Problem, price_of: Price) -> Found:
    engine, current = problem.plain
    level = [np.full(len(s), engine.sigma[0]) for s in engine.data.stress_MPa]
    price = price_of(len(engine.target))
    names: list[str] = []
    try:
        while len(names) < MOST:
            pool = [e for e in problem.pool if e.id not in names]
            tried = forward(engine, current, pool, price)
            if not tried:
                break
            name, best = min(tried.items(), key=lambda i: criterion(i[1], price))
            if criterion(best, price) >= criterion(current, price):
                break
            names.append(name)
            current = alike(engine, best)
        made = folds.of(engine, current)
        error = folds.squares(engine, made)
    finally:
        # The engine is shared with other methods: it is handed back as it was.
        engine.set_noise(level, None)
    return Found(
        {n: 1 / len(names) for n in names},
        1.0 if names else 0.0,
        1.0,
        folds.nrmse(engine, error),
    )


def forward(
    engine: Engine, current: Fit, pool: list[Effect], price: float
) -> dict[str, Fit]:
    """Every effect fitted beside what is there, at its best start and form."""
    screen = Screen(engine, current)
    tried = {}
    for effect in pool:
        leads: list[Lead] = []
        for law in effect.forms:
            leads += screen.lead(law, price)
        if leads:
            lead = max(leads, key=lambda one: one.gain)
            tried[effect.id] = joint(engine, current, lead.piece)
    near = sorted(tried, key=lambda n: criterion(tried[n], price))[:3]
    for name in near:
        index = next(
            i
            for i, p in enumerate(tried[name].guess.pieces)
            if p.effect.id == name and not p.nuisance
        )
        freed = release(engine, tried[name], index, True, 6)
        if criterion(freed, price) < criterion(tried[name], price):
            tried[name] = freed
    return tried


def joint(engine: Engine, current: Fit, piece: Piece) -> Fit:
    order = [e.id for e in EFFECTS]
    pieces = sorted(
        (*current.guess.pieces, piece), key=lambda p: order.index(p.effect.id)
    )
    guess = Guess(current.guess.units, current.guess.stiffness, tuple(pieces))
    return fit(engine, guess, fixed_base=current.fixed_base, iterations=6)


def aic(problem: Problem, rng: np.random.Generator) -> Found:
    return search(problem, akaike)


def bic(problem: Problem, rng: np.random.Generator) -> Found:
    return search(problem, schwarz)
