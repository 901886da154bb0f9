"""Networks scored: on recordings, on the sines of section 7.3, as C, in an actuator."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bench.survivor.data import Problem
from bench.survivor.networks import Size
from softnn.actuator import walk
from softnn.contracts import Array, Chunk
from softnn.export.compiled import Compiled
from softnn.metrics import nrmse
from softnn.neural import StoredNetwork
from softnn.study import strips
from softnn.study.realtime_inputs import SCENARIOS, STEP_S, counted, law, offsets, sine

LENGTH_mm = 33.0  # of the strips of Table 7.3
Row = dict[str, Any]


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
    """The network as C: agreement, time of a step, and the loop of an"""
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
    chain = strips.chain_of(float(e @ s / (e @ e)), strips.top_stress())
    seconds = 10.0 if size.steps == Size().steps else 0.3
    goal, load = strips.stride(seconds)
    walked = walk(chain, goal, load, strips.VirtualStrip(), compiled)
    return {
        "largest_difference": float(off.max()),
        "compared_steps": n,
        "step_from_python_s": step,
        "step_ns": strips.step_times(compiled, size.steps),
        "steps": size.steps,
        "times_real_time": strips.timed(compiled, chain, seconds),
        "walking": strips.errors(walked, goal),
    }
