"""Is an outlying specimen a mistake, such as a wrong cross-section?

Specimens of one material differ by some per cent, and every candidate model has free
specimen scales. An outlier may be natural scatter or a scale that is wrong by any
factor; the fit alone cannot distinguish them. The prior does. Either all logarithms of
scales are normal with a half-Cauchy spread (Gelman 2006, doi:10.1214/06-BA117A), or one
of them has a size of its own. All cases are summed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from softnn.contracts import Array
from softnn.fit import Engine, Fit, Guess, fit
from softnn.mismatch.accounts import FEWEST
from softnn.mismatch.evidence import SCATTER_PRIOR
from softnn.mismatch.faults import shared
from softnn.mismatch.posterior import Posterior
from softnn.mismatch.screen import clipped
from softnn.mismatch.specimens import UNSAID, estimated, marginal

SPREADS = 0.01 * 2.0 ** np.arange(8)  # between specimens, of the logarithm
SIZES = (0.3, 1.0, 2.5)  # of the logarithm of a mistake: factors of about 1.3, 3 and 10


def weighed(at: Array, known: Array) -> Array:
    """Return the probability (n,) that each specimen is a mistake, the reference first.

    `at` (n - 1,) are logarithms of scales relative to the reference, and `known`
    (n - 1, n - 1) is their precision.
    """
    each = np.eye(len(at) + 1)
    usual = np.log(SPREADS / (1 + (SPREADS / SCATTER_PRIOR) ** 2))

    def likely(sizes: Array) -> float:
        weights = each * sizes
        return marginal(at, known, weights[1:] - weights[0])

    none = logsumexp([likely(np.full(len(each), s)) for s in SPREADS] + usual)
    out = np.empty((len(each), len(SIZES), len(SPREADS)))
    for i, j, k in np.ndindex(*out.shape):
        sizes = np.full(len(each), SPREADS[k])
        sizes[i] = SIZES[j]
        out[i, j, k] = likely(sizes) + usual[k]
    prior = UNSAID + np.log(out[:, :, 0].size)
    one = logsumexp(out, axis=(1, 2)) - prior
    return np.exp(one - np.logaddexp(none, logsumexp(one)))


def told(found: Fit) -> Array:
    """Return this probability for the labelled specimens of a fit (n,); empty for few.

    A simulation from elsewhere has the scale of the reference, and that stays.
    """
    said = [p for p in found.guess.pieces if p.nuisance and not p.unsaid]
    if not said or len(said[0].groups) + 1 < FEWEST:
        return np.zeros(0)
    at, known = estimated(found)
    scale = 1 + at
    chance = weighed(np.log(scale), known * np.outer(scale, scale))
    return np.where(np.arange(len(chance)) > 0, chance, chance * (not found.fixed_base))


def wrong(guess: Guess, which: int) -> Guess:
    """Return the guess in which specimen `which`, as `told` counts, is a mistake."""
    place = next(i for i, p in enumerate(guess.pieces) if p.nuisance)
    said = guess.pieces[place]
    name = said.effect.amplitude
    scale = 1.0 + said.values[name]
    others = {r for group in said.groups for r in group}
    groups = [tuple(r for r in range(len(scale)) if r not in others), *said.groups]
    mine = groups.pop(which)
    if which == 0:  # scales refer to the specimen in the middle of the others
        groups.sort(key=lambda group: scale[group[0]])
        groups.insert(0, groups.pop((len(groups) - 1) // 2))
    one = scale[groups[0][0]]
    off = np.isin(np.arange(len(scale)), mine)
    rest = np.where(off, 0.0, scale / one - 1)
    error = np.where(off, scale / one - 1, 0.0)
    pair = (
        replace(said, values={name: rest}, groups=tuple(groups[1:])),
        replace(said, values={name: error}, groups=(mine,), nuisance=False),
    )
    pieces = (*guess.pieces[:place], *pair, *guess.pieces[place + 1 :])
    return replace(guess, stiffness=one * guess.stiffness, pieces=pieces)


def allowed(guess: Guess) -> bool:
    """Return whether all scales, relative to the new reference, are in range."""
    scales = [(p.effect, p.values) for p in guess.pieces if p.effect.scatter]
    return all(
        np.array_equal(clipped(law, values)[law.amplitude], values[law.amplitude])
        for law, values in scales
    )


def mistaken(found: Fit) -> frozenset[str]:
    """Return ids of mistakes in labelled specimens; they leave the misfit unchanged."""
    said = [p for p in found.guess.pieces if p.nuisance and not p.unsaid]
    scaled = {r for p in said for group in p.groups for r in group}
    apart = [p for p in found.guess.pieces if p.effect.scatter and not p.nuisance]
    free = (p.effect.id for p in apart if not scaled & {r for g in p.groups for r in g})
    return frozenset(free if said else ())


def likeliest(found: Fit, engine: Engine) -> tuple[float, Fit] | None:
    """Return how likely the likeliest specimen is a mistake, and the fit with it so.

    None if no labelled specimen can be one. The misfit stays: its scale was free.
    """
    if any(p.effect.scatter and not p.nuisance for p in found.guess.pieces):
        return None
    chance = told(found)
    if not chance.sum() > 0:
        return None
    guess, fixed = wrong(found.guess, int(chance.argmax())), found.fixed_base
    if not allowed(guess):
        return None
    return float(chance.max()), fit(engine, guess, fixed_base=fixed, iterations=0)


def with_mistakes(probable: Posterior, engine: Engine) -> Posterior:
    """Return the posterior with each hypothesis split: no mistaken specimen, or one."""
    return shared(probable, lambda found: likeliest(found, engine))
