r"""Branch strength that changes with strain."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import ramps


class StrainDependentRelaxation(Effect):
    r"""Branches that grow stronger or weaker as the specimen is strained.

    .. math:: \sigma_b \to \sigma_b \,(1 + a|\varepsilon| + b\,\varepsilon^2)

    a and b per unit of strain; the factor is not taken below zero. Schapery 1969,
    doi:10.1002/pen.760090410 (h_1 outside the integral).

    In a recording: holds at different strains do not fall on one another when divided
    by strain. Mistaken for finite strain and for nonlinear viscosity.
    """

    stage = "material"
    ports: tuple[str, ...] = ("branches",)
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "growth",
            "-",
            -20.0,
            50.0,
            1.0,
            meaning="a, per unit of strain",
            per_strain=1,
        ),
        Parameter(
            "curvature",
            "-",
            -50.0,
            100.0,
            0.0,
            meaning="b, per strain squared",
            per_strain=2,
        ),
    )
    off: Mapping[str, float] = {"growth": 0.0, "curvature": 0.0}
    amplitude = "growth"
    shape: tuple[str, ...] = ("curvature",)
    spoken = "strain-dependent relaxation"
    family = "viscosity that depends on strain or rate"
    where = "in relaxation, by different shares at different strains"
    twins = {
        "finite_strain": "cycles to larger strain",
        "nonlinear_viscosity": "holds at one strain reached at different rates",
    }

    @property
    def second_forms(self):
        return (
            StrainDrivenBranches(),
            Schapery(),
            StrainClock(),
            WholeSchapery(),
            DecliningBranches(),
        )

    def factor(self, p, strain):
        x = np.abs(strain)
        return np.maximum(1 + p["growth"] * x + p["curvature"] * x * x, 0.0)

    def after(self, p, signal, state):
        return (
            signal.having(branches=signal.branches * self.factor(p, signal.strain)),
            None,
        )

    def starts(self, scales):
        unit = 1 / max(scales.strain, 1e-6)
        return [
            {"growth": float(np.clip(g * unit, -20, 50)), "curvature": 0.0}
            for g in (1.0, -0.6)
        ]

    def telltale(self):
        return ramps([0, 0.2, 0.2, 0.5, 0.5, 0.8, 0.8, 0], 0.1)


class StrainDrivenBranches(StrainDependentRelaxation):
    r"""Branches driven by a nonlinear strain measure, inside the integral.

    .. math:: d\varepsilon_b = (1 + a|\varepsilon| + b\,\varepsilon^2)\, d\varepsilon

    Fung's quasi-linear viscoelasticity has this form (Fung 1993, section 7.6).
    """

    ports = ("branch_strain",)

    def before(self, p, signal, state):
        e = signal.branch_strain
        measure = e + p["growth"] * e * np.abs(e) / 2 + p["curvature"] * e**3 / 3
        return signal.having(branch_strain=measure), None

    def after(self, p, signal, state):
        return signal, None


class Schapery(StrainDependentRelaxation):
    r"""Strain dependence inside and outside the integral, each with its own measure.

    .. math:: \sigma_b = (1 + b|\varepsilon|) \int E(t - t')\,
              d\left(\varepsilon + a\,\varepsilon|\varepsilon| / 2\right)

    h_2 and h_1 of Schapery 1969, doi:10.1002/pen.760090410, to first order in strain.
    """

    ports = ("branch_strain", "branches")
    parameters = (
        StrainDependentRelaxation.parameters[0],
        Parameter(
            "outer",
            "-",
            -20.0,
            50.0,
            0.0,
            meaning="b, outside the integral, per unit of strain",
            per_strain=1,
        ),
    )
    off = {"growth": 0.0, "outer": 0.0}
    shape = ("outer",)

    def before(self, p, signal, state):
        e = signal.branch_strain
        measure = e + p["growth"] * e * np.abs(e) / 2
        return signal.having(branch_strain=measure), None

    def after(self, p, signal, state):
        factor = np.maximum(1 + p["outer"] * np.abs(signal.strain), 0.0)
        return signal.having(branches=signal.branches * factor), None

    def starts(self, scales):
        unit = 1 / max(scales.strain, 1e-6)
        return [
            {
                "growth": float(np.clip(inside * unit, -20, 50)),
                "outer": float(np.clip(outside * unit, -20, 50)),
            }
            for inside, outside in ((1.0, -0.5), (1.0, 0.5), (-0.6, 1.0))
        ]


class StrainClock(StrainDependentRelaxation):
    r"""Branches whose relaxation speeds up or slows down with strain.

    .. math:: \dot\xi = e^{a|\varepsilon|}, \quad
              \text{branches relax in } \xi \text{ in place of } t

    Knauss and Emri 1981, doi:10.1016/0045-7949(81)90177-2; a_sigma of Schapery 1969.
    """

    ports: tuple[str, ...] = ("branch_strain",)
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "growth",
            "-",
            -50.0,
            50.0,
            1.0,
            meaning="a, per unit of strain",
            per_strain=1,
        ),
    )
    off = {"growth": 0.0}
    shape = ()
    after = Effect.after

    def before(self, p, signal, state):
        time = signal.branch_clock
        last, gone = (time[:1], time[:1]) if state is None else state
        step = increments(time, last)
        pace = np.exp(np.clip(p["growth"] * np.abs(signal.strain), -30, 30))
        passed = gone + np.cumsum(step * pace, axis=0)
        passed = np.where(p["growth"] == 0, time, passed)  # to the last bit
        new = signal.having(branch_time_s=passed)
        return new, (time[-1:], passed[-1:])

    def starts(self, scales):
        unit = 1 / max(scales.strain, 1e-6)
        return [{"growth": float(np.clip(g * unit, -50, 50))} for g in (1.5, -1.0)]


class WholeSchapery(StrainClock):
    r"""Branches whose relaxation times and strength both depend on strain.

    .. math:: \sigma_b = (1 + b|\varepsilon|) \int E(\xi - \xi')\, d\varepsilon, \qquad
              \dot\xi = e^{a|\varepsilon|}

    h_1 and a_sigma of Schapery 1969, doi:10.1002/pen.760090410, by strain.
    """

    ports = ("branch_strain", "branches")
    parameters = (*StrainClock.parameters, Schapery.parameters[1])
    off = {"growth": 0.0, "outer": 0.0}
    after = Schapery.after

    def starts(self, scales):
        unit = 1 / max(scales.strain, 1e-6)
        return [
            {
                "growth": float(np.clip(a * unit, -50, 50)),
                "outer": float(np.clip(b * unit, -20, 50)),
            }
            for a, b in ((1.5, 1.0), (1.5, -0.5))
        ]


class DecliningBranches(StrainDependentRelaxation):
    r"""Branches whose strength falls, or grows, as a power of the strain.

    .. math:: \sigma_b = \left(1 + \frac{|\varepsilon|}{c}\right)^{-k}
              \int E(t - t') \left(1 + \frac{|\varepsilon|}{c}\right)^{-n} d\varepsilon

    decline k outside the integral, n inside, from the strain c on: outside the damping
    function of melts (Soskey and Winter 1984, *J. Rheol.* 28, 625-645), inside a
    measure of strain as in QLV (Fung 1993, section 7.6), a power of it for small c.
    """

    ports = ("branch_strain", "branches")
    parameters = (
        Parameter("decline", "-", -3.0, 3.0, 0.5, meaning="k, outside the integral"),
        Parameter("inner", "-", -3.0, 3.0, 0.0, meaning="n, inside of it"),
        Parameter("width", "-", 1e-3, 3.0, 0.1, "log", "c, as strain", -1),
    )
    off = {"decline": 0.0, "inner": 0.0}
    amplitude = "decline"
    shape = ("inner",)

    def before(self, p, signal, state):
        e, width, m = signal.branch_strain, p["width"], 1 - p["inner"]
        by = np.log1p(np.abs(e) / width)
        near = np.abs(m) < 1e-9
        measure = width * np.where(near, by, np.expm1(m * by) / np.where(near, 1.0, m))
        measure = np.where(m == 1, e, np.sign(e) * measure)  # to the last bit
        return signal.having(branch_strain=measure), None

    def after(self, p, signal, state):
        factor = (1 + np.abs(signal.strain) / p["width"]) ** -p["decline"]
        return signal.having(branches=signal.branches * factor), None

    def starts(self, scales):
        width = float(np.clip(0.1 * scales.strain, 1e-3, 3))
        return [
            {"decline": k, "inner": n, "width": width}
            for k, n in ((0.6, 0), (0.1, 0.6))
        ]
