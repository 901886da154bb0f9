r"""No stress in compression: a strip buckles."""

from __future__ import annotations

from dataclasses import replace

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
    parameters = (Parameter("amount", "-", 0.0, 1.0, 1.0, meaning="kappa"),)
    off = {"amount": 0.0}
    amplitude = "amount"
    where = "where the simulation pushes"
    twins = {
        "permanent_set": "unloading to a small tension only",
        "slack": "a first loading from zero",
        "load_cell_saturation": "compression of a short block",
    }

    def after(self, p, signal, state):
        pushed = signal.equilibrium + signal.branches < 0
        factor = np.where(pushed, 1 - p["amount"], 1.0)
        new = replace(
            signal,
            equilibrium=signal.equilibrium * factor,
            branches=signal.branches * factor,
        )
        return new, None

    def starts(self, scales):
        return [{"amount": 1.0}]

    def telltale(self):
        return ramps([0, 0.5, -0.2, 0.5, 0.5, 0, 0], 0.1)
