r"""Branches that follow true strain, with stress on the current cross-section."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Array, Effect, Parameter
from softnn.effects._programmes import ramps

FARTHEST = 2.0  # logarithmic elastic strain of a branch: seven times its length
THINNEST = 0.05  # smallest stretch: a specimen in compression cannot get flatter


class FiniteStrain(Effect):
    r"""Finite strain in the branches of an incompressible material.

    .. math:: \varepsilon_b = \frac{(1+\varepsilon)^{m} - 1}{m}, \quad m = 1-\kappa,
              \qquad \sigma_b \to \sigma_b \,(1+\varepsilon)^{-\kappa s}

    A branch is driven by a strain of the Seth-Hill family, and gives the stress that
    does work on it. `amount` kappa selects the measure. At 0 it is engineering strain;
    at 1 Hencky strain, with true stress on the current cross-section; at -1 Green
    strain, with the second Piola-Kirchhoff stress. `section` s scales the effect on the
    cross-section apart from the measure; at 1 stress and strain are work conjugate.
    Hill 1968, doi:10.1016/0022-5096(68)90031-8; Reese and Govindjee 1998,
    doi:10.1016/S0020-7683(97)00217-5; Simo 1987, doi:10.1016/0045-7825(87)90107-1.

    In a recording: relaxation and loops grow less than in proportion to strain (more,
    for kappa below 0). Mistaken for branches whose strength falls with strain, which at
    one stretch are the same thing, and for nonlinear viscosity (which depends on rate).
    """

    stage = "material"
    ports = ("branch_strain", "branches")
    parameters: tuple[Parameter, ...] = (
        Parameter("amount", "-", -3.0, 4.0, 1.0, meaning="1 Hencky, -1 Green strain"),
        Parameter("section", "-", 0.0, 3.0, 1.0, meaning="power of the cross-section"),
    )
    off = {"amount": 0.0}
    amplitude = "amount"
    shape: tuple[str, ...] = ("section",)
    spoken = "finite-strain viscoelasticity"
    family = "viscosity that depends on strain or rate"
    where = "in the viscous part, at large strain"
    twins = {
        "strain_dependent_relaxation": "cycles to larger strain",
        "nonlinear_viscosity": "the same strain at three rates over two decades",
    }

    def before(self, p, signal, state):
        engineering = signal.branch_strain
        true = np.log(np.maximum(1 + engineering, 1e-3))
        strain = _measure(true, 1 - p["amount"])
        strain = np.where(p["amount"] == 0, engineering, strain)
        return signal.having(branch_strain=strain), None

    def after(self, p, signal, state):
        stretch = np.maximum(1 + signal.strain, 1e-3)
        return (
            signal.having(
                branches=signal.branches * stretch ** -(p["amount"] * p["section"]),
            ),
            None,
        )

    @property
    def second_forms(self):
        return (StretchedBranches(), DirectedBranches(), MaterialBranches())

    def starts(self, scales):
        return [{"amount": k, "section": 1.0} for k in (1.0, -1.0)]

    def telltale(self):
        return ramps([0, 0.4, 0.4, 0.9, 0.9, 0.4, 0.4, 0], 0.1)


class StretchedBranches(FiniteStrain):
    r"""Finite strain with rubber springs in the branches, of elastic stretch e^q.

    .. math:: \sigma_b \to \frac{G}{3\kappa}
              \left(e^{2\kappa q} - e^{-\kappa q}\right) (1+\varepsilon)^{-\kappa s},
              \qquad q = \sigma_b / G

    At kappa 1 the springs are neo-Hookean; modulus G in MPa is that of the branches
    together, as if all had the same elastic stretch. Ogden 1972,
    doi:10.1098/rspa.1972.0026, of one term; Reese and Govindjee 1998, there.
    """

    parameters = (
        replace(FiniteStrain.parameters[0], low=0.0, meaning="1 neo-Hookean"),
        FiniteStrain.parameters[1],
        Parameter("modulus_MPa", "MPa", 1e-6, 1e6, 1.0, "log", "G, of all branches", 1),
    )
    shape = ("section", "modulus_MPa")

    def after(self, p, signal, state):
        modulus, kappa = p["modulus_MPa"], p["amount"]
        safe = np.maximum(kappa, 1e-9)
        q = np.clip(signal.branches / modulus, -FARTHEST, FARTHEST)
        rubber = (np.expm1(2 * safe * q) - np.expm1(-safe * q)) / (3 * safe)
        bent = np.where(kappa > 0, modulus * rubber, signal.branches)
        return super().after(p, signal.having(branches=bent), state)

    def starts(self, scales):
        modulus = scales.stress_MPa / scales.strain
        modulus = float(np.clip(modulus, 1e-6, 1e6))
        return [{"amount": 1.0, "section": 1.0, "modulus_MPa": modulus}]


class DirectedBranches(FiniteStrain):
    r"""Branches that relax in every direction, of which a share is at finite strain.

    .. math:: \sigma_b = (1-\kappa)\, R[\varepsilon] + \frac{2\kappa}{3} \left(
              \lambda^{n-1} R[E_m(\lambda)]
              - \lambda^{-n/2-1} R[E_m(\lambda^{-1/2})] \right), \qquad
              E_m(\lambda) = \frac{\lambda^m - 1}{m}

    R is the response of the branches to a strain. Axial and lateral stress relax
    separately; the pressure keeps the volume constant. The exponents m of strain and n
    of stress are 0 in Hencky's measure. Both are 2 where the second Piola-Kirchhoff
    stress follows Green's strain. They are -2 and 2 in an upper-convected Maxwell
    element, a network whose chains break and re-form. Hill 1968 and Simo 1987, as in
    `FiniteStrain`; Lodge 1956, doi:10.1039/TF9565200120.
    """

    parameters = (
        Parameter("amount", "-", 0.0, 1.0, 0.5, meaning="share, 1 all of them"),
        Parameter("strain_exponent", "-", -3.0, 3.0, 0.0, meaning="m, 0 is Hencky"),
        Parameter("stress_exponent", "-", -3.0, 3.0, 0.0, meaning="n"),
    )
    shape: tuple[str, ...] = ("strain_exponent", "stress_exponent")
    after = Effect.after

    def before(self, p, signal, state):
        share, m, n = p["amount"], p["strain_exponent"], p["stress_exponent"]
        felt = np.log(np.maximum(1 + signal.branch_strain, THINNEST))
        now = np.log(np.maximum(1 + signal.strain, THINNEST))
        parts = (
            (1 - share, signal.branch_strain),
            (2 / 3 * share * np.exp((n - 1) * now), _measure(felt, m)),
            (-2 / 3 * share * np.exp(-(n / 2 + 1) * now), _measure(-felt / 2, m)),
        )
        return signal.having(branch_parts=parts), None

    def starts(self, scales):
        return [
            {"amount": k, "strain_exponent": m, "stress_exponent": n}
            for m, n in ((0.0, 0.0), (2.0, 2.0), (-2.0, 2.0))
            for k in (0.8, 0.2)
        ]


def _measure(log: Array, m: Array) -> Array:
    """Strain of the Seth-Hill family, of exponent m, at the logarithm of a stretch."""
    near = np.abs(m) < 1e-9  # Hencky, the limit of the family
    return np.where(near, log, np.expm1(m * log) / np.where(near, 1.0, m))


class MaterialBranches(FiniteStrain):
    r"""Branches that relax in material axes, as those of finite-element codes.

    .. math:: \sigma_b = \lambda^{\kappa} \int E(t - t')\, d\left((1-\kappa)\,
              \varepsilon + \kappa\,\frac{1 - \lambda^{-3}}{3}\right)

    For kappa 1 the overstress is that of Piola and Kirchhoff's second kind of
    neo-Hookean rubber, which relaxes where the first form has true stress relax. Simo
    1987, doi:10.1016/0045-7825(87)90107-1.
    """

    parameters = (
        Parameter("amount", "-", 0.0, 1.0, 1.0, meaning="kappa, 1 all of it"),
    )
    shape: tuple[str, ...] = ()

    def before(self, p, signal, state):
        e, share = signal.branch_strain, p["amount"]
        rubber = -np.expm1(-3 * np.log(np.maximum(1 + e, THINNEST))) / 3
        both = (1 - share) * e + share * rubber
        return signal.having(branch_strain=both), None

    def after(self, p, signal, state):
        stretch = np.maximum(1 + signal.strain, THINNEST)
        new = signal.branches * stretch ** p["amount"]
        return signal.having(branches=new), None

    def starts(self, scales):
        return [{"amount": k} for k in (0.7, 0.2)]
