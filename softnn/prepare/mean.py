"""Step 5: one curve from several specimens."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from softnn.contracts import Array, InputError
from softnn.prepare.curve import rising, sign_of
from softnn.prepare.smoothing import noise_of
from softnn.recording import Recording


def unify(
    recordings: Iterable[Recording], samples: int | None = None
) -> list[Recording]:
    r"""One mean recording per material, test and strain rate (step 5).

    On a common grid of strain from zero to the mean ultimate strain the *increments* of
    stress are averaged over the specimens still whole, and summed. Where all of them
    are, that is the plain mean; where the shorter ones have failed, the curve goes on
    without the jump a plain mean makes there (the thesis's Fig. 4.5).

    `samples` is the number of grid points, by default the median of the specimens'.
    Rates within 10 % of each other are one rate. Specimens are taken as prepared.
    """
    return [_mean(group, samples) for group in by_group(recordings, "test specimens")]


def by_group(recordings: Iterable[Recording], what: str = "") -> list[list[Recording]]:
    """Recordings of the same material, test and strain rate (within 10 %) together."""
    groups: list[list[Recording]] = []
    ordered = sorted(
        recordings, key=lambda r: (r.material, r.test, r.rate_per_s or 0.0)
    )
    for recording in ordered:
        if groups and alike(groups[-1][0], recording):
            groups[-1].append(recording)
        else:
            groups.append([recording])
    if not groups:
        raise InputError(f"no {what or 'recordings'}; at least one is needed")
    return groups


def alike(a: Recording, b: Recording) -> bool:
    """Same material and test, and strain rates within 10 % of each other."""
    low, high = sorted([a.rate_per_s or 0.0, b.rate_per_s or 0.0])
    return (a.material, a.test) == (b.material, b.test) and high <= 1.1 * low


def _mean(group: Sequence[Recording], samples: int | None) -> Recording:
    sign = sign_of(group[0])
    curves = [rising(r) for r in group]
    ends = np.array([x[-1] for x, _, _ in curves])
    if ends.mean() <= 0:
        raise InputError(
            f"the mean ultimate strain is {sign * ends.mean():.3g}, against the sense "
            "of the stress; prepare the specimens first"
        )
    number = samples or int(np.median([len(r) for r in group]))
    grid = np.linspace(0, ends.mean(), max(number, 2))
    stress, time = (_mean_curve(grid, [(c[0], c[i]) for c in curves]) for i in (1, 2))
    first = group[0]
    note = {
        "specimens": [r.name for r in group],
        "samples": len(grid),
        "ultimate_strain": [float(sign * e) for e in ends],
        "whole_at_the_end": int(np.sum(ends >= grid[-1] * (1 - 1e-12))),
        "noise_MPa": float(np.sqrt(np.mean([noise_of(r) ** 2 for r in group])))
        / np.sqrt(len(group)),
    }
    rate = "" if first.rate_per_s is None else f" {first.rate_per_s:.3g}/s"
    mean = Recording(
        np.maximum.accumulate(time),
        sign * grid,
        sign * stress,
        name=f"{first.material or first.name}{rate} mean",
        specimen=f"mean of {len(group)}",
        material=first.material,
        test=first.test,
        rate_per_s=first.rate_per_s,
        source=first.source,
    )
    return mean.with_step("unify", note)


def _mean_curve(grid: Array, curves: Sequence[tuple[Array, Array]]) -> Array:
    """Mean of the curves' increments over those that reach, summed from the start."""
    # An end that misses the grid by rounding is on the grid.
    rows = np.array(
        [
            np.where(grid <= x[-1] * (1 + 1e-9), np.interp(grid, x, v - v[0]), np.nan)
            for x, v in curves
        ]
    )
    start = np.mean([v[0] for _, v in curves])
    steps = np.nanmean(np.diff(rows, axis=1), axis=0)
    return start + np.concatenate([[0.0], np.cumsum(steps)])
