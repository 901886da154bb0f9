"""The inputs of section 7.3 of the thesis, in every reading, and the law of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from softnn import virtual
from softnn.contracts import Array

NAME = "NatPolR"
STEP_S, SECONDS = 1e-3, 6.0
CONSTANT = 250.0  # mm/min, Fig. 7.3
ENCODER_MM = 16.5 / 4096  # twelve bits over the working range of Table 7.3
# Strain rates of the four inputs, mm/min: twice the amplitude in the second that a sine
# takes from its least to its largest, so that its period is two seconds.
SCENARIOS = {"a": 100.0, "b": 400.0, "c": 50.0, "d": 500.0}


def sine(speed: float, length_mm: float, offset: float | None) -> tuple[Array, Array]:
    """Strain and its derivative [1/s] (n,); without an offset the least strain is 0.

    >>> strain, rate = sine(396.0, 33.0, None)
    >>> round(float(np.ptp(strain)), 6), round(float(rate.max()), 4)
    (0.2, 0.3142)
    """
    t = np.arange(0, SECONDS, STEP_S)
    amplitude = speed / 60 / length_mm / 2
    shift = amplitude if offset is None else offset
    rate = np.pi * amplitude * np.cos(np.pi * t)
    return amplitude * np.sin(np.pi * t) + shift, rate


def offsets(scenario: str, speed: float, length_mm: float) -> dict[str, float | None]:
    """Where the sine may lie: the thesis names the sign of the strain alone."""
    if scenario == "c":
        return {"about zero": 0.0, "below zero": -speed / 60 / length_mm / 2}
    return {"from zero": None, "about 0.25": 0.25}


def readings(length_mm: float) -> dict[str, Callable[[Array, Array], Array]]:
    """What may have been fed as the strain rate, of strain and derivative [1/s]."""

    def quantised(strain: Array, rate: Array) -> Array:
        seen = np.round(strain * length_mm / ENCODER_MM) * ENCODER_MM / length_mm
        return np.diff(seen, prepend=seen[0]) / STEP_S

    return {
        "derivative": lambda strain, rate: rate,
        "derivative, 12 bits": quantised,
        "derivative in mm/s": lambda strain, rate: rate * length_mm,
        "increment a sample": lambda strain, rate: rate * STEP_S,
        "constant 250 mm/min": lambda strain, rate: np.full_like(
            rate, CONSTANT / 60 / length_mm
        ),
    }


def law(strain: Array) -> Array:
    """Stress [MPa] of the mean virtual specimen; a slack strip bears nothing."""
    calibration, one = virtual.calibration(NAME), virtual.Specimen()
    taut = virtual.stress(calibration, np.maximum(strain, 0), STEP_S, one)
    return np.maximum(taut, 0)
