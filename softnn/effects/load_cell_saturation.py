r"""The stress is clipped at a limit of the load cell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import cycles

NEVER_MPa = 1e6


class LoadCellSaturation(Effect):
    r"""Stress beyond the limit of the channel is written down as the limit.

    .. math:: \sigma \to \mathrm{clip}(\sigma, -L, L)

    limit L in MPa; `knee` k rounds the corner over k L (0 is sharp). Overload of an
    amplifier, ISO 7500-1.

    In a recording: flat tops at one stress, in every recording that gets there.
    Mistaken for yielding and for a hold.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters = (
        Parameter("limit_MPa", "MPa", 1e-9, NEVER_MPa, 1.0, "log", "L"),
        Parameter("knee", "-", 0.0, 0.5, 0.0, meaning="rounding, as a share of L"),
    )
    off = {"limit_MPa": NEVER_MPa}
    amplitude = "limit_MPa"
    shape = ("knee",)
    where = "at the highest stresses"
    twins = {"tension_only": "tension alone", "nonlinear_elasticity": "a second range"}

    def after(self, p, signal, state):
        x, limit = signal.stress, p["limit_MPa"]
        width = p["knee"] * limit
        over = np.abs(x) - limit  # how far beyond the corner
        soft = np.maximum(width, 1e-12)
        lost = np.where(
            over >= width,
            over,
            np.where(over > -width, (over + width) ** 2 / (4 * soft), 0.0),
        )
        return replace(signal, stress=x - np.sign(x) * lost), None

    def starts(self, scales):
        return [
            {"limit_MPa": float(share * scales.stress_MPa), "knee": k}
            for share, k in ((0.97, 0.0), (0.9, 0.0), (0.97, 0.1))
        ]

    def telltale(self):
        return cycles([0.3, 0.6, 0.6], 0.05)
