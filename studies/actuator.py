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

from bench.survivor.data import model_of, physics, virtual_problem
from softnn.actuator import walk
from softnn.contracts import InputError
from softnn.export.compiled import Compiled
from softnn.model_file import read_model
from softnn.motor import Strip, published_checks
from softnn.recording import data_hash
from softnn.study import common, strips
from softnn.study.material_data import prepared
from softnn.study.settings import Settings
from softnn.taught import taught
from studies.shown.actuator import draw, report


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
        (data,) = prepared(Settings(material=strips.NAME, seed=options.seed))
        known = [
            r.take(np.flatnonzero(r.strain <= strips.WORKING)) for r in data.tensile
        ]
        models, modulus = strips.strip_models(known, options.seed)
        models |= of_cycles(options.seed, options.smoke)
        if options.model:
            models[Path(options.model).stem[:24]] = Compiled(read_model(options.model))
        top = strips.top_stress()
        chain = strips.chain_of(modulus, top)
        goal, load = strips.stride(seconds)
        rows, walks = [], {}
        for name, model in models.items():
            began = time.perf_counter()
            found = walk(chain, goal, load, strips.VirtualStrip(), model)
            taken = time.perf_counter() - began
            walks[name] = found
            rows.append(
                {"model": name} | strips.errors(found, goal) | {"seconds": taken}
            )
        fast = strips.timed(models["PL-Wiechert"], chain, seconds)
        steps = strips.step_times(
            models["network, rate"], 10_000 if options.smoke else 10**6
        )
        checks = published_checks(top)
        body: strips.Row = {"published": checks, "models": rows, "step_ns": steps}
        body |= {"bundle": vars(chain.bundle), "stress_at_0.5_MPa": top}
        headline = {f"{r['model']}_rms_error": r["rms_error"] for r in rows}
        headline |= {f"{k}_mean_ns": v["mean"] for k, v in steps.items()}
        headline |= {
            "times_real_time": fast,
            "radius_mm": chain.bundle.radius_mm,
        } | checks
        print(report(rows, checks, steps, fast))
        place = common.results_folder(options.smoke, options.publish)
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


if __name__ == "__main__":
    sys.exit(main())
