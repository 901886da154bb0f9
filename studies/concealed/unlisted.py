"""Things that really happen and are on no list of effects.

Each differs from the base by 8-15 % of the peak stress at strength 1, calibrated on
the case itself (`forge.plant_unlisted`); `size` below multiplies the form.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from studies.concealed import marching
from studies.concealed.planting import Context, Planted, Signals
from studies.concealed.programmes import STEP_S, Array, Imposed

Make = Callable[[Context, float], Planted]


def crystallisation(c: Context, size: float) -> Planted:
    """Crystals form at large strain, stiffen it and melt late on the way back."""
    onset, time = c.pace.peak * c.rng.uniform(0.5, 0.65), c.rng.uniform(0.5, 2.0)

    def parts(h: Signals) -> None:
        share = marching.crystals(h.strain, onset, 0.6 * onset, time)
        h.extra = h.extra + size * c.peak / c.pace.peak * share

    return Planted("crystallisation", "onset and melt", {"size": size}, parts=parts)


def hum(c: Context, size: float) -> Planted:
    """A periodic disturbance of the force channel, period 0.6-6 s."""
    period = 10 ** c.rng.uniform(-0.2, 0.8)
    phase = c.rng.uniform(0, 2 * np.pi, len(c.programmes))

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        turn = 2 * np.pi * programme.time_s / period + phase[i]
        return stress + size * c.peak * (np.sin(turn) + 0.3 * np.sin(3 * turn))

    return Planted("hum", "two harmonics", {"period_s": period}, sensor=sensor)


def humidity(c: Context, size: float) -> Planted:
    """Somebody opens a door: stiffness sinks at a moment of some recordings."""
    which = c.some(0.5)
    when = {i: c.rng.uniform(0.25, 0.6) for i in which}

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        if i not in when:
            return stress
        t = programme.time_s
        return stress * (1 - size / (1 + np.exp(-(t - when[i] * t[-1]) / 2.0)))

    return Planted("humidity", "step of stiffness", {"when": when}, sensor=sensor)


def motor_noise(c: Context, size: float) -> Planted:
    """The running motor lifts the force reading, whichever way it turns."""
    power = c.rng.uniform(0.3, 0.6)
    fast = c.pace.peak / c.pace.ramp_s

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        speed = np.abs(np.gradient(programme.strain, STEP_S)) / fast
        return stress + size * c.peak * speed**power

    return Planted("motor_noise", "power of speed", {"power": power}, sensor=sensor)


def stick_slip(c: Context, size: float) -> Planted:
    """Saw teeth with a period in strain."""
    pitch = c.pace.peak * c.rng.uniform(0.06, 0.12)

    def parts(h: Signals) -> None:
        stick = size * c.peak
        h.extra = h.extra + marching.stick_slip(h.strain, stick / pitch, stick, -0.6)

    return Planted("stick_slip", "saw teeth", {"pitch": pitch}, parts=parts)


def thixotropy(c: Context, size: float) -> Planted:
    """Structure breaks with travel and comes back at rest."""
    rebuild, breaking = c.rng.uniform(10, 40), c.rng.uniform(1.0, 3.0) / c.pace.peak

    def parts(h: Signals) -> None:
        factor = 1 - size * (1 - marching.structure(h.rate, rebuild, breaking))
        h.spring, h.branches = h.spring * factor, h.branches * factor

    return Planted("thixotropy", "structure", {"rebuild_s": rebuild}, parts=parts)


def one_way_flow(c: Context, size: float) -> Planted:
    """Pore fluid drawn in through a valve: it charges one way only."""
    time = c.rng.uniform(4, 15)

    def parts(h: Signals) -> None:
        scale = size * c.peak / c.pace.peak
        h.extra = h.extra + scale * marching.one_way_flow(h.strain, time)

    return Planted("one_way_flow", "valve", {"time_s": time}, parts=parts)


def leadscrew(c: Context, size: float) -> Planted:
    """A periodic error of the machine's travel: strain wobbles with strain."""
    pitch = c.pace.peak * c.rng.uniform(0.1, 0.25)

    def rig(i: int, programme: Imposed, strain: Array) -> Array:
        return strain + size * c.pace.peak * np.sin(2 * np.pi * strain / pitch)

    return Planted("leadscrew", "periodic travel error", {"pitch": pitch}, rig=rig)


def creep_damage(c: Context, size: float) -> Planted:
    """Stiffness wears with the time spent under high load, not with cycles."""
    power = c.rng.uniform(2, 4)

    def parts(h: Signals) -> None:
        load = np.maximum(h.strain, 0) / c.pace.peak
        wear = np.cumsum(load**power) * STEP_S / 60
        factor = np.exp(-size * np.minimum(wear, 20))
        h.spring, h.branches = h.spring * factor, h.branches * factor

    return Planted("creep_damage", "time under load", {"power": power}, parts=parts)


def breathing(c: Context, size: float) -> Planted:
    """Stiffness rises and falls with the clock."""
    period, phase = c.rng.uniform(8, 25), c.rng.uniform(0, 2 * np.pi)

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        turn = 2 * np.pi * programme.time_s / period + phase
        return stress * (1 + size * np.sin(turn))

    return Planted(
        "breathing", "periodic stiffness", {"period_s": period}, sensor=sensor
    )


def knocks(c: Context, size: float) -> Planted:
    """Somebody walks past: decaying bursts on the force channel."""
    moments = [
        np.sort(c.rng.uniform(0, p.time_s[-1], int(c.rng.integers(2, 7))))
        for p in c.programmes
    ]
    frequency = c.rng.uniform(0.4, 1.2)

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        for moment in moments[i]:
            t = np.maximum(programme.time_s - moment, 0)
            burst = np.sin(2 * np.pi * frequency * t) * np.exp(-t / 1.5)
            stress = stress + size * c.peak * burst
        return stress

    return Planted("knocks", "ringing bursts", {"hz": frequency}, sensor=sensor)


UNLISTED: tuple[Make, ...] = (
    crystallisation,
    hum,
    humidity,
    motor_noise,
    stick_slip,
    thixotropy,
    one_way_flow,
    leadscrew,
    creep_damage,
    breathing,
    knocks,
)
