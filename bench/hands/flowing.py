"""Friction, and branches that the base lacks or takes for linear."""

from __future__ import annotations

import numpy as np

from bench.hands import kernels
from bench.hands.families import DEVELOPMENT, HELD_OUT, Array, Rng, loguniform
from bench.hands.materials import stretched
from bench.hands.testing import Act, Law, Run, Setup


def _steps(e: Array) -> Array:
    return np.diff(e, prepend=0.0)


def _friction(rng: Rng, s: Setup, form, **parameters: float) -> Act:
    return Act(
        0.5,
        parameters,
        "beside",
        extra=lambda run, e, x, a: a * s.peak * form(e),
    )


def dahl(rng: Rng, s: Setup) -> Act:
    """dF/dx = s0 (1 - F sgn(v)/Fc)^i; a = Fc over peak stress."""
    length, i = s.em * loguniform(rng, 0.02, 0.2), rng.choice([0.5, 1.0, 1.0, 1.5])
    return _friction(
        rng, s, lambda e: kernels.dahl(_steps(e), length, i), length=length, power=i
    )


def bouc_wen(rng: Rng, s: Setup) -> Act:
    """dz = dx (1 - |z|^n (beta sgn(z dx) + gamma))/d, beta + gamma = 1."""
    length, n = s.em * loguniform(rng, 0.03, 0.2), rng.uniform(1, 3)
    beta = rng.uniform(0.5, 0.9)
    return _friction(
        rng,
        s,
        lambda e: kernels.bouc_wen(_steps(e), length, beta, n),
        length=length,
        n=n,
        beta=beta,
    )


def iwan(rng: Rng, s: Setup) -> Act:
    """Elastic-plastic elements in parallel, their reaches uniform or a power law."""
    most, skew = s.em * loguniform(rng, 0.05, 0.4), rng.uniform(0.5, 2.5)
    reaches = most * ((np.arange(12) + 0.5) / 12) ** skew

    def form(e: Array) -> Array:
        steps = _steps(e)
        held = sum((kernels.slider(steps, r) for r in reaches), np.zeros(len(e)))
        return held / reaches.sum()

    return _friction(rng, s, form, most=most, skew=skew)


def berg(rng: Rng, s: Setup) -> Act:
    """Berg's smooth friction: half of it after a travel x2."""
    half = s.em * loguniform(rng, 0.02, 0.2)
    return _friction(rng, s, lambda e: kernels.berg(e, half), half=half)


def load_friction(rng: Rng, s: Setup) -> Act:
    """Coulomb: in proportion to the load carried, built up over a short travel."""
    length = s.em * loguniform(rng, 0.02, 0.1)

    def extra(run: Run, e: Array, x: Array, a: float) -> Array:
        return a * np.abs(x) * kernels.dahl(_steps(e), length, 1.0)

    return Act(0.6, {"length": length}, "beside", extra=extra)


def _missing(rng: Rng, s: Setup, taus: Array, parts: Array, **more: float) -> Act:
    def extra(run: Run, e: Array, x: Array, a: float) -> Array:
        unit = kernels.responses(_steps(e), run.clock, taus) @ parts
        return a * s.material.modulus * unit

    return Act(1.5, {"taus_s": taus.tolist(), **more}, "beside", extra=extra)


def one_branch(rng: Rng, s: Setup) -> Act:
    """One Maxwell branch more, its time a decade from the base's."""
    mid = float(s.material.taus[0]) if len(s.material.taus) else s.pace_s
    tau = mid * loguniform(rng, 4, 20) ** rng.choice([-1, 1])
    return _missing(rng, s, np.array([max(tau, 0.05)]), np.ones(1))


def two_branches(rng: Rng, s: Setup) -> Act:
    """A quick and a slow one."""
    taus = s.pace_s * np.array([loguniform(rng, 0.05, 0.4), loguniform(rng, 3, 20)])
    return _missing(rng, s, taus, rng.dirichlet([3, 3]))


def kohlrausch(rng: Rng, s: Setup) -> Act:
    """A stretched exponential."""
    taus, parts = stretched(rng, s.pace_s * loguniform(rng, 0.3, 4))
    return _missing(rng, s, taus, parts)


def springpot(rng: Rng, s: Setup) -> Act:
    """A fractional element between cut-offs."""
    b = rng.uniform(0.15, 0.5)
    taus = s.pace_s * np.geomspace(0.02, 40, 34)
    return _missing(rng, s, taus, taus**-b / (taus**-b).sum(), order=b)


def _dashpot(rng: Rng, s: Setup, mode: int, limit: float, form) -> Act:
    """`form(a)`: stress scale over that of the branch, and power."""

    def flow(run: Run, e: Array, clock: Array, a: float) -> Array:
        scale, power = form(a)
        m = s.material
        reference = scale * m.moduli * s.em
        return kernels.flow(_steps(e), clock, m.taus, m.moduli, mode, reference, power)

    return Act(limit, {}, "branches", flow=flow)


def eyring(rng: Rng, s: Setup) -> Act:
    """Rate ~ sinh(stress/s0); a = peak of an elastic branch over s0."""
    return _dashpot(rng, s, 0, 12.0, lambda a: (1 / max(a, 1e-9), 0.0))


def power_flow(rng: Rng, s: Setup) -> Act:
    """Rate ~ stress^(1 + a) (Norton)."""
    reference = rng.uniform(0.1, 0.5)
    return _dashpot(rng, s, 1, 4.0, lambda a: (reference, a))


def carreau(rng: Rng, s: Setup) -> Act:
    """Viscosity (1 + (stress/s0)^2)^(-a/2)."""
    reference = rng.uniform(0.03, 0.3)
    return _dashpot(rng, s, 2, 4.0, lambda a: (reference, a))


def perzyna(rng: Rng, s: Setup) -> Act:
    """Fluidity that grows with the overstress beyond a yield stress."""
    reference = rng.uniform(0.05, 0.3)
    return _dashpot(rng, s, 3, 20.0, lambda a: (reference, a))


def bergstrom_boyce(rng: Rng, s: Setup) -> Act:
    """Rate ~ (chain stretch - 1 + xi)^C stress^m, as for its network B."""
    c, xi, reference = rng.uniform(-1, -0.4), rng.uniform(0.02, 0.1), 0.3
    mean = float(np.sqrt(((1 + s.em) ** 2 + 2 / (1 + s.em)) / 3)) - 1

    def flow(run: Run, e: Array, clock: Array, a: float) -> Array:
        m = s.material
        stretch = np.maximum(1 + e, 0.05)
        chain = np.sqrt((stretch**2 + 2 / stretch) / 3) - 1
        quicker = ((chain / mean + xi) / (0.3 + xi)) ** (c * min(a, 1.0))
        scale = reference * m.moduli * s.em
        return kernels.flow(_steps(e), clock * quicker, m.taus, m.moduli, 1, scale, a)

    return Act(4.0, {"C": c, "xi": xi}, "branches", flow=flow)


_F, _B, _V = "friction_hysteresis", "relaxation_branch", "nonlinear_viscosity"
LAWS = (
    Law(_F, "dahl", DEVELOPMENT, "Dahl 1968, Aerospace Corp. TOR-0158", dahl),
    Law(_F, "bouc_wen", HELD_OUT, "Wen 1976, 10.1061/JMCEA3.0002106", bouc_wen),
    Law(_F, "iwan", DEVELOPMENT, "Iwan 1966, 10.1115/1.3625199", iwan),
    Law(_F, "berg", HELD_OUT, "Berg 1998, 10.1080/00423119808969454", berg),
    Law(_F, "load_coulomb", DEVELOPMENT, "Coulomb; Dahl's build-up", load_friction),
    Law(
        _B,
        "one_branch",
        DEVELOPMENT,
        "Maxwell 1867, 10.1098/rstl.1867.0004",
        one_branch,
    ),
    Law(
        _B,
        "kohlrausch",
        HELD_OUT,
        "Williams & Watts 1970, 10.1039/TF9706600080",
        kohlrausch,
    ),
    Law(
        _B,
        "springpot",
        HELD_OUT,
        "Schiessel et al. 1995, 10.1088/0305-4470/28/23/012",
        springpot,
    ),
    Law(
        _B,
        "two_branches",
        DEVELOPMENT,
        "Wiechert 1893, 10.1002/andp.18932861011",
        two_branches,
    ),
    Law(_V, "eyring", DEVELOPMENT, "Eyring 1936, 10.1063/1.1749836", eyring),
    Law(_V, "power", HELD_OUT, "Norton 1929, The Creep of Steel", power_flow),
    Law(_V, "carreau", HELD_OUT, "Carreau 1972, 10.1122/1.549276", carreau),
    Law(
        _V,
        "bergstrom_boyce",
        DEVELOPMENT,
        "Bergstrom & Boyce 1998, 10.1016/S0022-5096(97)00075-6",
        bergstrom_boyce,
    ),
    Law(_V, "perzyna", DEVELOPMENT, "Perzyna 1966, Adv. Appl. Mech. 9, 243", perzyna),
)
