"""The state of a specimen, sample by sample: branch, cycle, history.

It follows from the imposed strain alone, without a model or a stress.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from softnn.contracts import Array, Chunk

FEATURES = (
    "strain",
    "largest_strain",
    "log_rate",
    "direction",
    "log_time_since_reversal",
    "travel",
    "log_time",
)


@dataclass(frozen=True)
class Phases:
    """Branch and cycle of each sample (n,) of a recording."""

    branch: Array  # index into BRANCHES
    cycle: Array  # counts from 1


BRANCHES = ("hold", "first loading", "reloading", "unloading")


def phases(chunk: Chunk, band: float = 0.02) -> Phases:
    """Return branch and cycle of each sample; a reversal is `band` of the range."""
    strain, time = chunk.strain, chunk.time_s
    span = float(strain.max() - strain.min())
    n = len(strain)
    turn = turns(strain, band * span)
    rising = np.diff(strain[turn], append=strain[turn[-1]]) > 0
    at = np.arange(n)
    stretch = np.searchsorted(turn[1:-1], at, "right")
    cycle = 1 + np.cumsum(rising) - rising[0]
    # A hold is a stretch in which the strain moves far less than elsewhere.
    reach = max(n // 200, 2)
    ahead, behind = np.minimum(at + reach, n - 1), np.maximum(at - reach, 0)
    step = np.abs(strain - [strain[ahead], strain[behind]]).min(axis=0)
    rate = step / np.maximum(time[ahead] - time, 1e-12)
    took = np.diff(time)  # time stamps may repeat
    moving = np.abs(np.diff(strain))[took > 0] / took[took > 0]
    typical = np.median(moving[moving > 0]) if (moving > 0).any() else 0.0
    hold = rate < min(0.02 * typical, 1.0) if typical > 0 else np.ones(n, bool)
    hold |= (step < 1e-4 * span) & (rate < 0.1 * typical)
    # Outward from zero is loading, in tension and in compression.
    outward = rising[stretch] == (strain >= 0)
    size = np.abs(strain)
    fresh = size >= np.maximum.accumulate(size) - 1e-3 * span
    branch = np.where(outward, np.where(fresh, 1, 2), 3)
    return Phases(np.where(hold, 0, branch), cycle[stretch])


def turns(x: Array, band: float) -> Array:
    """Return indices of the turning points, with the first and last sample."""
    out = [0]
    low = high = 0
    direction = 0
    for i in range(1, len(x)):
        if direction >= 0 and x[i] > x[high]:
            high = i
        if direction <= 0 and x[i] < x[low]:
            low = i
        if direction >= 0 and x[high] - x[i] > band:
            if high != out[-1]:
                out.append(high)
            direction, low = -1, i
        elif direction <= 0 and x[i] - x[low] > band:
            if low != out[-1]:
                out.append(low)
            direction, high = 1, i
    if out[-1] != len(x) - 1:
        out.append(len(x) - 1)
    return np.array(out)


def features(
    chunk: Chunk, names: tuple[str, ...] = FEATURES, *, warm: bool = False
) -> Array:
    """Return state features (n, features) of a recording."""
    if warm:
        names = (*names, "temperature_C")
    time, strain = chunk.time_s - chunk.time_s[0], chunk.strain
    step = np.maximum(np.diff(time, prepend=time[0]), 1e-9)
    step[0] = step[1] if len(step) > 1 else 1.0
    rate = np.diff(strain, prepend=strain[0]) / step
    if len(rate) > 1:
        rate[0] = rate[1]
    branch = phases(chunk).branch
    change = np.concatenate([[True], np.diff(branch) != 0])
    since = time - np.maximum.accumulate(np.where(change, time, 0.0))
    typical = np.median(np.abs(rate[rate != 0])) if (rate != 0).any() else 1.0
    table = {
        "strain": strain,
        "largest_strain": np.maximum.accumulate(np.abs(strain)),
        "log_rate": np.log10(np.abs(rate) + 1e-3 * typical),
        "direction": np.sign(np.where(np.abs(rate) > 1e-3 * typical, rate, 0.0)),
        "log_time_since_reversal": np.log10(since + 0.01 * (time[-1] + 1e-9) + 1e-9),
        "travel": np.cumsum(np.abs(np.diff(strain, prepend=strain[0]))),
        "log_time": np.log10(time + 0.01 * (time[-1] + 1e-9) + 1e-9),
    }
    if chunk.temperature_C is not None:
        degrees = chunk.temperature_C
        known = np.isfinite(degrees)
        table["temperature_C"] = (
            np.interp(time, time[known], degrees[known]) if known.any() else 0 * time
        )
    return np.stack([table[n] for n in names], axis=1)


def runs(mask: Array, *labels: Array) -> Sequence[tuple[int, int]]:
    """Return runs [a, b) of True in which all labels stay the same."""
    if not mask.any():
        return []
    change = np.diff(mask.astype(int)) != 0
    for label in labels:
        change |= (np.diff(label) != 0) & mask[1:] & mask[:-1]
    edges = np.concatenate([[0], np.flatnonzero(change) + 1, [len(mask)]])
    return [(int(a), int(b)) for a, b in pairwise(edges) if mask[a]]
