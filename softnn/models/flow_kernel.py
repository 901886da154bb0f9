"""The compiled flow behind `softnn.models.bergstrom_boyce`, imported where needed."""

from __future__ import annotations

import numba
import numpy as np

MOST = 3000  # steps between two samples
HALVINGS = 60
TINY = 1e-14
# Constants of Shampine and Reichelt's modified Rosenbrock formula.
D = 1 / (2 + np.sqrt(2.0))
E32 = 6 + np.sqrt(2.0)


@numba.njit(cache=True, error_model="numpy")
def elastic(terms, log_stretch):
    """Kirchhoff stress of a law of I1, and its derivative by the logarithmic stretch.

    terms (k,): dW/dI1 by powers 0 to k - 1 of I1.
    """
    stretch = np.exp(log_stretch)
    first = stretch * stretch + 2 / stretch
    across = stretch * stretch - 1 / stretch
    w, slope = 0.0, 0.0
    for term in terms[::-1]:
        slope = slope * first + w
        w = w * first + term
    rise = 2 * slope * across * across + w * (2 * stretch * stretch + 1 / stretch)
    return 2 * w * across, 2 * rise


@numba.njit(cache=True, error_model="numpy")
def flow(terms, law, total, viscous):
    """Rate of the viscous strain, and its derivatives by viscous and by total strain.

    Strains are logarithmic; the rate is per relaxation time. law: exponents of stress
    and of chain strain, xi, and the reference of both.
    """
    m, c, xi, reference = law
    stress, rise = elastic(terms, total - viscous)
    stress, rise = stress / reference, rise / reference
    stretch = np.exp(viscous)
    chain = np.sqrt((stretch * stretch + 2 / stretch) / 3)
    slack = chain - 1 + xi
    pace = reference * (slack / reference) ** c * abs(stress) ** (m - 1)
    rate = pace * stress
    by_total = m * pace * rise
    hindered = c * rate / slack * (stretch * stretch - 1 / stretch) / (3 * chain)
    return rate, hindered - by_total, by_total


@numba.njit(cache=True, error_model="numpy")
def over(terms, law, tolerance, first, last, length, viscous):
    """Viscous strain after a step in which the stretch goes straight.

    `length` is over the relaxation time. By Shampine and Reichelt's Rosenbrock formula
    of order 2, which damps whatever is fast (1997, doi:10.1137/S1064827594276424), in
    steps as long as the tolerance of their error allows.
    """
    at, h, slope = 0.0, 1.0, last - first
    for _ in range(MOST):
        stretch = first + at * slope
        rate, by_viscous, by_total = flow(terms, law, np.log(stretch), viscous)
        f0, hd = length * rate, h * D * length
        w = 1 - hd * by_viscous
        drive = hd * by_total * slope / stretch
        k1 = (f0 + drive) / w
        middle = np.log(stretch + 0.5 * h * slope)
        f1 = length * flow(terms, law, middle, viscous + 0.5 * h * k1)[0]
        k2 = (f1 - k1) / w + k1
        new = viscous + h * k2
        f2 = length * flow(terms, law, np.log(stretch + h * slope), new)[0]
        k3 = (f2 - E32 * (k2 - f1) - 2 * (k1 - f0) + drive) / w
        error = abs(h / 6 * (k1 - 2 * k2 + k3))
        if error <= tolerance:
            viscous, at = new, at + h
            if at > 1 - TINY:
                return viscous
        wider = 0.8 * (tolerance / max(error, TINY * tolerance)) ** (1 / 3)
        h *= min(max(wider, 0.1), 5.0) if error < np.inf else 0.1
        h = min(h, 1 - at)
    return relaxed(terms, law, np.log(last), (1 - at) * length, viscous)


@numba.njit(cache=True, error_model="numpy")
def relaxed(terms, law, total, length, viscous):
    """Viscous strain after one step of the implicit Euler method, by bisection.

    It serves where a flow is so sudden that no number of steps can follow it. The flow
    never goes beyond the strain at which the stress is zero.
    """
    start, near, far = viscous, viscous, total
    for _ in range(HALVINGS):
        middle = (near + far) / 2
        left = start + length * flow(terms, law, total, middle)[0] - middle
        if left * (total - start) > 0:
            near = middle
        else:
            far = middle
    return far


@numba.njit(cache=True, error_model="numpy")
def network(terms, law, tolerance, length, stretch, last, viscous, out):
    """Nominal stress (n, sets) of the network that flows, for stretches (n, sets).

    length (n,): steps over the relaxation time. tolerance: of logarithmic strain, a
    step. last and viscous (sets,): the stretch and the logarithmic viscous strain
    before; they are left at the end.
    """
    samples, sets = stretch.shape
    for s in range(sets):
        before, v = last[s], viscous[s]
        for i in range(samples):
            now = stretch[i, s]
            if length[i] > 0:
                v = over(terms, law, tolerance, before, now, length[i], v)
            out[i, s] = elastic(terms, np.log(now) - v)[0] / now
            before = now
        last[s], viscous[s] = before, v
