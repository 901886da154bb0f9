"""What the machine is told: corners in units of the largest strain and of a pace.

A programme is a list of corners (time, level); the machine goes straight between
them, or with rounded corners. Samples are dense, and between two samples the machine
goes straight: what is recorded is what happened.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, loguniform

RATES = (4, 5, 8, 10, 12.5, 20, 25, 40, 50, 80, 100, 125, 200)
SAMPLES = (300, 3000)
Corners = tuple[list[float], list[float]]


@dataclass(frozen=True)
class Course:
    """What one recording imposes; temperatures whether recorded or not."""

    kind: str
    rate_Hz: float
    time_s: Array
    strain: Array
    warmth_C: Array


@dataclass(frozen=True)
class Programme:
    """`make(rng, both)`: corners; `both` goes through zero; `monotone` never back."""

    name: str
    side: str
    make: Callable[[Rng, bool], Corners]
    monotone: bool = False
    cyclic: bool = False
    smooth: bool = False


def _through(levels: list[float], paces: list[float] | float) -> Corners:
    """Corners at unit speed over `paces`; a repeated level holds for its pace."""
    if isinstance(paces, float):
        paces = [paces] * (len(levels) - 1)
    times = [0.0]
    for a, b, p in zip(levels, levels[1:], paces, strict=False):
        times.append(times[-1] + (abs(b - a) * p if a != b else p))
    return times, levels


def ramp(rng: Rng, both: bool) -> Corners:
    """Up and down again."""
    return _through([0, 1, 0], 1.0)


def hold(rng: Rng, both: bool) -> Corners:
    """Up quickly, and a long hold."""
    quick = rng.uniform(0.1, 0.5)
    return _through([0, 1, 1], [quick, rng.uniform(6, 30)])


def growing(rng: Rng, both: bool) -> Corners:
    """Cycles to larger and larger peaks, each perhaps repeated."""
    steps, repeats = int(rng.integers(3, 6)), int(rng.integers(1, 4))
    levels = [0.0]
    for i in range(1, steps + 1):
        for _ in range(repeats):
            levels += [i / steps, -i / steps if both else 0.0]
    return _through(levels + ([0.0] if both else []), 1.0)


def nested(rng: Rng, both: bool) -> Corners:
    """Small loops inside a large one, on the way up and on the way down."""
    levels = [0.0]
    for level in sorted(rng.uniform(0.3, 0.9, 2)):
        levels += [level, level - rng.uniform(0.1, 0.25)]
    levels += [1.0]
    for level in sorted(rng.uniform(0.2, 0.7, 2))[::-1]:
        levels += [level, level + rng.uniform(0.1, 0.25)]
    return _through([*levels, 0.0], 1.0)


def sine(rng: Rng, both: bool) -> Corners:
    """Sines from rest, about zero or about a mean."""
    turns, period = int(rng.integers(4, 12)), rng.uniform(0.6, 2.0)
    t = np.linspace(0, turns, turns * 80 + 1)
    wave = np.sin(2 * np.pi * t) if both else (1 - np.cos(2 * np.pi * t)) / 2
    return (t * period).tolist(), wave.tolist()


def multistep(rng: Rng, both: bool) -> Corners:
    """Steps up, a hold on each."""
    levels, paces = [0.0], []
    for level in np.sort(rng.uniform(0.1, 0.95, int(rng.integers(2, 5)))).tolist() + [
        1.0
    ]:
        levels += [level, level]
        paces += [rng.uniform(0.2, 1.0), rng.uniform(1, 4)]
    return _through(levels, paces)


def trapezoid(rng: Rng, both: bool) -> Corners:
    """Up, hold, down, hold, again and again."""
    levels, paces = [0.0], []
    for i in range(int(rng.integers(2, 6))):
        peak = rng.uniform(0.5, 1.0) * (-1.0 if both and i % 2 else 1.0)
        levels += [peak, peak, 0.0, 0.0]
        paces += [1.0, rng.uniform(0.5, 3), 1.0, rng.uniform(0.5, 2)]
    return _through(levels, paces)


def staircase(rng: Rng, both: bool) -> Corners:
    """Steps up and steps down."""
    n = int(rng.integers(3, 6))
    up = [i / n for i in range(1, n + 1)]
    levels, paces = [0.0], []
    for level in up + up[-2::-1] + [0.0]:
        levels += [level, level]
        paces += [rng.uniform(0.3, 1), rng.uniform(0.8, 2.5)]
    return _through(levels, paces)


def sweep(rng: Rng, both: bool) -> Corners:
    """A sine whose frequency rises tenfold or less."""
    turns, factor = int(rng.integers(6, 14)), rng.uniform(3, 10)
    u = np.linspace(0, 1, turns * 80 + 1)
    phase = turns * (factor**u - 1) / (factor - 1)
    turn = 2 * np.pi * phase
    wave = np.sin(turn) if both else (1 - np.cos(turn)) / 2
    return (u * turns).tolist(), wave.tolist()


def rate_jump(rng: Rng, both: bool) -> Corners:
    """One way, the speed jumping between quick and slow."""
    marks = [0.0, *np.sort(rng.uniform(0.1, 0.9, 4)).tolist(), 1.0]
    quick, slow = rng.uniform(0.2, 0.5), rng.uniform(2, 6)
    return _through(marks, [quick if i % 2 else slow for i in range(5)])


def walk(rng: Rng, both: bool) -> Corners:
    """To levels at random, at speeds at random."""
    n = int(rng.integers(8, 20))
    levels = rng.uniform(-1.0 if both else 0.0, 1.0, n)
    levels[rng.integers(n)] = 1.0
    paces = np.exp(rng.uniform(np.log(0.3), np.log(2.5), n + 1))
    return _through([0.0, *levels.tolist(), 0.0], paces.tolist())


def recovery(rng: Rng, both: bool) -> Corners:
    """Load and unload, a long rest at zero, the same again."""
    rest = rng.uniform(2, 8)
    levels = [0.0, 1.0, 0.0, 0.0, 1.0, 0.0]
    return _through(levels, [1.0, 1.0, rest, 1.0, 1.0])


def cycles(rng: Rng, both: bool) -> Corners:
    """The same triangle again and again."""
    levels = [0.0]
    for _ in range(int(rng.integers(5, 16))):
        levels += [1.0, -1.0 if both else rng.choice([0.0, 0.0, 0.2])]
    return _through(levels, 1.0)


PROGRAMMES = (
    Programme("ramp", DEVELOPMENT, ramp),
    Programme("hold", DEVELOPMENT, hold, monotone=True),
    Programme("growing", DEVELOPMENT, growing, cyclic=True),
    Programme("nested", DEVELOPMENT, nested),
    Programme("sine", DEVELOPMENT, sine, cyclic=True, smooth=True),
    Programme("multistep", DEVELOPMENT, multistep, monotone=True),
    Programme("trapezoid", HELD_OUT, trapezoid),
    Programme("staircase", HELD_OUT, staircase),
    Programme("sweep", HELD_OUT, sweep, cyclic=True, smooth=True),
    Programme("rate_jump", HELD_OUT, rate_jump, monotone=True),
    Programme("walk", HELD_OUT, walk),
    Programme("recovery", HELD_OUT, recovery),
    Programme("cycles", HELD_OUT, cycles, cyclic=True),
)


def rounded(e: Array, width: int) -> Array:
    """Corners rounded over `width` samples; the first strain stays as it is."""
    if width < 2 or len(e) < 4 * width:
        return e
    window = np.hanning(2 * width + 1)[1:-1]
    window /= window.sum()
    k = len(window) // 2
    padded = np.concatenate([2 * e[0] - e[k:0:-1], e, 2 * e[-1] - e[-2 : -k - 2 : -1]])
    return np.convolve(padded, window, "valid")


@dataclass(frozen=True)
class Habits:
    """Of a case: what all its recordings have in common."""

    em: float
    mode: str
    pace_s: float
    home: bool  # every recording ends at zero strain
    irregular: bool
    corners_s: float
    swing_C: float
    rest_C: float


def draw_course(rng: Rng, programme: Programme, habits: Habits, top: bool) -> Course:
    """One recording: its pace, its rate, its samples."""
    sign = {"tension": 1.0, "compression": -1.0}.get(habits.mode, 0.0)
    both = sign == 0 and rng.random() < 0.6
    times, levels = programme.make(rng, both)
    if habits.home and levels[-1] != 0:
        times, levels = times + [times[-1] + 1.0], levels + [0.0]
    sign = sign or float(rng.choice([-1, 1]))
    size = habits.em * sign * (1.0 if top else rng.uniform(0.6, 1.0))
    pace = habits.pace_s * loguniform(rng, 0.3, 3.0)
    pace = float(np.clip(pace, 2.0 / times[-1], 600.0 / times[-1]))
    knots = np.array(times) * pace
    start = 0.0 if rng.random() < 0.4 else loguniform(rng, 0.2, 2.0)
    if start:
        knots, levels = np.concatenate([[0.0], knots + start]), [0.0, *levels]
    span = float(knots[-1])
    rates = [r for r in RATES if SAMPLES[0] <= r * span <= SAMPLES[1]]
    rate = float(rates[rng.integers(len(rates))])
    n = int(span * rate) + 1
    time = np.arange(n) / rate
    if habits.irregular:
        if rng.random() < 0.5:  # stamps that jitter
            time[1:] += rng.uniform(-0.3, 0.3, n - 1) / rate
        else:  # a logger that leaves rows out
            time = time[np.sort(rng.permutation(n - 1)[: int(0.85 * n)] + 1)]
            time = np.concatenate([[0.0], time])
        time = np.round(time, 5)
    strain = size * np.interp(time, knots, levels)
    strain = rounded(strain, int(habits.corners_s * rate)) if start else strain
    warmth = np.full(len(time), habits.rest_C)
    if habits.swing_C:
        turns, phase = loguniform(rng, 0.3, 2.0), rng.uniform(0, 2 * np.pi)
        shift = rng.uniform(-0.5, 0.5)
        wave = np.sin(2 * np.pi * turns * time / span + phase) / 2
        warmth = warmth + habits.swing_C * (wave + shift)
    return Course(programme.name, rate, time, strain, warmth)
