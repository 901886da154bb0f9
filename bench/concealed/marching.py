"""The recursions of the forge that have to be marched step by step (numba)."""

from __future__ import annotations

import numpy as np
from numba import njit

from bench.concealed.programmes import STEP_S, Array


@njit(cache=True)
def dahl(strain: Array, limit: float, reach: float, exponent: float) -> Array:
    """Dahl friction: dF/dx = (limit/reach) |1 - F/limit sgn dx|**exponent sgn(...)."""
    out = np.zeros_like(strain)
    force, before = 0.0, 0.0
    for i in range(len(strain)):
        step = strain[i] - before
        before = strain[i]
        pieces = max(1, int(abs(step) / (0.02 * reach)) + 1)
        dx = step / pieces
        for _ in range(pieces):
            left = 1.0 - force / limit * np.sign(dx)
            force += limit / reach * abs(left) ** exponent * np.sign(left) * dx
        out[i] = force
    return out


@njit(cache=True)
def iwan(strain: Array, stiffness: Array, yields: Array) -> Array:
    """Parallel elastic sliders: each a spring that slides at its own force."""
    out = np.zeros_like(strain)
    force = np.zeros_like(yields)
    before = 0.0
    for i in range(len(strain)):
        step = strain[i] - before
        before = strain[i]
        for k in range(len(yields)):
            f = force[k] + stiffness[k] * step
            force[k] = min(max(f, -yields[k]), yields[k])
            out[i] += force[k]
    return out


CARREAU, GAROFALO = 0, 1


@njit(cache=True)
def flow_rate(
    stress: float, law: int, scale: float, time: float, power: float
) -> float:
    """Relaxation rate of stress, MPa/s: stress/time at small stress, then faster."""
    x = stress / scale
    if law == CARREAU:
        return stress / time * (1.0 + x * x) ** power
    # Garofalo's sinh**n flows with x**n at first: add the linear creep of the rest.
    return (
        stress / time + scale / time * np.sign(x) * np.sinh(min(abs(x), 30.0)) ** power
    )


@njit(cache=True)
def flowing(
    strain: Array, stiffness: float, law: int, scale: float, time: float, power: float
) -> Array:
    """Spring and nonlinear dashpot in series, classical Runge-Kutta."""
    out = np.zeros_like(strain)
    s, before = 0.0, 0.0
    h = STEP_S
    for i in range(len(strain)):
        push = stiffness * (strain[i] - before) / h
        before = strain[i]
        a = push - flow_rate(s, law, scale, time, power)
        b = push - flow_rate(s + h / 2 * a, law, scale, time, power)
        c = push - flow_rate(s + h / 2 * b, law, scale, time, power)
        d = push - flow_rate(s + h * c, law, scale, time, power)
        s += h / 6 * (a + 2 * b + 2 * c + d)
        out[i] = s
    return out


@njit(cache=True)
def neo_hookean_branch(stretch: Array, modulus: float, time: float) -> Array:
    """Kirchhoff stress of a multiplicative branch with linear flow, midpoint rule.

    Small strain: a Maxwell branch of stiffness `modulus` and relaxation `time`.
    """
    out = np.zeros_like(stretch)
    elastic, before = 0.0, 1.0  # logarithmic elastic strain, stretch
    for i in range(len(stretch)):
        push = np.log(stretch[i] / before)
        before = stretch[i]
        s = modulus / 3 * (np.exp(2 * elastic) - np.exp(-elastic))
        half = elastic + (push - STEP_S * s / (modulus * time)) / 2
        s = modulus / 3 * (np.exp(2 * half) - np.exp(-half))
        elastic += push - STEP_S * s / (modulus * time)
        out[i] = modulus / 3 * (np.exp(2 * elastic) - np.exp(-elastic))
    return out


@njit(cache=True)
def reversals(strain: Array, least: float) -> Array:
    """How many times loading has begun again after unloading by `least`, so far."""
    out = np.zeros_like(strain)
    count, turn, rising = 0.0, 0.0, True
    for i in range(len(strain)):
        e = strain[i]
        if rising:
            turn = max(turn, e)
            if e < turn - least:
                rising, turn = False, e
        else:
            turn = min(turn, e)
            if e > turn + least:
                rising, turn = True, e
                count += 1.0
        out[i] = count
    return out


@njit(cache=True)
def structure(stress: Array, rebuild_s: Array, breaking: Array) -> Array:
    """Mean thixotropic structure 0..1 of several populations of bonds; 1 at the start.

    ds/dt = (1-s)**2 / rebuild - breaking * max(|stress| - 1, 0) * s: broken ends find
    each other two by two, and only stress above the yield stress (1) breaks bonds.
    """
    out = np.zeros_like(stress)
    s = np.ones_like(rebuild_s)
    for i in range(len(stress)):
        over = max(abs(stress[i]) - 1.0, 0.0)
        for k in range(len(s)):
            up = STEP_S * (1.0 - s[k]) ** 2 / rebuild_s[k]
            # Implicit in the breaking: it stays within 0..1.
            s[k] = (s[k] + up) / (1.0 + STEP_S * breaking[k] * over)
            out[i] += s[k] / len(s)
    return out


@njit(cache=True)
def stick_slip(strain: Array, stiffness: float, stick: float, keep: float) -> Array:
    """Saw teeth: force grows with travel until `stick`, then drops to `keep` of it."""
    out = np.zeros_like(strain)
    force, before = 0.0, 0.0
    for i in range(len(strain)):
        force += stiffness * (strain[i] - before)
        before = strain[i]
        if abs(force) > stick:
            force *= keep
        out[i] = force
    return out


@njit(cache=True)
def pore_suction(strain: Array, time: float, valve: float, narrowing: float) -> Array:
    """Mean suction in a drained slab that stretching by `strain` empties of pressure.

    Diffusion in odd modes of relaxation times time/n**2, exact for a step of constant
    permeability; it is `valve` times larger while fluid leaves than while it enters,
    and falls as exp(-narrowing * strain) as the pores close (Lai and Mow).
    """
    out = np.zeros_like(strain)
    s = np.zeros(8)
    before, mean = 0.0, 0.0
    for i in range(len(strain)):
        step = strain[i] - before
        before = strain[i]
        open_to = (1.0 if mean + step > 0 else valve) * np.exp(-narrowing * before)
        mean = 0.0
        for k in range(len(s)):
            odd = (2 * k + 1) ** 2
            s[k] = (s[k] + step) * np.exp(-STEP_S * odd * open_to / time)
            mean += 8 / (np.pi**2 * odd) * s[k]
        out[i] = mean
    return out


@njit(cache=True)
def tack(strain: Array, reach: float, time: float) -> Array:
    """Force of a joint that peels within `reach` and bonds again where it is closed.

    First opening: x e**(1-x), x = strain/reach. Closed is below a fifth of `reach`.
    """
    out = np.zeros_like(strain)
    bond, before = 1.0, 0.0
    for i in range(len(strain)):
        x = max(strain[i] / reach, 0.0)
        bond *= np.exp(-max(x - before, 0.0))
        before = x
        if x < 0.2:
            bond += STEP_S / time * (1.0 - bond)
        out[i] = bond * x * np.e
    return out


@njit(cache=True)
def stiction(strain: Array, reach: float, age_s: float) -> Array:
    """Friction of contacts that strengthen with the logarithm of their age.

    Rate and state (Dieterich, Ruina): d age/dt = 1 - |rate| age / reach; the force goes
    to ln(1 + age/age_s) within a sixth of `reach` of travel.
    """
    out = np.zeros_like(strain)
    age, force, before = age_s, 0.0, 0.0
    for i in range(len(strain)):
        step = strain[i] - before
        before = strain[i]
        age = age * np.exp(-abs(step) / reach) + STEP_S
        limit = np.log1p(age / age_s)
        goal = limit * np.sign(step)
        force = goal + (force - goal) * np.exp(-6.0 * abs(step) / reach)
        out[i] = force
    return out


@njit(cache=True)
def crystals(strain: Array, onset: float, melt: float, time: float) -> Array:
    """Crystallised share: grows above `onset`, melts only below `melt` < `onset`."""
    out = np.zeros_like(strain)
    s = 0.0
    for i in range(len(strain)):
        e = strain[i]
        if e > onset:
            s += STEP_S / time * ((e - onset) - s)
        elif e < melt:
            s -= STEP_S / (0.3 * time) * s
        out[i] = s
    return out
