"""Laws in which strain changes the response."""

from __future__ import annotations

import numpy as np

from bench.hands import kernels
from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng
from bench.hands.testing import Act, Law, Run, Setup, linear_flow


def _bent(s: Setup, form, limit: float, **parameters: float) -> Act:
    """`form(x, a)` in place of x, x the strain over its largest; form(x, 0) = x."""

    def spring(run: Run, stress: Array, a: float) -> Array:
        x = np.abs(run.strain) / s.em
        return stress * np.where(x > 1e-9, form(x, a) / np.maximum(x, 1e-9), 1.0)

    return Act(limit, parameters, "spring", spring=spring)


def cubic(rng: Rng, s: Setup) -> Act:
    """x + a x^p, p from 2 to 4: stiffening."""
    p = rng.uniform(2, 4)
    return _bent(s, lambda x, a: x + a * x**p, 3.0, power=p)


def exponential(rng: Rng, s: Setup) -> Act:
    """(exp(a x) - 1)/a."""
    return _bent(s, lambda x, a: np.expm1(a * x) / a if a else x, 3.0)


def plateau(rng: Rng, s: Setup) -> Act:
    """Struts bow: (x + a w tanh(x/w))/(1 + a), stiff at first."""
    w = rng.uniform(0.15, 0.5)
    return _bent(s, lambda x, a: (x + a * w * np.tanh(x / w)) / (1 + a), 6.0, w=w)


def ramberg_osgood(rng: Rng, s: Setup) -> Act:
    """Softening without a plateau: x/(1 + a x^p)^(1/p)."""
    p = rng.uniform(1.0, 3.0)
    return _bent(s, lambda x, a: x / (1 + a * x**p) ** (1 / p), 4.0, power=p)


def locking(rng: Rng, s: Setup) -> Act:
    """Chains lock: x/(1 - a x^2)."""
    return _bent(s, lambda x, a: x / (1 - a * x**2), 0.8)


def schapery(rng: Rng, s: Setup) -> Act:
    """h1(e) int E(psi - psi') d(h2 e): h1, h2 = 1 + c a x, x = |e| over largest."""
    c1, c2 = rng.choice([-0.5, 0.7, 1.0]), rng.uniform(0.3, 1.0)

    def flow(run: Run, e: Array, clock: Array, a: float) -> Array:
        x = np.abs(e) / s.em
        drive = e * (1 + c2 * a * x)
        return (1 + c1 * a * x) * linear_flow(s.material, drive, clock)

    return Act(1.8, {"h1": float(c1), "h2": c2}, "branches", flow=flow)


def strain_clock(rng: Rng, s: Setup) -> Act:
    """Free volume: times 10^(-a x) of what they were, x = |e| over largest."""
    way = rng.choice([-1.0, 1.0], p=[0.3, 0.7])

    def tempo(run: Run, e: Array, a: float) -> Array:
        return 10 ** (way * a * np.abs(e) / s.em)

    return Act(2.5, {"way": float(way)}, "branch times", tempo=tempo)


def pipkin_rogers(rng: Rng, s: Setup) -> Act:
    """int R(e, t - t') de: each branch's stiffness has its own course with strain."""
    powers = rng.uniform(0.8, 2.0, len(s.material.taus))
    signs = np.ones(len(powers))
    if len(powers) > 1:
        signs[rng.permutation(len(powers))[: len(powers) // 3]] = -0.4

    def flow(run: Run, e: Array, clock: Array, a: float) -> Array:
        m, total = s.material, np.zeros(len(e))
        steps, x = np.diff(e, prepend=0.0), np.abs(e) / s.em
        for tau, modulus, p, sign in zip(m.taus, m.moduli, powers, signs, strict=True):
            stiff = np.maximum(1 + sign * a * x**p, 0.1)
            unit = kernels.responses(steps * stiff, clock, np.array([tau]))
            total += modulus * unit[:, 0]
        return total

    parameters = {"powers": powers.tolist(), "signs": signs.tolist()}
    return Act(2.5, parameters, "branches", flow=flow)


def outer_factor(rng: Rng, s: Setup) -> Act:
    """Branch stress times a function of the present strain, (1 + a x^p)^+-1."""
    p, stiffer = rng.uniform(0.8, 2.0), rng.random() < 0.5

    def flow(run: Run, e: Array, clock: Array, a: float) -> Array:
        factor = 1 + a * (np.abs(e) / s.em) ** p
        return linear_flow(s.material, e, clock) * (factor if stiffer else 1 / factor)

    return Act(2.5, {"power": p, "stiffer": float(stiffer)}, "branches", flow=flow)


def _large(s: Setup, form, **parameters: float) -> Act:
    """A blend of linear branches and of `form(stretch, clock)`; a is its share."""

    def flow(run: Run, e: Array, clock: Array, a: float) -> Array:
        small = linear_flow(s.material, e, clock)
        return (1 - a) * small + a * form(np.maximum(1 + e, 0.02), clock)

    return Act(1.0, parameters, "branches", flow=flow)


def hencky(rng: Rng, s: Setup) -> Act:
    """Branches follow ln l; their true stress over l is engineering stress."""
    return _large(s, lambda y, dt: linear_flow(s.material, np.log(y), dt) / y)


def green_strain(rng: Rng, s: Setup) -> Act:
    """Second Piola-Kirchhoff branches follow (l^2 - 1)/2; times l."""
    return _large(s, lambda y, dt: y * linear_flow(s.material, (y**2 - 1) / 2, dt))


def _by_branch(s: Setup, kernel) -> Act:
    def form(y: Array, dt: Array) -> Array:
        m, total = s.material, np.zeros(len(y))
        for tau, modulus in zip(m.taus, m.moduli, strict=True):
            total += modulus * kernel(y, dt, tau)
        return total

    return _large(s, form)


def upper_convected(rng: Rng, s: Setup) -> Act:
    """Upper-convected Maxwell branches: a transient network."""
    return _by_branch(s, kernels.convected)


def split_stretch(rng: Rng, s: Setup) -> Act:
    """Neo-Hookean spring and dashpot in series, stretches multiplied."""
    return _by_branch(s, kernels.spring_in_dashpot)


def ogden_overstress(rng: Rng, s: Setup) -> Act:
    """Second Piola-Kirchhoff branches follow the deviator of an Ogden potential's.

    sigma = (2 l R*(k/l^2) + R*(k l)/l^2)/3, k = 2/(3 alpha) (l^alpha - l^(-alpha/2)):
    R*, the branches' convolution, acts on axial and lateral stress of the material.
    """
    alpha = rng.uniform(1.3, 3.0)

    def form(y: Array, dt: Array) -> Array:
        kirchhoff = 2 / (3 * alpha) * (y**alpha - y ** (-alpha / 2))
        axial = linear_flow(s.material, kirchhoff / y**2, dt)
        lateral = linear_flow(s.material, kirchhoff * y, dt)
        return (2 * y * axial + lateral / y**2) / 3

    return _large(s, form, alpha=alpha)


def micro_sphere(rng: Rng, s: Setup) -> Act:
    """Chains of every direction, and tubes about them, have branches of their own.

    sigma = 5/l <R* ln L  d ln L/d ln l>, the mean over cosines c to the axis, of
    L^2 = c^2 z^2 + (1 - c^2)/z: z = l for stretch of chains, 1/l for area of tubes.
    """
    tubes = rng.uniform(0.0, 0.5)  # their share of the moduli
    cosines, weights = (half[16:] for half in np.polynomial.legendre.leggauss(32))

    def form(y: Array, dt: Array) -> Array:
        m, total = s.material, np.zeros(len(y))
        for z, share in ((y, 1 - tubes), (1 / y, -tubes)):
            along = np.outer(z**2, cosines**2)
            across = np.outer(1 / z, 1 - cosines**2)
            square = along + across
            steps = np.diff(np.log(square) / 2, axis=0, prepend=0.0)
            force = kernels.branches(steps, dt, m.taus, m.moduli)
            total += share * (force * (along - across / 2) / square) @ weights
        return 5 * total / y

    return _large(s, form, tubes=tubes)


_N, _R = "nonlinear_elasticity", "strain_dependent_relaxation"
_L = "finite_strain"
LAWS = (
    Law(
        _N,
        "power",
        DEVELOPMENT,
        "polynomial, after Yeoh 1993, 10.5254/1.3538343",
        cubic,
    ),
    Law(
        _N,
        "exponential",
        HELD_OUT,
        "Fung 1967, 10.1152/ajplegacy.1967.213.6.1532",
        exponential,
    ),
    Law(_N, "plateau", DEVELOPMENT, "after Gibson & Ashby 1997", plateau),
    Law(
        _N,
        "soft_knee",
        HELD_OUT,
        "inverse of Ramberg & Osgood 1943, NACA TN 902",
        ramberg_osgood,
    ),
    Law(_N, "locking", DEVELOPMENT, "after Gent 1996, 10.5254/1.3538357", locking),
    Law(_R, "schapery", DEVELOPMENT, "Schapery 1969, 10.1002/pen.760090410", schapery),
    Law(
        _R,
        "pipkin_rogers",
        HELD_OUT,
        "Pipkin & Rogers 1968, 10.1016/0022-5096(68)90016-1",
        pipkin_rogers,
    ),
    Law(
        _R,
        "strain_clock",
        DEVELOPMENT,
        "Knauss & Emri 1981, Comput. Struct. 13, 123",
        strain_clock,
    ),
    Law(
        _R,
        "outer_factor",
        HELD_OUT,
        "after Simo 1987, 10.1016/0045-7825(87)90107-1",
        outer_factor,
    ),
    Law(
        _L, "hencky", DEVELOPMENT, "Hencky 1928; Anand 1979, 10.1115/1.3424532", hencky
    ),
    Law(
        _L,
        "green",
        DEVELOPMENT,
        "Simo 1987, 10.1016/0045-7825(87)90107-1",
        green_strain,
    ),
    Law(
        _L,
        "upper_convected",
        DEVELOPMENT,
        "Oldroyd 1950, 10.1098/rspa.1950.0035",
        upper_convected,
    ),
    Law(
        _L,
        "split_stretch",
        DEVELOPMENT,
        "Reese & Govindjee 1998, 10.1016/S0020-7683(97)00217-5",
        split_stretch,
    ),
    Law(
        _L,
        "ogden_overstress",
        HELD_OUT,
        "Holzapfel 1996, Int. J. Numer. Meth. Engng 39, 3903",
        ogden_overstress,
    ),
    Law(
        _L,
        "micro_sphere",
        HELD_OUT,
        "Miehe & Goektepe 2005, 10.1016/j.jmps.2005.04.006",
        micro_sphere,
    ),
)
