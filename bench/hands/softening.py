"""Stress softening, permanent set, softening by cycles."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from bench.hands import kernels
from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, farthest, reach
from bench.hands.testing import Act, Law, Run, Setup, on_spring_or_whole


def _works(run: Run) -> tuple[Array, Array, float]:
    """Energy of the spring, its largest so far, its largest of the case."""
    material = run.setup.material
    work = material.energy(run.strain)
    top = float(np.max(material.energy(run.setup.reached())))
    return work, np.maximum.accumulate(work), top


def ogden_roxburgh(rng: Rng, s: Setup) -> Act:
    """eta = 1 - erf((Wm - W)/(m + beta Wm))/r; a = 1/r."""
    m, beta = rng.uniform(0.05, 0.5), rng.uniform(0, 0.3)

    def hook(run: Run, x: Array, a: float) -> Array:
        work, most, top = _works(run)
        return x * (1 - a * erf((most - work) / (m * top + beta * most)))

    return on_spring_or_whole(rng, hook, limit=0.8, parameters={"m": m, "beta": beta})


def dorfmann_ogden(rng: Rng, s: Setup) -> Act:
    """eta = 1 - tanh((Wm - W)/m)/r; a = 1/r."""
    m = rng.uniform(0.05, 0.6)

    def hook(run: Run, x: Array, a: float) -> Array:
        work, most, top = _works(run)
        return x * (1 - a * np.tanh((most - work) / (m * top)))

    return on_spring_or_whole(rng, hook, limit=0.8, parameters={"m": m})


def simo_damage(rng: Rng, s: Setup) -> Act:
    """(1 - d) with d = a (1 - exp(-sqrt(2 Wm)/b)): damage of the largest energy."""
    b = rng.uniform(0.3, 1.5)

    def hook(run: Run, x: Array, a: float) -> Array:
        _, most, top = _works(run)
        return x * (1 + a * np.expm1(-np.sqrt(most / top) / b))

    return on_spring_or_whole(rng, hook, limit=0.85, parameters={"b": b})


def network_alteration(rng: Rng, s: Setup) -> Act:
    """Chains lengthen and fewer carry: eight chains, N and Cr of the largest so far.

    N = N0 exp(n x), Cr = C0 exp(-c x), x the largest chain stretch less one over its
    largest of the case; sigma is multiplied by Cr sqrt(N) L^-1(l/sqrt N) over the same
    of the virgin (Pade form of L^-1). a = c.
    """
    ratio, chain = rng.uniform(0.3, 0.9), rng.uniform(1.5, 3.0)

    def inverse(y: Array) -> Array:
        return y * (3 - y**2) / (1 - y**2)

    def hook(run: Run, x: Array, a: float) -> Array:
        def links(e: Array) -> Array:
            stretch = np.maximum(1 + e, 0.05)
            return np.sqrt((stretch**2 + 2 / stretch) / 3)

        now = links(run.strain)
        top = float(links(s.reached()).max())
        past = (np.maximum.accumulate(now) - 1) / (top - 1)
        first = (chain * top) ** 2
        grown = first * np.exp(ratio * a * past)
        after = np.sqrt(grown) * inverse(now / np.sqrt(grown))
        before = np.sqrt(first) * inverse(now / np.sqrt(first))
        return x * np.exp(-a * past) * after / before

    return on_spring_or_whole(
        rng, hook, limit=1.2, parameters={"ratio": ratio, "chain": chain}
    )


def soft_domains(rng: Rng, s: Setup) -> Act:
    """Occluded hard domains set rubber free: share v grows with the largest stretch.

    dv = a (vs - v) (k - 1)/(k - z)^2 dz, z the largest stretch so far over its scale
    from 1, k the locking stretch; the response scales with v X, X = 1 + 3.5 (1 - v) +
    18 (1 - v)^2.
    """
    first, last = rng.uniform(0.35, 0.5), rng.uniform(0.75, 0.95)
    lock = rng.uniform(1.6, 3.0)

    def hook(run: Run, x: Array, a: float) -> Array:
        z = 1 + farthest(run.strain) / s.em * 0.5
        grown = (lock - 1) * (1 / (lock - z) - 1 / (lock - 1))
        v = last - (last - first) * np.exp(-a * grown)

        def size(u):
            return u * (1 + 3.5 * (1 - u) + 18 * (1 - u) ** 2)

        return x * size(v) / size(first)

    return on_spring_or_whole(
        rng, hook, limit=3.0, parameters={"first": first, "last": last, "lock": lock}
    )


def linear_set(rng: Rng, s: Setup) -> Act:
    """A share of the largest strain so far is left."""
    return Act(0.3, strain=lambda run, e, a: e - a * reach(e), acts_on="whole")


def power_set(rng: Rng, s: Setup) -> Act:
    """The share grows with a power of the largest strain."""
    p = rng.uniform(1.5, 3.0)

    def strain(run: Run, e: Array, a: float) -> Array:
        far = reach(e)
        return e - a * s.em * np.sign(far) * np.abs(far / s.em) ** p

    return Act(0.3, {"power": p}, strain=strain, acts_on="whole")


def residual_stress(rng: Rng, s: Setup) -> Act:
    """(1 - eta2) N, eta2 = tanh((W/Wm)^alpha)/tanh(1), N ~ largest strain so far."""
    alpha = rng.uniform(0.3, 1.0)

    def extra(run: Run, e: Array, stress: Array, a: float) -> Array:
        work, most, _ = _works(run)
        eta = np.tanh((work / (most + 1e-15)) ** alpha) / np.tanh(1.0)
        return -a * s.peak * reach(e) / s.em * (1 - eta)

    return Act(0.4, {"alpha": alpha}, extra=extra, acts_on="whole")


def ratcheting_set(rng: Rng, s: Setup) -> Act:
    """Linear in the largest strain, and more with every decade of cycles."""
    more = rng.uniform(0.3, 1.5)

    def strain(run: Run, e: Array, a: float) -> Array:
        cycles = kernels.valleys(e, 0.2 * s.em)
        growth = 1 + more * np.log10(1 + kernels.follow(cycles, run.clock, 0.5, 0.5))
        return e - a * reach(e) * growth

    return Act(0.2, {"per_decade": more}, strain=strain, acts_on="whole")


def _cyclic(rng: Rng, hook, **parameters: float) -> Act:
    return on_spring_or_whole(rng, hook, limit=0.6, parameters=parameters)


def decade_softening(rng: Rng, s: Setup) -> Act:
    """A share of the stiffness a decade of cycles closed."""

    def hook(run: Run, x: Array, a: float) -> Array:
        n = kernels.valleys(run.strain, 0.2 * s.em)
        return x * np.maximum(1 - a * np.log10(1 + n), 0.1)

    return _cyclic(rng, hook)


def power_softening(rng: Rng, s: Setup) -> Act:
    """(1 + N)^-a."""

    def hook(run: Run, x: Array, a: float) -> Array:
        return x * (1 + kernels.valleys(run.strain, 0.2 * s.em)) ** -a

    return _cyclic(rng, hook)


def continuous_damage(rng: Rng, s: Setup) -> Act:
    """1 - a (1 - exp(-beta/b)), beta the arc length of energy so far."""
    scale = rng.uniform(2.0, 12.0)

    def hook(run: Run, x: Array, a: float) -> Array:
        work, _, top = _works(run)
        arc = np.cumsum(np.abs(np.diff(work, prepend=0.0))) / top
        return x * (1 + a * np.expm1(-arc / scale))

    return _cyclic(rng, hook, scale=scale)


def saturating_softening(rng: Rng, s: Setup) -> Act:
    """1 - a (1 - exp(-N/n)), N the cycles closed."""
    n = rng.uniform(1.5, 6)

    def hook(run: Run, x: Array, a: float) -> Array:
        return x * (1 + a * np.expm1(-kernels.valleys(run.strain, 0.2 * s.em) / n))

    return _cyclic(rng, hook, cycles=n)


_M, _S, _C = "mullins_softening", "permanent_set", "cyclic_softening"
LAWS = (
    Law(
        _M,
        "ogden_roxburgh",
        DEVELOPMENT,
        "Ogden & Roxburgh 1999, 10.1098/rspa.1999.0431",
        ogden_roxburgh,
    ),
    Law(
        _M,
        "dorfmann_ogden",
        HELD_OUT,
        "Dorfmann & Ogden 2003, 10.1016/S0020-7683(03)00089-1",
        dorfmann_ogden,
    ),
    Law(
        _M,
        "simo_damage",
        HELD_OUT,
        "Simo 1987, 10.1016/0045-7825(87)90107-1",
        simo_damage,
    ),
    Law(
        _M,
        "network_alteration",
        DEVELOPMENT,
        "Marckmann et al. 2002, 10.1016/S0022-5096(01)00136-3",
        network_alteration,
    ),
    Law(
        _M,
        "soft_domains",
        HELD_OUT,
        "Qi & Boyce 2004, 10.1016/j.jmps.2004.04.008",
        soft_domains,
    ),
    Law(
        _S,
        "linear",
        DEVELOPMENT,
        "Diani et al. 2009 (review), 10.1016/j.eurpolymj.2008.11.017",
        linear_set,
    ),
    Law(_S, "power", HELD_OUT, "after Diani et al. 2009 (review)", power_set),
    Law(
        _S,
        "residual_stress",
        HELD_OUT,
        "Dorfmann & Ogden 2004, 10.1016/j.ijsolstr.2003.11.014",
        residual_stress,
    ),
    Law(
        _S,
        "ratcheting",
        DEVELOPMENT,
        "logarithm of cycles; after Diani et al. 2009",
        ratcheting_set,
    ),
    Law(_C, "decade", DEVELOPMENT, "logarithm of cycles, common", decade_softening),
    Law(_C, "power", HELD_OUT, "power of cycles, common", power_softening),
    Law(
        _C,
        "continuous_damage",
        HELD_OUT,
        "Miehe 1995, Eur. J. Mech. A 14, 697",
        continuous_damage,
    ),
    Law(
        _C,
        "saturating",
        DEVELOPMENT,
        "exponential of cycles (Voce form), common",
        saturating_softening,
    ),
)
