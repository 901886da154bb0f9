"""What of the machine's arithmetic does training use, and would half the digits do?

The products that a step cannot do without are those of the Jacobian with itself: of n
samples and p parameters 2 n p^2 operations, at most half of it saved by symmetry. They
are put against the largest product of square matrices, in the same precision and on one
core, in all of a training and in the calls that form the normal equations.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import numpy as np
import torch

from softnn.contracts import Array
from softnn.metrics import nrmse
from softnn.neural import train, training

SIDE, REPEATS = 1500, 5  # of the square matrices


def peak_flops(kind: torch.dtype) -> float:
    """Operations a second of square matrix products on one core, the best of a few."""
    square = torch.randn(SIDE, SIDE, dtype=kind)
    best = np.inf
    for _ in range(REPEATS):
        began = time.perf_counter()
        torch.mm(square, square)
        best = min(best, time.perf_counter() - began)
    return 2 * SIDE**3 / best


@contextmanager
def half_the_digits() -> Iterator[None]:
    """Samples and Jacobian in float32, the steps in float64: all in float32 fails."""
    tanh, stacked = training._Tanh, training.stacked
    normal, sse = tanh.normal, tanh.sse

    def shorter(many: Any) -> Any:
        return tuple(a.astype(np.float32) for a in stacked(many))

    def short_normal(self: Any, parameters: Any, which: Any) -> Any:
        return tuple(x.double() for x in normal(self, parameters.float(), which))

    def short_sse(self: Any, parameters: Any, which: Any) -> Any:
        return sse(self, parameters.float(), which).double()

    with (
        patch.object(training, "stacked", shorter),
        patch.object(tanh, "normal", short_normal),
        patch.object(tanh, "sse", short_sse),
    ):
        yield


@contextmanager
def counted() -> Iterator[dict[str, float]]:
    """Operations of the products in each step, and the seconds of forming them."""
    normal = training._Tanh.normal
    total = {"operations": 0.0, "seconds": 0.0}

    def watched(self: Any, parameters: Any, which: Any) -> Any:
        began = time.perf_counter()
        out = normal(self, parameters, which)
        total["seconds"] += time.perf_counter() - began
        rows = self.x.shape[1] * len(which)
        total["operations"] += 2.0 * rows * parameters.shape[1] ** 2
        return out

    with patch.object(training._Tanh, "normal", watched):
        yield total


def measure(
    inputs: Array, target: Array, held_in: np.ndarray, neurons: list[int], seed: int
) -> list[dict[str, Any]]:
    """A row a network and precision: error held out, steps, seconds, share of peak."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    peaks = {32: peak_flops(torch.float32), 64: peak_flops(torch.float64)}
    torch.set_num_threads(before)
    rows = []
    for size in neurons:
        for bits in (64, 32):
            began = time.perf_counter()
            with counted() as products:
                if bits == 64:
                    one = _trained(inputs, target, held_in, size, seed)
                else:
                    with half_the_digits():
                        one = _trained(inputs, target, held_in, size, seed)
            seconds = time.perf_counter() - began
            out = ~held_in
            rows.append(
                {
                    "neurons": size,
                    "bits": bits,
                    "nrmse": nrmse(one.network.predict(inputs[out]), target[out]),
                    "gamma": one.gamma,
                    "iterations": one.iterations,
                    "stopped": one.stopped,
                    "seconds": seconds,
                    "peak_gflops": peaks[bits] / 1e9,
                    "share_of_peak": products["operations"] / seconds / peaks[bits],
                    "share_in_products": products["operations"]
                    / products["seconds"]
                    / peaks[bits],
                }
            )
    return rows


def _trained(
    inputs: Array, target: Array, held_in: np.ndarray, neurons: int, seed: int
) -> training.Trained:
    (one,) = train(
        inputs,
        target,
        neurons=[neurons],
        train_mask=held_in[None],
        seeds=[seed],
        threads=1,
    )
    return one
