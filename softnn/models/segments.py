"""Where a stress-strain curve is cut into segments: three criteria.

Each criterion takes strain (n,), rising from zero or above, and stress (n,) [MPa]. It
returns the strains (m,) at which segments start, in rising order. The first is zero;
each of the others is the strain of a sample.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from softnn.contracts import Array, InputError

Knots = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Tolerance:
    """A new segment where the slope has changed by more than a fraction of it.

    The thesis's criterion (Fig. 5.7) compares the slope between samples with the slope
    at the start of the segment. Where they differ by more than `fraction` of the
    latter, a new segment starts, and its slope becomes the reference. A segment of
    zero slope ends at the next change.

    >>> strain = np.arange(6.0)
    >>> Tolerance(0.4)(strain, np.array([0, 2, 4, 5, 6, 7.0]))
    array([0., 2.])
    """

    fraction: float

    def __post_init__(self) -> None:
        if not self.fraction > 0:
            raise InputError(f"tolerance is {self.fraction}; allowed is above 0")

    def __call__(self, strain: Array, stress: Array) -> Array:
        slopes = (np.diff(stress) / np.diff(strain)).tolist()
        starts, reference = [0], slopes[0]
        for i, slope in enumerate(slopes):
            if abs(slope - reference) > self.fraction * abs(reference):
                starts.append(i)
                reference = slope
        knots = strain[starts]
        knots[0] = 0.0
        return knots

    def __str__(self) -> str:
        return f"tolerance {100 * self.fraction:.0f} %"


@dataclass(frozen=True)
class Equal:
    """Segments of equal width, each start moved to the nearest sample."""

    segments: int

    def __call__(self, strain: Array, stress: Array) -> Array:
        _check(self.segments, strain)
        wanted = np.linspace(0, strain[-1], self.segments, endpoint=False)[1:]
        after = np.clip(np.searchsorted(strain, wanted), 1, len(strain) - 1)
        left = wanted - strain[after - 1] < strain[after] - wanted
        starts = np.unique(after - left)
        # Leave a step at either end, as every segment needs two samples.
        starts = starts[(starts > 0) & (starts < len(strain) - 1)]
        return np.concatenate([[0.0], strain[starts]])

    def __str__(self) -> str:
        return f"{self.segments} equal segments"


@dataclass(frozen=True)
class Optimal:
    """The segments of least squared error about a straight line in each.

    Dynamic programming over all ways to cut (Bellman and Roth 1969,
    doi:10.1080/01621459.1969.10501038). Neighbours share the sample between them;
    cuts are sought at `candidates` samples, spread evenly, if the curve has more.
    No other cut at these samples, into as many segments, has a smaller error.
    """

    segments: int
    candidates: int = 250

    def __call__(self, strain: Array, stress: Array) -> Array:
        _check(self.segments, strain)
        n = len(strain)
        at = np.unique(np.linspace(0, n - 1, min(n, self.candidates)).round())
        at = at.astype(int)
        cost = line_errors(strain, stress, at)
        best = cost[0].copy()  # of one segment from the start to each candidate
        back = []
        for _ in range(1, min(self.segments, len(at) - 1)):
            total = best[:, None] + cost
            back.append(np.argmin(total, axis=0))
            best = total[back[-1], np.arange(len(at))]
        end, starts = len(at) - 1, []
        for choice in reversed(back):
            end = choice[end]
            starts.append(at[end])
        return np.concatenate([[0.0], strain[starts[::-1]]])

    def __str__(self) -> str:
        return f"{self.segments} optimal segments"


def line_errors(strain: Array, stress: Array, at: Array) -> Array:
    """Squared error (c, c) of a regression line from sample at[i] to at[j], ends in.

    Infinite where j <= i. From running sums, about the middle of the curve.
    """
    x, y = strain - strain.mean(), stress - stress.mean()
    sums = [
        np.concatenate([[0.0], np.cumsum(v)])
        for v in (np.ones_like(x), x, y, x * x, x * y, y * y)
    ]
    s, sx, sy, sxx, sxy, syy = (v[at + 1][None, :] - v[at][:, None] for v in sums)
    later = np.arange(len(at))[None, :] > np.arange(len(at))[:, None]
    s = np.where(later, s, 1.0)
    spread = np.where(later, sxx - sx * sx / s, 1.0)
    error = syy - sy * sy / s - (sxy - sx * sy / s) ** 2 / spread
    return np.where(later, np.maximum(error, 0.0), np.inf)


def _check(segments: int, strain: Array) -> None:
    if not 1 <= segments < len(strain):
        raise InputError(
            f"{segments} segments on {len(strain)} samples; "
            f"allowed is 1 to {len(strain) - 1}"
        )
