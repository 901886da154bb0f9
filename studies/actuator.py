"""What does the choice of strip model cost a series-viscoelastic actuator in torque?

Section 7.4 of the thesis (Table 7.3): motor, gearbox and strips of NatPolR in closed
loop, 15 Nm at the knee in walking. The strips are virtual specimens; the controller
takes them for a linear spring, PL-SLS, PL-Wiechert or a network, and wins the torque
from their elongation. Table 7.3 is first held against itself. Torque and knee angle
are made up (the thesis prints none): one stride a second, as fast as 50 rpm allows.
`--model` adds a corrected model or a network of your own.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from softnn import virtual
from softnn.actuator import Chain, Controller, Walk, walk
from softnn.contracts import Array, InputError
from softnn.export.compiled import Compiled
from softnn.model_file import Stored, read_model
from softnn.models.units import Units
from softnn.motor import Bundle, Motor, Strip, published_checks
from softnn.recording import data_hash
from softnn.study import common
from softnn.study.material_data import prepared
from softnn.study.settings import Settings
from softnn.study.strips import NAME, STEP_S, VirtualStrip, step_times, strip_models
from studies.shown.actuator import KNEE, Row, TORQUE_Nm, draw, report

WORKING = 0.5  # strain, Table 7.3


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


if __name__ == "__main__":
    sys.exit(main())
