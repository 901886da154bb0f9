r"""The scale of the stress is wrong in some recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import cycles


class GainError(Effect):
    r"""A factor on the stress of a recording: a wrong cross-section or calibration.

    .. math:: \sigma \to (1 + \gamma)\,\sigma

    error gamma, one a recording. It is told from a stiffer material only by other
    recordings; where several specimens were used, a factor for each of them is no news.
    Classes of testing machines: ISO 7500-1.

    In a recording: the residual is proportional to the stress, all through. Mistaken
    for softening and for temperature.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters: tuple[Parameter, ...] = (
        Parameter("error", "-", -0.8, 4.0, 0.1, meaning="gamma"),
    )
    off = {"error": 0.0}
    amplitude = "error"
    per_recording = ("error",)
    some = True
    scatter = True
    where = "all through some recordings, in proportion to the stress"
    twins = {
        "thermal_softening": "one recording over which the temperature changes",
        "cyclic_softening": "more cycles in one recording",
        "mullins_softening": "a second recording of a virgin specimen",
    }

    @property
    def second_forms(self):
        return (BentGain(), GainDrift())

    def after(self, p, signal, state):
        return replace(signal, stress=signal.stress * (1 + p["error"])), None

    def starts(self, scales):
        return [{"error": 0.1}]

    def telltale(self):
        return cycles([0.3, 0.6], 0.05)


class BentGain(GainError):
    r"""A gain that depends on the load, in all recordings or in each by its own.

    .. math:: \sigma \to \sigma\,(1 + b\,|\sigma|^n\,a), \qquad
              a = 1 \; (\sigma > 0), \; a_- \; (\sigma < 0)

    bend b at 1 MPa, exponent n (0: a factor, 1 and 2: calibration curves of second and
    third degree, ISO 376), share a_- in compression: 1 alike, -1 even, 0 in tension
    alone, where the cell was calibrated in one direction.
    """

    parameters = (
        Parameter("bend", "MPa^-n", -1e9, 1e9, 0.1, meaning="b, at 1 MPa"),
        Parameter("exponent", "-", 0.0, 4.0, 1.0, meaning="n"),
        Parameter("pushed", "-", -1.0, 1.0, 1.0, meaning="a_-, in compression"),
    )
    off = {"bend": 0.0}
    amplitude = "bend"
    per_recording = ("bend",)
    shape = ("exponent", "pushed")
    some = False

    def after(self, p, signal, state):
        x = signal.stress
        size = np.maximum(np.abs(x), 1e-300) ** p["exponent"]
        error = p["bend"] * size * np.where(x < 0, p["pushed"], 1.0)
        return replace(signal, stress=x * (1 + error)), None

    def starts(self, scales):
        bend = 0.15 / scales.stress_MPa
        return [{"bend": bend, "exponent": 1.0, "pushed": a} for a in (1.0, 0.0)]


class GainDrift(GainError):
    r"""A gain that changes while a recording lasts, and settles or not.

    .. math:: \sigma \to \sigma\,(1 + \dot\gamma\,\tau\,(1 - e^{-t / \tau}))

    Supply or amplifier that warms up: span drift, OIML R 60. In all recordings, or in
    each by its own.
    """

    parameters = (
        Parameter("error_per_s", "1/s", -1.0, 1.0, 1e-3, meaning="gamma'"),
        Parameter("settling_s", "s", 1e-2, 1e7, 100.0, "log", "tau"),
    )
    off = {"error_per_s": 0.0}
    amplitude = "error_per_s"
    per_recording = ("error_per_s",)
    some = False

    def after(self, p, signal, state):
        t = (signal.time_s - signal.begun_s)[:, None]
        error = p["error_per_s"] * p["settling_s"] * -np.expm1(-t / p["settling_s"])
        return replace(signal, stress=signal.stress * (1 + error)), None

    def starts(self, scales):
        longest = float(np.max(scales.duration_s))
        size = np.minimum(0.1 / np.maximum(scales.duration_s, 1e-9), 1.0)
        tau = float(np.clip(longest, 1e-2, 1e7))
        return [{"error_per_s": size, "settling_s": tau}]
