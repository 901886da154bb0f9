"""Which network survives strain that goes up and down, at a rate that changes?

The network of section 7.3 fails on a sine. One with history inputs that need no
differentiation (`FFH7`: strain, largest strain, the springs of five Maxwell branches),
inputs held within the training and stress of one sign, trained on cyclic recordings and
on histories that the corrected physical model simulates, is put beside what there is:
on the sines of the thesis, on virtual recordings, on foam and VHB not learned from; in
C, and in the closed loop of a walking actuator.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from softnn.actuator import walk
from softnn.contracts import Array, Chunk, InputError
from softnn.export.compiled import Compiled
from softnn.metrics import nrmse
from softnn.neural import (
    PUBLISHED,
    Samples,
    Seen,
    StoredNetwork,
    Trained,
    fit_samples,
    run,
    samples,
)
from softnn.neural.inputs import columns
from softnn.neural.radial import train_radial
from softnn.neural.recurrent import train_recurrent
from softnn.neural.training import BAYESIAN
from softnn.recording import Recording, data_hash
from softnn.study import common
from softnn.study.material_data import prepared
from softnn.study.realtime_inputs import SCENARIOS, STEP_S, law, offsets, sine
from softnn.study.settings import Settings
from softnn.taught import INPUTS, histories, lag_of, network_of, simulated_by
from studies import actuator
from studies.realtime import counted, networks
from studies.survivor_data import (
    VIRTUAL,
    Problem,
    model_of,
    physics,
    real_problems,
    virtual_problem,
)
from studies.survivor_report import draw, report, write_page

PUBLISHED_NETWORK = "FFRD4 as published"
LENGTH_mm = 33.0  # of the strips of Table 7.3
Row = dict[str, Any]
Predict = Callable[[Sequence[Recording]], list[Array]]


@dataclass(frozen=True)
class Size:
    """How much is spent on each network."""

    neurons: int = 12
    starts: int = 2
    simulated: int = 60
    units: int = 8  # of the recurrent network
    gaussians: int = 40
    epochs: int = 150
    even: int = 250  # steps of the longest history, of the recurrent network
    samples: int = 400  # of a recording
    specimens: int = 17  # virtual ones, learned from: as many as in Table 4.1
    steps: int = 10**6  # of C


SMALL = Size(4, 1, 6, 2, 6, 3, 40, 60, 2, 10_000)


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.survivor`; returns the exit code."""
    parser = common.parser("survivor", __doc__)
    parser.add_argument(
        "--only",
        default="",
        help="problems with this in their name; the rest as found before",
    )
    parser.add_argument("--page", action="store_true", help="the page alone, from JSON")
    options = parser.parse_args(argv)

    def work() -> None:
        place = common.results_folder(options.smoke)
        if options.page:
            print(write_page(place))
            return
        size = SMALL if options.smoke else Size()
        problems = [virtual_problem(options.seed, size.specimens, size.samples)]
        problems += [] if options.smoke else real_problems(size.samples)
        problems = [p for p in problems if options.only in p.name]
        if not problems:
            raise InputError(f"--only {options.only!r} is in the name of no problem")
        body, read = kept(place, size, options.seed)
        rows = {row["name"]: row for row in body["problems"]}
        for problem in problems:
            row, found = judged(problem, size, options.seed, options.smoke)
            rows[problem.name] = row
            body |= found | {"problems": list(rows.values())}
            read[problem.name] = data_hash([*problem.known, *problem.unseen])
            # After each, so that what is finished is kept.
            path = common.write_result(
                "survivor",
                headline_of(body),
                body,
                seed=options.seed,
                data=read,
                folder=place,
            )
            print(f"{problem.name}: {row['seconds']:.0f} s", flush=True)
        print(report(body))
        if "sines" in body:
            common.save_figure(draw(body), "survivor", place)
        if not options.smoke:
            write_page(place)
        print(f"\nresult: {path}")

    return common.guarded(work)


def kept(place: Path, size: Size, seed: int) -> tuple[Row, dict[str, str]]:
    """What an earlier run of the same code has found, and in which data."""
    code = common.fingerprint([vars(size), seed], files=common.package_files())
    body: Row = {"problems": [], "size": vars(size), "code": code}
    file = place / "survivor.json"
    if file.exists():
        old = json.loads(file.read_text(encoding="utf-8"))
        if old.get("code") == code:
            found = {k: old[k] for k in (*body, "sines", "real_time") if k in old}
            return found, old["data"]
    return body, {}


def judged(problem: Problem, size: Size, seed: int, smoke: bool) -> tuple[Row, Row]:
    """All models on one problem; and what only the virtual one is asked."""
    began = time.thread_time()
    models = physics(problem, common.RUNS / "survivor", "sls" if smoke else None)
    corrected, base = (model_of(models[k]) for k in ("corrected", "base"))
    known, factor = problem.alike(corrected)
    made = histories(corrected, problem.span, size.simulated, seed, factor)
    lag_s = lag_of(known)
    stored, how = network_of([*known, *made], lag_s, size.neurons, size.starts, seed)
    about = {k: getattr(how, k) for k in ("parameters", "gamma", "iterations")}
    predict: dict[str, Predict] = {
        "corrected model": partial(simulated_by, corrected),
        "PL-Wiechert": partial(simulated_by, base),
        INPUTS: partial(stress_of, stored),
        **others(known, made, lag_s, size, seed),
    }
    found: Row = {}
    if problem.name.startswith("virtual"):
        published = as_published(seed, size)
        predict[PUBLISHED_NETWORK] = partial(stress_of, published)
        found = {
            "sines": sines({PUBLISHED_NETWORK: published, INPUTS: stored}),
            "real_time": real_time(stored, problem, size),
        }
    row = {
        "name": problem.name,
        "specimens": len(problem.known),
        "unseen": len(problem.unseen),
        "selected": models["selected"],
        "lag_s": lag_s,
        "network": about,
    }
    for name, one in predict.items():
        for key, value in scores(one(problem.unseen), problem).items():
            row.setdefault(key, {})[name] = value
    row["seconds"] = time.thread_time() - began
    return row, found


def trained(
    known: Samples, inputs: str, size: Size, seed: int, **given: Any
) -> Trained:
    """A network on all of these samples."""
    (one,) = fit_samples(
        known,
        inputs,
        neurons=[size.neurons],
        train_mask=np.ones((1, len(known.target)), bool),
        seeds=[seed],
        threads=1,
        **given,
    )
    return one


def others(
    recordings: Sequence[Recording],
    made: Sequence[Recording],
    lag_s: float,
    size: Size,
    seed: int,
) -> dict[str, Predict]:
    """The same data on other networks; those of Table 6.3 have the recordings alone."""
    every = [*recordings, *made]
    known = samples(every, INPUTS, lag_s)
    mask = np.ones((1, len(known.target)), bool)
    (radial,) = train_radial(
        known.inputs,
        known.target,
        neurons=[size.gaussians],
        train_mask=mask,
        seeds=[seed],
        regularisation=BAYESIAN,
    )
    longest = max(float(np.ptp(r.time_s)) for r in recordings)
    recurrent = train_recurrent(
        shorter(every, longest),
        units=size.units,
        step_s=longest / size.even,
        epochs=size.epochs,
        seed=seed,
    )

    def by_radial(asked: Sequence[Recording]) -> list[Array]:
        rows = [columns(r, INPUTS, lag_s) for r in asked]
        return [radial.network.predict(x) for x in rows]

    out: dict[str, Predict] = {
        "recurrent": lambda asked: [recurrent.predict(r) for r in asked],
        "Gaussian units": by_radial,
    }
    for name in PUBLISHED:
        rows = samples(recordings, name)
        out[name] = partial(run, trained(rows, name, size, seed).network, name)
    return out


def shorter(recordings: Sequence[Recording], most_s: float) -> list[Recording]:
    """No longer than `most_s`: slow simulated histories would be most of a batch."""
    return [
        r.take(np.flatnonzero(r.time_s <= r.time_s[0] + most_s)) for r in recordings
    ]


def stress_of(stored: StoredNetwork, recordings: Sequence[Recording]) -> list[Array]:
    chunks = [Chunk(r.time_s, r.strain) for r in recordings]
    names = [r.name for r in recordings]
    return stored.stress(names, chunks, [None] * len(names))


def as_published(seed: int, size: Size) -> StoredNetwork:
    """FFRD4 on tensile tests, as section 7.3 has it."""
    (data,) = prepared(Settings(material=VIRTUAL, seed=seed))
    (network,) = networks(data, "FFRD4", 1, size.neurons, seed)
    return StoredNetwork(network, "FFRD4", None, Seen.of(data.tensile))


def scores(out: Sequence[Array], problem: Problem) -> Row:
    """Error on what was not learned from, MPa over MPa, and stress of the wrong sign.

    `scaled`: with a factor on the stress of each recording, which is a specimen of its
    own; `wrong_sign` is the share of samples beyond 1 % of the largest stress.
    """
    measured = [r.stress_MPa for r in problem.unseen]
    good = [np.isfinite(m) for m in measured]
    y = [m[g] for m, g in zip(measured, good, strict=True)]
    p = [o[g] for o, g in zip(out, good, strict=True)]
    own = [
        a * float(a @ b) / max(float(a @ a), 1e-300) for a, b in zip(p, y, strict=True)
    ]
    every, stress = np.concatenate(p), np.concatenate(y)
    sign = 1 if problem.span.pulls else -1
    return {
        "nrmse": nrmse(every, stress),
        "scaled": nrmse(np.concatenate(own), stress),
        "wrong_sign": float(np.mean(sign * every < -0.01 * np.abs(stress).max())),
    }


def sines(models: Mapping[str, StoredNetwork]) -> list[Row]:
    """The inputs of Figs 7.2 and 7.3; time, law and stress, thinned, for the figure."""
    rows = []
    for scenario, speed in SCENARIOS.items():
        for where, offset in offsets(scenario, speed, LENGTH_mm).items():
            strain, _ = sine(speed, LENGTH_mm, offset)
            time_s, true = STEP_S * np.arange(len(strain), dtype=float), law(strain)
            chunk = Chunk(time_s, strain)
            row: Row = {"scenario": scenario, "place": where, "mm_per_min": speed}
            row |= {"time_s": time_s[::20], "law_MPa": true[::20], "models": {}}
            for name, model in models.items():
                (out,) = model.stress([name], [chunk], [None])
                found = counted(out[None], true, model.outside(chunk))
                row["models"][name] = found | {"stress_MPa": out[::20]}
            rows.append(row)
    return rows


def real_time(stored: StoredNetwork, problem: Problem, size: Size) -> Row:
    """The network as C: agreement, time of a step, and the loop of an actuator."""
    compiled = Compiled(stored)
    n = min(10**5, size.steps)
    at = 1e-3 * np.arange(n, dtype=float)
    strain = 0.22 + 0.22 * np.sin(5 * at) * np.cos(0.13 * at)
    got = compiled.run(at, strain)
    (want,) = stored.stress([""], [Chunk(at, strain)], [None])
    off = np.abs(got - want) / np.maximum(np.abs(want), 1e-3 * np.abs(want).max())
    compiled.reset()
    began = time.thread_time()
    for e in strain.tolist():
        compiled.step(1e-3, e)
    step = (time.thread_time() - began) / n
    e = np.concatenate([r.strain for r in problem.known])
    s = np.concatenate([r.stress_MPa for r in problem.known])
    chain = actuator.chain_of(float(e @ s / (e @ e)), actuator.top_stress())
    seconds = 10.0 if size.steps == Size().steps else 0.3
    goal, load = actuator.stride(seconds)
    walked = walk(chain, goal, load, actuator.VirtualStrip(), compiled)
    return {
        "largest_difference": float(off.max()),
        "compared_steps": n,
        "step_from_python_s": step,
        "step_ns": actuator.step_times(compiled, size.steps),
        "steps": size.steps,
        "times_real_time": actuator.timed(compiled, chain, seconds),
        "walking": actuator.errors(walked, goal),
    }


def headline_of(body: Row) -> Row:
    """What issues and texts quote, flat."""
    out: Row = {}
    for row in body["problems"]:
        short = row["name"].replace(", ", " ").replace(" ", "_")
        for key in (INPUTS, "corrected model", "FFRD4"):
            out[f"{short}_{key.replace(' ', '_')}_nrmse"] = row["nrmse"][key]
        out[f"{short}_over_corrected"] = (
            row["nrmse"][INPUTS] / row["nrmse"]["corrected model"]
        )
        out[f"{short}_wrong_sign"] = row["wrong_sign"][INPUTS]
    if "sines" not in body:
        return out
    mine = [row["models"][INPUTS] for row in body["sines"]]
    out["sines_negative"] = sum(m["networks_negative"] for m in mine)
    errors = [m["nrmse"] for m in mine if m["nrmse"] is not None]
    out["sines_largest_nrmse"] = max(errors)
    fast = body["real_time"]
    out |= {k: v for k, v in fast.items() if not isinstance(v, Mapping)}
    for name, taken in fast["step_ns"].items():
        out |= {f"{name}_step_{k}_ns": v for k, v in taken.items()}
    return out | {"walking_rms_error": fast["walking"]["rms_error"]}


if __name__ == "__main__":
    sys.exit(main())
