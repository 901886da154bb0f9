"""Step 2: what follows failure is left out."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Array, InputError
from softnn.prepare.curve import upright
from softnn.prepare.smoothing import white_noise
from softnn.recording import Recording


def cut_failure(recording: Recording, drop: float = 0.2) -> Recording:
    r"""Return the recording without the samples after failure.

    Failure: after its peak |stress| falls by more than the fraction `drop` of the peak
    and does not return, while the strain goes on. At rest the fall must take less than
    1 % of the time so far (a snap, or a machine that stops). A fall while the strain
    returns is unloading, and a slow fall at rest is relaxation; neither is cut. The
    last sample kept is the last one above ``1 - drop / 4`` of the peak, so neither
    noise on a plateau nor a sample in mid-fall moves it.
    """
    if not 0 < drop < 1:
        raise InputError(f"drop is {drop}; allowed is a fraction between 0 and 1")
    x, y = upright(recording)
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
    # The most it carries again, either way: friction only turns round.
    later = np.maximum.accumulate(np.abs(y)[::-1])[::-1][soon]
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
    return max(5e-3 * float(np.ptp(x)), 3 * white_noise(x))
