"""Strain programmes on a fine uniform clock, and the moments at which samples fall.

Every programme starts and ends at rest at zero strain; corners are rounded, as a
machine of finite power rounds them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

Array = NDArray[np.float64]
STEP_S = 0.004  # of the fine clock; 25 steps in the shortest relaxation time planted


@dataclass(frozen=True)
class Pace:
    """What the programmes of one case have in common.

    `peak` largest strain; `ramp_s` time from zero to it at the fastest rate;
    `corner_s` rounding; `cycle_hz` of the sine; `compress` lowest strain over peak.
    """

    peak: float
    ramp_s: float
    corner_s: float
    cycle_hz: float
    compress: float = 0.0


@dataclass(frozen=True)
class Imposed:
    """One programme: fine strain (n,), and the indices (m,) that are written down."""

    family: str
    strain: Array
    index: NDArray[np.int64]

    @property
    def time_s(self) -> Array:
        return STEP_S * np.arange(len(self.strain), dtype=np.float64)


Points = list[tuple[float, float]]  # (duration s, strain at its end)


def polyline(points: Points, corner_s: float) -> Array:
    """Straight lines through `points` from zero strain, corners rounded.

    Three running means make the acceleration continuous.
    """
    durations = np.array([corner_s, *(d for d, _ in points), corner_s])
    targets = np.array([0.0, 0.0, *(e for _, e in points), points[-1][1]])
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    time = np.arange(round(knots[-1] / STEP_S) + 1) * STEP_S
    strain = np.interp(time, knots, targets)
    width = max(1, round(corner_s / 3 / STEP_S))
    for _ in range(3):
        strain = uniform_filter1d(strain, width, mode="nearest")
    return strain - strain[0]


def ramp(rng: np.random.Generator, pace: Pace, slower: float) -> Array:
    """Up, a short dwell or none, and down again; slower on the way by `slower`."""
    top = pace.peak * rng.uniform(0.88, 1.0)
    up = pace.ramp_s * slower * top / pace.peak
    points = [(up, top), (rng.uniform(0.0, 1.0), top), (up, 0.0)]
    if pace.compress:
        low = pace.compress * pace.peak
        points += [(up * abs(low) / top, low), (up * abs(low) / top, 0.0)]
    return polyline(points, pace.corner_s)


def hold(rng: np.random.Generator, pace: Pace) -> Array:
    """A quick ramp, 300 s at rest, and back."""
    level = pace.peak * rng.uniform(0.6, 0.95)
    return polyline([(pace.ramp_s, level), (300.0, level), (pace.ramp_s, 0.0)], 0.1)


def growing(rng: np.random.Generator, pace: Pace) -> Array:
    """Cycles of growing amplitude, one to three of each."""
    levels, repeats = int(rng.integers(4, 7)), int(rng.integers(1, 4))
    points: Points = []
    for level in np.linspace(1 / levels, 1, levels) * pace.peak:
        leg = 2 * pace.ramp_s * level / pace.peak
        low = pace.compress * level
        points += [(leg, float(level)), (leg, float(low))] * repeats
    return polyline([*points, (0.5, 0.0)], pace.corner_s)


def staircase(rng: np.random.Generator, pace: Pace) -> Array:
    """Steps up and down with a dwell on each."""
    steps, dwell = int(rng.integers(3, 6)), rng.uniform(6.0, 14.0)
    up = [pace.peak * k / steps * rng.uniform(0.97, 1.0) for k in range(1, steps + 1)]
    leg = pace.ramp_s / steps
    points: Points = []
    for level in [*up, *up[-2::-1], 0.0]:
        points += [(leg, level), (dwell, level)]
    return polyline(points, pace.corner_s)


def sine(rng: np.random.Generator, pace: Pace) -> Array:
    """Fifteen to forty cycles from zero up and back, or through zero."""
    cycles = int(rng.integers(15, 41))
    time = np.arange(round(cycles / pace.cycle_hz / STEP_S) + 1) * STEP_S
    phase = 2 * np.pi * pace.cycle_hz * time
    top = pace.peak * rng.uniform(0.5, 0.9)
    # Down to `low` after the first cycle, back to zero with the last.
    turn = phase / (2 * np.pi)
    ease = np.clip(np.minimum(turn, cycles - turn), 0, 1)
    low = pace.compress * top * ease**2 * (3 - 2 * ease)
    return low + (top - low) * (1 - np.cos(phase)) / 2


def zigzag(rng: np.random.Generator, pace: Pace) -> Array:
    """Turning points drawn at random, at rates drawn over a decade."""
    points: Points = []
    here = 0.0
    for turn in range(int(rng.integers(8, 15))):
        there = pace.peak * (
            rng.uniform(0.5, 1.0) if turn % 2 == 0 else rng.uniform(0.0, 0.45)
        )
        slower = 10 ** rng.uniform(0, 1)
        points.append((pace.ramp_s * slower * abs(there - here) / pace.peak, there))
        here = there
    return polyline([*points, (2 * pace.ramp_s, 0.0)], pace.corner_s)


def chirp(rng: np.random.Generator, pace: Pace) -> Array:
    """A sine whose frequency grows fourfold."""
    low, duration = pace.cycle_hz / 2, 14 / pace.cycle_hz
    time = np.arange(round(duration / STEP_S) + 1) * STEP_S
    phase = 2 * np.pi * low * (time + 1.5 * time**2 / duration)
    top = pace.peak * rng.uniform(0.6, 1.0)
    return _closed(top * (1 - np.cos(phase)) / 2, pace)


def recovery(rng: np.random.Generator, pace: Pace) -> Array:
    """The same cycle before and after a minute at zero strain."""
    top, leg = pace.peak * rng.uniform(0.7, 1.0), 2 * pace.ramp_s
    cycle = [(leg, top), (leg, 0.0)]
    return polyline([*cycle, *cycle, (60.0, 0.0), *cycle], pace.corner_s)


def interrupted(rng: np.random.Generator, pace: Pace) -> Array:
    """One way up with short partial unloadings, then one way down."""
    points: Points = []
    for level in np.array([0.3, 0.55, 0.8, 1.0]) * pace.peak:
        back = level * rng.uniform(0.4, 0.8)
        leg = 3 * pace.ramp_s * (level - back) / pace.peak
        points += [(pace.ramp_s, float(level)), (leg, back), (leg, float(level))]
    return polyline([*points, (2 * pace.ramp_s, 0.0)], pace.corner_s)


def two_tone(rng: np.random.Generator, pace: Pace) -> Array:
    """A slow and a quick sine added."""
    slow, cycles = pace.cycle_hz / 4, int(rng.integers(4, 8))
    time = np.arange(round(cycles / slow / STEP_S) + 1) * STEP_S
    ratio = float(rng.choice([5.0, 6.0, 7.0]))
    share = rng.uniform(0.15, 0.35)
    base = (1 - np.cos(2 * np.pi * slow * time)) / 2
    quick = (1 - np.cos(2 * np.pi * slow * ratio * time)) / 2
    return pace.peak * rng.uniform(0.7, 1.0) * ((1 - share) * base + share * quick)


def _closed(strain: Array, pace: Pace) -> Array:
    """`strain` brought back to zero at the end, at ramp speed."""
    n = round(pace.ramp_s / STEP_S)
    tail = strain[-1] * (1 + np.cos(np.pi * np.arange(1, n + 1) / n)) / 2
    return np.concatenate([strain, tail])


Family = Callable[[np.random.Generator, Pace], Array]
FAMILIES: dict[str, Family] = {
    "ramp-fast": lambda rng, pace: ramp(rng, pace, 1.0),
    "ramp-medium": lambda rng, pace: ramp(rng, pace, 10**0.5),
    "ramp-slow": lambda rng, pace: ramp(rng, pace, 10.0),
    "hold": hold,
    "growing": growing,
    "staircase": staircase,
    "sine": sine,
}
# Kept for trials: no diagnosis has been developed on them.
HELD_OUT: dict[str, Family] = {
    "zigzag": zigzag,
    "chirp": chirp,
    "recovery": recovery,
    "interrupted": interrupted,
    "two-tone": two_tone,
}


def sample(
    rng: np.random.Generator, strain: Array, samples: int, clock: str
) -> NDArray[np.int64]:
    """Indices of the fine clock that are written down, about `samples` of them.

    `clock` is "steady" (one interval), "two-speed" (dense while the machine moves and
    for 10 s after, sparse at rest), "jittered" or "gappy" (jittered, with stretches
    lost and lone samples dropped).
    """
    n = len(strain)
    stride = max(1, round(n / samples))
    if clock == "steady":
        return np.arange(0, n, stride, dtype=np.int64)
    speed = np.abs(np.gradient(strain))
    after = round(10 / STEP_S)
    moving = uniform_filter1d(
        (speed > 1e-3 * speed.max()).astype(float), after, origin=after // 2 - 1
    )
    density = np.where(moving > 1e-9, 1.0, 0.1)
    count = np.cumsum(density)
    ticks = np.arange(0, count[-1], count[-1] / samples)
    if clock != "two-speed":
        ticks = ticks + rng.uniform(-0.35, 0.35, len(ticks)) * (count[-1] / samples)
    index = np.unique(np.clip(np.searchsorted(count, ticks), 0, n - 1))
    index[0] = 0  # at rest: whoever reads it may take what came before as nothing
    if clock == "gappy":
        keep = rng.random(len(index)) > 0.03
        for _ in range(int(rng.integers(1, 4))):
            start = int(rng.integers(0, len(index)))
            keep[start : start + int(rng.integers(5, max(6, len(index) // 25)))] = False
        keep[0] = True
        index = index[keep]
    return index.astype(np.int64)
