r"""Force from accelerating mass between load cell and specimen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import Chunk


class Inertia(Effect):
    r"""Mass of grip and specimen times acceleration.

    .. math:: \sigma \to \sigma + m\,\ddot\varepsilon

    m in MPa s2: moving mass times gauge length over cross-section. Acceleration is the
    second difference of strain, centred. Dynamic correction of load cells, ISO 4965-1.

    In a recording: spikes at reversals, and at high frequency a force opposed to the
    strain. Mistaken for a lag and for stiffness that depends on rate.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters = (
        Parameter("mass", "MPa s2", -10.0, 1e3, 1e-3, meaning="mass x length / area"),
    )
    off = {"mass": 0.0}
    amplitude = "mass"
    where = "at reversals and at high frequency"
    exempt = {
        "refine": "strain that is straight between samples has no acceleration there",
        "causal": "acceleration at a sample needs the next sample's strain",
        "chunked": "acceleration at a sample needs the next sample's strain",
    }
    twins = {
        "sensor_lag": "a fast reversal, and a sine at two frequencies",
        "relaxation_branch": "a sine at two frequencies",
    }

    def after(self, p, signal, state):
        t, e = signal.time_s, signal.strain
        acceleration = np.zeros_like(e)
        if len(t) > 2:
            step = np.maximum(np.diff(t), 1e-12)[:, None]
            rate = np.diff(e, axis=0) / step
            gap = (step[1:] + step[:-1]) / 2
            acceleration[1:-1] = np.diff(rate, axis=0) / gap
            if state is None:  # it was at rest before the first sample
                acceleration[0] = rate[0] / step[0]
        return replace(signal, stress=signal.stress + p["mass"] * acceleration), True

    def starts(self, scales):
        # A tenth of the peak stress at a sine of 8 samples a quarter period.
        highest = scales.strain * (2 * np.pi / (32 * scales.interval_s)) ** 2
        return [{"mass": float(min(0.1 * scales.stress_MPa / highest, 1e3))}]

    def telltale(self):
        time = np.arange(0, 20, 0.02)
        return Chunk(time, 0.3 * (1 - np.cos(2 * np.pi * time**2 / 20)) / 2)
