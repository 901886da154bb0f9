r"""Stiffness that follows the recorded temperature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Chunk, Effect, InputError, Parameter
from softnn.effects._programmes import cycles

REFERENCE_C = 23.0  # any other is the same law with other stiffnesses


class ThermalSoftening(Effect):
    r"""All stress is scaled by a factor that depends on temperature.

    .. math:: \sigma \to \sigma \, e^{-c\,(T - 23)}

    softening c per degC, positive: softer when warm. Missing temperatures repeat the
    last one known. Treloar 1975, *The Physics of Rubber Elasticity*, ch. 5.

    In a recording: the residual, divided by the stress, follows the temperature
    channel. Mistaken for drift and for cyclic softening where the temperature has a
    trend.
    """

    stage = "material"
    ports = ("equilibrium", "branches")
    parameters = (Parameter("softening_per_C", "1/degC", -0.1, 0.1, 0.01, meaning="c"),)
    off = {"softening_per_C": 0.0}
    amplitude = "softening_per_C"
    needs_temperature = True
    where = "wherever the temperature differs"
    twins = {
        "cyclic_softening": "cycles in a chamber at constant temperature",
        "load_cell_drift": "a stretch without load while the temperature changes",
        "gain_error": "one recording over which the temperature changes",
    }

    def factor(self, p, warmer):
        return np.exp(-p["softening_per_C"] * warmer)

    def after(self, p, signal, state):
        if signal.temperature_C is None:
            if np.all(p["softening_per_C"] == 0):
                return signal, None
            raise InputError(
                "thermal_softening needs a column temperature_C; record the temperature"
            )
        warmer = np.array(signal.temperature_C) - REFERENCE_C
        bad = np.isnan(warmer)
        if bad.any():
            last = np.maximum.accumulate(np.where(bad, -1, np.arange(len(warmer))))
            known = 0.0 if state is None else state
            warmer = np.where(last < 0, known, warmer[np.maximum(last, 0)])
        factor = self.factor(p, warmer[:, None])
        new = replace(
            signal,
            equilibrium=signal.equilibrium * factor,
            branches=signal.branches * factor,
        )
        return new, warmer[-1]

    def starts(self, scales):
        return [{"softening_per_C": 0.01}]

    def telltale(self):
        plain = cycles([0.5] * 6, 0.05)
        warm = 23 + 10 * np.sin(plain.time_s / 17)
        return Chunk(plain.time_s, plain.strain, warm)
