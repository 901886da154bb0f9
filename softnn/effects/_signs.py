"""What recordings show by themselves, whatever the material: for `Effect.shown`.

A specimen at rest that was never strained bears no stress, taut or not; and recordings
of one material agree where one of them has a fault. No law of the material comes in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Chunk
from softnn.noise import quantum

APART = 5.5  # times their spread, by which some recordings must differ from the others
UNMOVED = (0.01, 1e-4)  # of the largest strain: where rest may be, and no motion
QUIET = 6.0  # noises: stress that is none yet
START = 0.5  # of the largest strain: the first loading
FEWEST = 3  # recordings, to say which are out of line


def minority(
    values: Array, floor: float = 0.0, above: bool = False, most: float = 0.5
) -> NDArray[np.integer]:
    """Indices of the few that lie far above or below all others; maybe none.

    `floor`: the spread that others have at least; `above`: not below; the few are less
    than the share `most`.
    """
    order = np.argsort(values)
    n = len(order)
    best, odd = APART, order[:0]
    for few in range(1, int(np.ceil(most * n))):
        parts = [(order[-few:], order[:-few])]
        if not above:
            parts.insert(0, (order[:few], order[few:]))
        for part, rest in parts:
            spread = max(float(np.std(values[rest])), floor)
            gap = float(np.abs(values[part][:, None] - values[rest]).min())
            if gap > best * spread:
                best, odd = gap / max(spread, 1e-300), part
    return odd


def noise(stress: Array) -> float:
    """Of the channel, from second differences; no more is known without a law."""
    good = stress[np.isfinite(stress)]
    if len(good) < 3:
        return 0.0
    bend = float(np.median(np.abs(np.diff(good, n=2))))
    return max(1.4826 * bend / 6**0.5, quantum(good))


def reach(chunk: Chunk) -> float:
    """The largest strain of a recording, without its sign."""
    return float(np.abs(chunk.strain).max())


def at_rest(chunk: Chunk, stress: Array) -> float:
    """Stress before anything has moved; nan where a recording does not begin so."""
    top, strain = reach(chunk), chunk.strain
    near, still = UNMOVED
    if not abs(strain[0]) < near * top:
        return np.nan
    moved = np.abs(strain - strain[0]) > still * top
    # The two channels may be a little apart: the end of the rest is no rest for both.
    first = stress[: (int(np.argmax(moved)) + 3) // 4 or 1]
    return float(np.median(first)) if np.isfinite(first).all() else np.nan


def taken_up(chunk: Chunk, stress: Array, much: float) -> tuple[float, float]:
    """Strain at which the stress has left its level at rest by `much`, and by more.

    nan where a recording does not begin at rest, or does not get there.
    """
    level = at_rest(chunk, stress)
    if not np.isfinite(level):
        return np.nan, np.nan
    size = np.fmax.accumulate(np.nan_to_num(np.abs(stress - level)))
    way = np.abs(chunk.strain - chunk.strain[0])
    first, more = np.searchsorted(size, [much, 2 * much])
    if more == len(size):
        return np.nan, np.nan
    return float(way[max(first - 1, 0)]), float(way[more])


def pace(chunk: Chunk) -> float:
    """Strain a second of the first half of the first loading, once it moves."""
    size, (_, still) = np.abs(chunk.strain - chunk.strain[0]), UNMOVED
    a = max(int(np.argmax(size > still * reach(chunk))) - 1, 0)
    b = max(int(np.argmax(size > START * reach(chunk))), a + 1)
    seconds = chunk.time_s[b] - chunk.time_s[a]
    return float((size[b] - size[a]) / max(seconds, 1e-9))


WIDE = 0.03  # of the time of the first loading: a slip takes no longer
BACK = 0.03  # of the largest strain: less is no way back
EVEN, STEADY = 3.0, 1.5  # ratios of the compliances, and speeds, beside it, at most
LOUD, RARE = 8.0, 4.0  # noises, and times what is usual, that it must be


def jump(chunk: Chunk, stress: Array) -> tuple[float, float]:
    """Strain lost at once in the first loading, over the largest; and its moment [s].

    Strain that comes with less stress than before it and after it.
    """
    top = reach(chunk)
    moved = int(np.argmax(np.abs(chunk.strain) > BACK * top))
    side = np.sign(chunk.strain[moved])
    most = np.maximum.accumulate(side * chunk.strain)
    back = most - side * chunk.strain > BACK * top
    end = int(np.argmax(back)) if back.any() else len(back)
    end = int(np.argmax(most[:end] > 0.98 * most[end - 1]))
    good = np.isfinite(stress[:end])
    time = chunk.time_s[:end][good]
    strain, force = side * chunk.strain[:end][good], side * stress[:end][good]
    if len(time) < 40:
        return 0.0, 0.0
    width = WIDE * (time[-1] - time[0])
    i = np.arange(len(time))
    a, j, b = (np.searchsorted(time, time + k * width) for k in (-2, 1, 3))
    inside = (time - time[0] > 2 * width) & (b < len(time)) & (i - a > 1) & (j - i > 0)
    a, i, j, b = a[inside], i[inside], j[inside], b[inside]
    rises = np.stack([force[i] - force[a], force[b] - force[j]])
    ways = np.stack([strain[i] - strain[a], strain[b] - strain[j]])
    speeds = ways / np.stack([time[i] - time[a], time[b] - time[j]])
    clear = (rises.min(axis=0) > QUIET * noise(stress)) & (ways.min(axis=0) > 0)
    clear &= speeds.max(axis=0) < STEADY * speeds.min(axis=0)
    if not clear.any():
        return 0.0, 0.0
    i, j = i[clear], j[clear]
    soft = ways[:, clear] / rises[:, clear]
    lost = strain[j] - strain[i] - soft.max(axis=0) * (force[j] - force[i])
    even = soft.max(axis=0) < EVEN * soft.min(axis=0)
    loud = lost / soft.max(axis=0) < LOUD * noise(stress)
    usual = float(np.quantile(np.abs(lost), 0.75))
    lost = np.where(even & ~loud & (lost > RARE * usual), lost, 0.0)
    most_lost = float(lost.max())
    if not most_lost > 0:
        return 0.0, 0.0
    whole = np.flatnonzero(lost > 0.9 * most_lost)
    middle = 0.5 * (time[i[whole[0]]] + time[j[whole[-1]]])
    return most_lost / top, float(middle - chunk.time_s[0])


OUT, HOME = 0.5, 0.15  # of the largest strain: away from, and back at, the beginning
LIKE = 0.05  # of the largest strain, by which peaks and returns may differ
IDLE = 0.02  # of the peak stress: what changes no more while strained bears nothing
RETURNS = 4  # at least, to see that they do not settle
STEADILY = (0.6, 0.15)  # slope of the later half, and scatter, over the whole change


def creeping(chunk: Chunk, stress: Array) -> tuple[float, float]:
    """Change of stress a second at one strain, cycle after cycle; and of how much.

    Steady cycles leave a material in a steady state, which it nears ever more slowly;
    But they relax, away from the load: a change that way tells of no drift, unless
    nothing is loaded at the return. 0 where the change slows down, and nan where there
    are too few like cycles.
    """
    strain = chunk.strain - chunk.strain[0]
    top = float(np.abs(strain).max())
    size, high = np.abs(strain) / top, float(np.nanmax(np.abs(stress)))
    where = np.where(size > OUT, 1, np.where(size < HOME, -1, 0))
    known = np.flatnonzero(where)
    swing = np.flatnonzero(np.diff(where[known])) + 1
    rows = []
    for visit in np.split(known, swing)[1:]:
        if where[visit[0]] > 0:
            peak = float(size[visit].max())
            continue
        part = strain[visit]
        low = part[np.argmin(np.abs(part))]
        near = visit[np.abs(part - low) < 0.5 * LIKE * top]
        near = near[np.isfinite(stress[near])]
        if len(near):
            middle = chunk.time_s[near[len(near) // 2]]
            gone = visit[np.isfinite(stress[visit])]
            gone = gone[np.abs(strain[gone] - low) < LIKE * top]
            span = np.ptp(np.quantile(stress[gone], [0.1, 0.9])) / high
            rows.append((middle, np.median(stress[near]), low / top, peak, span))
    if len(rows) < RETURNS:
        return np.nan, 0.0
    time, level, back, peaks, spans = np.array(rows).T
    if max(np.ptp(back), np.ptp(peaks)) > LIKE:
        return np.nan, 0.0
    slope, level_0 = np.polyfit(time, level, 1)
    late = slice(len(time) // 2, None)
    later = np.polyfit(time[late], level[late], 1)[0]
    change = slope * np.ptp(time)
    scatter = np.std(level - slope * time - level_0)
    steady, straight = STEADILY
    side = np.sign(strain[np.argmax(size)])
    if slope * side < 0 and np.median(spans) > IDLE:
        return np.nan, 0.0
    if later * np.sign(slope) < steady * abs(slope) or scatter > straight * abs(change):
        return 0.0, 0.0
    return float(slope), float(abs(change))


def flat(chunk: Chunk, at: NDArray[np.bool]) -> float:
    """Longest way of strain (its range) along which `at` holds without a break."""
    edge = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(int)))
    runs = zip(edge[::2], edge[1::2], strict=True)
    return max((float(np.ptp(chunk.strain[a:b])) for a, b in runs), default=0.0)
