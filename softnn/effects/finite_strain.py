r"""Branches that follow true strain, with stress on the current cross-section."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import ramps


class FiniteStrain(Effect):
    r"""Finite strain in the branches of an incompressible material.

    .. math:: \varepsilon_b = (1-\kappa)\,\varepsilon + \kappa \ln(1+\varepsilon),
              \qquad \sigma_b \to \sigma_b \,(1+\varepsilon)^{-\kappa}

    A branch is driven by Hencky strain, and its true stress is divided by the stretch to
    give engineering stress. `amount` kappa is 0 (engineering strain) to 1 (Hencky); up
    to 1.5 tells that the material turns softer still. Reese and Govindjee 1998,
    doi:10.1016/S0020-7683(97)00217-5.

    In a recording: relaxation and loops grow less than in proportion to strain.
    Mistaken for branches whose strength falls with strain, which at one stretch are
    the same thing, and for nonlinear viscosity (which depends on rate).
    """

    stage = "material"
    ports = ("branch_strain", "branches")
    parameters = (
        Parameter("amount", "-", 0.0, 1.5, 1.0, meaning="0 engineering, 1 Hencky"),
    )
    off = {"amount": 0.0}
    amplitude = "amount"
    where = "in the viscous part, at large strain"
    twins = {
        "strain_dependent_relaxation": "compression as well as tension",
        "nonlinear_viscosity": "the same strain at three rates over two decades",
    }

    def before(self, p, signal, state):
        k = p["amount"]
        true = np.log(np.maximum(1 + signal.branch_strain, 1e-3))
        mixed = signal.branch_strain + k * (true - signal.branch_strain)
        return replace(signal, branch_strain=mixed), None

    def after(self, p, signal, state):
        stretch = np.maximum(1 + signal.strain, 1e-3)
        return (
            replace(signal, branches=signal.branches * stretch ** -p["amount"]),
            None,
        )

    def starts(self, scales):
        return [{"amount": 1.0}]

    def telltale(self):
        return ramps([0, 0.4, 0.4, 0.9, 0.9, 0.4, 0.4, 0], 0.1)
