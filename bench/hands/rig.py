"""Laws of the rig: slack and slip in the grips."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from bench.hands import kernels
from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, some
from bench.hands.testing import Act, Law, Setup


def _slack(rng: Rng, s: Setup, form) -> Act:
    """Take-up by `form(|strain|, gap)`, a gap of its own in each recording."""
    shares = rng.uniform(0.25, 1.0, s.n)
    if rng.random() < 0.3:
        shares = np.full(s.n, 1.0)
    if s.continued:
        shares = np.full(s.n, 1.0)

    def rig(i: int, t: Array, e: Array, a: float) -> Array:
        gap = a * s.em * shares[i]
        return np.sign(e) * form(np.abs(e), gap) if gap > 0 else e

    return Act(0.3, {"shares": shares.tolist()}, rig=rig, own_faults=True)


def sharp_slack(rng: Rng, s: Setup) -> Act:
    """Nothing up to the gap, then all."""
    return _slack(rng, s, lambda x, gap: np.maximum(x - gap, 0))


def parabolic_toe(rng: Rng, s: Setup) -> Act:
    """x^2/(4 gap) up to twice the gap, then x - gap."""
    return _slack(
        rng, s, lambda x, gap: np.where(x < 2 * gap, x**2 / (4 * gap), x - gap)
    )


def exponential_toe(rng: Rng, s: Setup) -> Act:
    """x - gap (1 - exp(-x/gap))."""
    return _slack(rng, s, lambda x, gap: x - gap * -np.expm1(-x / gap))


def recruitment(rng: Rng, s: Setup) -> Act:
    """Fibres straighten at a Gaussian of gaps: the integral of their share."""
    width = rng.uniform(0.25, 0.5)

    def form(x: Array, gap: float) -> Array:
        def area(y: Array) -> Array:
            u = (y - gap) / (width * gap)
            bell = np.exp(-(u**2) / 2) / np.sqrt(2 * np.pi)
            return width * gap * (u * (1 + erf(u / np.sqrt(2))) / 2 + bell)

        return area(x) - area(np.zeros(1))

    return _slack(rng, s, form)


def play(rng: Rng, s: Setup) -> Act:
    """A worn nut: the crosshead loses its play at every turn."""

    def rig(i: int, t: Array, e: Array, a: float) -> Array:
        if a == 0:
            return e
        return e - kernels.slider(np.diff(e, prepend=0.0), a * s.em)

    return Act(0.2, rig=rig)


def _moments(rng: Rng, s: Setup) -> dict[int, float]:
    """When it slips, in some recordings: under load, not at the very end."""
    when = {}
    for i in some(rng, s.n, 0.3, 0.8):
        course = s.courses[i]
        load = np.abs(course.strain) > 0.4 * np.abs(course.strain).max()
        load[int(0.8 * len(load)) :] = False
        spots = np.flatnonzero(load)
        if len(spots):
            when[i] = float(course.time_s[spots[rng.integers(len(spots))]])
    return when


def _slip(rng: Rng, s: Setup, form) -> Act:
    """`form(time since the slip, end)` from 0 to 1, its own size in each recording."""
    when = _moments(rng, s)
    size = {i: float(rng.uniform(0.4, 1.0)) for i in when}

    def rig(i: int, t: Array, e: Array, a: float) -> Array:
        if i not in when:
            return e
        lost = a * s.em * size[i] * form(i, t - when[i], t[-1] - when[i])
        way = np.sign(e[int(np.argmax(np.abs(e)))])
        return e - way * lost

    events = {str(i): [when[i], size[i]] for i in when}
    return Act(0.3, {"events": events}, rig=rig, own_faults=True)


def sudden_slip(rng: Rng, s: Setup) -> Act:
    """All at once."""
    return _slip(rng, s, lambda i, t, end: (t >= 0) * 1.0)


def two_slips(rng: Rng, s: Setup) -> Act:
    """Twice: a part at once, the rest a while later."""
    share, later = rng.uniform(0.3, 0.7), rng.uniform(0.15, 0.6)
    return _slip(
        rng,
        s,
        lambda i, t, end: share * (t >= 0) + (1 - share) * (t >= later * end),
    )


def creeping_slip(rng: Rng, s: Setup) -> Act:
    """From a moment on at a steady pace, until it catches."""
    span = rng.uniform(0.1, 0.5)
    return _slip(rng, s, lambda i, t, end: np.clip(t / (span * end + 1e-9), 0, 1))


def settling_slip(rng: Rng, s: Setup) -> Act:
    """Quickly at first and slower and slower."""
    tau = s.pace_s * rng.uniform(0.1, 0.6)
    return _slip(rng, s, lambda i, t, end: -np.expm1(-np.maximum(t, 0) / tau))


_TOE = "toe compensation, ASTM D638 annex A1"
LAWS = (
    Law("slack", "sharp", DEVELOPMENT, _TOE, sharp_slack, "rig"),
    Law("slack", "parabolic_toe", HELD_OUT, _TOE, parabolic_toe, "rig"),
    Law(
        "slack",
        "exponential_toe",
        DEVELOPMENT,
        "after Fung 1993, Biomechanics",
        exponential_toe,
        "rig",
    ),
    Law(
        "slack",
        "recruitment",
        HELD_OUT,
        "Lanir 1983, 10.1016/0021-9290(83)90041-6",
        recruitment,
        "rig",
    ),
    Law(
        "slack",
        "play",
        HELD_OUT,
        "play operator; Krasnosel'skii & Pokrovskii 1989",
        play,
        "rig",
    ),
    Law("grip_slip", "sudden", DEVELOPMENT, "ASTM D412, slippage", sudden_slip, "rig"),
    Law("grip_slip", "two_steps", HELD_OUT, "ASTM D412, slippage", two_slips, "rig"),
    Law("grip_slip", "creeping", DEVELOPMENT, "creep of a jaw", creeping_slip, "rig"),
    Law("grip_slip", "settling", HELD_OUT, "creep of a jaw", settling_slip, "rig"),
)
