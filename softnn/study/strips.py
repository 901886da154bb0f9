"""Models of strips in a controller: their accuracy, their time, and a walk."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softnn import virtual
from softnn.actuator import Chain, Controller, Walk, walk
from softnn.contracts import Array
from softnn.effects import effect
from softnn.export.compiled import Compiled
from softnn.export.files import stored_of
from softnn.fit import Piece
from softnn.model_file import Stored
from softnn.models import Hooke
from softnn.models.fit_piecewise import fit_jointly
from softnn.models.segments import Equal
from softnn.models.units import Units
from softnn.motor import Bundle, Motor, Strip
from softnn.neural import STEADY, Seen, StoredNetwork, samples, train
from softnn.recording import Recording

NAME, STEP_S = "NatPolR", 1e-3
NEURONS = 13  # Table 6.6
SEGMENTS, BRANCHES = 12, 8
WORKING = 0.5  # strain, Table 7.3
TORQUE_Nm, KNEE = 15.0, (5.0, 63.0)  # half of 29 Nm; degrees, `studies.gait`
Row = dict[str, Any]


@dataclass
class VirtualStrip:
    """The mean virtual specimen, step by step; it stands for the real strips."""

    def __post_init__(self) -> None:
        self.law, self.one = virtual.calibration(NAME), virtual.Specimen()
        self.times = np.array(self.law.branch_times)
        self.moduli = np.array(self.law.branch_moduli)
        self.reset()

    def reset(self) -> None:
        self.carried, self.last = np.zeros(len(self.times)), 0.0

    def step(self, step_s: float, strain: float) -> float:
        c, strain = self.law, max(strain, 0.0)  # slack, it bears nothing
        soft = -c.branch_strain * math.expm1(-strain / c.branch_strain)
        measure = c.branch_share * strain + (1 - c.branch_share) * soft
        x = step_s / self.times
        gain = -np.expm1(-x) / x if step_s > 0 else np.ones(len(x))
        self.carried = np.exp(-x) * self.carried + gain * (measure - self.last)
        self.last = measure
        lasting = float(virtual.equilibrium(c, np.array([strain]), self.one)[0])
        return lasting + float(self.moduli @ self.carried)


def strip_models(
    known: Sequence[Recording], seed: int
) -> tuple[dict[str, Strip], float]:
    """What the controller may take strips for, all from the same tensile tests.

    And the modulus [MPa] of the linear spring.
    """
    strain = np.concatenate([r.strain for r in known])
    stress = np.concatenate([r.stress_MPa for r in known])
    modulus = float(strain @ stress / (strain @ strain))
    models: dict[str, Strip] = {
        "linear spring": Compiled(
            stored_of(Hooke(), {"equilibrium_stiffness": modulus})
        )
    }
    for name, branches in (("PL-SLS", 1), ("PL-Wiechert", BRANCHES)):
        fit = fit_jointly(known, branches, Equal(SEGMENTS))
        models[name] = Compiled(stored_of(fit.model, fit.parameters))
    for name, architecture in (
        ("network, strain", "FFRI1"),
        ("network, rate", "FFRD4"),
    ):
        rows = samples(known, architecture)
        (one,) = train(
            rows.inputs,
            rows.target,
            neurons=[NEURONS],
            train_mask=np.ones((1, len(rows.target)), bool),
            seeds=[seed],
            settings=STEADY,
        )
        network = StoredNetwork(one.network, architecture, None, Seen.of(known))
        models[name] = Compiled(network)
    return models, modulus


def step_times(network: Strip, steps: int) -> Row:
    """Nanoseconds of a compiled step at a constant rate, of a million steps.

    Mean by processor time; by the clock, the slowest thousand, interruptions included.
    """
    knots = tuple(np.linspace(0, 0.6, SEGMENTS + 1).tolist())
    times = tuple(np.geomspace(0.01, 100, BRANCHES).tolist())
    units = Units("pl-wiechert", knots, times)
    pieces = tuple(
        Piece(law, law.defaults() | values, ())
        for law, values in (
            (effect("permanent_set"), {"ratio": 0.1}),
            (effect("mullins_softening"), {"depth": 0.4}),
        )
    )
    own: tuple[dict, ...] = ({}, {})
    corrected = Stored(units, np.ones(units.columns), pieces, own, False, "virgin")
    assert isinstance(network, Compiled)
    out = {}
    at: Array = np.arange(steps, dtype=np.float64) * 2.0**-10  # steps exactly alike
    strain: Array = 0.25 - 0.25 * np.cos(2 * np.pi * at)
    for name, model in (("corrected", Compiled(corrected)), ("network", network)):
        model.reset()
        taken, busy = [], time.thread_time_ns()
        for k in range(0, steps, 1000):
            part = slice(k, k + 1000)
            began = time.perf_counter_ns()
            model.run(at[part], strain[part])
            taken.append((time.perf_counter_ns() - began) / 1000)
        busy = time.thread_time_ns() - busy
        out[name] = {"mean": busy / steps, "slowest_1000": max(taken)}
    return out


def top_stress() -> float:
    """Stress [MPa] of a virtual strip that is pulled to the working range."""
    strain = np.arange(0, WORKING, 0.25 * STEP_S)
    law = virtual.calibration(NAME)
    return float(virtual.stress(law, strain, STEP_S, virtual.Specimen())[-1])


def chain_of(modulus_MPa: float, top_MPa: float) -> Chain:
    """The published chain whose strips of a modulus give 15 Nm at a top stress."""
    bundle = Bundle().for_torque(TORQUE_Nm, top_MPa)
    force_per_angle = bundle.strips * bundle.area_mm2 * modulus_MPa * bundle.radius_mm
    stiff = 1e-3 * bundle.radius_mm * force_per_angle / bundle.length_mm
    control = Controller(stiffness_Nm_per_rad=stiff)
    return Chain(Motor.published(), bundle, control, STEP_S)


def stride(seconds: float) -> tuple[Array, Array]:
    """Torque wanted [Nm] and angle of the knee [rad], each (n,): a stride a second."""
    t = np.arange(0, seconds, STEP_S)
    swing = 0.5 - 0.5 * np.cos(2 * np.pi * t)
    low, high = np.radians(KNEE)
    return TORQUE_Nm * swing, low + (high - low) * swing


def errors(found: Walk, goal: Array) -> Row:
    """Return the torque error over the largest torque wanted, and the model's part."""
    off = (found.torque_Nm - goal) / TORQUE_Nm
    blind = (found.torque_Nm - found.estimate_Nm) / TORQUE_Nm
    return {
        "rms_error": float(np.sqrt(np.mean(off**2))),
        "largest_error": float(np.max(np.abs(off))),
        "rms_of_estimate": float(np.sqrt(np.mean(blind**2))),
        "largest_strain": float(found.strain.max()),
        "largest_voltage_V": float(np.max(np.abs(found.voltage_V))),
    }


def timed(model: Strip, chain: Chain, seconds: float) -> float:
    """How many times faster than real time a loop of compiled models runs.

    By processor time, so that what else the machine does is left out.
    """
    assert isinstance(model, Compiled)
    goal, load = stride(min(6 * seconds, 60))
    other = Compiled(
        Stored(Units("hooke", (0.0, 1.0)), np.ones(1), (), (), False, "virgin")
    )
    began = time.thread_time()
    walk(chain, goal, load, model, other)
    return float(len(goal) * STEP_S / (time.thread_time() - began))
