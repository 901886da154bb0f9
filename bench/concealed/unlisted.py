"""Things that really happen and are on no list of effects.

Each differs from the base by 8-15 % of the peak stress at strength 1, calibrated on
the case itself (`forge.plant_unlisted`); `size` below multiplies the form.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from bench.concealed import marching
from bench.concealed.planting import Context, Planted, Signals
from bench.concealed.programmes import STEP_S, Array, Imposed

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
    """Flocs break under stress above a yield stress and form again at rest.

    Quick coarse flocs and slow fine ones; the flow suffers more than the skeleton.
    """
    rebuild = np.array([c.rng.uniform(3, 8), c.rng.uniform(40, 120)])
    breaking = np.array([c.rng.uniform(0.5, 1.5), c.rng.uniform(0.05, 0.2)])
    threshold = c.peak * c.rng.uniform(0.15, 0.35)

    def parts(h: Signals) -> None:
        stress = (h.spring + h.branches) / threshold
        broken = size * (1 - marching.structure(stress, rebuild, breaking))
        h.spring, h.branches = h.spring * (1 - 0.4 * broken), h.branches * (1 - broken)

    parameters: dict[str, object] = {"rebuild_s": float(rebuild[1])}
    return Planted("thixotropy", "flocs under stress", parameters, parts=parts)


def one_way_flow(c: Context, size: float) -> Planted:
    """Pore fluid diffuses through a slab: drawn in slowly, pressed out quickly."""
    time, valve = c.rng.uniform(15, 60), c.rng.uniform(8, 20)
    narrowing = c.rng.uniform(1, 2.5)

    def parts(h: Signals) -> None:
        strain = h.strain / c.pace.peak
        suction = marching.pore_suction(strain, time, valve, narrowing)
        h.extra = h.extra + size * c.peak * suction

    return Planted("one_way_flow", "diffusion", {"time_s": time}, parts=parts)


def leadscrew(c: Context, size: float) -> Planted:
    """Each turn of the screw errs, from its thread's skewed flanks, most where worn."""
    peak = c.pace.peak
    pitch, phase = peak * c.rng.uniform(0.06, 0.35), c.rng.uniform(0, 2 * np.pi)
    skew = c.rng.uniform(0.3, 0.7)
    worn, spread = peak * c.rng.uniform(0.2, 0.8), peak * c.rng.uniform(0.3, 0.6)

    def error(strain: Array) -> Array:
        turn = 2 * np.pi * strain / pitch + phase
        flank = np.arctan2(skew * np.sin(turn), 1 - skew * np.cos(turn))
        wear = 0.4 + 0.6 * np.exp(-0.5 * ((strain - worn) / spread) ** 2)
        return wear * flank / np.arcsin(skew)

    def rig(i: int, programme: Imposed, strain: Array) -> Array:
        return strain + size * peak * (error(strain) - error(np.zeros(1)))

    return Planted("leadscrew", "skewed and worn", {"pitch": pitch}, rig=rig)


def creep_damage(c: Context, size: float) -> Planted:
    """Voids grow with the time under stress, the faster the more there are.

    Kachanov and Rabotnov: dw/dt = size * load**power / (1-w)**feedback, where load is
    the stress of the sound part above a threshold; stiffness goes with 1-w.
    """
    power, feedback = c.rng.uniform(1.5, 3), c.rng.uniform(1, 2)
    threshold = c.rng.uniform(0.1, 0.25)

    def wear(stress: Array) -> Array:
        load = np.maximum(stress / c.peak - threshold, 0) / (1 - threshold)
        return np.cumsum(load**power)

    longest = max(float(wear(s)[-1]) for s in c.stress)

    def parts(h: Signals) -> None:
        spent = size * wear(h.spring + h.branches) / longest
        sound = np.maximum(1 - (feedback + 1) * spent, 0.02) ** (1 / (feedback + 1))
        h.spring, h.branches = h.spring * sound, h.branches * sound

    return Planted("creep_damage", "accelerating", {"power": power}, parts=parts)


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


def self_heating(c: Context, size: float) -> Planted:
    """A share of the work turns to heat, warms the specimen inside and softens it.

    Heat leaves with one time constant; no thermometer sits inside the specimen.
    """
    time = c.rng.uniform(15, 60)

    def warmth(strain: Array, stress: Array) -> Array:
        work = np.abs(stress * np.diff(strain, prepend=0.0))
        return np.asarray(lfilter([1], [1, -np.exp(-STEP_S / time)], work))

    runs = zip(c.programmes, c.stress, strict=True)
    hottest = max(float(warmth(p.strain, s).max()) for p, s in runs)

    def parts(h: Signals) -> None:
        share = warmth(h.strain, h.spring + h.branches) / hottest
        factor = 1 / (1 + size * share)
        h.spring, h.branches = h.spring * factor, h.branches * factor

    return Planted("self_heating", "heat of work", {"time_s": time}, parts=parts)


def curing(c: Context, size: float) -> Planted:
    """Bonds go on forming with the logarithm of time, at rest in the shape of then.

    A bond knows only what strain came after it: d stress = growth(t) d strain.
    """
    start = c.rng.uniform(1, 6)

    def parts(h: Signals) -> None:
        time = STEP_S * np.arange(len(h.strain))
        growth = np.log1p(time / start) / np.log1p(60 / start)
        grown = np.cumsum(growth * np.diff(h.strain, prepend=0.0))
        h.extra = h.extra + size * c.peak / c.pace.peak * grown

    return Planted("curing", "logarithm of time", {"start_s": start}, parts=parts)


def tack(c: Context, size: float) -> Planted:
    """The specimen sticks to its support near zero strain: a peak on parting."""
    reach, time = c.pace.peak * c.rng.uniform(0.05, 0.12), c.rng.uniform(1, 8)

    def parts(h: Signals) -> None:
        h.extra = h.extra + size * c.peak * marching.tack(h.strain, reach, time)

    return Planted("tack", "peeling", {"reach": reach, "time_s": time}, parts=parts)


def stiction(c: Context, size: float) -> Planted:
    """A guide seizes the longer it rests: a peak at every fresh start."""
    reach, age = c.pace.peak * c.rng.uniform(0.03, 0.08), c.rng.uniform(0.5, 3)

    def parts(h: Signals) -> None:
        force = marching.stiction(h.strain, reach, age) / np.log1p(30 / age)
        h.extra = h.extra + size * c.peak * force

    return Planted("stiction", "ageing contacts", {"age_s": age}, parts=parts)


def lost_blocks(c: Context, size: float) -> Planted:
    """Two loggers: blocks of the force channel get lost or are written twice."""
    blocks = [
        [
            (float(t), float(jump))
            for t, jump in zip(
                p.time_s[-1] * c.rng.uniform(0.05, 0.7, 3),
                c.rng.uniform(0.4, 1.0, 3) * c.rng.choice([-1, 1], 3),
                strict=True,
            )
        ]
        for p in c.programmes
    ]

    def sensor(i: int, programme: Imposed, stress: Array) -> Array:
        t = programme.time_s
        behind = np.zeros_like(t)
        for moment, jump in blocks[i]:
            behind[t >= moment] += size * c.pace.ramp_s * jump
        return np.interp(t - behind, t, stress)

    return Planted("lost_blocks", "jumps of delay", {"blocks": blocks}, sensor=sensor)


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
    self_heating,
    curing,
    tack,
    stiction,
    lost_blocks,
)
