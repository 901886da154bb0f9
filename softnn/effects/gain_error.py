r"""The scale of the stress is wrong in some recordings."""

from __future__ import annotations

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import cycles


class GainError(Effect):
    r"""A factor on the stress of a recording: a wrong cross-section or calibration.

    .. math:: \sigma \to (1 + \gamma)\,\sigma

    error gamma, one a recording. It is told from a stiffer material only by other
    recordings; where several specimens were used, a factor for each of them is no news,
    but one far outside what the others differ by is (`softnn.mismatch.mistakes`).
    Classes of testing machines: ISO 7500-1.

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
