r"""Stiffness that follows the recorded temperature."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Chunk, Effect, InputError, Parameter, increments
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
    ports: tuple[str, ...] = ("equilibrium", "branches")
    parameters: tuple[Parameter, ...] = (
        Parameter("softening_per_C", "1/degC", -0.1, 0.1, 0.01, meaning="c"),
    )
    off = {"softening_per_C": 0.0}
    amplitude = "softening_per_C"
    needs_temperature = True
    where = "wherever the temperature differs"
    twins = {
        "cyclic_softening": "cycles in a chamber at constant temperature",
        "load_cell_drift": "a stretch without load while the temperature changes",
        "gain_error": "one recording over which the temperature changes",
    }

    @property
    def second_forms(self):
        return (ThermalSpring(), ThermalBranches(), ThermalClock(), GlassySoftening())

    def warmer(self, signal, state):
        """Temperature above the reference (n,), degC; gaps repeat the last one."""
        if signal.temperature_C is None:
            raise InputError(
                "thermal_softening needs a column temperature_C; record the temperature"
            )
        warmer = np.array(signal.temperature_C) - REFERENCE_C
        bad = np.isnan(warmer)
        if bad.any():
            last = np.maximum.accumulate(np.where(bad, -1, np.arange(len(warmer))))
            known = 0.0 if state is None else state
            warmer = np.where(last < 0, known, warmer[np.maximum(last, 0)])
        return warmer

    def factor(self, p, warmer):
        return np.exp(-p["softening_per_C"] * warmer)

    def after(self, p, signal, state):
        if signal.temperature_C is None and np.all(p["softening_per_C"] == 0):
            return signal, None
        warmer = self.warmer(signal, state)
        factor = self.factor(p, warmer[:, None])
        parts = {port: getattr(signal, port) * factor for port in self.ports}
        return signal.having(**parts), warmer[-1]

    def starts(self, scales):
        return [{"softening_per_C": 0.01}]

    def telltale(self):
        plain = cycles([0.5] * 6, 0.05)
        warm = 23 + 10 * np.sin(plain.time_s / 17)
        return Chunk(plain.time_s, plain.strain, warm)


class ThermalSpring(ThermalSoftening):
    """Thermal softening of the spring alone, as for entropy elasticity."""

    ports = ("equilibrium",)


class ThermalBranches(ThermalSoftening):
    """Thermal softening of the branches alone."""

    ports = ("branches",)


class ThermalClock(ThermalSoftening):
    r"""Branches whose times follow the temperature: time runs faster when warm.

    .. math:: \dot\xi = e^{c\,(T - 23)}, \quad
              \text{branches relax in } \xi \text{ in place of } t

    The shift of Williams, Landel and Ferry 1955, doi:10.1021/ja01619a008, over a range
    in which its logarithm is straight in temperature.
    """

    ports = ("branch_strain",)
    parameters = (
        Parameter("quickening_per_C", "1/degC", -1.0, 1.0, 0.08, meaning="c"),
    )
    off = {"quickening_per_C": 0.0}
    amplitude = "quickening_per_C"
    after = Effect.after

    def before(self, p, signal, state):
        pace = p["quickening_per_C"]
        if signal.temperature_C is None and np.all(pace == 0):
            return signal, None
        time = signal.branch_clock
        known, last, gone = (0.0, time[:1], time[:1]) if state is None else state
        warmer = self.warmer(signal, known)
        step = increments(time, last)
        passed = gone + np.cumsum(step * np.exp(pace * warmer[:, None]), axis=0)
        passed = np.where(pace == 0, time, passed)  # to the last bit
        new = signal.having(branch_time_s=passed)
        return new, (warmer[-1], time[-1:], passed[-1:])

    def starts(self, scales):
        return [{"quickening_per_C": c} for c in (0.08, 0.03)]


class GlassySoftening(ThermalSoftening):
    r"""Thermal softening near a transition between two levels of stiffness.

    .. math:: \sigma \to \sigma\, \exp\left(-c\,w\left(\tanh\frac{T - T_g}{w}
              - \tanh\frac{23 - T_g}{w}\right)\right)

    softening c per degC at the middle T_g, width w in degC. Mahieux and Reifsnider
    2001, *Polymer* 42, 3281-3291, describe such steps with a Weibull distribution.
    """

    parameters = (
        *ThermalSoftening.parameters,
        Parameter("middle_C", "degC", -60.0, 120.0, 23.0, meaning="T_g"),
        Parameter("width_C", "degC", 1.0, 100.0, 10.0, "log", "w"),
    )
    shape = ("middle_C", "width_C")

    def factor(self, p, warmer):
        middle, width = p["middle_C"] - REFERENCE_C, p["width_C"]
        way = np.tanh((warmer - middle) / width) + np.tanh(middle / width)
        return np.exp(-p["softening_per_C"] * width * way)

    def starts(self, scales):
        return [
            {"softening_per_C": 0.02, "middle_C": m, "width_C": 10.0}
            for m in (REFERENCE_C, REFERENCE_C + 10)
        ]
