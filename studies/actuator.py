"""What does the choice of strip model cost a series-viscoelastic actuator in torque?

Section 7.4 of the thesis (Table 7.3): motor, gearbox and strips of NatPolR in closed
loop, 15 Nm at the knee in walking. The strips are virtual specimens; the controller
takes them for a linear spring, PL-SLS, PL-Wiechert, a network of tensile tests, and for
the corrected model of cyclic recordings and the network taught by it, and wins the
torque from their elongation. Table 7.3 is first held against itself. Torque and knee
angle are made up (the thesis prints none): one stride a second, as fast as 50 rpm
allows. `--model` adds a corrected model or a network of your own.
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
from softnn.taught import taught
from studies.shown.actuator import KNEE, Row, TORQUE_Nm, draw, report
from studies.survivor_data import model_of, physics, virtual_problem

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
        models |= of_cycles(options.seed, options.smoke)
        if options.model:
            models[Path(options.model).stem[:24]] = Compiled(read_model(options.model))
        top = top_stress()
        chain = chain_of(modulus, top)
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
        checks = published_checks(top)
        body: Row = {"published": checks, "models": rows, "step_ns": steps}
        body |= {"bundle": vars(chain.bundle), "stress_at_0.5_MPa": top}
        headline = {f"{r['model']}_rms_error": r["rms_error"] for r in rows}
        headline |= {f"{k}_mean_ns": v["mean"] for k, v in steps.items()}
        headline |= {
            "times_real_time": fast,
            "radius_mm": chain.bundle.radius_mm,
        } | checks
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


def of_cycles(seed: int, smoke: bool) -> dict[str, Strip]:
    """The corrected model of cyclic recordings, and the network taught by it."""
    problem = virtual_problem(seed, *((2, 60) if smoke else (17, 400)))
    found = physics(problem, common.RUNS / "survivor", "sls" if smoke else None)
    corrected = model_of(found["corrected"])
    few = {"neurons": 3, "simulated": 4} if smoke else {}
    network = taught(problem.known, corrected, starts=2, seed=seed, **few)
    return {"corrected model": Compiled(corrected), "FFH7": Compiled(network)}


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
