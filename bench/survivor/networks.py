"""What the network of histories stands beside: other networks on the same data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from bench.survivor.data import VIRTUAL
from softnn.contracts import Array, Chunk
from softnn.neural import PUBLISHED, Seen, StoredNetwork, fit_samples, run, samples
from softnn.neural.inputs import columns
from softnn.neural.radial import train_radial
from softnn.neural.recurrent import train_recurrent
from softnn.neural.training import BAYESIAN
from softnn.recording import Recording
from softnn.study.material_data import prepared
from softnn.study.realtime_inputs import networks
from softnn.study.settings import Settings
from softnn.taught import INPUTS

Predict = Callable[[Sequence[Recording]], list[Array]]


@dataclass(frozen=True)
class Size:
    """How much is spent on each network."""

    neurons: int = 12
    starts: int = 2
    simulated: int = 120
    units: int = 8  # of the recurrent network
    gaussians: int = 40
    epochs: int = 150
    even: int = 250  # steps of the longest history, of the recurrent network
    samples: int = 400  # of a recording
    specimens: int = 17  # virtual ones, learned from: as many as in Table 4.1
    steps: int = 10**6  # of C


SMALL = Size(4, 1, 6, 2, 6, 3, 40, 60, 2, 10_000)


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
        (one,) = fit_samples(
            rows,
            name,
            neurons=[size.neurons],
            train_mask=np.ones((1, len(rows.target)), bool),
            seeds=[seed],
            threads=1,
        )
        out[name] = partial(run, one.network, name)
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
