"""The first rows of a recording: what a machine left there, and where zero is."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Array

MOST = 3  # rows that may be left from before
AFTER = 12  # rows by which the start is judged
JUMP = 8.0  # times the largest step after it
SMALL = 0.003  # of the range: a smaller jump harms nothing
ALONE = 0.3  # of the jump, each in its own range: the other channel goes along
REST = 0.05  # of the range of load: the specimen is not loaded yet
PRELOAD = 0.5  # of the share of travel: a smaller share of load is but a preload
OFFSET = 0.5  # of the range of travel, beyond which the start is the machine's
ODD = 0.02  # of it, beyond which the start is reported


def stale(moved: Array, load: Array) -> int:
    """How many first rows hold values from before the test.

    One channel jumps by many times its later steps while the other does not: the
    machine wrote what its memory held. A step of strain moves both.

    >>> load = np.array([4.6, 0.01, 0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8])
    >>> stale(np.linspace(0, 1, 10) ** 2, load)
    1
    >>> stale(np.r_[0.0, np.ones(9)], np.r_[0.0, np.exp(-np.arange(9.0))])
    0
    """
    found = 0
    if len(moved) < MOST + 4:
        return 0
    for k in range(1, MOST + 1):
        jumps = []
        for values in (moved, load):
            later = values[k : k + AFTER]
            span = float(np.nanmax(values) - np.nanmin(values))
            step = float(np.nanmax(np.abs(np.diff(later)), initial=0.0))
            jump = float(abs(values[k] - values[k - 1]))
            if not np.isfinite(jump) or span == 0:
                jumps.append((0.0, False))
                continue
            jumps.append((jump / span, jump > max(JUMP * step, SMALL * span)))
        for (mine, far), (other, _) in (jumps, jumps[::-1]):
            if far and other < ALONE * mine:
                found = k
        # A step of a test leads away from rest; one back to rest has nothing after it.
        most = float(np.nanmax(np.abs(load[k:])))
        rests = abs(load[k]) <= REST * most and most >= REST * abs(load[k - 1])
        if all(far for _, far in jumps) and rests:
            found = k
    return found


def start(values: Array) -> float:
    """Where a channel starts: the median of its first rows, as long as it rests.

    >>> start(np.array([0.018, 0.021, 0.021, 0.022, 1.3, 2.6])), start(np.arange(9.0))
    (0.021, 0.0)
    """
    good = values[np.isfinite(values)]
    if not len(good):
        return 0.0
    near = np.abs(good[:6] - good[0]) <= SMALL * float(np.ptp(good))
    resting = len(near) if near.all() else int(np.argmin(near))
    return float(np.median(good[:resting]))


def resting(moved: Array) -> int:
    """How many first samples of a travel (n,) stand before it moves, at least one.

    >>> resting(np.array([0.0, 0.0, 0.0, 0.1, 0.2])), resting(np.arange(5.0))
    (3, 1)
    """
    span = float(np.nanmax(moved) - np.nanmin(moved)) if len(moved) else 0.0
    near = ~(np.abs(moved - moved[:1]) > SMALL * span)
    return len(near) if near.all() else max(int(np.argmin(near)), 1)


def at_rest(moved: Array, load: Array) -> float | None:
    """The load before any travel; None where the travel does not begin at zero.

    >>> at_rest(np.array([0.0, 0.0, 0.1, 0.2]), np.array([0.15, 0.17, 0.3, 0.5]))
    0.16
    """
    span = float(np.ptp(moved)) if len(moved) else 0.0
    if span == 0 or abs(moved[0]) > 0.01 * span:
        return None
    return float(np.median(load[: resting(moved)]))


def unloaded(load: Array) -> bool:
    """Whether the load is near zero where the recording starts."""
    good = load[np.isfinite(load)]
    return bool(len(good)) and abs(start(good)) <= REST * float(np.abs(good).max())


def preloaded(moved: Array, load: Array) -> bool:
    """Whether the load at the start is far too small for the travel there.

    As under a preload, at a position that the machine counts from elsewhere.

    >>> travel = np.array([17.5, 18.7, 19.9, 21.1])
    >>> preloaded(travel, np.array([1.5, 2.8, 4.1, 5.5])), preloaded(travel, travel)
    (True, False)
    """
    shares = []
    for values in (moved, load):
        good = values[np.isfinite(values)]
        most = float(np.abs(good).max(initial=0.0))
        shares.append(abs(start(good)) / most if most > 0 else 0.0)
    return shares[1] < PRELOAD * shares[0]


def beginning(moved: Array, load: Array, preload: bool = False) -> tuple[float, float]:
    """Where the travel starts, and that over its range; 0, 0 of a loaded start.

    `preload`: a load too small for that travel is none.
    """
    good = moved[np.isfinite(moved)]
    rests = unloaded(load) or (preload and preloaded(moved, load))
    if len(good) < 2 or not rests:
        return 0.0, 0.0
    first, span = start(good), float(np.ptp(good))
    return first, abs(first) / span if span > 0 else 0.0
