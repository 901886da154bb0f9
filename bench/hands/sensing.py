"""Laws of the sensor: what is written down of the stress."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from bench.hands import kernels
from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, some
from bench.hands.testing import Act, Law, Setup, fine

HAND_S = 0.03  # no machine turns within less


def accelerations(s: Setup) -> list[Array]:
    """Second derivatives of the strain on an even clock, over the largest of all."""
    found = []
    for course in s.courses:
        t, e = fine(course, course.time_s), fine(course, course.strain)
        even = np.arange(0, t[-1], 0.005)
        bent = gaussian_filter1d(np.interp(even, t, e), HAND_S / 0.005, mode="nearest")
        found.append(np.interp(t, even, np.gradient(np.gradient(bent, 0.005), 0.005)))
    most = max(float(np.abs(x).max()) for x in found)
    return [x / max(most, 1e-12) for x in found]


def mass(rng: Rng, s: Setup) -> Act:
    """Force of a rigid mass; a is its largest over the peak stress."""
    jolts = accelerations(s)
    return Act(0.5, sensor=lambda i, t, x, a: x + a * s.peak * jolts[i])


def ringing_mass(rng: Rng, s: Setup) -> Act:
    """A mass on a springy cell: the mass's force followed by a damped ringing."""
    period, damping = rng.uniform(0.15, 0.6), rng.uniform(0.1, 0.5)
    jolts, ringing = accelerations(s), []
    for i, course in enumerate(s.courses):
        t = fine(course, course.time_s)
        even = np.arange(0, t[-1] + 0.005, 0.005)
        lag = np.arange(0, 6 * period / damping / 6.28, 0.005)
        w = 2 * np.pi / period
        wd = w * np.sqrt(1 - damping**2)
        answer = w**2 / wd * np.exp(-damping * w * lag) * np.sin(wd * lag) * 0.005
        rung = np.convolve(np.interp(even, t, jolts[i]), answer)[: len(even)]
        ringing.append(np.interp(t, even, rung))
    return Act(
        0.5,
        {"period_s": period, "damping": damping},
        sensor=lambda i, t, x, a: x + a * s.peak * ringing[i],
    )


def first_order(rng: Rng, s: Setup) -> Act:
    """a dy/dt = x - y."""
    return Act(0.5, sensor=lambda i, t, x, a: _follow(x, t, a))


def _follow(x: Array, t: Array, a: float) -> Array:
    """y of a dy/dt = x - y: x less a Maxwell response to it, exact."""
    if a < 1e-9:
        return x
    behind = kernels.responses(
        np.diff(x, prepend=x[0]), np.diff(t, prepend=t[0]), np.array([a])
    )
    return x - behind[:, 0]


def delay(rng: Rng, s: Setup) -> Act:
    """x(t - a)."""
    return Act(0.5, sensor=lambda i, t, x, a: np.interp(t - a, t, x))


def moving_average(rng: Rng, s: Setup) -> Act:
    """Mean of the last 2 a seconds."""

    def sensor(i: int, t: Array, x: Array, a: float) -> Array:
        if a < 1e-9:
            return x
        area = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2 * np.diff(t))])
        past = t - 2 * a
        k = np.maximum(np.searchsorted(t, past, "right") - 1, 0)
        u = past - t[k]  # below zero before the first sample: its value held
        there = (x[k] + np.interp(past, t, x)) / 2
        before = area[k] + u * there
        return (area - before) / (2 * a)

    return Act(0.5, sensor=sensor)


def two_stage_filter(rng: Rng, s: Setup) -> Act:
    """Two first-order filters of a/2 in a row."""
    return Act(0.5, sensor=lambda i, t, x, a: _follow(_follow(x, t, a / 2), t, a / 2))


def _drift(rng: Rng, s: Setup, form, **parameters: float) -> Act:
    """`form(i, t)` of unit size over the longest recording."""
    return Act(
        1.0,
        parameters,
        sensor=lambda i, t, x, a: x + a * s.peak * form(i, t),
        own_faults=True,
    )


def _longest(s: Setup) -> float:
    return max(float(c.time_s[-1]) for c in s.courses)


def linear_drift(rng: Rng, s: Setup) -> Act:
    """So much an hour, the amplifier zeroed before each recording."""
    sign, span = rng.choice([-1, 1]), _longest(s)
    return _drift(rng, s, lambda i, t: sign * t / span)


def warm_up(rng: Rng, s: Setup) -> Act:
    """1 - exp(-t/tau) after each zeroing."""
    sign, span = rng.choice([-1, 1]), _longest(s)
    tau = span * rng.uniform(0.1, 0.5)
    return _drift(rng, s, lambda i, t: -sign * np.expm1(-t / tau), tau_s=tau)


def wander(rng: Rng, s: Setup) -> Act:
    """Slow sines of periods about the recording's length and longer, from zero."""
    span = _longest(s)
    periods = span * rng.uniform(0.8, 3.0, (s.n, 3))
    phases, sizes = rng.uniform(0, 6.28, (s.n, 3)), rng.normal(0, 0.6, (s.n, 3))

    def form(i: int, t: Array) -> Array:
        turn = 2 * np.pi * t[:, None] / periods[i] + phases[i]
        return (np.sin(turn) - np.sin(phases[i])) @ sizes[i]

    return _drift(rng, s, form)


def root_drift(rng: Rng, s: Setup) -> Act:
    """Creep of the cell: the root of time, its own sign and size each recording."""
    span, sizes = _longest(s), rng.normal(0, 1, s.n)
    return _drift(rng, s, lambda i, t: sizes[i] * np.sqrt(t / span))


def _offsets(sizes: Array, s: Setup) -> Act:
    return Act(
        0.5,
        {"sizes": sizes.tolist()},
        sensor=lambda i, t, x, a: x + a * s.peak * sizes[i],
        own_faults=True,
    )


def some_offsets(rng: Rng, s: Setup) -> Act:
    """Not zeroed before some recordings."""
    sizes = np.zeros(s.n)
    chosen = some(rng, s.n, 0.2, 0.5)
    sizes[chosen] = rng.uniform(0.5, 1, len(chosen)) * rng.choice([-1, 1], len(chosen))
    return _offsets(sizes, s)


def never_zeroed(rng: Rng, s: Setup) -> Act:
    """All but the first carry the same offset."""
    sizes = np.full(s.n, float(rng.choice([-1, 1])))
    sizes[: int(rng.integers(1, max(2, s.n // 2)))] = 0
    return _offsets(sizes, s)


def one_offset(rng: Rng, s: Setup) -> Act:
    """One recording only."""
    sizes = np.zeros(s.n)
    sizes[rng.integers(s.n)] = rng.choice([-1, 1])
    return _offsets(sizes, s)


def growing_offset(rng: Rng, s: Setup) -> Act:
    """A hysteretic cell: each recording leaves a little more."""
    sizes = np.cumsum(rng.uniform(0, 1, s.n))
    sizes = (sizes - sizes[0]) / sizes[-1] * rng.choice([-1, 1])
    return _offsets(sizes, s)


def _gains(sizes: Array) -> Act:
    return Act(
        0.6,
        {"sizes": sizes.tolist()},
        sensor=lambda i, t, x, a: x * (1 + a * sizes[i]),
        own_faults=True,
    )


def some_gains(rng: Rng, s: Setup) -> Act:
    """Its own wrong cross-section in some recordings."""
    sizes = np.zeros(s.n)
    chosen = some(rng, s.n, 0.2, 0.5)
    sizes[chosen] = rng.uniform(0.5, 1, len(chosen)) * rng.choice([-1, 1], len(chosen))
    return _gains(sizes)


def one_width(rng: Rng, s: Setup) -> Act:
    """A width mistyped once."""
    sizes = np.zeros(s.n)
    sizes[rng.integers(s.n)] = rng.choice([-1, 1])
    return _gains(sizes)


def second_day(rng: Rng, s: Setup) -> Act:
    """Another calibration from some recording on."""
    sizes = np.zeros(s.n)
    sizes[int(rng.integers(1, s.n)) :] = rng.choice([-1, 1])
    return _gains(sizes)


def two_thicknesses(rng: Rng, s: Setup) -> Act:
    """Two sheets, recordings by turns."""
    sizes = np.zeros(s.n)
    sizes[rng.permutation(s.n)[: s.n // 2]] = rng.choice([-1, 1])
    return _gains(sizes)


def _clipped(rng: Rng, s: Setup, form) -> Act:
    """`form(|x|, limit)`; the limit is 1 - a of the peak, in one way or both."""
    return Act(
        0.6,
        sensor=lambda i, t, x, a: (
            np.sign(x) * form(np.abs(x), (1 - a) * 1.02 * s.peak) if a else x
        ),
    )


def hard_clip(rng: Rng, s: Setup) -> Act:
    """No more than the limit."""
    return _clipped(rng, s, np.minimum)


def soft_clip(rng: Rng, s: Setup) -> Act:
    """x/(1 + (x/limit)^p)^(1/p): a knee (Rapp), the limit 0.15/a of the peak."""
    p = rng.uniform(6, 16)

    def sensor(i: int, t: Array, x: Array, a: float) -> Array:
        return x / (1 + (a * np.abs(x) / (0.15 * s.peak)) ** p) ** (1 / p)

    return Act(0.6, {"power": p}, sensor=sensor)


def flat_overload(rng: Rng, s: Setup) -> Act:
    """Flat at the limit, and flat until the load has fallen well below it."""
    back = rng.uniform(0.75, 0.95)

    def form(x: Array, top: float) -> Array:
        held = kernels.latch(x, top, back * top)
        return np.where(held > 0, top, x)

    return _clipped(rng, s, form)


def compressed(rng: Rng, s: Setup) -> Act:
    """Above the limit a tenth of the slope is left."""
    slope = rng.uniform(0.02, 0.15)
    return _clipped(
        rng, s, lambda x, top: np.minimum(x, top) + slope * np.maximum(x - top, 0)
    )


_I, _G, _D = "inertia", "sensor_lag", "load_cell_drift"
_Z, _W, _C = "zero_offset", "gain_error", "load_cell_saturation"
_S, _USE = "sensor", "common fault, no paper"
LAWS = (
    Law(_I, "mass", DEVELOPMENT, "Newton's second law", mass, _S),
    Law(
        _I, "ringing_mass", HELD_OUT, "damped oscillator; ISO 4965-1", ringing_mass, _S
    ),
    Law(_G, "first_order", DEVELOPMENT, "RC filter", first_order, _S),
    Law(_G, "delay", HELD_OUT, "pure dead time", delay, _S),
    Law(_G, "moving_average", HELD_OUT, "boxcar filter", moving_average, _S),
    Law(_G, "two_stage", DEVELOPMENT, "two RC filters", two_stage_filter, _S),
    Law(_D, "linear", DEVELOPMENT, "OIML R 60, zero drift", linear_drift, _S),
    Law(_D, "warm_up", HELD_OUT, "OIML R 60, warm-up", warm_up, _S),
    Law(_D, "wander", DEVELOPMENT, "OIML R 60, zero drift", wander, _S),
    Law(_D, "root_of_time", HELD_OUT, "OIML R 60, creep", root_drift, _S),
    Law(_Z, "some", DEVELOPMENT, _USE, some_offsets, _S),
    Law(_Z, "never_zeroed", HELD_OUT, _USE, never_zeroed, _S),
    Law(_Z, "one", DEVELOPMENT, _USE, one_offset, _S),
    Law(_Z, "growing", HELD_OUT, _USE, growing_offset, _S),
    Law(_W, "some", DEVELOPMENT, _USE, some_gains, _S),
    Law(_W, "one_width", HELD_OUT, _USE, one_width, _S),
    Law(_W, "second_day", DEVELOPMENT, _USE, second_day, _S),
    Law(_W, "two_thicknesses", HELD_OUT, _USE, two_thicknesses, _S),
    Law(_C, "hard", DEVELOPMENT, _USE, hard_clip, _S),
    Law(_C, "soft", HELD_OUT, "Rapp 1991, ECSC", soft_clip, _S),
    Law(_C, "flat_overload", HELD_OUT, _USE, flat_overload, _S),
    Law(_C, "compressed", DEVELOPMENT, _USE, compressed, _S),
)
