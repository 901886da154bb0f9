"""Does the zero of some recordings differ from the others, before the strain moves?

A specimen at rest that has seen no strain bears no stress, whatever its material, and
errors of laws begin when it moves. So only samples at rest are judged, before any model
is fitted. Zeros differ by a half-Cauchy spread (Gelman 2006, doi:10.1214/06-BA117A)
with the error of a machine of class 2 as its scale (ISO 7500-1). Or some recordings
have an offset of their own size besides. All cases are summed. An offset that all
recordings share is a preload and no fault.
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

SPREADS = 2.0 ** np.arange(8)  # spread of zeros, relative to `ZEROS`


def at_rest(engine: Engine) -> list[Fault]:
    """Return the recordings whose zero differs from the others, as a fault, if any."""
    seen = shown(engine, [law for law in EFFECTS if law.unmoved])
    return [Fault(piece, likely(engine, piece)) for piece in seen[:1]]


def likely(engine: Engine, piece: Piece) -> float:
    """Return the probability that recordings of a piece have an offset of their own."""
    data = engine.fine.data
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
    """Return the log density (to a constant) of normal values (n,) with a free mean."""
    weight = 1 / variance
    middle = weight @ values / weight.sum()
    size = np.log(variance).sum() + np.log(weight.sum())
    return -0.5 * float(size + weight @ (values - middle) ** 2)
