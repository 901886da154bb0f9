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
CLASS = 0.02  # of the stress: a machine of class 2 errs no more, ISO 7500-1


class Zeros:
    """What is read of specimens not yet moved, in those recordings that begin so."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        data = engine.data
        self.own = np.array([noise(s) for s in data.stress_MPa])
        every = zip(data.chunks, data.stress_MPa, strict=True)
        self.fresh = np.isfinite([at_rest(chunk, s) for chunk, s in every])
        self.fresh[1:] &= not data.continued

    def _at_rest(self, values: Array) -> Array:
        """The first of the values (valid,) of each recording; nan if not at rest.

        No later one: what drifts is a little off soon.
        """
        own = np.array([x[0] for x in self.engine.by_recording(values)])
        return np.where(self.fresh, own, np.nan)

    def evidence(self, stress: Array, made: Array) -> float:
        """Log evidence of what is read, where `stress` (valid,) is simulated.

        `made` (valid,): what its effects change of that. Where they change what is read
        at rest it is what is read there, but for how far it is off: what laws get wrong
        may bend a zero by what a machine may err by, and more is less likely. 0 where
        fewer than two recordings begin at rest.
        """
        level = self.engine.level
        read = self._at_rest(self.engine.target - stress)
        there = np.isfinite(read)
        if there.sum() < LEAST:
            return 0.0
        read, own = read[there], self.own[there] ** 2
        set_ = np.abs(self._at_rest(made)[there]) > ZEROS * level
        middle = np.median(read[~set_]) if not set_.all() else np.median(read)
        off = np.where(set_, read - middle, 0.0)
        prior = np.log(SPREADS / (1 + SPREADS**2))
        each = [_apart(read - off, (ZEROS * level * s) ** 2 + own) for s in SPREADS]
        bent = 0.5 * float(off @ off) / (CLASS * level) ** 2
        return float(logsumexp(each + prior)) - bent


def _apart(values: Array, variance: Array) -> float:
    """Log density (to a constant) of normal values (n,) about a mean that is free."""
    weight = 1 / variance
    middle = weight @ values / weight.sum()
    size = np.log(variance).sum() + np.log(weight.sum())
    return -0.5 * float(size + weight @ (values - middle) ** 2)
