"""How fast are the models? Simulation of branches, and a whole fit, on one core.

Rivals are what a user would otherwise write: a plain Python loop, a loop compiled by
numba, SciPy's filter branch by branch. All give the same numbers, which is checked.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
from scipy.signal import lfilter

from softnn import prepare, virtual
from softnn.contracts import Array, Chunk, InputError
from softnn.metrics import nrmse
from softnn.models import Wiechert
from softnn.models.branches import coefficients
from softnn.models.fit_piecewise import branch_stress, sweep
from softnn.models.relaxation import collocation
from softnn.models.segments import Tolerance
from softnn.study.baselines import TOLERANCES, relaxation_tests
from softnn.study.common import guarded, markdown, parser, results_folder, write_result

BRANCHES = 8
SAMPLES = 1_000_000
PLAIN_SAMPLES = 20_000  # of the plain loop, whose time grows in proportion


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.speed_models`; returns the exit code."""
    arguments = parser("speed_models", __doc__).parse_args(argv)

    def work() -> None:
        samples = 20_000 if arguments.smoke else SAMPLES
        material = "PR" if arguments.smoke else "NR"
        found = measure(samples, material, arguments.seed)
        rows = [[name, f"{value:.4g}"] for name, value in found.items()]
        print(markdown(["figure", "value"], rows))
        path = write_result(
            "speed_models",
            found,
            {"branches": BRANCHES, "samples": samples, "material": material},
            seed=arguments.seed,
            folder=results_folder(arguments.smoke, arguments.publish),
        )
        print(f"result: {path}")

    return guarded(work)


def measure(
    samples: int = SAMPLES, material: str = "NR", seed: int = 0
) -> dict[str, float]:
    """Branch-samples a second, how many times faster than rivals, seconds of a fit."""
    found = simulation(samples, seed, irregular=False)
    found |= simulation(samples, seed, irregular=True)
    return found | whole_fit(material, seed)


def simulation(samples: int, seed: int, irregular: bool) -> dict[str, float]:
    """Branches over a random strain history, at constant or at irregular steps."""
    rng = np.random.default_rng(seed)
    strain = np.cumsum(rng.normal(0, 1e-3, samples))
    steps = np.full(samples - 1, 0.01)
    if irregular:
        steps = rng.uniform(0.005, 0.015, samples - 1)
        at = np.concatenate([[0.0], np.cumsum(steps)])
    else:
        at = np.arange(samples) * 0.01
    k, tau = np.linspace(0.5, 2, BRANCHES), np.geomspace(0.05, 5e4, BRANCHES)
    parameters: dict[str, float] = {"equilibrium_stiffness": 0.0}
    for j in range(BRANCHES):
        parameters[f"stiffness_{j + 1}"] = float(k[j])
        parameters[f"relaxation_time_{j + 1}"] = float(tau[j])
    model, chunk = Wiechert(BRANCHES), Chunk(at, strain)
    loop = _irregular_loop if irregular else _constant_loop
    rivals: dict[str, Callable[[], Array]] = {
        "softnn": lambda: model.apply(parameters, chunk)[0],
        "numba_loop": lambda: loop(np.diff(at), strain, k, tau),
    }
    if not irregular:
        rivals["lfilter"] = lambda: _filters(strain, k, tau)
    seconds, answers = {}, {}
    for name, run in rivals.items():
        answers[name] = run()  # compiles what is compiled
        seconds[name] = _fastest(run)
    few = min(PLAIN_SAMPLES, samples)
    # `py_func` is the same loop, interpreted.
    began = time.perf_counter()
    plain = loop.py_func(np.diff(at[:few]), strain[:few], k, tau)
    seconds["plain_loop"] = (time.perf_counter() - began) * samples / few
    scale = np.abs(answers["softnn"]).max()
    for name, answer in [*answers.items(), ("plain_loop", plain)]:
        apart = np.abs(answer - answers["softnn"][: len(answer)]).max() / scale
        if apart > 1e-10:
            raise InputError(f"{name} differs from softnn by {apart:.2g} of the peak")
    kind = "irregular" if irregular else "constant"
    rate = samples * BRANCHES / seconds["softnn"]
    found = {f"{kind}_branch_samples_per_s": rate}
    for name, taken in seconds.items():
        if name != "softnn":
            found[f"{kind}_times_{name}"] = taken / seconds["softnn"]
    return found


def whole_fit(material: str, seed: int) -> dict[str, float]:
    """PL-Wiechert of one material: ten tolerances, one to ten branches, their NRMSE."""
    specimens = [prepare.specimen(r) for r in virtual.tensile(material, seed)]
    curve = prepare.unify(specimens)[-1]
    hold = relaxation_tests(virtual.relaxation(material, seed))[0].mean

    def run() -> Array:
        relaxations = [collocation(*hold, b) for b in range(1, 11)]
        rows = sweep([curve], relaxations, [Tolerance(t) for t in TOLERANCES])
        viscous = [branch_stress(r, curve) for r in relaxations]
        return np.array(
            [
                [nrmse(fit.predict(curve, v), curve.stress_MPa) for fit in row]
                for row, v in zip(rows, viscous, strict=True)
            ]
        )

    run()
    return {"pl_wiechert_fit_s": _fastest(run, 3), "pl_wiechert_fits": 100}


def _fastest(run: Callable[[], Any], times: int = 5) -> float:
    """Least wall time of a few, s: what the machine can do when nothing else runs."""
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        run()
        taken.append(time.perf_counter() - began)
    return min(taken)


@numba.njit
def _constant_loop(steps, strain, stiffness, times):
    n, branches = len(strain), len(times)
    decay, gain = np.empty(branches), np.empty(branches)
    for j in range(branches):
        x = steps[0] / times[j]
        decay[j] = np.exp(-x)
        gain[j] = stiffness[j] * (1 - decay[j]) / x
    q = stiffness * strain[0]
    out = np.empty(n)
    out[0] = q.sum()
    for i in range(1, n):
        jump = strain[i] - strain[i - 1]
        total = 0.0
        for j in range(branches):
            q[j] = decay[j] * q[j] + gain[j] * jump
            total += q[j]
        out[i] = total
    return out


@numba.njit
def _irregular_loop(steps, strain, stiffness, times):
    n, branches = len(strain), len(times)
    q = stiffness * strain[0]
    out = np.empty(n)
    out[0] = q.sum()
    for i in range(1, n):
        jump = strain[i] - strain[i - 1]
        total = 0.0
        for j in range(branches):
            x = steps[i - 1] / times[j]
            decay = np.exp(-x)
            q[j] = decay * q[j] + stiffness[j] * (1 - decay) / x * jump
            total += q[j]
        out[i] = total
    return out


def _filters(strain: Array, k: Array, tau: Array) -> Array:
    decay, gain = coefficients(0.01, tau, "exact")
    jumps = np.diff(strain)
    out = np.zeros(len(strain))
    out[0] = k.sum() * strain[0]
    for j in range(len(k)):
        start = [decay[j] * k[j] * strain[0]]
        part, _ = lfilter([gain[j] * k[j]], [1, -decay[j]], jumps, zi=start)
        out[1:] += part
    return out
