"""A loading curve, turned upright and put in order; strain and stress from loads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, InputError
from softnn.recording import Recording

Indices = NDArray[np.intp]


def stress_strain(recording: Recording) -> Recording:
    """Engineering strain and stress from elongation, load and geometry (step 8)."""
    if recording.force_N is None or recording.elongation_mm is None:
        lacking = "force_N" if recording.force_N is None else "elongation_mm"
        raise InputError(
            f"no {lacking}; load and elongation are needed for stress and strain",
            file=recording.source or recording.name or None,
        )
    length, area = recording.geometry.length_mm, recording.geometry.area
    if length is None or area is None:
        lacking = "length_mm" if length is None else "area (or width and thickness)"
        raise InputError(
            f"geometry has no {lacking}; give it to turn load and elongation "
            "into stress and strain",
            file=recording.source or recording.name or None,
        )
    return recording.with_step(
        "stress_strain",
        {"length_mm": length, "area_mm2": area},
        strain=recording.elongation_mm / length,
        stress_MPa=recording.force_N / area,
    )


def resample(recording: Recording, samples: int) -> Recording:
    """`samples` points at equal strain steps; a strain that turns back is skipped."""
    if samples < 2:
        raise InputError(f"samples is {samples}; at least 2 are needed")
    sign = sign_of(recording)
    x = sign * recording.strain
    forward = forward_samples(x)
    grid = np.linspace(x[forward[0]], x[forward[-1]], samples)
    columns = {
        name: _between(grid, x[forward], values[forward])
        for name, values in recording.columns.items()
        if name != "strain"
    }
    return recording.with_step(
        "resample", {"samples": samples}, strain=sign * grid, **columns
    )


def _between(at: Array, x: Array, y: Array) -> Array:
    """`np.interp(at, x, y)` within the range of `x`, the same on every processor.

    `np.interp` is compiled code, and some compilers fuse a product with a sum.
    """
    before = np.searchsorted(x, at, side="right") - 1
    after = np.minimum(before + 1, len(x) - 1)
    step = np.where(after > before, x[after] - x[before], 1.0)
    between = (y[after] - y[before]) / step * (at - x[before]) + y[before]
    return np.where(at == x[before], y[before], between)


def complete(recording: Recording) -> Recording:
    """Without samples that lack strain or stress."""
    whole = ~(np.isnan(recording.strain) | np.isnan(recording.stress_MPa))
    if whole.all():
        return recording
    if whole.sum() < 2:
        raise InputError(
            "fewer than two samples have both strain and stress",
            file=recording.source or recording.name or None,
        )
    removed = {"removed": int((~whole).sum())}
    return recording.take(whole).with_step("drop_missing", removed)


def sign_of(recording: Recording) -> float:
    """-1 for a recording whose largest stress is compressive, else 1."""
    y = recording.stress_MPa
    return -1.0 if -np.nanmin(y) > np.nanmax(y) else 1.0


def upright(recording: Recording) -> tuple[Array, Array]:
    """Strain and stress with the main direction of loading positive."""
    sign = sign_of(recording)
    return sign * recording.strain, sign * recording.stress_MPa


def forward_samples(x: Array) -> Indices:
    """Samples at which `x` goes beyond all earlier ones."""
    before = np.concatenate([[-np.inf], np.maximum.accumulate(x)[:-1]])
    forward = np.flatnonzero(x > before)
    if forward.size < 2:
        raise InputError("the strain never grows; a loading curve is needed")
    return forward


def rising(recording: Recording) -> tuple[Array, Array, Array]:
    """Strain (growing), stress and time from its start, of a loading curve."""
    x, y = upright(recording)
    forward = forward_samples(x)
    time = recording.time_s[forward] - recording.time_s[forward[0]]
    return x[forward], y[forward], time
