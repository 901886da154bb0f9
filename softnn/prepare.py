r"""Recording -> Recording: the eight preparation steps of thesis 4.3.1.1, and cycles.

Each step returns a changed copy whose log names the step, its arguments and what it
found. Strain and stress are what the steps change; load and elongation stay as the
machine wrote them (rows that are cut go from every channel). Both signs work:
compression is turned over, treated as tension and turned back.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from softnn.contracts import Array, InputError
from softnn.recording import Recording

Indices = NDArray[np.intp]


def specimen(recording: Recording, samples: int | None = None) -> Recording:
    """One specimen pulled to failure, ready for a model: steps 2, 4, 6 and 7.

    With `samples` the result has that many points at equal strain steps.

    >>> strain = np.linspace(0, 2, 401)
    >>> pulled = np.where(strain < 1.8, 3 * strain, 0.0)
    >>> ready = specimen(Recording(20 * strain, strain, pulled), samples=100)
    >>> len(ready), round(float(ready.strain[-1]), 2), [s.name for s in ready.log][:2]
    (100, 1.79, ['cut_failure', 'compensate_toe'])
    """
    ready = compensate_toe(cut_failure(_complete(recording)))
    ready = remove_negative_offset(smooth(ready))
    return ready if samples is None else resample(ready, samples)


# --- steps 1 and 8: load and elongation to stress and strain ---------------------


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


# --- step 2: failure --------------------------------------------------------------


def cut_failure(recording: Recording, drop: float = 0.2) -> Recording:
    r"""Leave out what follows failure.

    Failure is where |stress|, after its peak, falls for good by more than the fraction
    `drop` of the peak while the strain goes on, or at rest within 1 % of the time so
    far (a snap, or a machine that stops). A fall while the strain returns
    is unloading, a slow fall at rest is relaxation: neither is cut. The last sample
    kept is the last one above ``1 - drop / 4`` of the peak, so that neither noise on a
    plateau nor a sample caught in mid-fall moves it.
    """
    if not 0 < drop < 1:
        raise InputError(f"drop is {drop}; allowed is a fraction between 0 and 1")
    x, y = _upright(recording)
    last = _failure(recording.time_s, x, y, drop)
    found = {"drop": drop, "removed": len(recording) - 1 - last}
    return recording.take(slice(0, last + 1)).with_step("cut_failure", found)


def _failure(time: Array, x: Array, y: Array, drop: float) -> int:
    """Index of the last sample to keep."""
    end, peak = len(y) - 1, float(y.max())
    if peak <= 0:
        return end
    motion = _resolution(x)
    # A branch that relaxes in 1 % of the time of loading carries next to no load, so
    # a fall as quick as that is no relaxation.
    soon = np.searchsorted(time, time + 0.01 * (time - time[0]))
    soon = np.clip(soon, np.arange(len(y)) + 2, end)
    later = np.maximum.accumulate(y[::-1])[::-1][soon]  # the most it carries again
    # A displacement sensor that lags shows unloading as a quick fall at rest.
    after = np.searchsorted(time, time + 0.1 * (time - time[0])).clip(soon, end)
    stays = (x[after] >= x - motion) | (later < 0.1 * peak)
    snaps = (later < y - drop * peak) & (x[soon] >= x - motion) & stays
    if snaps.any():
        fall = int(soon[snaps.argmax()])
        level = float(y[snaps.argmax()])
    else:
        fall = int(np.flatnonzero(y >= (1 - drop) * peak)[-1]) + 1
        level = peak
    if fall > end:
        return end
    kept = int(np.flatnonzero(y[:fall] >= (1 - drop / 4) * level)[-1])
    returned = x[fall] < x[: fall + 1].max() - 4 * motion
    advanced = x[fall] > x[kept] + motion and stays[kept]
    return kept if not returned and (snaps.any() or advanced) else end


def _resolution(x: Array) -> float:
    """The least change of `x` that is motion: 0.5 % of its range, or its noise."""
    return max(5e-3 * float(np.ptp(x)), 3 * noise(x))


# --- step 4: toe -------------------------------------------------------------------


def compensate_toe(
    recording: Recording,
    rise: float = 0.005,
    within: float = 0.2,
    share: float = 0.9,
    loose: float = 0.3,
) -> Recording:
    r"""Zero strain where the first straight part meets zero load (ASTM D638, annex).

    A chord spans a rise of the load by `rise` of its peak (more where noise would blur
    it), and its slope is fitted. The straight part begins with the first chord whose
    slope reaches `share` of the steepest one below `within` of the peak. Its line is
    drawn to zero load: strain is counted from there, what lies before is left out and
    what lies between is put on the line, as the standard does.

    Nothing is shifted where there is no toe:

    - the first chord is as steep as any (a rubber that softens from the start);
    - the load before the line meets zero is, on the mean, more than `loose` of what
      the line would give (slack carries next to nothing: this is the material);
    - the slope still grows at `within` (no straight part to extend);
    - the line meets zero load before the first sample (a preload is not a toe), or
      no further from it than noise may carry it.
    """
    x, y = _upright(recording)
    begin, shift, modulus = _toe(x, y, rise, within, share, loose)
    found = {
        "rise": rise,
        "within": within,
        "share": share,
        "loose": loose,
        "shift": shift,
        "modulus_MPa": modulus,
    }
    if begin == 0:
        return recording.with_step("compensate_toe", found)
    sign = sign_of(recording)
    before = int(np.flatnonzero(x[:begin] <= shift)[-1])
    time = recording.time_s.copy()
    time[before] += (shift - x[before]) * np.divide(
        time[before + 1] - time[before], x[before + 1] - x[before]
    )
    strain = np.maximum(x - shift, 0)
    strain[before] = 0
    stress = np.where(np.arange(len(x)) < begin, modulus * strain, y)
    shifted = replace(
        recording, time_s=time, strain=sign * strain, stress_MPa=sign * stress
    )
    return shifted.take(slice(before, None)).with_step("compensate_toe", found)


def _toe(
    x: Array, y: Array, rise: float, within: float, share: float, loose: float
) -> tuple[int, float, float]:
    """First sample of the straight part, its strain at zero load, and its slope.

    (0, 0, 0) without a toe.
    """
    none = 0, 0.0, 0.0
    peak = float(y.max())
    above = np.flatnonzero(y >= within * peak)
    if peak <= 0 or not above.size or above[0] < 8:
        return none
    stop = int(above[0]) + 1
    # A rise d seen through noise s at r samples per MPa has a slope known to
    # s sqrt(12 / r d) / d: let that be at most a tenth.
    error = noise(y[:stop])
    level = max(rise * peak, np.cbrt(1200 * error**2 * y[stop - 1] / stop))
    ceiling = np.maximum.accumulate(y[: stop + 1])
    starts = np.flatnonzero(ceiling[:stop] + level <= ceiling[stop - 1])
    if starts.size < 3:
        return none
    ends = np.searchsorted(ceiling, ceiling[starts] + level) + 1
    ends = np.minimum(np.maximum(ends, starts + 5), len(x))
    slopes, at_zero = _lines(x, y, starts, ends)
    if slopes.max() <= 0:
        return none
    first = int(np.flatnonzero(slopes >= share * slopes.max())[0])
    # The first chord may straddle the bend; the steepest that starts in it does not.
    overlapping = np.flatnonzero(starts < ends[first])
    first += int(slopes[first : overlapping[-1] + 1].argmax())
    begin, modulus, shift = int(starts[first]), slopes[first], at_zero[first]
    begin = max(begin, int((x[: stop + 1] > shift).argmax()))
    chord = x[starts[first] : ends[first]]
    doubt = 1 / len(chord) + (chord.mean() - shift) ** 2 / np.sum(
        (chord - chord.mean()) ** 2
    )
    straight = ceiling[begin] <= 0.5 * (ceiling[0] + within * peak)
    if not straight or shift - x[0] <= 2 * error / modulus * np.sqrt(doubt):
        return none
    slack = np.arange(len(x)) < begin
    slack &= x <= shift
    count = int(slack.sum())
    level = np.median(y[slack][: max(count // 4, 3)])  # the zero of the load cell
    carried = np.mean(y[slack]) - level - 2 * error / np.sqrt(count)
    if carried > loose * modulus * np.mean(x[slack] - x[0]):
        return none
    return begin, float(shift), float(modulus)


def _lines(x: Array, y: Array, starts: Indices, ends: Indices) -> tuple[Array, Array]:
    """Least-squares slope of y[start:end], and x where that line meets zero."""
    sums = [np.concatenate([[0.0], np.cumsum(v)]) for v in (x, y, x * x, x * y)]
    n = ends - starts
    sx, sy, sxx, sxy = (s[ends] - s[starts] for s in sums)
    spread = sxx - sx * sx / n
    moves = spread > 1e-12 * sxx  # where the strain stands there is no slope
    slope = np.where(moves, sxy - sx * sy / n, 0) / np.where(moves, spread, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        at_zero = sx / n - sy / n / slope
    return slope, at_zero


# --- step 5: one curve from several specimens ----------------------------------------


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


# --- steps 6 and 7: noise and offset -------------------------------------------------


def smooth(
    recording: Recording, portion: float = 0.1, order: int = 2, guard: float = 1.5
) -> Recording:
    """Savitzky-Golay over the samples of one second, for noisy recordings (step 6).

    Noisy is a recording with `peak_to_peak` above zero in the first `portion` of its
    samples, as the thesis has it; others stay. A second may be too long for a fast test
    (0.25 of strain at 500 mm/min on 33 mm) and flatten the curve itself, so the window
    is halved until what it takes away is noise: nowhere more than `guard` times the
    noise of the recording, root mean square over a window. ``guard=inf`` leaves the
    thesis's rule alone. Nothing is done where no window holds the polynomial.
    """
    y = recording.stress_MPa
    level = peak_to_peak(y[: max(int(portion * len(y)), 3)])
    second = _one_second(recording.time_s)
    found = {
        "portion": portion,
        "order": order,
        "guard": guard,
        "peak_to_peak_MPa": level,
        "one_second": second,
        "noise_MPa": max(noise(y), _quantum(y) / np.sqrt(12)),
    }
    allowed = guard * found["noise_MPa"]
    window = min(second, len(y) - 1 + len(y) % 2) if level > 0 else 0
    while window > order + 1:
        smoothed = savgol_filter(y, window, order)
        if _largest_rms(y - smoothed, max(window, 31)) <= allowed:
            found["window"] = window
            return recording.with_step("smooth", found, stress_MPa=smoothed)
        window = window // 2 - 1 + window // 2 % 2
    return recording.with_step("smooth", {**found, "window": 0})


def _largest_rms(values: Array, chunk: int) -> float:
    """Largest root mean square over stretches of `chunk` samples."""
    starts = np.arange(0, max(len(values) - chunk // 2, 1), chunk)
    counts = np.diff(np.append(starts, len(values)))
    return float(np.sqrt((np.add.reduceat(values**2, starts) / counts).max()))


def _quantum(values: Array) -> float:
    """The smallest step of values that repeat themselves, 0 where they do not."""
    steps = np.abs(np.diff(values))
    coarse = np.mean(steps == 0) > 0.05 and steps.any()
    return float(steps[steps > 0].min()) if coarse else 0.0


def peak_to_peak(values: Array) -> float:
    """Mean absolute difference between successive peaks and troughs; 0 without any.

    >>> peak_to_peak(np.array([0, 2.0, 1.0, 3.0, 4.0])), peak_to_peak(np.arange(9.0))
    (1.0, 0.0)
    """
    known = values[~np.isnan(values)]
    steps = np.diff(known)
    moves = np.flatnonzero(steps)
    turns = moves[1:][np.diff(np.sign(steps[moves])) != 0]
    if turns.size < 2:
        return 0.0
    return float(np.abs(np.diff(known[turns])).mean())


def _one_second(time_s: Array) -> int:
    """Samples in one second, odd, counted by the median step."""
    step = max(float(np.median(np.diff(time_s))), 1 / len(time_s))
    count = round(1 / step)
    return count - 1 + count % 2


def remove_negative_offset(recording: Recording) -> Recording:
    """Lift a curve that starts below zero load to zero (step 7); others stay."""
    sign = sign_of(recording)
    offset = min(0.0, float(sign * recording.stress_MPa[0]))
    return recording.with_step(
        "remove_negative_offset",
        {"offset_MPa": offset},
        stress_MPa=recording.stress_MPa - sign * offset,
    )


def noise(values: Array) -> float:
    """Standard deviation of white noise on a smooth signal, from second differences.

    Robust: the median does not see jumps. Second differences of white noise have six
    times its variance.
    """
    if len(values) < 5:
        return 0.0
    return float(1.4826 * np.median(np.abs(np.diff(values, 2))) / np.sqrt(6))


def noise_of(recording: Recording) -> float:
    """White noise of the stress [MPa] as it was before smoothing took the fast part.

    What is slower than the window is still there: a fit has to reckon with it.
    """
    for step in reversed(recording.log):
        if "noise_MPa" in step.arguments:
            return float(step.arguments["noise_MPa"])
    return noise(recording.stress_MPa)


def resample(recording: Recording, samples: int) -> Recording:
    """`samples` points at equal strain steps; a strain that turns back is skipped."""
    if samples < 2:
        raise InputError(f"samples is {samples}; at least 2 are needed")
    sign = sign_of(recording)
    x = sign * recording.strain
    forward = _forward(x)
    grid = np.linspace(x[forward[0]], x[forward[-1]], samples)
    columns = {
        name: np.interp(grid, x[forward], values[forward])
        for name, values in recording.columns.items()
        if name != "strain"
    }
    return recording.with_step(
        "resample", {"samples": samples}, strain=sign * grid, **columns
    )


# --- small tools ----------------------------------------------------------------------


def _complete(recording: Recording) -> Recording:
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


def _upright(recording: Recording) -> tuple[Array, Array]:
    """Strain and stress with the main direction of loading positive."""
    sign = sign_of(recording)
    return sign * recording.strain, sign * recording.stress_MPa


def _forward(x: Array) -> Indices:
    """Samples at which `x` goes beyond all earlier ones."""
    before = np.concatenate([[-np.inf], np.maximum.accumulate(x)[:-1]])
    forward = np.flatnonzero(x > before)
    if forward.size < 2:
        raise InputError("the strain never grows; a loading curve is needed")
    return forward


def rising(recording: Recording) -> tuple[Array, Array, Array]:
    """Strain (growing), stress and time from its start, of a loading curve."""
    x, y = _upright(recording)
    forward = _forward(x)
    time = recording.time_s[forward] - recording.time_s[forward[0]]
    return x[forward], y[forward], time


# --- cycles and holds -----------------------------------------------------------------


Kind = Literal["loading", "unloading", "hold"]
KINDS: tuple[Kind, ...] = ("loading", "unloading", "hold")
LOADING, UNLOADING, HOLD = range(3)


@dataclass(frozen=True)
class Segment:
    """Samples `start` to `stop` (not included) of one kind; cycles count from 1.

    Loading leads away from zero strain, whichever the sign. A cycle begins with a
    loading that follows an unloading.
    """

    kind: Kind
    cycle: int
    start: int
    stop: int


def segments(
    recording: Recording, reversal: float = 0.05, dwell: float = 0.15
) -> list[Segment]:
    """Loading, unloading and holds of a recording, in order and without gaps.

    The strain is read in steps of 0.5 % of its range (more where it is noisy), so
    that noise, a coarse sensor and small overshoots do not count. It turns where it
    returns by the fraction `reversal` of its range. It is held where it stays within
    a fifth of a step for longer than it usually takes to cross the fraction `dwell` of
    its range; three such steps or more in one direction are a slow ramp, not holds.

    >>> t = np.arange(0, 4.01, 0.01)
    >>> strain = np.interp(t, [0, 1, 2, 3, 4], [0, 0.5, 0.5, 0, 0.5])
    >>> [(s.kind, s.cycle) for s in segments(Recording(t, strain, strain))]
    [('loading', 1), ('hold', 1), ('unloading', 1), ('loading', 2)]
    """
    x = recording.strain
    if np.isnan(x).any():
        raise InputError(
            f"{int(np.isnan(x).sum())} samples have no strain; leave them out first",
            file=recording.source or recording.name or None,
        )
    away = x - x[0]
    x = -x if -away.min() > away.max() else x
    reach = float(np.ptp(x))
    step = max(5e-3 * reach, 6 * noise(x))
    if 2 * step >= reach:  # nothing but noise
        return [Segment("hold", 1, 0, len(x))]
    loading = _loading(x, _marks(x, step), reversal * reach)
    kinds = np.where(loading, LOADING, UNLOADING)
    # Finer for holds: the rounded top of a sine stays long within a coarse step.
    fine = max(step / 5, 6 * noise(x))
    for start, stop in _holds(recording.time_s, x, fine, dwell * reach / fine):
        kinds[start:stop] = HOLD
    return _segments(x, kinds, 2 * step)


def _marks(x: Array, step: float) -> Indices:
    """Samples at which `x` has moved by `step` since the last of them; and the ends."""
    marks, level = [0], x[0]
    for i, value in enumerate(x.tolist()):
        if abs(value - level) >= step:
            marks.append(i)
            level = value
    return np.array(marks + [len(x) - 1] * (marks[-1] < len(x) - 1))


def _loading(x: Array, marks: Indices, threshold: float) -> NDArray[np.bool_]:
    """True (n,) where `x` is on its way up, between reversals of over `threshold`."""
    levels = x[marks].tolist()
    high = low = 0  # marks of the extremes since the last turn
    turns: list[tuple[int, bool]] = []  # mark, and whether it goes up from there
    for i, level in enumerate(levels):
        high, low = (
            i if level > levels[high] else high,
            i if level < levels[low] else low,
        )
        up = turns[-1][1] if turns else None
        if up is not False and levels[high] - level >= threshold:
            turns.append((high, False))
            high = low = i
        elif up is not True and level - levels[low] >= threshold:
            turns.append((low, True))
            high = low = i
    loading = np.full(len(x), turns[0][1])
    for k, (mark, up) in enumerate(turns):
        begin, end = marks[max(mark - 1, 0)], marks[min(mark + 1, len(marks) - 1)]
        around = x[begin : end + 1]
        turn = begin + int(around.argmin() if up else around.argmax())
        if k or abs(x[turn] - x[0]) >= threshold:
            loading[: turn + 1] = np.where(k, loading[: turn + 1], not up)
            loading[turn + 1 :] = up
    return loading


def _holds(time: Array, x: Array, step: float, steps: float) -> list[tuple[int, int]]:
    """Where `x` stays within a step for as long as it usually takes for `steps`."""
    marks = _marks(x, step)
    travel = np.diff(x[marks])
    whole = np.abs(travel) >= step
    slowness = np.diff(time[marks]) / np.maximum(np.abs(travel) / step, 1)
    inside = time[np.maximum(marks[1:] - 1, marks[:-1])] - time[marks[:-1]]
    slow = inside > steps * np.median(slowness[whole])
    holds: list[tuple[int, int]] = []
    for first, last in _runs(slow):
        stretch = x[marks[first] : marks[last] + (marks[last] == len(x) - 1)]
        if not slow[first] or (last - first > 3 and np.ptp(stretch) >= 3 * step):
            continue
        near = np.abs(stretch - np.median(stretch)) <= max(step / 4, 3 * noise(x))
        start, stop = marks[first] + np.flatnonzero(near)[[0, -1]] + [0, 1]
        if holds and np.ptp(x[holds[-1][0] : stop]) < 2 * step:
            start = holds.pop()[0]
        holds.append((int(start), int(stop)))
    return holds


def _segments(x: Array, kinds: NDArray[np.int_], least: float) -> list[Segment]:
    """Runs of one kind with cycles counted; ramps shorter than `least` are absorbed."""
    runs = _runs(kinds)
    for before, (start, stop) in zip([None, *runs], runs, strict=False):
        short = abs(x[stop - 1] - x[start]) < least
        if kinds[start] != HOLD and short and len(runs) > 1:
            kinds[start:stop] = kinds[stop] if before is None else kinds[start - 1]
    found: list[Segment] = []
    cycle, unloaded = 1, False
    for start, stop in _runs(kinds):
        kind = kinds[start]
        cycle += bool(kind == LOADING and unloaded)
        unloaded = kind == UNLOADING or (unloaded and kind == HOLD)
        found.append(Segment(KINDS[kind], cycle, start, stop))
    return found


def _runs(labels: NDArray[np.generic]) -> list[tuple[int, int]]:
    """Start and stop of every stretch of equal labels."""
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), len(labels)]
    return list(pairwise(edges))
