"""The inputs of section 7.3 of the thesis, in every reading, and the law of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn import virtual
from softnn.contracts import Array
from softnn.neural import STEADY, samples, train
from softnn.neural.guard import DIRECTION
from softnn.study.material_data import Data

NAME = "NatPolR"
STEP_S, SECONDS = 1e-3, 6.0
CONSTANT = 250.0  # mm/min, Fig. 7.3
ENCODER_MM = 16.5 / 4096  # twelve bits over the working range of Table 7.3
# Strain rates of the four inputs, mm/min: twice the amplitude in the second that a sine
# takes from its least to its largest, so that its period is two seconds.
SCENARIOS = {"a": 100.0, "b": 400.0, "c": 50.0, "d": 500.0}
LEAST_MPa = 0.01  # a stress below minus this is negative
Row = dict[str, Any]


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
    """Return possible offsets of the sine: the thesis names the sign of the strain."""
    if scenario == "c":
        return {"about zero": 0.0, "below zero": -speed / 60 / length_mm / 2}
    return {"from zero": None, "about 0.25": 0.25}


def readings(length_mm: float) -> dict[str, Callable[[Array, Array], Array]]:
    """Return possible strain rates fed to the network, from strain and derivative."""

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


def networks(
    data: Data, architecture: str, number: int, neurons: int, seed: int
) -> list[Any]:
    """Networks of one kind on all samples of all specimens.

    A sine leaves the strains and rates of their training, where rounding of the targets
    by 1e-13 moved a third of all figures by more than 1 %. `STEADY` lets it move none.
    """
    known = samples(data.tensile, architecture)
    every = np.ones((number, len(known.target)), bool)
    seeds = [1000 * seed + i for i in range(number)]
    trained = train(
        known.inputs,
        known.target,
        neurons=[neurons] * number,
        train_mask=every,
        seeds=seeds,
        settings=STEADY,
    )
    return [one.network for one in trained]


def counted(out: Array, true: Array, flags: NDArray[np.uint8]) -> Row:
    """Failures of networks (m, n) against the law (n,): medians over the networks.

    A jump is the largest change in a controller's sample over the law's largest.
    `flagged` is the share of all samples outside the training, `negative_flagged` that
    of the negative ones.
    """
    negative = out < -LEAST_MPa
    rms = np.sqrt(np.mean(true**2))
    error = np.sqrt(np.mean((out - true) ** 2, axis=1))
    steps = np.max(np.abs(np.diff(out, axis=1)), axis=1)
    largest = np.max(np.abs(np.diff(true)))
    return {
        "networks_negative": int(np.sum(negative.any(axis=1))),
        "networks": len(out),
        "negative": float(np.median(negative.mean(axis=1))),
        "least_MPa": float(np.median(out.min(axis=1))),
        "most_MPa": float(np.median(out.max(axis=1))),
        "nrmse": float(np.median(error) / rms) if rms > 0 else None,
        "jump": float(np.median(steps) / largest) if largest > 0 else None,
        "flagged": float(np.mean(flags > 0)),
        "negative_flagged": _share(negative & (flags > 0), negative),
        "negative_unloading": _share(negative & (flags & DIRECTION > 0), negative),
    }


def _share(part: NDArray[np.bool], whole: NDArray[np.bool]) -> float | None:
    return float(part.sum() / whole.sum()) if whole.any() else None
