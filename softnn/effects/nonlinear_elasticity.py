r"""Stiffness that changes with strain where the simulation has a constant one."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import cycles

SHORTEST = 0.05  # smallest stretch: a specimen in compression cannot get flatter


class NonlinearElasticity(Effect):
    r"""A spring that stiffens as a power of strain and has a soft or stiff foot.

    .. math:: \sigma \to \sigma + S\, \varepsilon|\varepsilon|^{p-1}
              + F \left(1 - e^{-|\varepsilon|/c}\right) \mathrm{sign}\,\varepsilon

    stiffening S and foot F in MPa, either sign, exponent p, foot width c as strain. The
    power term has the leading order of Yeoh's law (1993, doi:10.5254/1.3538343), the
    foot that of the drop of stiffness at small strain of filled rubber.

    In a recording: every loading curve bends in the same way, whatever the rate.
    Mistaken for branches that change with strain (which shows in holds) and for slack
    (which differs between recordings).
    """

    stage = "material"
    ports = ("equilibrium",)
    parameters: tuple[Parameter, ...] = (
        Parameter("stiffening_MPa", "MPa", -1e4, 1e4, 0.1, meaning="S, at strain 1"),
        Parameter("exponent", "-", 1.3, 12.0, 3.0, "log", "p of the power term"),
        Parameter("foot_MPa", "MPa", -1e4, 1e4, 0.0, meaning="F, far beyond the foot"),
        Parameter("foot_width", "-", 1e-3, 3.0, 0.1, "log", "c, as strain", -1),
    )
    off = {"stiffening_MPa": 0.0, "foot_MPa": 0.0}
    amplitude = "stiffening_MPa"
    shape: tuple[str, ...] = ("foot_MPa", "foot_width")
    where = "on every loading, at the same strain"
    twins = {
        "strain_dependent_relaxation": "a hold at each of several strains",
        "finite_strain": "a hold at each of several strains",
        "slack": "a second recording of the same specimen",
    }

    @property
    def second_forms(self):
        return (OgdenSpring(),)

    def after(self, p, signal, state):
        e = signal.strain
        x = np.abs(e)
        bend = p["stiffening_MPa"] * x ** p["exponent"] + p["foot_MPa"] * -np.expm1(
            -x / p["foot_width"]
        )
        return signal.having(equilibrium=signal.equilibrium + np.sign(e) * bend), None

    def starts(self, scales):
        width = float(np.clip(0.2 * scales.strain, 1e-3, 3))
        return [
            {
                "stiffening_MPa": sign * 0.4 * scales.stress_MPa / scales.strain**p,
                "exponent": p,
                "foot_MPa": 0.0,
                "foot_width": width,
            }
            for sign, p in ((1, 3.0), (1, 1.6), (1, 6.0))
        ]

    def telltale(self):
        return cycles([0.8, 0.8], 0.02)


class OgdenSpring(NonlinearElasticity):
    r"""A spring of incompressible rubber, different in tension and compression.

    .. math:: \sigma \to \sigma + S \left(
              \frac{\lambda^{a-1} - \lambda^{-a/2-1}}{3a/2} - \varepsilon\right),
              \qquad \lambda = 1 + \varepsilon

    S in MPa is the part of the linear stiffness that follows this curve. Ogden 1972,
    doi:10.1098/rspa.1972.0026, one term; exponent a is 2 for neo-Hooke, -2 for the
    second term of Mooney and Rivlin. `NonlinearElasticity` is symmetric instead.
    """

    parameters = (
        NonlinearElasticity.parameters[0],
        Parameter("exponent", "-", -12.0, 14.0, 2.0, meaning="a"),
    )
    off = {"stiffening_MPa": 0.0}
    shape = ()

    def after(self, p, signal, state):
        a, e = p["exponent"], signal.strain
        a = np.where(np.abs(a) < 1e-6, 1e-6, a)
        by = np.log(np.maximum(1 + e, SHORTEST))
        curve = (np.exp((a - 1) * by) - np.exp(-(a / 2 + 1) * by)) / (1.5 * a)
        bend = p["stiffening_MPa"] * (curve - e)
        return signal.having(equilibrium=signal.equilibrium + bend), None

    def starts(self, scales):
        size = 0.5 * scales.stress_MPa / scales.strain
        return [{"stiffening_MPa": size, "exponent": a} for a in (2.0, -2.0)]
