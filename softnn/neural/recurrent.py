"""A small recurrent network: what it knows of the past it has to learn to keep.

`train_gated` takes samples as they are, as other networks do: another sampling is
another network, as it is with a lag of one sample. `train_recurrent` brings histories
to equal steps of time first.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from softnn.contracts import Array, InputError
from softnn.neural.network import RecurrentNetwork, Scaling
from softnn.neural.training import VALIDATION_SHARE, Regularisation, Trained
from softnn.recording import Recording

EPOCHS = 200
RATE = 0.05  # of Adam, at first; it falls to nothing along a cosine
KEEP = 1.0  # added to what keeps the past, at first (Jozefowicz et al. 2015, ICML)
MOST_NORM = 1.0  # of the gradient of a network


def train_gated(
    inputs: Array,
    target: Array,
    recording: np.ndarray,
    *,
    neurons: Sequence[int],
    train_mask: np.ndarray,
    seeds: Sequence[int],
    regularisation: Regularisation,
    epochs: int = EPOCHS,
) -> list[Trained]:
    """As `softnn.neural.train`, for gated recurrent units; raises `InputError`.

    `recording` (n,) says whose the samples are, which stand in order. A network goes
    through all samples of every recording, those it does not train on too: of these it
    sees the inputs and never the target. Networks of one size are trained side by side
    by Adam on all samples. Early stopping keeps the weights of the epoch that was best
    on a share of the training samples. There is no Bayesian regularisation: each step
    of Levenberg and Marquardt needs derivatives by all weights along all recordings.
    """
    if regularisation.kind == "bayesian":
        raise InputError(
            "regularisation is bayesian; recurrent units are trained by gradients "
            "alone, so allowed is early-stopping or l2=WEIGHT"
        )
    jobs = [
        _job(
            inputs, target, np.flatnonzero(mask), int(count), int(seed), regularisation
        )
        for count, mask, seed in zip(neurons, train_mask, seeds, strict=True)
    ]
    place = _places(recording)
    groups = [
        [i for i, job in enumerate(jobs) if job.neurons == count]
        for count in sorted({job.neurons for job in jobs})
    ]

    def run(group: list[int]) -> list[Trained]:
        chosen = [jobs[i] for i in group]
        return _train(chosen, inputs, target, place, regularisation.weight, epochs)

    # Torch's own threads only wait for each other inside products as small as these.
    with ThreadPoolExecutor(1, initializer=torch.set_num_threads, initargs=(1,)) as one:
        done = list(one.map(run, groups))
    found = {
        i: trained
        for group, several in zip(groups, done, strict=True)
        for i, trained in zip(group, several, strict=True)
    }
    return [found[i] for i in range(len(jobs))]


@dataclass(frozen=True)
class _Job:
    """A network to be: samples it learns from, those that say when to stop, weights."""

    neurons: int
    learns: np.ndarray
    checks: np.ndarray
    x: Scaling
    y: Scaling
    start: list[Array]

    @property
    def parameters(self) -> int:
        return sum(weights.size for weights in self.start)


def _job(
    inputs: Array,
    target: Array,
    rows: np.ndarray,
    count: int,
    seed: int,
    how: Regularisation,
) -> _Job:
    if count < 1 or len(rows) < 2:
        raise InputError(
            f"{count} recurrent units, {len(rows)} samples to learn from; needed are 1 "
            "and 2 at least"
        )
    rng = np.random.default_rng([seed, count])
    scales = Scaling.of(inputs[rows]), Scaling.of(target[rows])
    checks = rows[:0]
    if how.kind == "early-stopping":
        mixed = rng.permutation(rows)
        cut = max(1, round(VALIDATION_SHARE * len(rows)))
        checks, rows = mixed[:cut], mixed[cut:]
    # W of the inputs and a constant, U of the past, output of the units and a constant.
    wide = 3 * count
    shapes = (inputs.shape[1] + 1, wide), (count, wide), (count + 1, 1)
    start = [rng.uniform(-1, 1, shape) / np.sqrt(count) for shape in shapes]
    start[0][-1, count : 2 * count] += KEEP
    return _Job(count, rows, checks, *scales, start)


def _places(recording: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Step (n,) and row (n,) of samples whose recordings are run side by side."""
    _, row, length = np.unique(recording, return_inverse=True, return_counts=True)
    return np.arange(len(row)) - (np.cumsum(length) - length)[row], row


def _train(
    jobs: list[_Job],
    inputs: Array,
    target: Array,
    place: tuple[np.ndarray, np.ndarray],
    decay: float,
    epochs: int,
) -> list[Trained]:
    began = time.perf_counter()
    step, row = place
    shape = len(jobs), step.max() + 1, row.max() + 1  # shorter recordings end earlier
    x = torch.zeros(*shape, inputs.shape[1] + 1, dtype=torch.float64)
    y, learns, checks = (torch.zeros(shape, dtype=torch.float64) for _ in range(3))
    for i, job in enumerate(jobs):
        scaled = np.column_stack([job.x.apply(inputs), np.ones(len(step))])
        x[i, step, row] = torch.from_numpy(scaled)
        for weight, rows in ((learns, job.learns), (checks, job.checks)):
            weight[i, step[rows], row[rows]] = 1 / max(1, len(rows))
            y[i, step[rows], row[rows]] = torch.from_numpy(job.y.apply(target[rows]))
    stopping = len(jobs[0].checks) > 0
    free = [
        torch.from_numpy(np.stack(each)).requires_grad_()
        for each in zip(*(job.start for job in jobs), strict=True)
    ]
    best = [p.detach().clone() for p in free]
    least = torch.full((len(jobs),), torch.inf, dtype=x.dtype)
    when = torch.full((len(jobs),), epochs)
    adam = torch.optim.Adam(free, lr=RATE)
    slower = torch.optim.lr_scheduler.CosineAnnealingLR(adam, epochs)
    for epoch in range(epochs):
        adam.zero_grad()
        square = (_said(x, free) - y).square()
        if stopping:
            far = (checks * square.detach()).flatten(1).sum(dim=1)
            better = far < least
            least, when[better] = torch.minimum(least, far), epoch
            for kept, p in zip(best, free, strict=True):
                kept[better] = p.detach()[better]
        cost = (learns * square).sum() + decay * sum(p.square().sum() for p in free)
        cost.backward()
        _clip(free)
        adam.step()
        slower.step()
    ends = best if stopping else free
    seconds = (time.perf_counter() - began) / len(jobs)
    weights = zip(*(p.detach().numpy() for p in ends), strict=True)
    return [
        Trained(
            _network(job, *w),
            job.neurons,
            job.parameters,
            float(job.parameters),
            decay * len(job.learns),
            1.0,
            int(last),
            "validation error rises" if last < epochs - 1 else "epochs at maximum",
            seconds,
        )
        for job, w, last in zip(jobs, weights, when, strict=True)
    ]


def _said(x: Tensor, free: Sequence[Tensor]) -> Tensor:
    """Normalised stress (B, steps, rows) of B networks to x (B, steps, rows, d + 1)."""
    inputs, past, out = free
    every = _Gated.apply(x, inputs, past)
    # A product with a vector, or a sum over all samples, is rounded by its company.
    both = torch.cat([every, torch.ones_like(every[..., :1])], dim=3)
    return (both * out[:, None, None, :, 0]).sum(dim=3)


class _Gated(torch.autograd.Function):
    """States (B, steps, rows, size) of gated units, with their derivatives by hand.

    A step is so small that torch takes longer to note it down than to compute it: its
    own derivatives take up to three times as long.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, inputs: Tensor, past: Tensor) -> Tensor:
        networks, steps, rows, width = x.shape
        size = past.shape[1]
        driven = torch.bmm(x.reshape(networks, -1, width), inputs)
        gates = driven.reshape(networks, steps, rows, 3 * size).transpose(0, 1)
        gates = gates.contiguous()
        states = x.new_zeros(steps + 1, networks, rows, size)
        recalled = x.new_empty(steps, networks, rows, size)
        before = x.new_empty(networks, rows, 3 * size)
        for state, after, both, reset, keep, new, kept in zip(
            states[:-1].unbind(),
            states[1:].unbind(),
            gates[..., : 2 * size].unbind(),
            *(part.unbind() for part in gates.split(size, dim=3)),
            recalled.unbind(),
            strict=True,
        ):
            torch.bmm(state, past, out=before)
            both.add_(before[..., : 2 * size]).sigmoid_()
            kept.copy_(before[..., 2 * size :])
            new.addcmul_(reset, kept).tanh_()
            torch.sub(state, new, out=after).mul_(keep).add_(new)
        ctx.save_for_backward(x, past, gates, states, recalled)
        return states[1:].transpose(0, 1)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[None, Tensor, Tensor]:
        x, past, gates, states, recalled = ctx.saved_tensors
        networks, _, _, width = x.shape
        size = past.shape[1]
        reset, keep, new = (part.contiguous() for part in gates.split(size, dim=3))
        # What a step of the state is worth to new, to keep, and to reset by new.
        of_new = (1 - keep) * (1 - new * new)
        of_keep = (states[:-1] - new) * keep * (1 - keep)
        of_reset = recalled * reset * (1 - reset)
        felt = torch.empty_like(gates)  # by the products with the past
        driven = torch.empty_like(recalled)  # by the input of new
        given = (grads[0].transpose(0, 1), of_new, of_keep, of_reset, reset, keep)
        made = (felt, *felt.split(size, dim=3), driven)
        steps = zip(*(one.unbind() for one in (*given, *made)), strict=True)
        slope, back = torch.zeros_like(states[0]), past.transpose(1, 2)
        for now in reversed(list(steps)):
            grad, n, k, r, gate, stays, every, *rest = now
            to_reset, to_keep, to_past, to_new = rest
            slope = slope + grad
            torch.mul(slope, n, out=to_new)
            torch.mul(slope, k, out=to_keep)
            torch.mul(to_new, r, out=to_reset)
            torch.mul(to_new, gate, out=to_past)
            slope = torch.baddbmm(slope.mul_(stays), every, back)
        inward = torch.cat([felt[..., : 2 * size], driven], dim=3)

        def rows(values: Tensor) -> Tensor:
            return values.transpose(0, 1).reshape(networks, -1, values.shape[3])

        by_inputs = x.reshape(networks, -1, width).transpose(1, 2)
        by_past = rows(states[:-1]).transpose(1, 2)
        return None, torch.bmm(by_inputs, rows(inward)), torch.bmm(by_past, rows(felt))


def _clip(free: Sequence[Tensor]) -> None:
    """Shorten the gradient of each network that is longer than `MOST_NORM`."""
    slopes = [p.grad for p in free if p.grad is not None]
    norm = torch.cat([s.flatten(1) for s in slopes], dim=1).norm(dim=1)
    for slope in slopes:
        slope *= (MOST_NORM / norm).clamp(max=1)[:, None, None]


def _network(job: _Job, inputs: Array, past: Array, out: Array) -> RecurrentNetwork:
    gates, new = np.split(inputs.T, [2 * job.neurons])
    return RecurrentNetwork(
        new.copy(), out[:, 0].copy(), job.x, job.y, gates.copy(), past.T.copy()
    )


# --- histories at equal steps of time -------------------------------------------------


@dataclass(frozen=True)
class Recurrent:
    """A trained one on strain at equal steps of time [s]."""

    network: RecurrentNetwork
    step_s: float

    @property
    def parameters(self) -> int:
        """Weights in all."""
        net = self.network
        return net.hidden.size + net.gates.size + net.past.size + net.output.size

    def predict(self, recording: Recording) -> Array:
        """Stress (n,) in MPa of a recording; its own stress is not used."""
        time, strain = _even(recording, recording.strain, self.step_s)
        stress = self.network.predict(strain[:, None])
        return np.interp(recording.time_s, time, stress)


def train_recurrent(
    recordings: Sequence[Recording],
    *,
    units: int,
    step_s: float,
    epochs: int,
    seed: int,
) -> Recurrent:
    """A network on whole histories, all of them in each of `epochs` steps of Adam.

    Raises `InputError` for what cannot be trained on.
    """
    if not recordings or units < 1 or epochs < 1 or not step_s > 0:
        raise InputError(
            f"{len(recordings)} recordings, {units} units, {epochs} epochs, a step of "
            f"{step_s} s; all must be above 0"
        )
    strain = [_even(r, r.strain, step_s)[1] for r in recordings]
    stress = [_even(r, r.stress_MPa, step_s)[1] for r in recordings]
    whose = np.repeat(np.arange(len(strain)), [len(e) for e in strain])
    (one,) = train_gated(
        np.concatenate(strain)[:, None],
        np.concatenate(stress),
        whose,
        neurons=[units],
        train_mask=np.ones((1, len(whose)), bool),
        seeds=[seed],
        regularisation=Regularisation("l2"),
        epochs=epochs,
    )
    assert isinstance(one.network, RecurrentNetwork)
    return Recurrent(one.network, step_s)


def _even(recording: Recording, values: Array, step_s: float) -> tuple[Array, Array]:
    """Times and values at equal steps from the first sample to beyond the last."""
    good = np.isfinite(values) & np.isfinite(recording.strain)
    first, last = recording.time_s[0], recording.time_s[-1]
    time = first + step_s * np.arange(int(np.ceil((last - first) / step_s)) + 1)
    return time, np.interp(time, recording.time_s[good], values[good])
