"""Step 4: take-up slack is left out, and strain counted from where load begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Array
from softnn.prepare.curve import Indices, sign_of, upright
from softnn.prepare.smoothing import white_noise
from softnn.recording import Recording


def compensate_toe(
    recording: Recording,
    rise: float = 0.005,
    within: float = 0.2,
    share: float = 0.9,
    loose: float = 0.3,
) -> Recording:
    r"""Return the recording with zero strain at the foot of its straight part.

    This follows the annex of ASTM D638. A chord spans a rise of the load by `rise` of
    its peak (more if noise would blur it), and its slope is fitted. The straight part
    begins with the first chord whose slope reaches `share` of the steepest one below
    `within` of the peak. Its line is drawn to zero load, and strain is counted from
    there. Earlier samples are left out; samples in between are put on the line.

    Nothing is shifted if there is no toe:

    - the first chord is as steep as any (a rubber that softens from the start);
    - the load before the foot of the line is the material's: on the mean it is more
      than `loose` of the line (slack carries next to nothing);
    - the slope still grows at `within` (no straight part to extend);
    - the line meets zero load before the first sample (a preload is not a toe), or
      no further from it than noise may carry it.
    """
    x, y = upright(recording)
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
    error = white_noise(y[:stop])
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
