"""Integrators: exact exponentials within a step in which the strain is straight."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def responses(steps, clock, taus):
    """Unit Maxwell branches (n, m) for increments of strain and reduced time."""
    n, m = len(steps), len(taus)
    out = np.empty((n, m))
    for j in range(m):
        q = 0.0
        for k in range(n):
            x = clock[k] / taus[j]
            d = np.exp(-x)
            q = q * d + steps[k] * ((1 - d) / x if x > 1e-9 else 1 - 0.5 * x)
            out[k, j] = q
    return out


@njit(cache=True)
def branches(steps, clock, taus, moduli):
    """Maxwell branches on each column of steps (n, p): sum of their stresses."""
    n, p = steps.shape
    out = np.zeros((n, p))
    for j in range(len(taus)):
        q = np.zeros(p)
        for k in range(n):
            x = clock[k] / taus[j]
            d = np.exp(-x)
            g = moduli[j] * ((1 - d) / x if x > 1e-9 else 1 - 0.5 * x)
            for i in range(p):
                q[i] = q[i] * d + steps[k, i] * g
                out[k, i] += q[i]
    return out


@njit(cache=True)
def flow(steps, clock, taus, moduli, mode, scale, power):
    """Branches whose dashpots are not linear: sum of their stresses.

    The fluidity is multiplied by sinh(y)/y (mode 0), y**power (1),
    (1 + y*y)**(power/2) (2) or 1 + power*max(y-1, 0)/y (3), y = |q|/scale.
    """
    n = len(steps)
    out = np.zeros(n)
    for j in range(len(taus)):
        q = 0.0
        for k in range(n):
            guess = q
            new = q
            for _ in range(2):  # the fluidity at the middle of the step
                y = abs(guess) / scale[j] + 1e-12
                if mode == 0:
                    f = np.sinh(min(y, 30.0)) / y if y > 1e-4 else 1.0
                elif mode == 1:
                    f = y**power
                elif mode == 2:
                    f = (1 + y * y) ** (power / 2)
                else:
                    f = 1 + power * max(y - 1, 0.0) / y
                x = clock[k] * f / taus[j]
                d = np.exp(-x)
                g = (1 - d) / x if x > 1e-9 else 1 - 0.5 * x
                new = q * d + moduli[j] * steps[k] * g
                guess = 0.5 * (q + new)
            q = new
            out[k] += q
    return out


@njit(cache=True)
def convected(stretch, clock, tau):
    """Upper-convected Maxwell in uniaxial tension, unit tensile modulus.

    Engineering stress; axial and lateral extra stress by the Lodge integral: strain
    relative to a network that forms at the rate 1/tau.
    """
    n = len(stretch)
    out = np.empty(n)
    a, b, last = 1.0, 1.0, 1.0  # <lambda^2/lambda'^2>, <lambda'/lambda>
    for k in range(n):
        r = stretch[k] / last
        last = stretch[k]
        d = np.exp(-clock[k] / tau)
        mid = np.sqrt(r)  # what forms within the step is strained by half of it
        a = a * r * r * d + (1 - d) * mid * mid
        b = b / r * d + (1 - d) / mid
        out[k] = (a - b) / 3 / stretch[k]
    return out


@njit(cache=True)
def spring_in_dashpot(stretch, clock, tau):
    """Neo-Hookean spring in series with a linear dashpot, finite strain.

    log of the elastic stretch flows by Kirchhoff stress over viscosity.
    """
    n = len(stretch)
    out = np.empty(n)
    h, last = 0.0, 0.0
    for k in range(n):
        now = np.log(stretch[k])
        h += now - last
        last = now
        if abs(h) > 1e-12:
            s = (np.exp(2 * h) - np.exp(-h)) / 3
            h *= np.exp(-clock[k] / tau * s / h)
        out[k] = (np.exp(2 * h) - np.exp(-h)) / 3 / stretch[k]
    return out


@njit(cache=True)
def dahl(steps, length, power):
    """Dahl's friction of unit strength: dF/dx = (1 - F sgn dx)^power / length."""
    out = np.empty(len(steps))
    f = 0.0
    for k in range(len(steps)):
        dx = steps[k]
        if dx != 0:
            s = 1.0 if dx > 0 else -1.0
            u = max(1 - f * s, 0.0)
            if power == 1.0:
                u = u * np.exp(-abs(dx) / length)
            else:  # exact for any power
                if u > 0:
                    w = u ** (1 - power) + (power - 1) * abs(dx) / length
                    u = w ** (1 / (1 - power)) if w > 0 else 0.0
            f = s * (1 - u)
        out[k] = f
    return out


@njit(cache=True)
def bouc_wen(steps, length, beta, n):
    """dz = dx/length * (1 - |z|^n (beta sgn(z dx) + 1 - beta)), unit strength."""
    out = np.empty(len(steps))
    z = 0.0
    for k in range(len(steps)):
        parts = int(abs(steps[k]) / length * 20) + 1
        dx = steps[k] / parts
        for _ in range(parts):
            s = 1.0 if z * dx > 0 else -1.0
            z += dx / length * (1 - abs(z) ** n * (beta * s + 1 - beta))
        out[k] = z
    return out


@njit(cache=True)
def berg(e, half):
    """Berg's smooth friction of unit strength; `half` is the travel to half of it."""
    out = np.empty(len(e))
    xs, fs, f, last, way = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(e)):
        dx = e[k] - last
        if dx != 0:
            s = 1.0 if dx > 0 else -1.0
            if s != way:
                xs, fs, way = last, f, s
            mu = fs * s
            u = abs(e[k] - xs)
            f = fs + s * u / (half * (1 - mu) + u) * (1 - mu) if u > 0 else fs
            last = e[k]
        out[k] = f
    return out


@njit(cache=True)
def slider(steps, reach):
    """An elastic-perfectly-plastic element: strain held by it, within +-reach."""
    out = np.empty(len(steps))
    z = 0.0
    for k in range(len(steps)):
        z = min(max(z + steps[k], -reach), reach)
        out[k] = z
    return out


@njit(cache=True)
def follow(target, clock, up, down):
    """First-order follower with its own time each way."""
    out = np.empty(len(target))
    y = 0.0
    for k in range(len(target)):
        tau = up if target[k] > y else down
        y += (target[k] - y) * (1 - np.exp(-clock[k] / tau))
        out[k] = y
    return out


@njit(cache=True)
def valleys(e, threshold):
    """Cycles closed so far: counted where |e| turns up by more than `threshold`."""
    out = np.empty(len(e))
    count, low, high, falling = 0.0, 0.0, 0.0, False
    for k in range(len(e)):
        x = abs(e[k])
        if falling:
            low = min(low, x)
            if x > low + threshold:
                falling, high = False, x
                count += 1
        else:
            high = max(high, x)
            if x < high - threshold:
                falling, low = True, x
        out[k] = count
    return out


@njit(cache=True)
def whiten(gap, taus, weights, floor, x):
    """Innovations of the columns of x (n, p) over their standard deviation.

    The noise has unit variance: `floor` of it white, `weights` of it in
    Ornstein-Uhlenbeck processes of times `taus`; a Kalman filter, exact.
    """
    n, p = x.shape
    m = len(taus)
    out = np.empty((n, p))
    cov = np.zeros((m, m))
    state = np.zeros((m, p))
    for i in range(m):
        cov[i, i] = weights[i]
    keep = np.empty(m)
    gain = np.empty(m)
    for k in range(n):
        if k > 0:
            for i in range(m):
                keep[i] = np.exp(-gap[k] / taus[i])
            for i in range(m):
                for j in range(m):
                    cov[i, j] *= keep[i] * keep[j]
                cov[i, i] += weights[i] * (1 - keep[i] ** 2)
                for c in range(p):
                    state[i, c] *= keep[i]
        s = floor
        for i in range(m):
            g = 0.0
            for j in range(m):
                g += cov[i, j]
            gain[i] = g
            s += g
        s = max(s, 1e-9)
        for c in range(p):
            v = x[k, c]
            for i in range(m):
                v -= state[i, c]
            out[k, c] = v / np.sqrt(s)
            for i in range(m):
                state[i, c] += gain[i] / s * v
        for i in range(m):
            for j in range(m):
                cov[i, j] -= gain[i] * gain[j] / s
    return out


@njit(cache=True)
def latch(x, up, down):
    """1 from where x exceeds `up` until it falls below `down`, 0 elsewhere."""
    out = np.zeros(len(x))
    on = 0.0
    for k in range(len(x)):
        if x[k] > up:
            on = 1.0
        elif x[k] < down:
            on = 0.0
        out[k] = on
    return out


@njit(cache=True)
def structure(travel, heal):
    """dS = (1 - S) heal - S travel, from 1, exact within a step."""
    out = np.empty(len(travel))
    level = 1.0
    for k in range(len(travel)):
        rate = travel[k] + heal[k]
        if rate > 0:
            end = heal[k] / rate
            level = end + (level - end) * np.exp(-rate)
        out[k] = level
    return out


@njit(cache=True)
def stiction(steps, still, clock):
    """What breaks away after a rest: log(1 + its time), over a travel of one."""
    out = np.zeros(len(steps))
    age, moved, strong = 0.0, 50.0, 0.0
    for k in range(len(steps)):
        if still[k]:
            age += clock[k]
        else:
            if age > 0.1:
                strong, moved = np.log(1 + age), 0.0
            age = 0.0
            moved += abs(steps[k])
            way = 1.0 if steps[k] > 0 else -1.0
            out[k] = way * strong * moved * np.exp(1 - moved)
    return out
