r"""The load cell does not read zero without load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import ramps
from softnn.effects._signs import FEWEST, at_rest, minority, noise, peak

TARED = 0.004  # of the usual peak stress: as well as zeros agree


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
    parameters = (Parameter("offset_MPa", "MPa", -1e3, 1e3, 0.02, meaning="sigma_0"),)
    off = {"offset_MPa": 0.0}
    amplitude = "offset_MPa"
    per_recording = ("offset_MPa",)
    some = True
    where = "all through some recordings, at any strain"
    twins = {
        "slack": "a hold at zero strain before loading",
        "load_cell_drift": "a longer recording",
        "permanent_set": "a first loading from zero",
    }

    def after(self, p, signal, state):
        return replace(signal, stress=signal.stress + p["offset_MPa"]), None

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
            TARED * float(np.median([peak(s) for s in stress_MPa])),
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
