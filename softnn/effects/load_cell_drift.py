r"""The load cell wanders with time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import ramps
from softnn.effects._signs import creeping, noise

MUCH = (0.02, 5.0)  # of the peak stress, and noises, that a drift is in all
ALL = 0.8  # of the recordings that could show it


class LoadCellDrift(Effect):
    r"""Stress that grows with time, whatever the specimen does.

    .. math:: \sigma \to \sigma + a\,t

    drift a in MPa/s, one for all recordings; t since the recording began, where the
    cell was zeroed. Temperature drift of strain gauges, OIML R 60.

    In a recording: slow, the same loaded or not, and largest in the longest recording.
    Mistaken for a very long relaxation time (which needs load) and for a zero offset.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters: tuple[Parameter, ...] = (
        Parameter("drift_MPa_per_s", "MPa/s", -1.0, 1.0, 1e-4, meaning="a"),
    )
    off = {"drift_MPa_per_s": 0.0}
    bends = ("time", "size")
    amplitude = "drift_MPa_per_s"
    where = "late in long recordings, loaded or not"
    twins = {
        "relaxation_branch": "a long stretch without load",
        "zero_offset": "a longer recording",
        "thermal_softening": "a stretch without load while the temperature changes",
    }

    @property
    def second_forms(self):
        return (OwnDrift(), WarmUp())

    def after(self, p, signal, state):
        t = (signal.time_s - signal.begun_s)[:, None]
        return replace(signal, stress=signal.stress + self.wander(p, t)), None

    def wander(self, p, t):
        return p["drift_MPa_per_s"] * t

    def starts(self, scales):
        longest = float(np.max(scales.duration_s))
        return [{"drift_MPa_per_s": float(min(0.08 * scales.stress_MPa / longest, 1))}]

    def shown(self, chunks, stress_MPa):
        """Stress that moves on from cycle to cycle and does not settle."""
        speeds, sure = [], 0
        for chunk, stress in zip(chunks, stress_MPa, strict=True):
            speed, change = creeping(chunk, stress)
            if np.isnan(speed):
                continue
            share, noises = MUCH
            peak = float(np.nanmax(np.abs(stress)))
            speeds.append(speed)
            sure += change > max(share * peak, noises * noise(stress))
        if not speeds or sure < ALL * len(speeds) or np.ptp(np.sign(speeds)):
            return None
        return {"drift_MPa_per_s": float(np.median(speeds))}

    def telltale(self):
        return ramps([0, 0.5, 0.5, 0, 0, 0, 0.5, 0], 0.1)


class OwnDrift(LoadCellDrift):
    r"""A drift of its own in each recording."""

    per_recording = ("drift_MPa_per_s",)

    def starts(self, scales):
        size = 0.05 * scales.stress_MPa / np.maximum(scales.duration_s, 1e-9)
        return [{"drift_MPa_per_s": np.minimum(size, 1.0)}]


class WarmUp(LoadCellDrift):
    r"""Drift that dies away as the cell warms up: a tau (1 - exp(-t / tau))."""

    parameters = LoadCellDrift.parameters + (
        Parameter("warm_up_s", "s", 1e-2, 1e7, 100.0, "log", "tau"),
    )

    def wander(self, p, t):
        return p["drift_MPa_per_s"] * p["warm_up_s"] * -np.expm1(-t / p["warm_up_s"])

    def starts(self, scales):
        longest = float(np.max(scales.duration_s))
        tau = float(np.clip(0.5 * longest, 1e-2, 1e7))
        return [super().starts(scales)[0] | {"warm_up_s": tau}]
