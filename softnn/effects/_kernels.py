"""Compiled recursions of the effects, imported when first needed (numba loads slowly).

Shapes: signals are (n, sets); parameters and carried states are (sets,) or (sets,
elements). A parameter of one value serves every set. `carried` is updated in place to
the state at the end of the chunk; `out` receives the result. Strains are fractions,
times are in s.
"""

from __future__ import annotations

import numba
import numpy as np

ONE_POLE = 1e-6  # of the square of a quality factor, below which there is one pole


@numba.njit(cache=True)
def first_order(step, signal, time_constant, before, carried, out):
    """Write to `out` a first-order lag of a signal that is linear between samples.

    `step` (n,) and `time_constant` are in s; `before` is the last sample of the chunk
    before. The update is exact for such a signal.
    """
    n, sets = signal.shape
    for s in range(sets):
        tau = time_constant[s if time_constant.size > 1 else 0]
        x0, y = before[s], carried[s]
        for i in range(n):
            x1 = signal[i, s]
            if tau <= 0.0:
                y = x1
            elif step[i] > 0.0:
                lost = -np.expm1(-step[i] / tau)
                y = x1 + (1.0 - lost) * (y - x0) - (x1 - x0) * lost * tau / step[i]
            x0 = x1
            out[i, s] = y
        before[s], carried[s] = x0, y


@numba.njit(cache=True)
def second_order(step, signal, delay, quality, before, carried, pace, out):
    """Write to `out` a two-pole filter of a signal that is linear between samples.

    `delay` [s] is the mean delay, the sum of both time constants. `quality` is Q^2, the
    product of the time constants over the square of the delay. `carried` holds the
    output, `pace` its rate [1/s].
    """
    n, sets = signal.shape
    for s in range(sets):
        mean = delay[s if delay.size > 1 else 0]
        square = quality[s if quality.size > 1 else 0] * mean * mean
        x0, y, v = before[s], carried[s], pace[s]
        one = square < ONE_POLE * mean * mean
        if mean > 0.0 and not one:
            half = 0.5 * mean / square
            apart = half * half - 1.0 / square
            root = np.sqrt(abs(apart))
        for i in range(n):
            x1, h = signal[i, s], step[i]
            if mean <= 0.0:
                y = x1
            elif h > 0.0 and one:
                lost = -np.expm1(-h / mean)
                y = x1 + (1.0 - lost) * (y - x0) - (x1 - x0) * lost * mean / h
            elif h > 0.0:
                if apart > 0.0:
                    fast = half + root
                    slow = 1.0 / (square * fast)
                    late, soon = np.exp(-slow * h), np.exp(-fast * h)
                    even = 0.5 * (late + soon)
                    odd = -late * np.expm1(-2.0 * root * h) / (2.0 * root)
                else:
                    lost = np.exp(-half * h)
                    even = lost * np.cos(root * h)
                    odd = lost * (np.sin(root * h) / root if root > 0.0 else h)
                slope = (x1 - x0) / h
                e, w = y - x0 + mean * slope, v - slope
                y = x1 - mean * slope + even * e + odd * (half * e + w)
                v = slope + even * w - odd * (e / square + half * w)
            x0 = x1
            out[i, s] = y
        before[s], carried[s], pace[s] = x0, y, v


@numba.njit(cache=True)
def maxwell(step, increment, time, carried, out):
    """Unit stress of one Maxwell branch, strain linear between samples.

    `step` (n,) and `time` [s] are the sampling step and the relaxation time;
    `increment` (n, sets) is the change of strain.
    """
    n, sets = out.shape
    for s in range(sets):
        j = s if increment.shape[1] > 1 else 0
        tau = time[s if time.size > 1 else 0]
        q = carried[s]
        for i in range(n):
            x = step[i] / tau
            lost = -np.expm1(-x)
            gain = lost / x if x > 1e-9 else 1.0 - 0.5 * x
            q = (1.0 - lost) * q + gain * increment[i, j]
            out[i, s] = q
        carried[s] = q


@numba.njit(cache=True)
def stops(increment, radius, weight, carried, out):
    """Write to `out` the weighted sum of elastic-perfectly plastic (stop) elements.

    Each element is in units of its own limit, so it stays within -1 and 1; `radius` is
    the strain at which it slides.
    """
    n, sets = out.shape
    elements = weight.shape[1]
    for s in range(sets):
        j = s if increment.shape[1] > 1 else 0
        k = s if radius.shape[0] > 1 else 0
        for i in range(n):
            total = 0.0
            for e in range(elements):
                r = radius[k, e]
                z = min(max(carried[s, e] + increment[i, j], -r), r)
                carried[s, e] = z
                total += weight[k, e] * z / r
            out[i, s] = total


@numba.njit(cache=True)
def play(signal, pulled, pushed, carried, out):
    """Follower with play: from `pulled` behind the signal to `pushed` ahead."""
    n, sets = out.shape
    for s in range(sets):
        j = s if signal.shape[1] > 1 else 0
        k = s if pulled.size > 1 else 0
        y = carried[s]
        for i in range(n):
            x = signal[i, j]
            y = min(max(y, x - pulled[k]), x + pushed[k])
            out[i, s] = y
        carried[s] = y


@numba.njit(cache=True)
def bouc_wen(increment, radius, sharpness, carried, out):
    """Bouc-Wen variable z in [-1, 1]: dz = (1 - |z|^n (z dx > 0)) dx / radius.

    Wen 1976, doi:10.1061/JMCEA3.0002106. Long increments are divided and integrated by
    the midpoint rule.
    """
    n, sets = out.shape
    for s in range(sets):
        j = s if increment.shape[1] > 1 else 0
        r = radius[s if radius.size > 1 else 0]
        power = sharpness[s if sharpness.size > 1 else 0]
        z = carried[s]
        for i in range(n):
            dx = increment[i, j] / r
            parts = int(min(max(np.ceil(abs(dx) * 2.0 * power), 1.0), 60.0))
            d = dx / parts
            for _ in range(parts):  # midpoint rule
                a = d * (1.0 - (abs(z) ** power if z * d > 0 else 0.0))
                m = z + 0.5 * a
                z += d * (1.0 - (min(abs(m), 1.0) ** power if m * d > 0 else 0.0))
                z = min(max(z, -1.0), 1.0)
            out[i, s] = z
        carried[s] = z


@numba.njit(cache=True)
def flow(step, increment, time, threshold, exponent, carried, out):
    """Write to `out` the strain of a spring in series with a nonlinear dashpot.

    Strang splitting. Exponent 0 means Eyring, dg/dt = -(threshold/time)
    sinh(g/threshold); any other exponent a power law, dg/dt = -(threshold/time)
    |g/threshold|^exponent. Both relax in closed form. `step` (n, 1 or sets) is a step
    of time or of an internal clock.
    """
    n, sets = out.shape
    for s in range(sets):
        j = s if increment.shape[1] > 1 else 0
        k = s if step.shape[1] > 1 else 0
        tau = time[s if time.size > 1 else 0]
        e0 = threshold[s if threshold.size > 1 else 0]
        power = exponent[s if exponent.size > 1 else 0]
        g = carried[s] / e0
        for i in range(n):
            dx = increment[i, j] / e0
            parts = int(min(max(np.ceil(abs(dx) * 1.5), 1.0), 24.0))
            h = step[i, k] / parts / tau
            d = dx / parts
            for _ in range(parts):
                g += 0.5 * d
                if h > 0.0:
                    if power == 0.0:
                        t = np.tanh(0.5 * g) * np.exp(-h)
                        g = np.log1p(t) - np.log1p(-t) if abs(t) < 1 else g
                    elif abs(power - 1.0) < 1e-9:
                        g *= np.exp(-h)
                    elif g != 0.0:
                        a = abs(g)
                        base = a ** (1.0 - power) + (power - 1.0) * h
                        a = base ** (1.0 / (1.0 - power)) if base > 0.0 else 0.0
                        g = a if g > 0 else -a
                g += 0.5 * d
            out[i, s] = g * e0
        carried[s] = g * e0


@numba.njit(cache=True)
def reversals(strain, band, power, state, done, pending):
    """Half cycles (n, sets): of closed cycles to `done`, of the open one to `pending`.

    A reversal is a return by more than `band`, a share of the largest absolute strain
    so far. A half cycle counts by a power (sets,) of its range over the largest range
    so far. `state` (sets, 7) holds: the extreme since the last reversal, the direction,
    both counts, the largest strain, the strain at the last reversal and the largest
    range.
    """
    n, sets = strain.shape
    for s in range(sets):
        extreme, direction, closed, half, peak, turn, widest = state[s]
        for i in range(n):
            e = strain[i, s]
            peak = max(peak, abs(e))
            if direction == 0.0:
                if abs(e - extreme) > band * peak and e != extreme:
                    direction = 1.0 if e > extreme else -1.0
                    extreme = e
            elif direction * (e - extreme) > 0:
                extreme = e
            elif direction * (extreme - e) > band * peak:
                length = abs(extreme - turn)
                widest = max(widest, length)
                counts = (length / widest) ** power[s if power.size > 1 else 0]
                if half > 0.0:
                    closed, half = closed + half + counts, 0.0
                else:
                    half = counts
                direction, turn, extreme = -direction, extreme, e
            done[i, s], pending[i, s] = closed, half
        state[s, 0], state[s, 1], state[s, 2], state[s, 3] = (
            extreme,
            direction,
            closed,
            half,
        )
        state[s, 4], state[s, 5], state[s, 6] = peak, turn, widest


@numba.njit(cache=True)
def ringing(step, kick, omega, zeta, carried, out):
    """Force (n, sets) of a mass on a mount that is kicked at the samples.

    `carried` (2, sets) is the force and its rate; a kick is the time integral of force.
    `omega` [rad/s] is the resonance, `zeta` the damping ratio.
    """
    n, sets = kick.shape
    for s in range(sets):
        x, v = carried[0, s], carried[1, s]
        decay, square = zeta[s] * omega[s], omega[s] ** 2
        gap = square - decay * decay
        w = np.sqrt(max(abs(gap), 1e-9 * square))
        for i in range(n):
            h = step[i]
            if gap > 0:
                e = np.exp(-decay * h)
                c, q = e * np.cos(w * h), e * np.sin(w * h) / w
            else:
                slow, fast = np.exp((w - decay) * h), np.exp(-(w + decay) * h)
                c, q = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
            x, v = x * c + (v + decay * x) * q, v * c - (square * x + decay * v) * q
            out[i, s] = x
            v += square * kick[i, s]
        carried[0, s], carried[1, s] = x, v


@numba.njit(cache=True)
def turning(step, kick, width, out):
    """Write to `out` the force (n, sets) of kicks at the samples, each a bell in time.

    The bell is 3 (1 + x + x^2 / 3) exp(-x) / (16 w) at a distance of x w, before and
    after the kick (Matern 5/2, of unit area).
    """
    n, sets = kick.shape
    for s in range(sets):
        w = width[s if width.size > 1 else 0]
        scale = 3.0 / (16.0 * w)
        for way in (1, -1):
            a = b = c = 0.0  # sums of kicks times x^0, x^1, x^2, each by exp(-x)
            for k in range(n):
                i = k if way > 0 else n - 1 - k
                x = 0.0
                if k:
                    x = (step[i] if way > 0 else step[i + 1]) / w
                e = np.exp(-x)
                a, b, c = e * a, e * (b + x * a), e * (c + 2.0 * x * b + x * x * a)
                if way > 0:
                    out[i, s] = scale * (kick[i, s] + a + b + c / 3.0)
                else:
                    out[i, s] += scale * (a + b + c / 3.0)
                a += kick[i, s]


@numba.njit(cache=True)
def ratchet(step, goal, time, carried, out):
    """Follower that approaches a goal (n, 1 or sets) in `time` s and never falls."""
    n, sets = out.shape
    for s in range(sets):
        j = s if goal.shape[1] > 1 else 0
        tau = time[s if time.size > 1 else 0]
        before, d = carried[0, s], carried[1, s]
        for i in range(n):
            gap = 0.5 * (before + goal[i, j]) - d
            if gap > 0.0:
                d -= gap * np.expm1(-step[i] / tau)
            before = goal[i, j]
            out[i, s] = d
        carried[0, s], carried[1, s] = before, d
