r"""Branch strength that changes with strain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
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
    ports = ("branches",)
    parameters = (
        Parameter("growth", "-", -20.0, 50.0, 1.0, meaning="a, per unit of strain"),
        Parameter("curvature", "-", -50.0, 100.0, 0.0, meaning="b, per strain squared"),
    )
    off = {"growth": 0.0, "curvature": 0.0}
    amplitude = "growth"
    shape = ("curvature",)
    where = "in relaxation, by different shares at different strains"
    twins = {
        "finite_strain": "compression as well as tension",
        "nonlinear_viscosity": "holds at one strain reached at different rates",
    }

    @property
    def second_forms(self):
        return (StrainDrivenBranches(),)

    def factor(self, p, strain):
        x = np.abs(strain)
        return np.maximum(1 + p["growth"] * x + p["curvature"] * x * x, 0.0)

    def after(self, p, signal, state):
        return (
            replace(signal, branches=signal.branches * self.factor(p, signal.strain)),
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
    r"""The same inside the integral: branches are driven by a nonlinear strain measure.

    .. math:: d\varepsilon_b = (1 + a|\varepsilon| + b\,\varepsilon^2)\, d\varepsilon

    Fung's quasi-linear viscoelasticity has this form (Fung 1993, section 7.6).
    """

    ports = ("branch_strain",)

    def before(self, p, signal, state):
        e = signal.branch_strain
        measure = e + p["growth"] * e * np.abs(e) / 2 + p["curvature"] * e**3 / 3
        return replace(signal, branch_strain=measure), None

    def after(self, p, signal, state):
        return signal, None
