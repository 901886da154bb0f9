"""Strain programmes on which effects show, for `telltale`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softnn.contracts import Chunk


def ramps(
    levels: Sequence[float], rate: float | Sequence[float], interval_s: float = 0.05
) -> Chunk:
    """Return a chunk of linear strain between `levels`, at `rate` [1/s] each.

    Equal neighbouring levels hold for 10 s; samples are `interval_s` [s] apart.
    """
    rates = np.broadcast_to(np.asarray(rate, float), (len(levels) - 1,))
    steps = np.abs(np.diff(levels)) / rates
    corners = np.concatenate([[0.0], np.cumsum(np.where(steps > 0, steps, 10.0))])
    time = np.arange(0, corners[-1] + interval_s / 2, interval_s)
    return Chunk(time, np.interp(time, corners, levels))


def cycles(peaks: Sequence[float], rate: float, floor: float = 0.0) -> Chunk:
    """Return triangles: up to each of `peaks` and back to `floor`, at `rate` [1/s]."""
    levels = [0.0]
    for peak in peaks:
        levels += [peak, floor]
    return ramps(levels, rate)
