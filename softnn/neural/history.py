"""The past as input of a network: largest strain, filtered strain, own stress."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Array
from softnn.recording import Recording


def largest(recording: Recording) -> Array:
    """Return the largest size of strain so far (n,); missing strains are skipped."""
    size = np.nan_to_num(np.abs(recording.strain), nan=0.0)
    return np.maximum.accumulate(size)


def filtered(recording: Recording, time_s: float) -> Array:
    r"""Strain (n,) behind a first-order low-pass filter of time constant `time_s`.

    .. math:: T \dot y = \varepsilon - y, \quad y = 0 \text{ before the first sample}

    Exact for strain that is straight between samples; the first strain is reached in
    a step. So :math:`\varepsilon - y` is the strain of the spring of a Maxwell branch.

    >>> time = np.linspace(0, 4, 5)
    >>> held = Recording(time, np.ones(5), np.ones(5))
    >>> bool(np.allclose(filtered(held, 2.0), 1 - np.exp(-time / 2)))
    True
    """
    known = np.isfinite(recording.strain)
    time, index = np.unique(recording.time_s[known], return_index=True)
    strain = recording.strain[known][index]
    step = np.diff(time)
    decay = np.exp(-step / time_s)
    # Response to a ramp over the step, as a share of its rise.
    behind = -np.expm1(-step / time_s) * time_s / step
    value, out = 0.0, [0.0] * len(time)
    seen = strain.tolist()  # plain numbers: ten times faster than those of NumPy
    for i, (kept, share) in enumerate(
        zip(decay.tolist(), behind.tolist(), strict=True), 1
    ):
        before, now = seen[i - 1], seen[i]
        value = now - (before - value) * kept - (now - before) * share
        out[i] = value
    return np.interp(recording.time_s, time, out) if len(time) else recording.strain


def earlier(recording: Recording, lag_s: float | None) -> tuple[np.ndarray, Array]:
    """Return where the stress of a lag ago is: an index (n,) and a weight (n,).

    It lies `weight` of the way from sample `index` to the next one. An index of -1 is
    before the recording, where there is no stress. It is one sample ago or earlier, so
    it is known when the stress of a sample is computed.
    """
    count = len(recording)
    last = np.arange(count) - 1
    if lag_s is None:
        return last, np.zeros(count)
    time = recording.time_s
    asked = time - lag_s
    index = np.minimum(np.searchsorted(time, asked, side="right") - 1, last)
    begin = time[np.maximum(index, 0)]
    step = time[np.minimum(index + 1, count - 1)] - begin
    inside = (index >= 0) & (index < last) & (step > 0)
    weight = np.where(inside, (asked - begin) / np.where(step > 0, step, 1.0), 0.0)
    return index, weight


def at_lag(stress: Array, index: np.ndarray, weight: Array) -> Array:
    """Return the stress (n,) a lag ago, by index and weight of `earlier`."""
    padded = np.concatenate([[0.0], stress])
    before, after = padded[index + 1], padded[np.minimum(index + 2, len(stress))]
    return np.where(weight > 0, (1 - weight) * before + weight * after, before)
