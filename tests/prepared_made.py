"""Pulls and programmes that tests of preparation share."""

from __future__ import annotations

import numpy as np

from softnn.recording import Recording

RATE = 0.1  # 1/s


def hold(relaxed=0.3, ramp=200, n=4000):
    """A ramp to 0.5 in 5 s and a hold in which all but `relaxed` of the load goes."""
    time = np.concatenate([np.linspace(0, 5, ramp), 5 + np.geomspace(0.025, 500, n)])
    strain = np.minimum(RATE * time, 0.5)
    fall = np.exp(-np.maximum(time - 5, 0) / 2)
    return Recording(time, strain, strain * (relaxed + (1 - relaxed) * fall))
