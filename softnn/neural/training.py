"""Training: Bayesian regularisation, early stopping or a fixed L2 weight.

All three are Levenberg-Marquardt behind one interface; many networks (folds, starts,
neuron counts) are trained in one batch, in float64, on any torch device.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from softnn.contracts import Array, InputError
from softnn.neural.levenberg import DEFAULTS, Result, Settings, device_of, minimise
from softnn.neural.network import Network, Scaling
from softnn.neural.rows import Rows, nguyen_widrow, normalised, stacked, summary

# Rows taken at once, the same in any batch, so that sums are rounded alike.
ROWS = 1024
HELD = 2**27  # Jacobian entries held at once by a device, whose rounding is its own
VALIDATION_SHARE = 0.15  # of the training set, with early stopping


@dataclass(frozen=True)
class Regularisation:
    """The way to limit overfitting: `bayesian`, `early-stopping`, or `l2` of a weight.

    With `l2` the cost is mean squared error + weight x sum of squared parameters, in
    normalised units.

    >>> Regularisation.parse("l2=1e-4")
    Regularisation(kind='l2', weight=0.0001)
    """

    kind: str
    weight: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Regularisation:
        """From the command line's word; raises `InputError` for any other."""
        kind, equals, number = text.partition("=")
        if kind in ("bayesian", "early-stopping") and not equals:
            return cls(kind)
        if kind == "l2" and equals:
            try:
                weight = float(number)
            except ValueError:
                weight = float("nan")
            if np.isfinite(weight) and weight >= 0:
                return cls("l2", weight)
        raise InputError(
            f"regularisation is {text!r}; allowed is bayesian, early-stopping or "
            "l2=WEIGHT with a weight of 0 or more, as in l2=1e-4"
        )

    def __str__(self) -> str:
        return f"l2={self.weight:g}" if self.kind == "l2" else self.kind


BAYESIAN = Regularisation("bayesian")


@dataclass(frozen=True)
class Trained:
    """A network and how its training went.

    `gamma` is the effective number of parameters (of `parameters` in all); `alpha` and
    `beta` are the precisions of parameters and errors (normalised units); `seconds` is
    this network's share of its batch.
    """

    network: Network
    neurons: int
    parameters: int
    gamma: float
    alpha: float
    beta: float
    iterations: int
    stopped: str
    seconds: float


class _Tanh:
    """Networks of one tanh layer as the least-squares problems of `levenberg`.

    x is (B, m, d + 1) with a last column of ones, y and weight are (B, m). A row counts
    `weight` times. `within` (B,) is a sum of squared errors that no network changes. A
    parameter row is W_1 column by column, b_1, w_2, b_2. A network with fewer neurons
    than the widest has zeros there, which stay zero. `slack` (B, m) is 1 or -1 where y
    is only a bound: any answer below or above is right, since a slack strip is held at
    zero afterwards. It is 0 elsewhere.
    """

    def __init__(
        self,
        x: Tensor,
        y: Tensor,
        weight: Tensor,
        within: Tensor,
        neurons: Tensor,
        slack: Tensor | None = None,
        held_out: _Tanh | None = None,
    ) -> None:
        self.x, self.y, self.weight, self.within = x, y, weight, within
        self.slack = slack
        self.width = int(neurons.max())
        self.count = weight.sum(dim=1)
        self.size = neurons * (x.shape[2] + 1) + 1
        self.plain = int((weight == 1).long().cumprod(dim=1).sum(dim=1).min())
        self.held_out = held_out

    def split(self, parameters: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        return _split(parameters, self.x.shape[2], self.width)

    def _chunks(self, networks: int, columns: int) -> list[slice]:
        rows, total = ROWS, self.x.shape[1]
        if self.x.device.type != "cpu":
            rows = max(256, HELD // max(1, networks * columns))
        return [slice(i, min(i + rows, total)) for i in range(0, total, rows)]

    def sse(self, parameters: Tensor, which: Tensor) -> Tensor:
        hidden, output, bias = self.split(parameters)
        total = self.within[which].clone()
        for rows in self._chunks(len(which), 2 * self.width):
            layer = torch.bmm(self.x[which, rows], hidden).tanh_()
            error = (layer * output).sum(dim=2)
            error += bias - self.y[which, rows]
            if self.slack is not None:
                error[self.slack[which, rows] * error < 0] = 0
            total += (self.weight[which, rows] * error * error).sum(dim=1)
        return total

    def normal(
        self, parameters: Tensor, which: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        hidden, output, bias = self.split(parameters)
        b, p, s = len(which), parameters.shape[1], self.width
        d1 = self.x.shape[2]
        pairs = [(k, m) for k in range(d1) for m in range(k, d1)]
        products = self.x.new_zeros(b, p + 1, p + 1)  # of the Jacobian and, last, error
        bent = self.x.new_zeros(b, len(pairs), s)  # sum e d2f/dw_k dw_m
        mixed = self.x.new_zeros(b, d1, s)  # sum e d2f/dw_k dw_2
        for rows in self._chunks(b, 2 * p):
            x = self.x[which, rows]
            both = self.x.new_empty(b, x.shape[1], p + 1)
            jacobian = both[:, :, :-1]
            layer = jacobian[:, :, d1 * s : -1]
            torch.tanh(torch.bmm(x, hidden), out=layer)
            jacobian[:, :, -1] = 1
            error = (layer * output).sum(dim=2)
            error += bias - self.y[which, rows]
            root = self.weight[which, rows].sqrt() if rows.stop > self.plain else None
            if self.slack is not None:
                root = self.weight[which, rows].sqrt() if root is None else root
                root[self.slack[which, rows] * error < 0] = 0
            both[:, :, -1] = error
            if root is not None:
                error *= root * root
            slope = torch.addcmul(torch.ones_like(output), layer, layer, value=-1)
            felt = slope * error[:, :, None]
            mixed.baddbmm_(x.transpose(1, 2), felt)
            felt *= layer
            of_x = torch.stack([x[:, :, k] * x[:, :, m] for k, m in pairs], dim=1)
            bent.baddbmm_(of_x, felt)
            slope *= output
            for k in range(d1 - 1):
                torch.mul(
                    slope, x[:, :, k, None], out=jacobian[:, :, k * s : k * s + s]
                )
            jacobian[:, :, (d1 - 1) * s : d1 * s] = slope
            if root is not None:
                both *= root[:, :, None]
            products.baddbmm_(both.transpose(1, 2), both)
        hessian, gradient = products[:, :p, :p].contiguous(), products[:, :p, p]
        bent *= -2 * output
        curvature = self.x.new_zeros(b, d1 + 1, s, d1 + 1, s)
        diagonal = curvature.diagonal(dim1=2, dim2=4)  # (b, d1 + 1, d1 + 1, s)
        for i, (k, m) in enumerate(pairs):
            diagonal[:, k, m] = diagonal[:, m, k] = bent[:, i]
        diagonal[:, :d1, d1] = diagonal[:, d1, :d1] = mixed
        exact = hessian.clone()
        exact[:, :-1, :-1] += curvature.reshape(b, p - 1, p - 1)
        return hessian, gradient, exact

    def validation(self, parameters: Tensor, which: Tensor) -> Tensor | None:
        return None if self.held_out is None else self.held_out.sse(parameters, which)


def train(
    inputs: Array,
    target: Array,
    *,
    neurons: Sequence[int],
    train_mask: np.ndarray,
    seeds: Sequence[int],
    regularisation: Regularisation = BAYESIAN,
    settings: Settings = DEFAULTS,
    starts: int = 1,
    one_sign: bool = False,
    device: str = "cpu",
    threads: int | None = None,
) -> list[Trained]:
    """Train B networks; network i sees the samples in `train_mask[i]` and no others.

    inputs (n, d), target (n,), neurons (B,), train_mask (B, n) of bool, seeds (B,).
    Normalisation is that of the training samples alone. With `starts` above 1 the best
    of that many starts, by log evidence on the summary of the samples, is trained on.
    On a CPU the same seed gives the same network, alone or in a batch. On another
    `device` (see `device_of`) rounding differs. `threads`: one a core by default; take
    one where processes share the cores.
    """
    inputs, target = np.asarray(inputs, float), np.asarray(target, float)
    _check(inputs, target, neurons, train_mask, seeds, starts)
    device = device_of(device)
    jobs = [
        _Job(inputs, target, np.flatnonzero(mask), int(count), int(seed))
        for mask, count, seed in zip(train_mask, neurons, seeds, strict=True)
    ]
    threads = 1 if device != "cpu" else threads or os.cpu_count() or 1
    groups = [list(range(len(jobs)))] if device != "cpu" else _groups(jobs, threads)

    def run(group: list[int]) -> list[Trained]:
        chosen = [jobs[i] for i in group]
        return _train_batch(chosen, regularisation, settings, starts, one_sign, device)

    if device != "cpu":
        done = [run(group) for group in groups]
    else:
        # A thread per core, each with torch on one thread: threads inside the small
        # products of one network wait for each other, and badly so on a busy machine.
        with ThreadPoolExecutor(
            threads, initializer=torch.set_num_threads, initargs=(1,)
        ) as pool:
            done = list(pool.map(run, groups))
    found = dict(
        (i, one)
        for group, trained in zip(groups, done, strict=True)
        for i, one in zip(group, trained, strict=True)
    )
    return [found[i] for i in range(len(jobs))]


@dataclass(frozen=True)
class _Job:
    """A network to be trained: shared data, its training rows, its size, its seed."""

    inputs: Array
    target: Array
    rows: np.ndarray
    neurons: int
    seed: int


def _groups(jobs: list[_Job], workers: int) -> list[list[int]]:
    """Indices of jobs trained together: those of one size, shared among workers."""
    order = sorted(range(len(jobs)), key=lambda i: -jobs[i].neurons)
    groups: list[list[int]] = []
    for _, same in itertools.groupby(order, key=lambda i: jobs[i].neurons):
        members = list(same)
        parts = min(len(members), workers)
        groups += [members[k::parts] for k in range(parts)]
    return groups


def _train_batch(
    jobs: list[_Job],
    regularisation: Regularisation,
    settings: Settings,
    starts: int,
    one_sign: bool,
    device: str,
) -> list[Trained]:
    began = time.perf_counter()
    inputs, target = jobs[0].inputs, jobs[0].target
    rngs = [np.random.default_rng([job.seed, job.neurons]) for job in jobs]
    rows = [job.rows for job in jobs]
    scalings = [(Scaling.of(inputs[r]), Scaling.of(target[r])) for r in rows]
    held_out: list[np.ndarray] | None = None
    if regularisation.kind == "early-stopping":
        mixed = [rng.permutation(r) for rng, r in zip(rngs, rows, strict=True)]
        cut = [max(1, round(VALIDATION_SHARE * len(r))) for r in mixed]
        held_out = [np.sort(r[:c]) for r, c in zip(mixed, cut, strict=True)]
        rows = [np.sort(r[c:]) for r, c in zip(mixed, cut, strict=True)]

    counts = torch.tensor([job.neurons for job in jobs], device=device)
    width = int(counts.max())

    def problem(sets: list[Rows], repeats: int) -> _Tanh:
        many = [one for one in sets for _ in range(repeats)]
        x, y, weight, within = (torch.from_numpy(a).to(device) for a in stacked(many))
        slack = None
        if one_sign:
            ends = [[float(z.low + z.high) / 2, float(z.half)] for _, z in scalings]
            middle, half = torch.tensor(ends, device=device).T
            sign = torch.where(middle >= 0, 1.0, -1.0).repeat_interleave(repeats)
            zero = (-middle / half).repeat_interleave(repeats)
            slack = sign[:, None] * (sign[:, None] * (y - zero[:, None]) <= 1e-6)
        return _Tanh(x, y, weight, within, counts.repeat_interleave(repeats), slack)

    def fit(sets: list[Rows], start: Tensor, how: Settings, repeats: int = 1) -> Result:
        task = problem(sets, repeats)
        if checks is not None:  # also early on, or it would overfit unnoticed
            task.held_out = problem(checks, repeats)
        decay: Tensor | float = 0.0
        if regularisation.kind == "l2":
            decay = regularisation.weight * task.count
        bayesian = regularisation.kind == "bayesian"
        return minimise(task, start, evidence=bayesian, alpha=decay, settings=how)

    start = torch.stack(
        [
            torch.from_numpy(nguyen_widrow(rng, job.neurons, inputs.shape[1], width))
            for rng, job in zip(rngs, jobs, strict=True)
            for _ in range(starts)
        ]
    ).to(device)

    def scaled(some: list[np.ndarray]) -> list[Rows]:
        pairs = zip(some, scalings, strict=True)
        return [normalised(inputs, target, r, *z) for r, z in pairs]

    checks = None if held_out is None else scaled(held_out)
    whole = scaled(rows)
    fewer = [summary(one, rng) for one, rng in zip(whole, rngs, strict=True)]
    able = [few is not one for few, one in zip(fewer, whole, strict=True)]
    if starts == 1 and 0 < sum(able) < len(jobs):
        # A summary brings a first stage of training. Neighbours must not bring it too.
        found: dict[int, Trained] = {}
        for way in (True, False):
            group = [i for i, one in enumerate(able) if one is way]
            some = [jobs[i] for i in group]
            about = regularisation, settings, starts, one_sign, device
            found |= zip(group, _train_batch(some, *about), strict=True)
        return [found[i] for i in range(len(jobs))]
    if starts > 1 or all(able):
        # Most of the training uses far fewer rows, at a fraction of the cost.
        early = fit(fewer, start, settings, starts)
        pick = early.evidence.reshape(-1, starts).nan_to_num(nan=-torch.inf).argmax(1)
        first = torch.arange(len(jobs), device=device) * starts
        start = early.parameters[first + pick]
        settings = replace(settings, settled_epochs=min(settings.settled_epochs, 3))
    result = fit(whole, start, settings)
    seconds = (time.perf_counter() - began) / len(rows)
    parts = _split(result.parameters, inputs.shape[1] + 1, width)
    hidden, output, bias = (part.cpu().numpy() for part in parts)
    trained = []
    for i, job in enumerate(jobs):
        count = job.neurons
        network = Network(
            hidden[i, :, :count].T.copy(),
            np.append(output[i, 0, :count], bias[i]),
            *scalings[i],
        )
        trained.append(
            Trained(
                network,
                count,
                count * (inputs.shape[1] + 2) + 1,
                float(result.gamma[i]),
                float(result.alpha[i]),
                float(result.beta[i]),
                int(result.iterations[i]),
                result.stopped[i],
                seconds,
            )
        )
    return trained


def _split(parameters: Tensor, d1: int, s: int) -> tuple[Tensor, Tensor, Tensor]:
    """Hidden (b, d1, s), output (b, 1, s) and last bias (b, 1) of parameters (b, P)."""
    hidden = parameters[:, : d1 * s].reshape(-1, d1, s)
    return hidden, parameters[:, None, d1 * s : d1 * s + s], parameters[:, -1:]


def _check(
    inputs: Array,
    target: Array,
    neurons: Sequence[int],
    train_mask: np.ndarray,
    seeds: Sequence[int],
    starts: int,
) -> None:
    n, batch = len(target), len(neurons)
    if inputs.shape[:1] != (n,) or inputs.ndim != 2:
        raise InputError(f"inputs have shape {inputs.shape}; needed is ({n}, d)")
    if not (np.isfinite(inputs).all() and np.isfinite(target).all()):
        raise InputError("inputs or target hold NaN or infinity; leave such rows out")
    if train_mask.shape != (batch, n) or len(seeds) != batch:
        raise InputError(
            f"{batch} neuron counts, {len(seeds)} seeds and a mask of shape "
            f"{train_mask.shape}; needed are as many seeds and ({batch}, {n})"
        )
    if batch == 0 or min(neurons) < 1 or starts < 1:
        raise InputError("neurons and starts must be 1 or more, of 1 network or more")
    fewest = int(train_mask.sum(axis=1).min())
    if fewest < 2:
        raise InputError(f"a training set has {fewest} samples; at least 2 are needed")
