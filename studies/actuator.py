"""What does the choice of strip model cost a series-viscoelastic actuator in torque?

Section 7.4 of the thesis (Table 7.3): motor, gearbox and strips of NatPolR in closed
loop, 15 Nm at the knee in walking. The strips are virtual specimens; the controller
takes them for a linear spring, PL-SLS, PL-Wiechert or a network, and wins the torque
from their elongation. Table 7.3 is first held against itself. Torque and knee angle
are made up (the thesis prints none): one stride a second, as fast as 50 rpm allows.
`--model` adds a corrected model or a network of your own.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn import virtual
from softnn.actuator import Chain, Controller, Walk, walk
from softnn.contracts import Array, InputError
from softnn.effects import effect
from softnn.export.compiled import Compiled
from softnn.export.files import stored_of
from softnn.fit import Piece
from softnn.model_file import Stored, read_model
from softnn.models import Hooke
from softnn.models.fit_piecewise import fit_jointly
from softnn.models.segments import Equal
from softnn.models.units import Units
from softnn.motor import Bundle, Motor, Strip, published_checks
from softnn.neural import Seen, StoredNetwork, samples, train
from softnn.recording import Recording, data_hash
from studies import common
from studies.material_data import prepared
from studies.settings import Settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME, STEP_S = "NatPolR", 1e-3
TORQUE_Nm, KNEE = 15.0, (5.0, 63.0)  # half of 29 Nm; degrees, `studies.gait`
WORKING = 0.5  # strain, Table 7.3
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


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.actuator`; returns the exit code."""
    parser = common.parser("actuator", __doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="of walking (10)")
    parser.add_argument("--model", metavar="FILE", help="model.json or network.json")
    options = parser.parse_args(argv)

    def work() -> None:
        seconds = 0.3 if options.smoke else options.seconds
        if not 0.1 <= seconds <= 600:
            raise InputError(f"--seconds is {seconds}; allowed is 0.1 to 600")
        (data,) = prepared(Settings(material=NAME, seed=options.seed))
        known = [r.take(np.flatnonzero(r.strain <= WORKING)) for r in data.tensile]
        models, modulus = strip_models(known, options.seed)
        if options.model:
            models[Path(options.model).stem[:24]] = Compiled(read_model(options.model))
        strain = np.arange(0, WORKING, 0.25 * STEP_S)
        top = virtual.stress(
            virtual.calibration(NAME), strain, STEP_S, virtual.Specimen()
        )[-1]
        bundle = Bundle().for_torque(TORQUE_Nm, float(top))
        force_per_angle = bundle.strips * bundle.area_mm2 * modulus * bundle.radius_mm
        stiff = 1e-3 * bundle.radius_mm * force_per_angle / bundle.length_mm
        chain = Chain(
            Motor.published(), bundle, Controller(stiffness_Nm_per_rad=stiff), STEP_S
        )
        goal, load = stride(seconds)
        rows, walks = [], {}
        for name, model in models.items():
            began = time.perf_counter()
            found = walk(chain, goal, load, VirtualStrip(), model)
            taken = time.perf_counter() - began
            walks[name] = found
            rows.append({"model": name} | errors(found, goal) | {"seconds": taken})
        fast = timed(models["PL-Wiechert"], chain, seconds)
        steps = step_times(models["network, rate"], 10_000 if options.smoke else 10**6)
        checks = published_checks(float(top))
        body: Row = {"published": checks, "models": rows, "step_ns": steps}
        body |= {"bundle": vars(bundle), "stress_at_0.5_MPa": float(top)}
        headline = {f"{r['model']}_rms_error": r["rms_error"] for r in rows}
        headline |= {f"{k}_mean_ns": v["mean"] for k, v in steps.items()}
        headline |= {"times_real_time": fast, "radius_mm": bundle.radius_mm} | checks
        print(report(rows, checks, steps, fast))
        place = common.results_folder(options.smoke)
        if options.model:
            place = common.RUNS / ("smoke/results" if options.smoke else "results")
        path = common.write_result(
            "actuator",
            headline,
            body,
            seed=options.seed,
            data={data.source: data_hash(data.tensile)},
            folder=place,
        )
        common.save_figure(draw(walks, goal), "actuator", place)
        print(f"\nresult: {path}")

    return common.guarded(work)


def stride(seconds: float) -> tuple[Array, Array]:
    """Torque wanted [Nm] and angle of the knee [rad], each (n,): a stride a second."""
    t = np.arange(0, seconds, STEP_S)
    swing = 0.5 - 0.5 * np.cos(2 * np.pi * t)
    low, high = np.radians(KNEE)
    return TORQUE_Nm * swing, low + (high - low) * swing


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


def errors(found: Walk, goal: Array) -> Row:
    """Torque against what was wanted, over the largest wanted; and the model's part."""
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


def report(rows: Sequence[Row], checks: Row, steps: Row, fast: float) -> str:
    """Errors by model, Table 7.3 against itself, and what a step costs."""
    table = common.markdown(
        ["model of the strips", "rms error", "largest", "of it the estimate's"],
        [
            [
                r["model"],
                common.percent(r["rms_error"]),
                common.percent(r["largest_error"], 1),
                common.percent(r["rms_of_estimate"]),
            ]
            for r in rows
        ],
    )
    areas = ", ".join(
        f"{checks[f'area_{k}_mm2']:.0f} mm2 ({k.replace('_', ' ')}): pulley of "
        f"{checks[f'radius_{k}_mm']:.3g} mm, {checks[f'turn_{k}_degree']:.3g} degrees"
        for k in ("printed", "20_mm", "66_mm")
    )
    return "\n\n".join(
        [
            table,
            f"15 Nm through 1/81 takes {checks['current_A']:.3g} A and "
            f"{checks['heat_W']:.3g} W; at 24 V the knee then turns with "
            f"{checks['speed_rpm']:.3g} rpm at most, of 50 wanted",
            f"eight strips at strain 0.5: {areas}",
            f"C step: corrected model {steps['corrected']['mean']:.0f} ns, network "
            f"{steps['network']['mean']:.0f} ns; a loop: {fast:.0f} times real time",
        ]
    )


def draw(walks: dict[str, Walk], goal: Array) -> Figure:
    """Torque at the knee by what the controller takes the strips for; its error."""
    figure = common.new_figure(7.2, 4.0)
    top, bottom = figure.subplots(2, 1, sharex=True)
    last = min(len(goal), 3000)
    for colour, (name, found) in zip(common.COLOURS, walks.items(), strict=False):
        t = found.time_s[:last]
        top.plot(t, found.torque_Nm[:last], color=colour, linewidth=1)
        off = 100 * (found.torque_Nm - goal)[:last] / TORQUE_Nm
        bottom.plot(t, off, color=colour, linewidth=1, label=name)
    top.plot(t, goal[:last], "--", color=common.INK, linewidth=1)
    top.set(ylabel="torque [Nm]", title="wanted (dashed) and what the strips give")
    bottom.set(xlabel="time [s]", ylabel="error [% of 15 Nm]")
    figure.legend(loc="outside right upper", fontsize=8, title="taken for")
    return figure


if __name__ == "__main__":
    sys.exit(main())
