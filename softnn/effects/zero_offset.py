r"""The load cell does not read zero without load."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import ramps
from softnn.effects._signs import FEWEST, ZEROS, at_rest, minority, noise, peak


class ZeroOffset(Effect):
    r"""A constant added to the stress of a recording.

    .. math:: \sigma \to \sigma + \sigma_0

    offset sigma_0 in MPa, one a recording, either sign. Zero balance of a force-proving
    instrument, ISO 376.

    In a recording: the same from the first sample to the last, without any strain.
    Mistaken for slack, for a set and, in one recording alone, for drift.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters: tuple[Parameter, ...] = (
        Parameter("offset_MPa", "MPa", -1e3, 1e3, 0.02, meaning="sigma_0"),
    )
    off = {"offset_MPa": 0.0}
    amplitude = "offset_MPa"
    per_recording: tuple[str, ...] = ("offset_MPa",)
    some = True
    unmoved = True
    spoken = "a zero offset"
    where = "all through some recordings, at any strain"
    twins = {
        "slack": "a hold at zero strain before loading",
        "load_cell_drift": "a longer recording",
        "permanent_set": "a first loading from zero",
    }

    @property
    def second_forms(self):
        return (SettlingOffset(),)

    def after(self, p, signal, state):
        t = (signal.time_s - signal.begun_s)[:, None]
        shift = p["offset_MPa"] * self.there(p, t)
        return signal.having(stress=signal.stress + shift), None

    def there(self, p, t):
        """Share of the offset that is there at times t (n, 1)."""
        return 1.0

    def starts(self, scales):
        return [{"offset_MPa": float(min(0.05 * scales.stress_MPa, 1e3))}]

    def shown(self, chunks, stress_MPa):
        """Stress at rest, where others have none."""
        level = np.array(
            [at_rest(c, s) for c, s in zip(chunks, stress_MPa, strict=True)]
        )
        known = np.flatnonzero(np.isfinite(level))
        if len(known) < FEWEST:
            return None
        floor = max(
            ZEROS * float(np.median([peak(s) for s in stress_MPa])),
            float(np.median([noise(s) for s in stress_MPa])),
        )
        odd = known[minority(level[known], floor)]
        if not len(odd):
            return None
        offset = np.zeros(len(chunks))
        offset[odd] = level[odd] - np.median(level[np.setdiff1d(known, odd)])
        return {"offset_MPa": offset}

    def telltale(self):
        return ramps([0, 0, 0.5, 0.5, 0, 0], 0.1)


class SettlingOffset(ZeroOffset):
    r"""Zeroed before it had settled: the offset, or a share r of it, dies away.

    .. math:: \sigma \to \sigma + \sigma_0\,(1 - r + r\,e^{-t / \tau})

    A cell warmed by a hand, or just unloaded: return to zero, ISO 376.
    """

    parameters = ZeroOffset.parameters + (
        Parameter("settling_s", "s", 1e-2, 1e7, 10.0, "log", "tau"),
        Parameter("returning", "-", 0.0, 1.0, 1.0, meaning="r"),
    )
    shape = ("returning",)

    def there(self, p, t):
        return 1 + p["returning"] * np.expm1(-t / p["settling_s"])

    def starts(self, scales):
        tau = float(np.clip(0.2 * np.max(scales.duration_s), 1e-2, 1e7))
        more = {"settling_s": tau, "returning": 1.0}
        return [s | more for s in super().starts(scales)]
