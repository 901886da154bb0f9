"""What strips are taken for in a controller: virtual specimens, models, their cost."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softnn import virtual
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
from softnn.motor import Strip
from softnn.neural import Seen, StoredNetwork, samples, train
from softnn.recording import Recording

NAME, STEP_S = "NatPolR", 1e-3
NEURONS = 13  # Table 6.6
SEGMENTS, BRANCHES = 12, 8
Row = dict[str, Any]


@dataclass
class VirtualStrip:
    """The mean virtual specimen, step by step: what the strips are."""

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
