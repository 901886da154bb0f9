r"""No stress in compression: a strip buckles."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import ramps


class TensionOnly(Effect):
    r"""Negative stress is lost, whole or in part.

    .. math:: \sigma \to (1 - \kappa)\,\sigma \quad \text{where} \quad \sigma < 0

    amount kappa from 0 (a block) to 1 (a slender strip, which buckles at once;
    Timoshenko and Gere, *Theory of Elastic Stability*, ch. 2).

    In a recording: stress stops at zero on unloading and stays there until the
    specimen is taut again. Mistaken for slack, for a set and for a clipped channel.
    """

    stage = "material"
    ports = ("equilibrium", "branches")
    parameters: tuple[Parameter, ...] = (
        Parameter("amount", "-", 0.0, 1.0, 1.0, meaning="kappa"),
    )
    off = {"amount": 0.0}
    amplitude = "amount"
    spoken = "tension-only behaviour"
    where = "in compression"
    twins = {
        "permanent_set": "unloading to a small tension only",
        "slack": "a first loading from zero",
        "load_cell_saturation": "a known push on the load cell, with no specimen",
    }

    @property
    def second_forms(self):
        return (CrookedStrip(), SlackStrip(), FoldedStrip())

    def kept(self, p, pushed):
        """Return the share of a compressive stress of `pushed` MPa that remains."""
        return 1 - p["amount"]

    def pushed(self, signal):
        """Return where a strip gives way, (n, sets) of bool."""
        return signal.equilibrium + signal.branches < 0

    def after(self, p, signal, state):
        stress = signal.equilibrium + signal.branches
        kept = self.kept(p, np.maximum(-stress, 0))
        factor = np.where(self.pushed(signal), kept, 1.0)
        new = signal.having(
            equilibrium=signal.equilibrium * factor,
            branches=signal.branches * factor,
        )
        return new, None

    def starts(self, scales):
        return [{"amount": 1.0}]

    def telltale(self):
        return ramps([0, 0.5, -0.2, 0.5, 0.5, 0, 0], 0.1)


class CrookedStrip(TensionOnly):
    r"""A strip that is not quite straight: its stress approaches the Euler load.

    .. math:: \sigma \to \left(1 - \kappa + \frac{\kappa}{1 + |\sigma| / p}\right)
              \sigma \quad \text{where} \quad \sigma < 0

    buckling p in MPa: the Euler load over the cross-section. The sideways deflection of
    a crooked column is a hyperbola of the load (Southwell 1932, *Proc. R. Soc. A* 135,
    601); here the axial shortening follows the same hyperbola.
    """

    parameters = TensionOnly.parameters + (
        Parameter("buckling_MPa", "MPa", 1e-9, 1e6, 0.01, "log", "p, Euler stress"),
    )
    shape = ("buckling_MPa",)

    def kept(self, p, pushed):
        bears = p["buckling_MPa"]
        return 1 - p["amount"] * pushed / (pushed + bears)

    def starts(self, scales):
        bears = float(np.clip(0.01 * scales.stress_MPa, 1e-9, 1e6))
        return [s | {"buckling_MPa": bears} for s in super().starts(scales)]


class SlackStrip(TensionOnly):
    r"""No stress below zero strain: the strip hangs loose when shorter than at rest.

    .. math:: \sigma \to (1 - \kappa)\,\sigma \quad \text{where} \quad \varepsilon < 0

    Strain decides when a membrane wrinkles, whatever stress its branches still bear
    (Roddeman et al. 1987, doi:10.1115/1.3173134).
    """

    def pushed(self, signal):
        return signal.strain < 0


class FoldedStrip(TensionOnly):
    r"""A strip that bends sideways, so its material is not shortened any further.

    .. math:: \varepsilon \to \varepsilon - \kappa\,(\varepsilon + c)
              \quad \text{where} \quad \varepsilon < -c

    buckling strain c is Euler's, which depends on the shape alone and not on the
    material (Timoshenko and Gere, *Theory of Elastic Stability*, ch. 2). The branches
    of a folded strip see no further strain. In `TensionOnly` they go on relaxing, and
    have to be pulled back before stress appears.
    """

    ports = ("strain", "branch_strain")
    parameters = TensionOnly.parameters + (
        Parameter("buckling_strain", "-", 0.0, 0.9, 0.0, meaning="c", per_strain=-1),
    )
    shape = ("buckling_strain",)
    after = Effect.after

    def before(self, p, signal, state):
        def seen(strain):
            return strain - p["amount"] * np.minimum(strain + p["buckling_strain"], 0.0)

        new = signal.having(
            strain=seen(signal.strain),
            branch_strain=seen(signal.branch_strain),
        )
        return new, state

    def starts(self, scales):
        later = float(np.clip(0.1 * scales.strain, 0, 0.9))
        return [{"amount": 1.0, "buckling_strain": c} for c in (0.0, later)]
