"""Networks of any architecture: trained on samples, run over recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from softnn.contracts import Array, InputError
from softnn.neural.history import earlier
from softnn.neural.inputs import Samples, architecture_of, columns
from softnn.neural.levenberg import DEFAULTS, Settings
from softnn.neural.network import Network
from softnn.neural.radial import train_radial
from softnn.neural.recurrent import train_gated
from softnn.neural.training import BAYESIAN, Regularisation, Trained, train
from softnn.recording import Recording


def fit_samples(
    known: Samples,
    architecture: str,
    *,
    neurons: Sequence[int],
    train_mask: np.ndarray,
    seeds: Sequence[int],
    regularisation: Regularisation = BAYESIAN,
    settings: Settings = DEFAULTS,
    starts: int = 1,
    device: str = "cpu",
    threads: int | None = None,
) -> list[Trained]:
    """Return networks trained on rows of samples; see `train`.

    Units that are not tanh have one start and train on the CPU: their steps are too
    small for another device.
    """
    row = architecture_of(architecture)
    if row.convex:
        raise InputError(
            f"inputs are {architecture}; such a network is fitted in one step, by "
            "softnn.study.holding.held(recordings, holds)"
        )
    if row.radial:
        return train_radial(
            known.inputs,
            known.target,
            neurons=neurons,
            train_mask=train_mask,
            seeds=seeds,
            regularisation=regularisation,
        )
    if row.recurrent:
        return train_gated(
            known.inputs,
            known.target,
            known.recording,
            neurons=neurons,
            train_mask=train_mask,
            seeds=seeds,
            regularisation=regularisation,
        )
    trained = train(
        known.inputs,
        known.target,
        neurons=neurons,
        train_mask=train_mask,
        seeds=seeds,
        regularisation=regularisation,
        settings=settings,
        starts=starts,
        one_sign=row.bounded,
        device=device,
        threads=threads,
    )
    return [replace(one, network=row.network(**vars(one.network))) for one in trained]


def run(
    network: Network,
    architecture: str,
    recordings: Sequence[Recording],
    lag_s: float | None = None,
) -> list[Array]:
    """Return the stress (n,) of each recording, MPa, from its strain and time alone.

    A network with feedback gets its own stress, from zero on. The result is NaN where
    strain is missing, and after that if the network has feedback or a memory.
    """
    rows = [columns(r, architecture, lag_s) for r in recordings]
    if not architecture_of(architecture).feedback:
        return [network.predict(x) for x in rows]
    # All recordings step side by side; a recording that has ended repeats its last row.
    most = max(map(len, rows))
    inputs = np.stack([x[np.minimum(np.arange(most), len(x) - 1)] for x in rows])
    stress = np.zeros((len(rows), most + 1))  # the first column is before the start
    places = [earlier(r, lag_s) for r in recordings]
    index = np.stack([_padded(i, most) for i, _ in places])
    weight = np.stack([_padded(w, most) for _, w in places])
    every = np.arange(len(rows))
    for i in range(most):
        j, w = index[:, i] + 1, weight[:, i]
        past = (1 - w) * stress[every, j] + w * stress[every, np.minimum(j + 1, i)]
        stress[:, i + 1] = network.predict(np.column_stack([inputs[:, i], past]))
    return [row[1 : len(x) + 1] for row, x in zip(stress, rows, strict=True)]


def _padded(values: np.ndarray, most: int) -> np.ndarray:
    return np.concatenate([values, np.repeat(values[-1:], most - len(values))])
