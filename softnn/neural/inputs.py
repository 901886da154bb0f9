"""Input architectures of the thesis (Table 6.3), as rows of a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softnn.contracts import Array, InputError
from softnn.recording import Recording


@dataclass(frozen=True)
class Architecture:
    """Strain at each of `lags` (in units of the lag time), and the strain rate."""

    lags: tuple[int, ...]
    rate: bool = False


ARCHITECTURES = {
    "FFRI1": Architecture(lags=(0,)),
    "FFRI2": Architecture(lags=(0, 1)),
    "FFRI3": Architecture(lags=(0, 1, 2)),
    "FFRD4": Architecture(lags=(0,), rate=True),
}


@dataclass(frozen=True)
class Samples:
    """A training set: inputs (n, d), target stress (n,) in MPa, and whose they are.

    `recording` (n,) is an index into the recordings; `names` (d,) are the columns.
    `lag_s` is the lag time, or None where each recording's own step was used.
    """

    inputs: Array
    target: Array
    recording: np.ndarray
    names: tuple[str, ...]
    lag_s: float | None = None


def samples(
    recordings: Sequence[Recording],
    architecture: str = "FFRD4",
    lag_s: float | None = None,
) -> Samples:
    """Inputs and targets of every sample that has both strain and stress.

    The thesis counts lags in samples, so that one network means different things at
    different sampling; here a lag is a time, `lag_s` [s], one sampling step of the
    recording by default. The strain rate [1/s] is the nominal one for a tensile test
    (the thesis's choice) and the backward difference over one lag otherwise; before
    the first sample the specimen is at rest.
    """
    if architecture not in ARCHITECTURES:
        raise InputError(
            f"architecture is {architecture!r}; allowed is {', '.join(ARCHITECTURES)}"
        )
    if lag_s is not None and not (np.isfinite(lag_s) and lag_s > 0):
        raise InputError(f"lag is {lag_s} s; it must be above 0")
    if not recordings:
        raise InputError("no recordings; at least one is needed")
    row = ARCHITECTURES[architecture]
    blocks, targets, owners = [], [], []
    for i, recording in enumerate(recordings):
        columns = [_lagged(recording, lag, lag_s) for lag in row.lags]
        if row.rate:
            columns.append(strain_rate(recording, lag_s))
        inputs = np.column_stack(columns)
        keep = np.isfinite(inputs).all(axis=1) & np.isfinite(recording.stress_MPa)
        blocks.append(inputs[keep])
        targets.append(recording.stress_MPa[keep])
        owners.append(np.full(int(keep.sum()), i))
    names = tuple(f"strain[t-{lag}]" if lag else "strain" for lag in row.lags)
    if row.rate:
        names += ("strain_rate_per_s",)
    return Samples(
        np.concatenate(blocks),
        np.concatenate(targets),
        np.concatenate(owners),
        names,
        lag_s,
    )


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
