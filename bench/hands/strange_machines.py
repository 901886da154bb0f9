"""Machines and loggers that do what is on no list of effects."""

from __future__ import annotations

import numpy as np

from bench.hands import kernels
from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, some
from bench.hands.testing import Act, Law, Setup


def lead_screw(rng: Rng, s: Setup) -> Act:
    """The pitch of the screw comes through: a sine in strain, and its second."""
    pitch, phase = s.em * rng.uniform(0.03, 0.2), rng.uniform(0, 6.28)

    def rig(i: int, t: Array, e: Array, a: float) -> Array:
        turn = 2 * np.pi * e / pitch
        wave = np.sin(turn + phase) - np.sin(phase) + 0.3 * np.sin(2 * turn)
        return e + a * pitch * wave

    return Act(0.15, {"pitch": pitch, "phase": phase}, rig=rig)


def end_stop(rng: Rng, s: Setup) -> Act:
    """The carriage meets a stop in some recordings: a stiff spring beside."""
    met, at = some(rng, s.n, 0.3, 0.7), rng.uniform(0.65, 0.9)
    power = rng.uniform(1, 1.5)

    def sensor(i: int, t: Array, x: Array, a: float) -> Array:
        if i not in met:
            return x
        e = np.interp(t, s.courses[i].time_s, s.courses[i].strain)
        into = np.maximum(np.abs(e) / s.em - at, 0) / (1 - at)
        return x + a * s.peak * np.sign(e) * into**power

    return Act(1.0, {"recordings": met, "at": at}, sensor=sensor)


def clock_skew(rng: Rng, s: Setup) -> Act:
    """The stress logger's clock runs fast or slow, more and more."""
    way = float(rng.choice([-1, 1]))

    def sensor(i: int, t: Array, x: Array, a: float) -> Array:
        return np.interp(t * (1 + way * a), t, x)

    return Act(0.1, {"way": way}, sensor=sensor)


def mains_hum(rng: Rng, s: Setup) -> Act:
    """Hum, folded down by sampling: a steady sine of a frequency of its own."""
    beats, phases = rng.uniform(0.05, 0.45, s.n), rng.uniform(0, 6.28, s.n)
    if rng.random() < 0.5:  # a building that sways: the same frequency everywhere
        beats = np.array([rng.uniform(0.1, 0.6) / c.rate_Hz for c in s.courses])

    def sensor(i: int, t: Array, x: Array, a: float) -> Array:
        f = beats[i] * s.courses[i].rate_Hz
        return x + a * s.peak * np.sin(2 * np.pi * f * t + phases[i])

    return Act(
        0.3, {"frequency_of_rate": beats.tolist()}, own_faults=True, sensor=sensor
    )


def bursts(rng: Rng, s: Setup) -> Act:
    """A relay nearby: bursts that fade, at moments of some recordings."""
    events = {
        i: (rng.uniform(0.05, 0.95, int(rng.integers(1, 5))), rng.choice([-1.0, 1.0]))
        for i in some(rng, s.n, 0.4, 0.9)
    }
    last = rng.uniform(0.005, 0.03)

    def sensor(i: int, t: Array, x: Array, a: float) -> Array:
        if i not in events:
            return x
        moments, sign = events[i]
        u = (t[:, None] / t[-1] - moments) / last
        return x + a * s.peak * sign * np.where(u >= 0, np.exp(-np.abs(u)), 0).sum(1)

    shown = {str(i): m.tolist() for i, (m, _) in events.items()}
    return Act(0.5, {"moments": shown}, sensor=sensor)


def asymmetric_gain(rng: Rng, s: Setup) -> Act:
    """A bent load path: the cell reads rising and falling load differently."""
    tau = rng.uniform(0.2, 1.0)

    def sensor(i: int, t: Array, x: Array, a: float) -> Array:
        dt = np.diff(t, prepend=t[0])
        slow = x[0] + kernels.follow(x - x[0], dt, tau, tau)
        way = np.tanh((x - slow) / (0.02 * s.peak))
        return x * (1 + a * way)

    return Act(0.3, {"tau_s": tau}, sensor=sensor)


_A, _R, _S = "alien", "rig", "sensor"
STRANGERS = (
    Law(_A, "lead_screw", DEVELOPMENT, "ISO 3408-3, travel deviation", lead_screw, _R),
    Law(_A, "end_stop", HELD_OUT, "contact; Hertz 1882 at power 1.5", end_stop, _S),
    Law(_A, "clock_skew", DEVELOPMENT, "two clocks, no paper", clock_skew, _S),
    Law(_A, "mains_hum", DEVELOPMENT, "aliasing; Shannon 1949", mains_hum, _S),
    Law(_A, "bursts", HELD_OUT, "IEC 61000-4-4, fast transients", bursts, _S),
    Law(
        _A, "direction_gain", HELD_OUT, "OIML R 60, reversibility", asymmetric_gain, _S
    ),
)
