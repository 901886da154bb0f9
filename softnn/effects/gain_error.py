r"""The scale of the stress is wrong in some recordings."""

from __future__ import annotations

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import cycles


class GainError(Effect):
    r"""A factor on the stress of a recording: a wrong cross-section or calibration.

    .. math:: \sigma \to (1 + \gamma)\,\sigma

    error gamma, one per recording. Only other recordings distinguish it from a stiffer
    material. Specimens differ by a factor anyway; a factor far outside the spread of
    the other specimens counts as a mistake (`softnn.mismatch.mistakes`). Classes of
    testing machines: ISO 7500-1.

    In a recording: the residual is proportional to the stress, all through. Mistaken
    for softening and for temperature.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters = (Parameter("error", "-", -0.95, 20.0, 0.1, meaning="gamma"),)
    off = {"error": 0.0}
    amplitude = "error"
    per_recording = ("error",)
    some = True
    scatter = True
    spoken = "a gain error"
    where = "all through some recordings, in proportion to the stress"
    twins = {
        "thermal_softening": "one recording over which the temperature changes",
        "cyclic_softening": "more cycles in one recording",
        "mullins_softening": "a second recording of a virgin specimen",
    }

    def after(self, p, signal, state):
        return signal.having(stress=signal.stress * (1 + p["error"])), None

    def starts(self, scales):
        return [{"error": 0.1}]

    def telltale(self):
        return cycles([0.3, 0.6], 0.05)
