r"""Recording -> numbers: elastic properties and relaxation (thesis 4.3.1.2, 4.3.2).

Loading curves are taken as `prepare.specimen` leaves them, relaxation tests raw. A
property that a curve does not have (no yield on a curve that only stiffens) is NaN.
Values come as magnitudes: compression gives positive moduli and stresses too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn import prepare
from softnn.contracts import Array, InputError
from softnn.recording import Recording

OFFSET = 0.2  # strain offset of the yield strength (thesis 4.3.1.2)
BEND = 0.03  # of a straight range: rms bend over its rise in stress; R2 about 0.99
Indices = NDArray[np.intp]
NAN = float("nan")
Range = tuple[float, float]


@dataclass(frozen=True)
class Elastic:
    """Properties of one loading curve; the ranges are those of the two regressions."""

    E_small_MPa: float
    E_large_MPa: float
    yield_stress_MPa: float
    yield_strain: float
    intercept_MPa: float  # of the line of E_small, at zero strain
    small: Range
    large: Range


def ultimate(recording: Recording) -> tuple[float, float]:
    """Largest stress [MPa] and last strain [-] of a specimen cut at failure."""
    return (
        float(np.nanmax(np.abs(recording.stress_MPa))),
        float(np.nanmax(np.abs(recording.strain))),
    )


def elastic(
    recording: Recording, offset: float = OFFSET, bend: float = BEND
) -> Elastic:
    r"""Return moduli and offset yield of a loading curve, with ranges found by rule.

    A range is straight while its bend, root mean square, is at most `bend` of its rise
    in stress (0.03 corresponds to R2 = 0.99). The bend is that of a fitted cubic; a
    bend within three standard errors of the noise counts as zero.

    `E_small` is the slope of the longest straight range from zero strain. The offset
    line is parallel to it, `offset` of strain further on; the curve yields at its
    intersection with that line. `E_large` is the slope of the widest straight range
    beyond the yield point, or beyond the first range of a curve that does not yield.

    >>> e = np.linspace(0, 2, 1001)
    >>> bilinear = np.where(e < 0.4, 5 * e, 2 + (e - 0.4))
    >>> p = elastic(Recording(e, e, bilinear), bend=1e-6)
    >>> round(p.E_small_MPa, 3), round(p.E_large_MPa, 3), round(p.yield_strain, 3)
    (5.0, 1.0, 0.65)
    """
    if not (bend > 0 and offset > 0):
        raise InputError(f"bend is {bend}, offset {offset}; both must be above 0")
    x, y, _ = prepare.rising(recording)
    if len(x) < 10:
        raise InputError(
            f"{len(x)} samples of growing strain; at least 10 are needed",
            file=recording.source or recording.name or None,
        )
    end = _first_range(x, y, bend, prepare.noise_of(recording))
    slope, intercept = _line(x[:end], y[:end])
    above = y - (intercept + slope * (x - offset))
    met = np.flatnonzero((above <= 0) & (x > x[0] + offset))
    yield_strain, yield_stress, begin = NAN, NAN, end - 1
    if met.size and met[0] > 0:
        i = int(met[0])
        part = above[i - 1] / (above[i - 1] - above[i]) if above[i - 1] > 0 else 0.0
        yield_strain = float(x[i - 1] + part * (x[i] - x[i - 1]))
        yield_stress = float(np.interp(yield_strain, x, y))
        begin = i
    large = _widest_range(x[begin:], y[begin:], bend)
    return Elastic(
        E_small_MPa=slope,
        E_large_MPa=large[0],
        yield_stress_MPa=yield_stress,
        yield_strain=yield_strain,
        intercept_MPa=intercept,
        small=(float(x[0]), float(x[end - 1])),
        large=large[1],
    )


def _line(x: Array, y: Array) -> tuple[float, float]:
    slope, intercept = np.polynomial.Polynomial.fit(x, y, 1).convert().coef[::-1]
    return float(slope), float(intercept)


def _first_range(x: Array, y: Array, bend: float, noise: float) -> int:
    """Return the number of samples of the first straight range, by a fitted cubic.

    All ranges from the first sample are fitted at once: running sums give the parts of
    y along the square and the cube of x, orthogonal to the lower powers. The cube
    detects a curve that softens and then stiffens, and a knee on a long line.
    """
    n = np.arange(1, len(x) + 1)
    u = (x - x[0]) / (x[-1] - x[0])
    s = [np.cumsum(u**k) for k in range(7)]
    t = [np.cumsum(u**k * y) for k in range(4)]

    def centred(i: int, j: int) -> Array:
        return s[i + j] - s[i] * s[j] / n

    y1, y2, y3 = (t[k] - s[k] * t[0] / n for k in (1, 2, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = centred(1, 2) / centred(1, 1), centred(1, 3) / centred(1, 1)
        square = centred(2, 2) - a * centred(1, 2)
        y2, y3 = y2 - a * y1, y3 - b * y1
        both = centred(2, 3) - a * centred(1, 3)
        cube = centred(3, 3) - b * centred(1, 3) - both**2 / square
        y3 = y3 - both / square * y2
        bent = np.sqrt((y2**2 / square + y3**2 / cube) / n)
        rise = np.abs(y1 / centred(1, 1) * u)
    # A crosshead that starts shakes the load: the first samples may be noisier.
    doubt = 3 * max(noise, prepare.white_noise(y[:32])) / np.sqrt(n)
    straight = np.flatnonzero(bent <= np.maximum(bend * rise, doubt))
    straight = straight[straight >= 5]
    if not straight.size:
        return len(x)
    # A break holds on until the range is half as long again; a shorter one is noise.
    broken = np.flatnonzero(u[straight[1:]] > 1.5 * u[straight[:-1]])
    return int(straight[broken[0] if broken.size else -1]) + 1


def _widest_range(
    x: Array, y: Array, bend: float, points: int = 160
) -> tuple[float, Range]:
    """Slope and ends of the widest straight range, at least a quarter of all; or NaN.

    On means over equal strain steps, so that noise counts less than the curve. A flat
    plateau has no such range: its bend is as large as its rise.
    """
    if len(x) < 10:
        return NAN, (NAN, NAN)
    edges = np.linspace(x[0], x[-1], min(points, len(x) // 2) + 1)
    starts = np.searchsorted(x, edges[:-1])
    starts = np.unique(starts)
    counts = np.diff(np.append(starts, len(x)))
    x, y = (np.add.reduceat(v, starts) / counts for v in (x, y))
    i, j = np.triu_indices(len(x) + 1, 3)  # ranges x[i:j] of three points and more
    sums = [np.concatenate([[0.0], np.cumsum(v)]) for v in (x, y, x * x, x * y, y * y)]
    n = j - i
    sx, sy, sxx, sxy, syy = (s[j] - s[i] for s in sums)
    sxx, sxy, syy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    slope = sxy / sxx
    width = x[j - 1] - x[i]
    rms = np.sqrt(np.maximum(syy - slope * sxy, 0) / n)
    share = rms / np.maximum(np.abs(slope) * width, np.finfo(float).tiny)
    straight = share <= bend
    best = int(np.where(straight, width, 0).argmax())
    if not straight[best] or width[best] < 0.25 * (x[-1] - x[0]):
        return NAN, (NAN, NAN)
    return float(slope[best]), (float(x[i[best]]), float(x[j[best] - 1]))


# --- several specimens ---------------------------------------------------------------


@dataclass(frozen=True)
class Estimate:
    """A value and the 95 % interval of its bootstrap; NaN where there is none."""

    value: float
    low: float = NAN
    high: float = NAN


@dataclass(frozen=True)
class Properties:
    """Table 4.2 for the specimens of one material at one strain rate.

    `values` holds, under the names of the published table, the median and the mean of
    the specimens' ultimate values, and yield and moduli of their mean curve.
    """

    material: str
    rate_per_s: float | None
    specimens: int
    values: dict[str, Estimate]
    curve: Elastic
    mean: Recording


def tensile(
    specimens: Sequence[Recording],
    rng: np.random.Generator,
    resamples: int = 200,
    bend: float = BEND,
) -> list[Properties]:
    """Properties per material and strain rate of prepared specimens pulled to failure.

    Intervals: percentile bootstrap over specimens, drawn with replacement `resamples`
    times. They are too narrow for a handful of specimens, as every bootstrap is, and
    NaN for a single one.
    """
    return [
        _properties(group, rng, resamples, bend)
        for group in prepare.by_group(specimens, "specimens")
    ]


def _properties(
    group: Sequence[Recording], rng: np.random.Generator, resamples: int, bend: float
) -> Properties:
    (mean,) = prepare.unify(group)
    stress, strain = np.array([ultimate(r) for r in group]).T
    curve = elastic(mean, bend=bend)

    def of_curve(drawn: Indices) -> Array:
        (again,) = prepare.unify([group[i] for i in drawn], samples=1000)
        return _of_curve(elastic(again, bend=bend))

    values = {}
    for name, v in (("ultimate_stress", stress), ("ultimate_strain", strain)):
        for statistic in (np.median, np.mean):
            low, high = bootstrap(len(v), _statistic(statistic, v), rng, 10 * resamples)
            values[f"{name}_{statistic.__name__}"] = Estimate(
                float(statistic(v)), float(low), float(high)
            )
    intervals = bootstrap(len(group), of_curve, rng, resamples)
    for name, value, low, high in zip(
        OF_CURVE, _of_curve(curve), *intervals, strict=True
    ):
        values[name] = Estimate(float(value), float(low), float(high))
    first = group[0]
    return Properties(first.material, first.rate_per_s, len(group), values, curve, mean)


def _statistic(function: Callable[..., Any], values: Array) -> Callable[..., Any]:
    return lambda drawn: function(values[drawn])


OF_CURVE = ("yield_stress", "yield_strain", "E_small", "E_large")


def _of_curve(p: Elastic) -> Array:
    return np.array([p.yield_stress_MPa, p.yield_strain, p.E_small_MPa, p.E_large_MPa])


def bootstrap(
    number: int,
    statistic: Callable[[Indices], Any],
    rng: np.random.Generator,
    resamples: int = 2000,
    confidence: float = 0.95,
) -> Array:
    """Percentile interval (2, ...) of `statistic(drawn)`, `drawn` indexing specimens.

    NaN for fewer than two specimens: they do not tell how they scatter.
    """
    if number < 2:
        return np.full((2, *np.shape(statistic(np.zeros(number, dtype=int)))), np.nan)
    draws = rng.integers(number, size=(resamples, number))
    values = np.array([statistic(drawn) for drawn in draws], dtype=float)
    tail = (1 - confidence) / 2
    # A property that not every draw has is given by the draws that have it.
    some = ~np.isnan(values).all(axis=0)
    interval = np.full((2, *values.shape[1:]), np.nan)
    interval[:, some] = np.nanquantile(values[:, some], [tail, 1 - tail], axis=0)
    return interval


# --- stress relaxation ---------------------------------------------------------------


@dataclass(frozen=True)
class Relaxation:
    """Start and end of one hold, and what went in between.

    `relaxed_percent` is S.R. of eq. 4.1. `time_s` is when the part that decays,
    ``stress_start - stress_end``, is down to 1/e: one relaxation time, if there is one.
    """

    stress_start_MPa: float
    stress_end_MPa: float
    relaxed_percent: float
    time_s: float
    strain: float
    hold_s: float


def relaxation(recording: Recording) -> Relaxation:
    """Stress relaxation in the first hold of a raw recording that follows a loading.

    The start is the largest stress where loading passes into the hold, by the median of
    three samples; the end is the median of the last 1 % of the time held.
    """
    parts = prepare.segments(recording)
    sign = prepare.sign_of(recording)
    found = [
        (a, b) for a, b in pairwise(parts) if (a.kind, b.kind) == ("loading", "hold")
    ]
    if not found:
        kinds = ", ".join(s.kind for s in parts[:6])
        raise InputError(
            f"no hold after a loading; the recording has: {kinds}",
            file=recording.source or recording.name or None,
        )
    ramp, hold = found[0]
    hold = _whole_hold(recording, hold, parts[parts.index(hold) + 1 :])
    y = sign * recording.stress_MPa
    top = ramp.start + int(np.nanargmax(y[ramp.start : hold.stop]))
    start = float(np.nanmedian(y[max(top - 1, 0) : top + 2]))
    time, y = recording.time_s[top : hold.stop], y[top : hold.stop]
    held = float(time[-1] - time[0])
    end = float(np.nanmedian(y[time >= time[-1] - 0.01 * held]))
    return Relaxation(
        stress_start_MPa=start,
        stress_end_MPa=end,
        relaxed_percent=relaxed(start, end),
        time_s=_decay_time(time - time[0], y, end + (start - end) / np.exp(1)),
        strain=float(np.median(np.abs(recording.strain[hold.start : hold.stop]))),
        hold_s=held,
    )


def _whole_hold(
    recording: Recording, hold: prepare.Segment, after: Sequence[prepare.Segment]
) -> prepare.Segment:
    """The hold with later ones at the same strain that follow all but at once.

    A noisy strain reads as a hold in pieces. The same strain is within 2 % of the
    range; at once is within 5 % of the time held.
    """
    time, strain = recording.time_s, recording.strain
    level = np.median(strain[hold.start : hold.stop])
    for part in after:
        if part.kind != "hold":
            continue
        apart = abs(np.median(strain[part.start : part.stop]) - level)
        gap = time[part.start] - time[hold.stop - 1]
        held = time[part.stop - 1] - time[hold.start]
        if apart > 0.02 * np.ptp(strain) or gap > 0.05 * held:
            break
        hold = replace(hold, stop=part.stop)
    return hold


def relaxed(start: float, end: float) -> float:
    r"""S.R. in per cent, :math:`100\,(\sigma_o - \sigma_{end}) / \sigma_o` (eq. 4.1).

    >>> round(relaxed(1.22, 0.80), 1)
    34.4
    """
    return 100 * (start - end) / start


def _decay_time(time: Array, y: Array, level: float) -> float:
    """When `y` passes `level`: between the first sample below and the last above it."""
    below = np.flatnonzero(y < level)
    if not below.size or below[0] == 0:
        return NAN
    above = np.flatnonzero(y >= level)
    first, last = int(below[0]), int(above[-1])
    if first == last + 1:  # once, by interpolation
        part = (y[last] - level) / (y[last] - y[first])
        return float(time[last] + part * (time[first] - time[last]))
    return float(np.sqrt(time[first] * time[last]))


def relaxations(
    recordings: Sequence[Recording],
) -> list[tuple[list[Recording], list[Relaxation]]]:
    """Relaxation tests of one material, strain (5 %) and time held (10 %), together."""
    groups: list[tuple[list[Recording], list[Relaxation]]] = []
    for recording in recordings:
        found = relaxation(recording)
        for others, results in groups:
            near = np.isclose(found.strain, results[0].strain, rtol=0.05)
            long = np.isclose(found.hold_s, results[0].hold_s, rtol=0.1)
            if near and long and prepare.alike(others[0], recording):
                others.append(recording)
                results.append(found)
                break
        else:
            groups.append(([recording], [found]))
    return groups
