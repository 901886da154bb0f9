"""How fast is softnn, against what a user would otherwise pick, in the same run?

Networks: time until the held-out NRMSE is within 0.1 % of the best that any rival finds
on the same samples, counting every restart that was needed. Models: branch-samples a
second, and the seconds of a whole piecewise-linear fit (`speed_models.py`). What of the
machine's arithmetic is used, and what float32 would change: `speed_arithmetic.py`.
"""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from sklearn.neural_network import MLPRegressor

from bench import speed_arithmetic, speed_models
from softnn import prepare, virtual
from softnn.contracts import Array, InputError
from softnn.metrics import nrmse
from softnn.neural import Samples, Scaling, samples, train, training
from softnn.recording import Recording, data_hash
from softnn.study.common import guarded, markdown, parser, results_folder, write_result

WITHIN = 1e-3  # of the best held-out NRMSE
NEURONS = (5, 12, 20)


@dataclass(frozen=True)
class Task:
    """Normalised training samples, held-out samples, and the size of the network."""

    inputs: Array
    target: Array
    held_in: np.ndarray
    neurons: int

    @property
    def scaled(self) -> tuple[Array, Array]:
        x, y = self.inputs[self.held_in], self.target[self.held_in]
        return Scaling.of(x).apply(x), Scaling.of(y).apply(y)

    def held_out_error(self, predict: Callable[[Array], Array]) -> float:
        """NRMSE outside the training set of `predict`, which sees normalised inputs."""
        x, y = self.inputs[self.held_in], self.target[self.held_in]
        out = ~self.held_in
        scaled = predict(Scaling.of(x).apply(self.inputs[out]))
        return nrmse(Scaling.of(y).undo(scaled), self.target[out])


@dataclass
class Run:
    """One start of one method: held-out NRMSE reached, after how many seconds."""

    seconds: list[float] = field(default_factory=list)
    error: list[float] = field(default_factory=list)
    total: float = 0.0  # until the method stopped by itself, or was stopped


class _Watch:
    """Keeps (seconds, weights) of a rival as it goes, not counting the keeping."""

    def __init__(self, budget: float) -> None:
        self.kept: list[tuple[float, Any]] = []
        self.budget, self.began, self.aside = budget, time.perf_counter(), 0.0

    def keep(self, weights: Any) -> None:
        now = time.perf_counter()
        self.kept.append((now - self.began - self.aside, weights))
        if self.kept[-1][0] > self.budget:
            raise TimeoutError
        self.aside += time.perf_counter() - now


def ours(task: Task, seed: int, budget: float) -> Run:
    """softnn, as the studies use it, preparation of the data included."""
    watch = _Watch(budget)
    original = training._Tanh.normal

    def watched(self, parameters, which):
        result = original(self, parameters, which)
        watch.keep(parameters[0].clone())
        return result

    training._Tanh.normal = watched  # type: ignore[method-assign]
    try:
        with contextlib.suppress(TimeoutError):
            train(
                task.inputs,
                task.target,
                neurons=[task.neurons],
                train_mask=task.held_in[None],
                seeds=[seed],
            )
    finally:
        training._Tanh.normal = original  # type: ignore[method-assign]
    s, d = task.neurons, task.inputs.shape[1]

    def error(parameters: Any) -> float:
        hidden = parameters[: (d + 1) * s].reshape(d + 1, s).numpy()
        output = parameters[(d + 1) * s :].numpy()

        def predict(z: Array) -> Array:
            return np.tanh(z @ hidden[:d] + hidden[d]) @ output[:s] + output[s]

        return task.held_out_error(predict)

    return _scored(watch, error)


def scikit_learn(task: Task, seed: int, budget: float) -> Run:
    """MLPRegressor with lbfgs, weight decay off, run until it stops by itself."""
    x, y = task.scaled
    watch = _Watch(budget)

    class Watched(MLPRegressor):
        def _loss_grad_lbfgs(self, packed, *args, **kwargs):
            result = super()._loss_grad_lbfgs(packed, *args, **kwargs)
            watch.keep(packed.copy())
            return result

    model = Watched(
        hidden_layer_sizes=(task.neurons,),
        activation="tanh",
        solver="lbfgs",
        alpha=0.0,
        max_iter=20000,
        max_fun=30000,
        tol=1e-9,
        random_state=seed,
    )
    with warnings.catch_warnings(), contextlib.suppress(TimeoutError):
        warnings.simplefilter("ignore")
        model.fit(x, y)
    s, d = task.neurons, x.shape[1]

    def error(packed: Array) -> float:
        hidden = packed[: d * s].reshape(d, s)
        output = packed[d * s : d * s + s]
        first, last = packed[d * s + s : d * s + 2 * s], packed[-1]
        return task.held_out_error(
            lambda z: np.tanh(z @ hidden + first) @ output + last
        )

    return _scored(watch, error)


def pyrenn_lm(task: Task, seed: int, budget: float) -> Run:
    """pyrenn's Levenberg-Marquardt, stopped at the budget (it never settles)."""
    import pyrenn

    x, y = task.scaled
    watch = _Watch(budget)
    # pyrenn draws its start from NumPy's global generator and offers no other way.
    np.random.seed(seed)  # noqa: NPY002
    net = pyrenn.CreateNN([x.shape[1], task.neurons, 1])
    original = pyrenn.RTRL

    def watched(net, data):
        result = original(net, data)
        watch.keep(net["w"].copy())
        return result

    pyrenn.RTRL = watched
    try:
        with (
            contextlib.suppress(TimeoutError, np.linalg.LinAlgError),
            contextlib.redirect_stdout(io.StringIO()),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")
            pyrenn.train_LM(x.T, y, net, k_max=1000)
    finally:
        pyrenn.RTRL = original

    def error(weights: Array) -> float:
        net["w"] = weights
        return task.held_out_error(lambda z: pyrenn.NNOut(z.T, net))

    return _scored(watch, error)


def _scored(watch: _Watch, error: Callable[[Array], float]) -> Run:
    run = Run(total=time.perf_counter() - watch.began - watch.aside)
    # Every tenth of the way is close enough on a log scale, and cheap to score.
    picks = np.unique(np.geomspace(1, len(watch.kept), 60).astype(int)) - 1
    for i in picks:
        seconds, weights = watch.kept[i]
        run.seconds.append(seconds)
        run.error.append(error(weights))
    return run


METHODS: dict[str, Callable[[Task, int, float], Run]] = {
    "softnn": ours,
    "scikit-learn": scikit_learn,
    "pyrenn": pyrenn_lm,
}


def time_to(target: float, runs: Sequence[Run]) -> tuple[float, bool]:
    """Seconds until one of the runs, one after the other, is at `target` or below.

    >>> time_to(0.1, [Run([1.0], [0.2], 3.0), Run([1.0, 2.0], [0.3, 0.1], 5.0)])
    (5.0, True)
    """
    spent = 0.0
    for run in runs:
        for seconds, error in zip(run.seconds, run.error, strict=True):
            if error <= target:
                return spent + seconds, True
        spent += run.total
    return spent, False


def starts(
    method: Callable[[Task, int, float], Run], task: Task, budget: float, seed: int
) -> list[Run]:
    """Starts of a method, one after the other, until its seconds are spent."""
    runs: list[Run] = []
    while (left := budget - sum(run.total for run in runs)) > 0:
        runs.append(method(task, seed + len(runs), left))
    return runs


def known(material: str, seed: int) -> tuple[list[Recording], Samples, np.ndarray]:
    """Recordings, the samples of them, and which of these are learned from."""
    recordings = [
        prepare.specimen(r, samples=len(r)) for r in virtual.tensile(material, seed)
    ]
    data = samples(recordings)
    held_in = np.random.default_rng(seed).random(len(data.target)) < 0.9
    return recordings, data, held_in


def arithmetic(
    material: str, neurons: Sequence[int], seed: int
) -> list[dict[str, Any]]:
    """What training uses of a core, for each network: see `speed_arithmetic`."""
    _, data, held_in = known(material, seed)
    return speed_arithmetic.measure(
        data.inputs, data.target, held_in, list(neurons), seed
    )


def networks(
    material: str, neurons: Sequence[int], budget: float, seed: int
) -> dict[str, Any]:
    """Times to the same held-out NRMSE, by size of network and method.

    Every method has the same seconds in all, for as many starts as fit in them.
    """
    recordings, data, held_in = known(material, seed)
    rows, ratios = [], []
    for size in neurons:
        task = Task(data.inputs, data.target, held_in, size)
        runs = {
            name: starts(method, task, budget, seed) for name, method in METHODS.items()
        }
        best = min(min(r.error) for many in runs.values() for r in many)
        target = best * (1 + WITHIN)
        row: dict[str, Any] = {"neurons": size, "target_nrmse": target}
        for name, many in runs.items():
            seconds, reached = time_to(target, many)
            row[name] = {
                "seconds": seconds,
                "reached": reached,
                "best_nrmse": min(min(r.error) for r in many),
                "starts": len(many),
                "seconds_a_start": float(np.mean([r.total for r in many])),
            }
        # A rival that never gets there took at least the time it was given.
        rivals = [row[name]["seconds"] for name in METHODS if name != "softnn"]
        row["ratio"] = min(rivals) / row["softnn"]["seconds"]
        if not row["softnn"]["reached"]:
            row["ratio"] = None
        else:
            ratios.append(row["ratio"])
        rows.append(row)
    complete = len(ratios) == len(rows)
    return {
        "rows": rows,
        "arithmetic": arithmetic(material, neurons, seed),
        "training_samples": int(held_in.sum()),
        "geometric_mean_ratio": float(np.exp(np.mean(np.log(ratios))))
        if complete
        else None,
        "data": data_hash(recordings),
    }


TEN_FOLDS = """
import sys, resource
from softnn import crossval, neural, prepare, virtual
material, neurons, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
raw = virtual.tensile(material, seed)
recordings = [prepare.specimen(r, samples=len(r)) for r in raw]
data = neural.samples(recordings)
folds = crossval.make_folds(recordings, data.recording)
neural.train(
    data.inputs, data.target, neurons=[neurons] * 10, train_mask=folds.train,
    seeds=range(10), settings=neural.Settings(epochs=3),
)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def memory_gib(material: str, neurons: int, seed: int) -> float:
    """Largest resident size of a process that trains ten folds of `material`, GiB.

    Three epochs are enough: what a network needs does not grow with them.
    """
    arguments = [sys.executable, "-c", TEN_FOLDS, material, str(neurons), str(seed)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True)
    unit = 1024 if sys.platform != "darwin" else 1  # ru_maxrss is in kB, or in bytes
    return int(done.stdout) * unit / 2**30


def main(argv: Sequence[str] | None = None) -> int:
    options = parser("speed", __doc__)
    options.add_argument(
        "--budget", type=float, default=30.0, help="seconds a method has, at each size"
    )
    given = options.parse_args(argv)

    def work() -> None:
        if not given.budget > 0:
            raise InputError(f"--budget is {given.budget} s; it must be above 0")
        smoke = given.smoke
        material = "NatPolR" if smoke else "NR"
        found = networks(
            material,
            NEURONS[:1] if smoke else NEURONS,
            1.0 if smoke else given.budget,
            given.seed,
        )
        models = speed_models.measure(
            *((20_000, "PR") if smoke else (speed_models.SAMPLES, material)), given.seed
        )
        peak = memory_gib("PR" if smoke else "NatR", 2 if smoke else 20, given.seed)
        headline = {
            f"{name.replace('-', '_')}_seconds_{row['neurons']}": row[name]["seconds"]
            for row in found["rows"]
            for name in METHODS
        }
        for row in found["arithmetic"]:
            about = f"{row['bits']}_bits_{row['neurons']}_neurons"
            headline |= {
                f"{k}_{about}": row[k]
                for k in ("nrmse", "gamma", "seconds", "share_of_peak")
            }
        headline |= {
            "network_speed_ratio": found["geometric_mean_ratio"],
            "training_samples": found["training_samples"],
            "peak_memory_gib": peak,
        }
        print(f"peak memory of ten folds of the largest material: {peak:.2f} GiB\n")
        print(
            markdown(
                ["neurons", "held-out NRMSE to reach", *METHODS, "ratio"],
                [
                    [
                        row["neurons"],
                        f"{100 * row['target_nrmse']:.3f} %",
                        *(_told(row[name]) for name in METHODS),
                        "-" if row["ratio"] is None else f"{row['ratio']:.1f}",
                    ]
                    for row in found["rows"]
                ],
            )
        )
        print()
        print(
            markdown(
                ["neurons", "digits", "NRMSE", "gamma", "steps", "ended", "s", "peak"],
                [
                    [
                        row["neurons"],
                        f"{row['bits']} bits",
                        f"{100 * row['nrmse']:.3f} %",
                        f"{row['gamma']:.1f}",
                        row["iterations"],
                        row["stopped"],
                        f"{row['seconds']:.2f}",
                        f"{100 * row['share_of_peak']:.0f} %; of the products "
                        f"{100 * row['share_in_products']:.0f} %",
                    ]
                    for row in found["arithmetic"]
                ],
            )
        )
        write_result(
            "speed",
            headline | models,
            {"networks": found["rows"], "arithmetic": found["arithmetic"]},
            seed=given.seed,
            data={"networks": found["data"]},
            folder=results_folder(smoke, given.publish),
        )

    return guarded(work)


def _told(cell: dict[str, Any]) -> str:
    sign = "" if cell["reached"] else "not in "
    return f"{sign}{cell['seconds']:.2f} s"
