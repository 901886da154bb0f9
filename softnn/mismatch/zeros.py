"""What is read before anything has moved: no law of a material has a part in it.

A specimen at rest that has seen no strain bears no stress, whatever it is made of, and
what laws get wrong begins when it moves. So zeros are likely or not by themselves,
under any account: they differ by a spread that is half-Cauchy (Gelman 2006,
doi:10.1214/06-BA117A), of the scale that a machine of class 2 may be off by (ISO
7500-1). What all recordings have alike is a preload, and no news.
"""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from softnn.contracts import Array
from softnn.effects._signs import ZEROS, at_rest, noise
from softnn.fit import Engine

SPREADS = 2.0 ** np.arange(8)  # of zeros, over `ZEROS`: less is no news
LEAST = 2  # recordings that begin at rest, to tell one from the other


class Zeros:
    """What is read of specimens not yet moved, in those recordings that begin so."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.own = np.array([noise(s) for s in engine.data.stress_MPa])

    def evidence(self, stress: Array) -> float:
        """Log evidence of what is read, where `stress` (valid,) is simulated.

        0 where fewer than two recordings begin so.
        """
        engine, data = self.engine, self.engine.data
        left = engine.by_recording(engine.target - stress)
        read = np.array([at_rest(c, x) for c, x in zip(data.chunks, left, strict=True)])
        read[1:] = np.where(data.continued, np.nan, read[1:])
        there = np.isfinite(read)
        if there.sum() < LEAST:
            return 0.0
        prior = np.log(SPREADS / (1 + SPREADS**2))
        spread, own = ZEROS * engine.level * SPREADS, self.own[there] ** 2
        each = [_apart(read[there], s**2 + own) for s in spread]
        return float(logsumexp(each + prior))


def _apart(values: Array, variance: Array) -> float:
    """Log density (to a constant) of normal values (n,) about a mean that is free."""
    weight = 1 / variance
    middle = weight @ values / weight.sum()
    size = np.log(variance).sum() + np.log(weight.sum())
    return -0.5 * float(size + weight @ (values - middle) ** 2)
