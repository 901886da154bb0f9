"""Steps 6 and 7: noise is smoothed where there is any, a negative offset taken off."""

from __future__ import annotations

from typing import Any

import numpy as np

from softnn.contracts import Array
from softnn.noise import quantum, white
from softnn.prepare.curve import sign_of
from softnn.recording import Recording


def smooth(
    recording: Recording,
    portion: float = 0.1,
    order: int = 2,
    guard: float = 1.5,
    window_s: float = 1.0,
) -> Recording:
    """Smooth a noisy recording: Savitzky-Golay over `window_s` (step 6 of the thesis).

    A recording is noisy if `peak_to_peak` is above zero in the first `portion` of its
    samples, as in the thesis; others stay. The thesis's window of one second may
    flatten a fast test (0.25 of strain at 500 mm/min on 33 mm). So the window is halved
    until it removes noise alone: nowhere more than `guard` times the noise of the
    recording, root mean square over a window. ``guard=inf`` keeps the thesis's rule.
    Nothing is done if no window holds the polynomial.
    """
    y = recording.stress_MPa
    level = peak_to_peak(y[: max(int(portion * len(y)), 3)])
    window = _samples_in(recording.time_s, window_s)
    found: dict[str, Any] = {
        "portion": portion,
        "order": order,
        "guard": guard,
        "peak_to_peak_MPa": level,
        "samples_in_window": window,
        "noise_MPa": max(white_noise(y), quantum(y) / np.sqrt(12)),
    }
    allowed = guard * found["noise_MPa"]
    window = min(window, len(y) - 1 + len(y) % 2) if level > 0 else 0
    while window > order + 1:
        smoothed = savitzky_golay(y, window, order)
        if _largest_rms(y - smoothed, max(window, 31)) <= allowed:
            found["window"] = window
            return recording.with_step("smooth", found, stress_MPa=smoothed)
        window = window // 2 - 1 + window // 2 % 2
    return recording.with_step("smooth", {**found, "window": 0})


def savitzky_golay(values: Array, window: int, order: int) -> Array:
    r"""Values (n,) smoothed by polynomials of degree `order` over `window` samples.

    The polynomial around a sample gives its smoothed value. The first and the last
    polynomial also give the half windows at the ends. `window` is odd, greater than
    `order` and at most n.

    The result is `scipy.signal.savgol_filter(values, window, order)` but for rounding.
    scipy solves a least-squares problem by LAPACK, which rounds differently on each
    processor. Here, elementary operations in a fixed order round the same on all of
    them. Gram polynomials (orthogonal on equally spaced samples) need no solver:

    .. math:: P_{j+1}(k) = k P_j(k) - b_j P_{j-1}(k), \quad
        b_j = \frac{j^2 (n^2 - j^2)}{4 (4 j^2 - 1)}, \quad
        \sum_k P_j^2 = n \, b_1 \cdots b_j

    >>> x = np.arange(7.0)
    >>> np.allclose(savitzky_golay(x**2, 5, 2), x**2)
    True
    """
    half = window // 2
    k = np.arange(-half, half + 1.0)
    weight, start, end = np.zeros((3, window))
    p, before, b, norm = np.ones(window), np.zeros(window), 0.0, float(window)
    for j in range(1, order + 2):
        scaled = p / norm
        weight += p[half] * scaled
        start += np.sum(p * values[:window]) * scaled
        end += np.sum(p * values[-window:]) * scaled
        p, before = k * p - b * before, p
        b = j**2 * (window**2 - j**2) / (4 * (4 * j**2 - 1))
        norm *= b
    inner = slice(half, len(values) - half)
    smoothed = np.empty(len(values))
    smoothed[:half], smoothed[inner.stop :] = start[:half], end[half + 1 :]
    # Not `np.convolve`, which multiplies by BLAS.
    smoothed[inner] = weight[half] * values[inner]
    for i in range(1, half + 1):
        sides = values[half - i : inner.stop - i] + values[half + i : inner.stop + i]
        smoothed[inner] += weight[half + i] * sides
    return smoothed


def _largest_rms(values: Array, chunk: int) -> float:
    """Largest root mean square over stretches of `chunk` samples."""
    starts = np.arange(0, max(len(values) - chunk // 2, 1), chunk)
    counts = np.diff(np.append(starts, len(values)))
    return float(np.sqrt((np.add.reduceat(values**2, starts) / counts).max()))


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


def _samples_in(time_s: Array, window_s: float) -> int:
    """Samples in so many seconds, odd, counted by the median step."""
    step = max(float(np.median(np.diff(time_s))), window_s / len(time_s))
    count = round(window_s / step)
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


def white_noise(values: Array) -> float:
    """Standard deviation of white noise by second differences (`softnn.noise.white`).

    Unlike higher ones, they still tell noise from the corners of a strain programme.
    """
    return white(values, 2)


def noise_of(recording: Recording) -> float:
    """Return the white noise of the stress [MPa] before smoothing.

    Noise slower than the window remains in the recording.
    """
    for step in reversed(recording.log):
        if "noise_MPa" in step.arguments:
            return float(step.arguments["noise_MPa"])
    return white_noise(recording.stress_MPa)
