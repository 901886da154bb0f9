"""Cyclic and hold recordings cut into loading, unloading and holds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, InputError
from softnn.prepare.curve import Indices
from softnn.prepare.smoothing import white_noise
from softnn.recording import Recording

Kind = Literal["loading", "unloading", "hold"]
KINDS: tuple[Kind, ...] = ("loading", "unloading", "hold")
LOADING, UNLOADING, HOLD = range(3)


@dataclass(frozen=True)
class Segment:
    """Samples `start` to `stop` (not included) of one kind; cycles count from 1.

    Loading leads away from zero strain, whichever the sign. A cycle begins with a
    loading that follows an unloading.
    """

    kind: Kind
    cycle: int
    start: int
    stop: int


def segments(
    recording: Recording, reversal: float = 0.05, dwell: float = 0.15
) -> list[Segment]:
    """Return loading, unloading and holds of a recording, in order and without gaps.

    The strain is read in steps of 0.5 % of its range (more if it is noisy), so noise, a
    coarse sensor and small overshoots do not count. The strain turns where it returns
    by the fraction `reversal` of its range. It is held where it stays within a fifth of
    a step for long: longer than the usual time for the fraction `dwell` of its range.
    Three such steps or more in one direction are a slow ramp, not holds.

    >>> t = np.arange(0, 4.01, 0.01)
    >>> strain = np.interp(t, [0, 1, 2, 3, 4], [0, 0.5, 0.5, 0, 0.5])
    >>> [(s.kind, s.cycle) for s in segments(Recording(t, strain, strain))]
    [('loading', 1), ('hold', 1), ('unloading', 1), ('loading', 2)]
    """
    x = recording.strain
    if np.isnan(x).any():
        raise InputError(
            f"{int(np.isnan(x).sum())} samples have no strain; leave them out first",
            file=recording.source or recording.name or None,
        )
    away = x - x[0]
    x = -x if -away.min() > away.max() else x
    reach = float(np.ptp(x))
    step = max(5e-3 * reach, 6 * white_noise(x))
    if 2 * step >= reach:  # nothing but noise
        return [Segment("hold", 1, 0, len(x))]
    loading = _loading(x, _marks(x, step), reversal * reach)
    kinds = np.where(loading, LOADING, UNLOADING)
    # Finer for holds: the rounded top of a sine stays long within a coarse step.
    fine = max(step / 5, 6 * white_noise(x))
    for start, stop in _holds(recording.time_s, x, fine, dwell * reach / fine):
        kinds[start:stop] = HOLD
    return _segments(x, kinds, 2 * step)


def _marks(x: Array, step: float) -> Indices:
    """Samples at which `x` has moved by `step` since the last of them; and the ends."""
    marks, level = [0], x[0]
    for i, value in enumerate(x.tolist()):
        if abs(value - level) >= step:
            marks.append(i)
            level = value
    return np.array(marks + [len(x) - 1] * (marks[-1] < len(x) - 1))


def _loading(x: Array, marks: Indices, threshold: float) -> NDArray[np.bool_]:
    """True (n,) where `x` is on its way up, between reversals of over `threshold`."""
    levels = x[marks].tolist()
    high = low = 0  # marks of the extremes since the last turn
    turns: list[tuple[int, bool]] = []  # mark, and whether it goes up from there
    for i, level in enumerate(levels):
        high, low = (
            i if level > levels[high] else high,
            i if level < levels[low] else low,
        )
        up = turns[-1][1] if turns else None
        if up is not False and levels[high] - level >= threshold:
            turns.append((high, False))
            high = low = i
        elif up is not True and level - levels[low] >= threshold:
            turns.append((low, True))
            high = low = i
    loading = np.full(len(x), turns[0][1])
    for k, (mark, up) in enumerate(turns):
        begin, end = marks[max(mark - 1, 0)], marks[min(mark + 1, len(marks) - 1)]
        around = x[begin : end + 1]
        turn = begin + int(around.argmin() if up else around.argmax())
        if k or abs(x[turn] - x[0]) >= threshold:
            loading[: turn + 1] = np.where(k, loading[: turn + 1], not up)
            loading[turn + 1 :] = up
    return loading


def _holds(time: Array, x: Array, step: float, steps: float) -> list[tuple[int, int]]:
    """Where `x` stays within a step for as long as it usually takes for `steps`."""
    marks = _marks(x, step)
    travel = np.diff(x[marks])
    whole = np.abs(travel) >= step
    slowness = np.diff(time[marks]) / np.maximum(np.abs(travel) / step, 1)
    inside = time[np.maximum(marks[1:] - 1, marks[:-1])] - time[marks[:-1]]
    slow = inside > steps * np.median(slowness[whole])
    holds: list[tuple[int, int]] = []
    for first, last in _runs(slow):
        stretch = x[marks[first] : marks[last] + (marks[last] == len(x) - 1)]
        if not slow[first] or (last - first > 3 and np.ptp(stretch) >= 3 * step):
            continue
        near = np.abs(stretch - np.median(stretch)) <= max(step / 4, 3 * white_noise(x))
        start, stop = marks[first] + np.flatnonzero(near)[[0, -1]] + [0, 1]
        if holds and np.ptp(x[holds[-1][0] : stop]) < 2 * step:
            start = holds.pop()[0]
        holds.append((int(start), int(stop)))
    return holds


def _segments(x: Array, kinds: NDArray[np.int_], least: float) -> list[Segment]:
    """Runs of one kind with cycles counted; ramps shorter than `least` are absorbed."""
    runs = _runs(kinds)
    for before, (start, stop) in zip([None, *runs], runs, strict=False):
        short = abs(x[stop - 1] - x[start]) < least
        if kinds[start] != HOLD and short and len(runs) > 1:
            kinds[start:stop] = kinds[stop] if before is None else kinds[start - 1]
    found: list[Segment] = []
    cycle, unloaded = 1, False
    for start, stop in _runs(kinds):
        kind = kinds[start]
        cycle += bool(kind == LOADING and unloaded)
        unloaded = kind == UNLOADING or (unloaded and kind == HOLD)
        found.append(Segment(KINDS[kind], cycle, start, stop))
    return found


def _runs(labels: NDArray[np.generic]) -> list[tuple[int, int]]:
    """Start and stop of every stretch of equal labels."""
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), len(labels)]
    return list(pairwise(edges))
