"""Effects of the material itself."""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve
from scipy.stats import gamma

from bench.concealed import marching
from bench.concealed.bases import draw_base, maxwell
from bench.concealed.planting import Context, Planted, Signals
from bench.concealed.programmes import STEP_S, Array

KELVIN = 273.15


def mullins_softening(c: Context) -> Planted:
    """25-50 % of the stiffness lost at small strain below the largest strain.

    "zuniga-beatty": exp(-b sqrt(M - m)) in strain; "hill": a rational share of the
    largest strain; "soft domains": the share of soft domains depends on M alone, so
    that first loading softens too.
    """
    # On a spring that must stay straight, first loading has to stay untouched.
    straight = c.base.name == "linear"
    form = c.pick("zuniga-beatty", "hill", *([] if straight else ["soft domains"]))
    lost, peak = c.amount(0.25, 0.50), c.pace.peak
    p, q = c.rng.uniform(0.5, 1.3), c.rng.uniform(1.0, 2.5)
    lock = peak * c.rng.uniform(1.3, 2.0)
    whole = bool(c.rng.random() < 0.5)

    def parts(h: Signals) -> None:
        m, e = h.largest, np.maximum(h.strain, 0.0)
        if form == "zuniga-beatty":
            factor = np.exp(np.log1p(-lost) * np.sqrt(np.maximum(m - e, 0) / peak))
        elif form == "hill":
            ratio = np.divide(e, m, out=np.ones_like(e), where=m > 0)
            factor = 1 - lost * (m / peak) ** p * (1 - ratio**q)
        else:
            share = -np.expm1(-2 * m / (lock - np.minimum(m, 0.999 * lock)))
            factor = 1 - lost * share / -np.expm1(-2 * peak / (lock - peak))
        h.spring = h.spring * factor
        if whole:
            h.branches = h.branches * factor

    return Planted(
        "mullins_softening",
        form,
        {"lost": lost, "p": p, "q": q, "lock": lock, "branches_too": whole},
        parts=parts,
    )


def permanent_set(c: Context) -> Planted:
    """A residual strain of 8-20 % of the largest strain.

    "split": elastic strain is strain less a hyperbolic sine of the largest strain; "on
    return": the same, but first loading is left as it was; "beyond yield": it starts
    above a strain.
    """
    straight = c.base.name == "linear"
    forms = ["on return"] if straight else ["split", "on return", "beyond yield"]
    form, peak = c.pick(*forms), c.pace.peak
    size, bend = peak * c.amount(0.08, 0.20), c.rng.uniform(0.5, 2.5)
    start, turn = peak * c.rng.uniform(0.1, 0.3), c.rng.uniform(1.0, 3.0)
    both = bool(c.rng.random() < 0.4)

    def strain(h: Signals) -> None:
        m = h.largest
        if form == "beyond yield":
            w = 0.05 * peak
            soft = np.logaddexp(0, (m - start) / w) - np.logaddexp(0, -start / w)
            residual = size * w * soft / (peak - start)
        else:
            residual = size * np.sinh(bend * m / peak) / np.sinh(bend)
        if form == "on return":
            ratio = np.divide(h.strain, m, out=np.ones_like(m), where=m > 0)
            residual = residual * np.cos(np.pi / 2 * np.clip(ratio, 0, 1)) ** turn
        h.spring_strain = h.spring_strain - residual
        if both:
            h.branch_strain = h.branch_strain - residual

    return Planted(
        "permanent_set",
        form,
        {"size": size, "bend": bend, "branches_too": both},
        strain=strain,
    )


def friction_hysteresis(c: Context) -> Planted:
    """A rate-independent loop of 5-12 % of the peak stress."""
    form = c.pick("dahl", "weibull sliders", "gamma sliders")
    limit = c.peak * c.amount(0.05, 0.12)
    reach = c.pace.peak * c.rng.uniform(0.01, 0.04)
    exponent = float(c.rng.choice([c.rng.uniform(0.5, 0.8), c.rng.uniform(1.3, 1.8)]))
    level = (np.arange(40) + 0.5) / 40
    if form == "weibull sliders":
        travel = reach * (-np.log1p(-level)) ** (1 / 1.5)
    else:  # a gamma distribution of shape two, by its quantiles
        travel = reach * gamma.ppf(level, 2.0) / 2
    yields = np.full(40, limit / 40)

    def parts(h: Signals) -> None:
        if form == "dahl":
            h.extra = h.extra + marching.dahl(h.strain, limit, reach, exponent)
        else:
            h.extra = h.extra + marching.iwan(h.strain, yields / travel, yields)

    return Planted(
        "friction_hysteresis",
        form,
        {"limit_MPa": limit, "reach": reach, "exponent": exponent},
        parts=parts,
    )


def relaxation_branch(c: Context) -> Planted:
    """One more branch, of 30-70 % of the modulus, far from the one there is."""
    form = c.pick("two times", "stretched exponential", "log-normal spectrum")
    stiffness = c.base.modulus * c.amount(0.30, 0.70)
    there = c.base.branches[0][1]
    # Ten to thirty times slower or quicker, on the side where it can be seen.
    apart = 10 ** c.rng.uniform(1.0, 1.5)
    time = there * apart if there < 4 else there / apart
    spread = c.rng.uniform(0.15, 0.3)
    stretch = c.rng.uniform(0.8, 0.92)

    def response(strain: Array) -> Array:
        if form == "two times":
            close = (time / (1 + spread), time * (1 + spread))
            return np.sum([maxwell(strain, t) / 2 for t in close], axis=0)
        if form == "log-normal spectrum":
            x = np.linspace(-2, 2, 9)
            weight = np.exp(-(x**2) / 2)
            weight /= weight.sum()
            parts = [
                w * maxwell(strain, time * 10 ** (spread * d))
                for w, d in zip(weight, x, strict=True)
            ]
            return np.sum(parts, axis=0)
        t = (np.arange(len(strain)) + 0.5) * STEP_S
        steps = np.diff(strain, prepend=0.0)
        return fftconvolve(steps, np.exp(-((t / time) ** stretch)))[: len(strain)]

    def parts(h: Signals) -> None:
        h.extra = h.extra + stiffness * response(h.branch_strain)

    return Planted(
        "relaxation_branch",
        form,
        {"stiffness_MPa": stiffness, "time_s": time, "spread": spread},
        parts=parts,
    )


def nonlinear_viscosity(c: Context) -> Planted:
    """An element about as stiff as the spring whose dashpot yields under stress."""
    form = c.pick("carreau", "garofalo")
    stiffness = c.base.modulus * c.amount(0.7, 1.3)
    scale = stiffness * c.pace.peak * c.rng.uniform(0.08, 0.2)
    time = c.pace.ramp_s * 10 ** c.rng.uniform(0.8, 1.4)
    power = c.rng.uniform(0.8, 1.5) if form == "carreau" else c.rng.uniform(1.5, 2.5)
    law = marching.CARREAU if form == "carreau" else marching.GAROFALO

    def parts(h: Signals) -> None:
        h.extra = h.extra + marching.flowing(
            h.branch_strain, stiffness, law, scale, time, power
        )

    return Planted(
        "nonlinear_viscosity",
        form,
        {
            "stiffness_MPa": stiffness,
            "scale_MPa": scale,
            "time_s": time,
            "power": power,
        },
        parts=parts,
    )


def nonlinear_elasticity(c: Context) -> Planted:
    """The straight spring gives way to a hyperelastic one (blended by strength)."""
    while True:
        other = draw_base(c.rng, c.pace.peak, linear=False, branches=0)
        grid = np.linspace(0, c.pace.peak, 200)
        tangent = np.gradient(other.spring(grid) / other.modulus, grid)
        if tangent.max() > 2 * tangent.min():  # strength 1: it at least doubles
            break
    share = min(1.0, c.strength)

    def parts(h: Signals) -> None:
        bent = other.spring(h.spring_strain) * (c.base.modulus / other.modulus)
        h.spring = h.spring + share * (bent - c.base.spring(h.spring_strain))

    return Planted(
        "nonlinear_elasticity",
        other.name,
        {"share": share, **other.shape},
        parts=parts,
    )


def strain_dependent_relaxation(c: Context) -> Planted:
    """Branches 2 to 3 times as stiff, or a half to a third, at the largest strain."""
    form = c.pick("driven", "amplified")
    change, power = c.amount(1.0, 2.0), c.rng.uniform(1.0, 2.0)
    growing = bool(c.rng.random() < 0.6)
    peak = c.pace.peak

    def strength(strain: Array) -> Array:
        m = 1 + change * np.clip(strain / peak, 0, None) ** power
        return m if growing else 1 / m

    def strain(h: Signals) -> None:
        if form == "driven":
            grid = np.linspace(-0.5 * peak, 1.5 * peak, 2001)
            table = np.cumsum(strength(grid)) * (grid[1] - grid[0])
            table -= np.interp(0.0, grid, table)
            h.branch_strain = np.interp(h.branch_strain, grid, table)

    def parts(h: Signals) -> None:
        if form == "amplified":
            h.branches = h.branches * strength(h.strain)

    return Planted(
        "strain_dependent_relaxation",
        form,
        {"change": change, "power": power, "growing": growing},
        strain=strain,
        parts=parts,
    )


def finite_strain(c: Context) -> Planted:
    """Branches of finite strain, stress on the current section (blended by strength).

    "multiplicative": elastic stretch times viscous stretch, neo-Hookean spring;
    "bazant": half of what a stretch and its inverse differ by, each to a power.
    """
    form = c.pick("multiplicative", "bazant")
    m, share = c.rng.uniform(0.2, 0.8), min(1.0, c.strength)

    def parts(h: Signals) -> None:
        stretch = np.maximum(1 + h.branch_strain, 0.2)
        if form == "multiplicative":
            finite = sum(
                marching.neo_hookean_branch(stretch, k, t) for k, t in c.base.branches
            )
        else:
            measure = np.sinh(m * np.log(stretch)) / m
            finite = c.base.relaxing(measure)
        h.branches = h.branches + share * (
            np.asarray(finite) / stretch - c.base.relaxing(h.branch_strain)
        )

    return Planted("finite_strain", form, {"share": share, "m": m}, parts=parts)


def thermal_softening(c: Context) -> Planted:
    """0.6-1.5 % of the stiffness per degC, of spring and branches alike."""
    form, rate = c.pick("arrhenius", "rational"), c.amount(0.006, 0.015)

    def parts(h: Signals) -> None:
        if form == "arrhenius":
            reference = 23.0 + KELVIN
            over = 1 / (h.temperature_C + KELVIN) - 1 / reference
            factor = np.exp(rate * reference**2 * over)
        else:
            x = rate * (h.temperature_C - 23.0)
            factor = (1 - x / 2) / (1 + x / 2)
        h.spring, h.branches = h.spring * factor, h.branches * factor
        h.extra = h.extra * factor

    return Planted("thermal_softening", form, {"per_degC": rate}, parts=parts)


def cyclic_softening(c: Context) -> Planted:
    """8-16 % of the stiffness lost from the first to the tenth cycle."""
    form, lost = c.pick("power of cycles", "saturating travel"), c.amount(0.08, 0.16)
    half = c.rng.uniform(4.0, 8.0)

    def parts(h: Signals) -> None:
        if form == "power of cycles":
            n = marching.reversals(h.strain, 0.1 * c.pace.peak)
            factor = (1 + n) ** np.log10(1 - lost)
        else:
            travel = np.abs(np.diff(h.strain, prepend=0.0)).cumsum()
            n = np.divide(
                travel, 2 * h.largest, out=np.zeros_like(travel), where=h.largest > 0
            )
            span = 10 / (10 + half) - 1 / (1 + half)
            factor = 1 - lost / span * n / (n + half)
        h.spring, h.branches = h.spring * factor, h.branches * factor

    return Planted("cyclic_softening", form, {"lost": lost, "half": half}, parts=parts)


def tension_only(c: Context) -> Planted:
    """The strip buckles: in compression a small plateau is all it bears."""
    form = c.pick("plateau", "elastica")
    bears, share = c.peak * c.rng.uniform(0.002, 0.008), min(1.0, c.strength)

    def stress(h: Signals, s: Array) -> Array:
        if form == "plateau":
            kept = np.where(s < 0, bears * np.expm1(np.minimum(s, 0) / bears), s)
        else:
            # Bent further, a strip bears a little more: ever less for the same push.
            first = bears / 8
            kept = np.where(s < 0, -first * np.log1p(-np.minimum(s, 0) / first), s)
        return s + share * (kept - s)

    return Planted(
        "tension_only",
        form,
        {"bears_MPa": bears, "share": share},
        stress=stress,
    )
