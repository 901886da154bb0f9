"""Is a zero apart from the others, before anything has moved?

A specimen at rest that has seen no strain bears no stress, whatever it is made of, and
what laws get wrong begins when it moves. So that is asked of what is read at rest
alone, and of every hypothesis. Zeros differ by a spread that is half-Cauchy (Gelman
2006, doi:10.1214/06-BA117A), of the scale that a machine of class 2 may be off by (ISO
7500-1); or so and some are apart, by a size of their own. All of it is summed over.
What all recordings have alike is a preload, and no news.
"""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from softnn.contracts import Array
from softnn.effects import EFFECTS
from softnn.effects._signs import ZEROS, noise
from softnn.effects._signs import at_rest as stress_at_rest
from softnn.fit import Engine, Piece
from softnn.mismatch.candidates import shown
from softnn.mismatch.evidence import MISTAKE
from softnn.mismatch.faults import Fault, on
from softnn.mismatch.specimens import UNSAID, picked

SPREADS = 2.0 ** np.arange(8)  # of zeros, over `ZEROS`: less is no news


def at_rest(engine: Engine) -> list[Fault]:
    """The zeros that stand apart from the others, if any do."""
    seen = shown(engine, [law for law in EFFECTS if law.unmoved])
    return [Fault(piece, likely(engine, piece)) for piece in seen[:1]]


def likely(engine: Engine, piece: Piece) -> float:
    """Probability that the zeros in which a piece is on are apart from the others."""
    data = (engine.fine or engine).data
    every = list(zip(data.chunks, data.stress_MPa, strict=True))
    read = np.array([stress_at_rest(chunk, s) for chunk, s in every])
    there = np.isfinite(read)
    own = np.array([noise(s) for _, s in every])[there] ** 2
    those = np.isin(np.flatnonzero(there), list(on(piece)))

    def density(size: float | None, spread: float) -> float:
        scale = np.where(those, spread if size is None else size, spread)
        return _apart(read[there], (engine.level * scale) ** 2 + own)

    prior = np.log(SPREADS / (1 + SPREADS**2))
    none, *some = (
        logsumexp([density(size, ZEROS * s) for s in SPREADS] + prior)
        for size in (None, *MISTAKE)
    )
    price = UNSAID + picked(len(own), int(those.sum())) + np.log(len(MISTAKE))
    return float(1 / (1 + np.exp(none - logsumexp(some) + price)))


def _apart(values: Array, variance: Array) -> float:
    """Log density (to a constant) of normal values (n,) about a mean that is free."""
    weight = 1 / variance
    middle = weight @ values / weight.sum()
    size = np.log(variance).sum() + np.log(weight.sum())
    return -0.5 * float(size + weight @ (values - middle) ** 2)
