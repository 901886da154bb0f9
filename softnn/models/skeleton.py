"""The elastic curve behind samples, and the slopes of its segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from softnn.contracts import Array, InputError


@dataclass(frozen=True)
class Skeleton:
    """One stress for each strain, away from zero: strain (m,) rising, weights (m,).

    `side` is -1 for compression: strain and stress are then those with their sign
    turned, so that everything that follows sees tension.
    """

    strain: Array
    stress: Array
    weight: Array
    side: float


def skeleton(strain: Array, stress: Array, points: int = 400) -> Skeleton:
    """The elastic curve behind samples of strain and stress in any order.

    Samples that rise in strain throughout are the curve themselves; others (several
    specimens, unloading, a hold) are averaged over `points` equal steps of strain.
    Samples without a stress, and those on the far side of zero, are left out.
    """
    keep = np.isfinite(stress)
    strain, stress = strain[keep], stress[keep]
    if not strain.size:
        raise InputError("no sample with a stress; a curve to fit is needed")
    side = 1.0 if strain.max() >= -strain.min() else -1.0
    strain, stress = side * strain, side * stress
    strain, stress = strain[strain >= 0], stress[strain >= 0]
    if strain.size < 2 or not strain.max() > 0:
        raise InputError("strain never leaves zero; a curve to fit is needed")
    if (np.diff(strain) > 0).all():
        return Skeleton(strain, stress, np.ones_like(strain), side)
    points = min(points, max(strain.size // 3, 2))
    bins = np.minimum((strain / strain.max() * points).astype(int), points - 1)
    _, index, counts = np.unique(bins, return_inverse=True, return_counts=True)
    means = [np.bincount(index, weights=v) / counts for v in (strain, stress)]
    return Skeleton(means[0], means[1], counts.astype(float), side)


def segment_slopes(curve: Skeleton, knots: Array) -> Array:
    """Slope (m,) of a linear regression within each segment, ends included.

    The thesis's method. Segments are fitted independently, so the curve joined from
    their slopes may drift away from the data.
    """
    x, y, w = curve.strain, curve.stress, curve.weight
    # Centred, so that the running sums lose few digits to cancellation.
    x, y = x - x.mean(), y - y.mean()
    sums = [
        np.concatenate([[0.0], np.cumsum(v)])
        for v in (w, w * x, w * y, w * x * x, w * x * y)
    ]
    first = np.searchsorted(curve.strain, knots, side="left")
    last = np.append(np.searchsorted(curve.strain, knots[1:], side="right"), len(x))
    s, sx, sy, sxx, sxy = (v[last] - v[first] for v in sums)
    spread = s * sxx - sx * sx
    if not (last - first >= 2).all():
        raise InputError("a segment with fewer than two samples; use fewer segments")
    return (s * sxy - sx * sy) / spread


def joint_slopes(curve: Skeleton, knots: Array) -> Array:
    """Slope (m,) of each segment of the continuous curve nearest to all samples.

    Least squares for the stress at each knot, which is tridiagonal; zero at zero.
    """
    vertices = np.append(knots, max(curve.strain[-1], np.nextafter(knots[-1], np.inf)))
    width = np.diff(vertices)
    place = np.clip(
        np.searchsorted(vertices, curve.strain, "right") - 1, 0, len(knots) - 1
    )
    share = (curve.strain - vertices[place]) / width[place]  # of the vertex above
    w, y = curve.weight, curve.stress
    m = len(vertices)

    def gather(index: NDArray[np.intp], weights: Array) -> Array:
        return np.bincount(index, weights=weights, minlength=m).astype(float)

    diagonal = gather(place, w * (1 - share) ** 2) + gather(place + 1, w * share**2)
    beside = gather(place + 1, w * share * (1 - share))
    right = gather(place, w * y * (1 - share)) + gather(place + 1, w * y * share)
    if not (diagonal[1:] > 0).all():
        raise InputError("a segment without a sample; use fewer segments")
    height = np.zeros(m)
    if m == 2:  # LAPACK knows no tridiagonal matrix of one number
        height[1:] = right[1:] / diagonal[1:]
    else:
        height[1:] = solveh_banded(np.stack([beside[1:], diagonal[1:]]), right[1:])
    return np.diff(height) / width
