"""Input architectures: those of the thesis (Table 6.3), and those it suggests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from softnn.contracts import Array, InputError
from softnn.neural.convex import ConvexNetwork
from softnn.neural.history import at_lag, earlier, filtered, largest
from softnn.neural.network import (
    BoundedNetwork,
    Network,
    RadialNetwork,
    RecurrentNetwork,
)
from softnn.recording import Recording


@dataclass(frozen=True)
class Architecture:
    """The inputs of a network, in the order in which they stand in a row.

    They are: strain at each of `lags` (in units of the lag time), the strain rate, the
    largest strain so far, strain behind filters of `filters` lag times, strain of the
    springs of Maxwell branches of `branches` lag times, the stress of one lag ago.

    `radial`: Gaussian units in place of tanh. `recurrent`: gated units, which run from
    sample to sample. `bounded`: see `BoundedNetwork`. `convex`: see `ConvexNetwork`,
    whose units need the time beside the strain.
    """

    lags: tuple[int, ...]
    rate: bool = False
    largest: bool = False
    filters: tuple[int, ...] = ()
    branches: tuple[int, ...] = ()
    feedback: bool = False
    radial: bool = False
    recurrent: bool = False
    bounded: bool = False
    convex: bool = False

    @property
    def width(self) -> int:
        """Number of inputs."""
        past = len(self.filters) + len(self.branches) + self.feedback
        return len(self.lags) + self.rate + self.largest + past + self.convex

    @property
    def names(self) -> tuple[str, ...]:
        """The inputs, by name."""
        names = [f"strain[t-{lag}]" if lag else "strain" for lag in self.lags]
        names += ["strain_rate_per_s"] * self.rate + ["largest_strain"] * self.largest
        names += [f"strain_filtered[{times}]" for times in self.filters]
        names += [f"strain_of_branch[{times}]" for times in self.branches]
        names += ["time_s"] * self.convex
        return (*names, *["stress_MPa[t-1]"] * self.feedback)

    @property
    def lagged(self) -> bool:
        """Whether the lag time matters for every recording."""
        return len(self.lags) > 1 or bool(self.filters + self.branches) or self.feedback

    @property
    def network(self) -> type[Network]:
        """The class of a network with these inputs."""
        if self.radial:
            return RadialNetwork
        if self.recurrent:
            return RecurrentNetwork
        if self.convex:
            return ConvexNetwork
        return BoundedNetwork if self.bounded else Network


PUBLISHED = ("FFRI1", "FFRI2", "FFRI3", "FFRD4")  # Table 6.3
ARCHITECTURES = {
    "FFRI1": Architecture(lags=(0,)),
    "FFRI2": Architecture(lags=(0, 1)),
    "FFRI3": Architecture(lags=(0, 1, 2)),
    "FFRD4": Architecture(lags=(0,), rate=True),
    "FFRD4S": Architecture(lags=(0,), rate=True, feedback=True),  # section 6.4.1
    "FFH4": Architecture(lags=(0,), largest=True, filters=(1, 10)),  # section 8.3
    "RBF": Architecture(lags=(0,), rate=True, radial=True),  # section 8.3
    "GRU": Architecture(lags=(0,), rate=True, recurrent=True),
}
# Made for histories, so not among those that are compared on tensile tests.
HISTORIES = {
    "FFH7": Architecture(
        lags=(0,), largest=True, branches=(1, 10, 100, 1000, 10_000), bounded=True
    ),
    # For rates never seen; fitted by `softnn.neural.convex`, not by epochs.
    "CONVEX": Architecture(lags=(0,), convex=True),
}
FILTER_S = 1.0  # shortest filter where no lag is given: tests last 5 s to minutes


@dataclass(frozen=True)
class Samples:
    """A training set: inputs (n, d), target stress (n,) in MPa, and their recordings.

    `recording` (n,) is an index into the recordings, `position` (n,) one into the
    samples of that recording; `names` (d,) are the columns. `lag_s` is the lag time, or
    None if each recording's own step was used.
    """

    inputs: Array
    target: Array
    recording: np.ndarray
    position: np.ndarray
    names: tuple[str, ...]
    lag_s: float | None = None

    def take(self, index: np.ndarray) -> Samples:
        """The rows at `index`."""
        rows = {
            name: getattr(self, name)[index]
            for name in ("inputs", "target", "recording", "position")
        }
        return replace(self, **rows)


def samples(
    recordings: Sequence[Recording],
    architecture: str = "FFRD4",
    lag_s: float | None = None,
) -> Samples:
    """Return inputs and targets of every sample that has both strain and stress.

    The thesis counts lags in samples, so one network means different things at
    different sampling. Here a lag is a time, `lag_s` [s]: one sampling step of the
    recording by default (filters: `FILTER_S`). The strain rate [1/s] of a tensile test
    is the nominal one, as in the thesis; otherwise it is the backward difference over
    one lag. Before the first sample the specimen is at rest. Stress fed back is the
    measured stress, as a load cell would give it.
    """
    row = architecture_of(architecture)
    if lag_s is not None and not (np.isfinite(lag_s) and lag_s > 0):
        raise InputError(f"lag is {lag_s} s; it must be above 0")
    if not recordings:
        raise InputError("no recordings; at least one is needed")
    blocks, targets, owners, positions = [], [], [], []
    for i, recording in enumerate(recordings):
        inputs = columns(recording, architecture, lag_s)
        if row.feedback:
            past = at_lag(recording.stress_MPa, *earlier(recording, lag_s))
            inputs = np.column_stack([inputs, past])
        keep = np.isfinite(inputs).all(axis=1) & np.isfinite(recording.stress_MPa)
        blocks.append(inputs[keep])
        targets.append(recording.stress_MPa[keep])
        owners.append(np.full(int(keep.sum()), i))
        positions.append(np.flatnonzero(keep))
    return Samples(
        np.concatenate(blocks),
        np.concatenate(targets),
        np.concatenate(owners),
        np.concatenate(positions),
        row.names,
        lag_s,
    )


def architecture_of(name: str) -> Architecture:
    """Return the architecture of a name. Raises `InputError` for an unknown name."""
    every = ARCHITECTURES | HISTORIES
    if name not in every:
        raise InputError(f"architecture is {name!r}; allowed is {', '.join(every)}")
    return every[name]


def columns(
    recording: Recording, architecture: str, lag_s: float | None = None
) -> Array:
    """Return the inputs (n, d) that follow from the strain: all but fed-back stress."""
    row = architecture_of(architecture)
    found = [_lagged(recording, lag, lag_s) for lag in row.lags]
    if row.rate:
        found.append(strain_rate(recording, lag_s))
    if row.largest:
        found.append(largest(recording))
    unit = FILTER_S if lag_s is None else lag_s
    found += [filtered(recording, times * unit) for times in row.filters]
    found += [
        recording.strain - filtered(recording, times * unit) for times in row.branches
    ]
    if row.convex:
        found.append(recording.time_s)
    return np.column_stack(found)


def _lagged(recording: Recording, lag: int, lag_s: float | None) -> Array:
    strain = recording.strain
    if lag == 0:
        return strain
    if lag_s is None:
        return np.concatenate([np.repeat(strain[:1], lag), strain[:-lag]])[
            : len(strain)
        ]
    time, index = np.unique(recording.time_s, return_index=True)
    return np.interp(recording.time_s - lag * lag_s, time, strain[index])


def strain_rate(recording: Recording, lag_s: float | None = None) -> Array:
    """Strain rate (n,) in 1/s as networks get it: see `samples`."""
    if recording.test == "tensile" and recording.rate_per_s is not None:
        return np.full(len(recording), recording.rate_per_s)
    time, index = np.unique(recording.time_s, return_index=True)
    strain = recording.strain[index]
    if len(time) < 2:
        raise InputError(
            f"{recording.name!r} has one instant only; a strain rate needs two"
        )
    step = np.diff(time) if lag_s is None else np.full(len(time) - 1, lag_s)
    before = np.interp(time[1:] - step, time, strain)
    rate = (strain[1:] - before) / step
    rate = np.concatenate([rate[:1], rate])
    return rate[np.searchsorted(time, recording.time_s)]
