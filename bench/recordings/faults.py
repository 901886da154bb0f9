"""Faults of a rig or a channel, made in copies of real recordings.

The specimen goes through what it went through; what changes is what the machine says
about it. So a gap is strain that the machine counts before the specimen is taut, and a
slip is strain that it counts and the specimen does not see. Sizes are in the middle of
what concealed cases of strength 1 have. How often a name comes with nothing made
is seen in a copy that lacks one recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bench.recordings.groups import amplitude, first_turn, holds
from softnn.mismatch.case import Case
from softnn.recording import Recording

SIBLINGS = 4  # specimens, among which one may stand out
UNLISTED = "on no list"  # where nothing new should be named


@dataclass(frozen=True)
class Fault:
    """A fault: the effect that stands for it, how it is made, and in which recordings.

    `make` takes a recording, the size, and the largest stress of the case. `share` of
    the recordings have it (rounded, at least one); with `own_scale` it cannot be seen
    where each recording has a scale of its own, with `among` only where `SIBLINGS`
    specimens are there to stand out from, with `held` only in a hold.
    """

    effect: str
    make: Callable[[Recording, float, float], Recording]
    share: float
    says: str
    own_scale: bool = False
    among: bool = False
    held: bool = False

    def shows(self, recordings: Sequence[Recording], specimens: bool) -> bool:
        """Whether such recordings, of a specimen each or of one, can show it."""
        alone = len(recordings) < 2 and self.share < 1.0  # nothing to be out of line of
        few = self.among and not (specimens and len(recordings) >= SIBLINGS)
        lost = self.own_scale and specimens
        return not (
            alone or few or lost or (self.held and not any(map(holds, recordings)))
        )


def peak(recording: Recording) -> float:
    return float(np.nanquantile(np.abs(recording.stress_MPa), 0.998))


def side(recording: Recording) -> float:
    strain = recording.strain
    return float(np.sign(strain[np.nanargmax(np.abs(strain))]))


def slack(recording: Recording, size: float, top: float) -> Recording:
    gap = 0.05 * size * amplitude(recording)
    time, strain = recording.time_s, recording.strain
    step = float(np.median(np.diff(time)))
    reach = max(first_turn(recording) - 1, 1)
    speed = amplitude(recording) / max(time[reach] - time[0], step)
    lead = np.arange(0.0, gap / speed, step)  # taking up the gap
    quiet = np.zeros(len(lead))
    return Recording(
        np.concatenate([lead, time - time[0] + gap / speed]),
        np.concatenate(
            [side(recording) * speed * lead, strain + side(recording) * gap]
        ),
        np.concatenate([quiet + recording.stress_MPa[0], recording.stress_MPa]),
        name=recording.name,
        specimen=recording.specimen,
        test=recording.test,
        axes=recording.axes,
    )


def offset(recording: Recording, size: float, top: float) -> Recording:
    return changed(recording, recording.stress_MPa + 0.055 * size * peak(recording))


def clip(recording: Recording, size: float, top: float) -> Recording:
    limit = (1 - 0.22 * size) * top  # one load cell, one limit
    return changed(recording, np.clip(recording.stress_MPa, -limit, limit))


def lag(recording: Recording, size: float, top: float) -> Recording:
    """First order; 0.25 s, or a fiftieth of the first loading where that is longer."""
    time = recording.time_s
    loading = time[first_turn(recording) - 1] - time[0]
    constant = size * max(0.25, 0.02 * loading)
    out = np.array(recording.stress_MPa)
    for i in range(1, len(out)):
        gone = 1 - np.exp(-(time[i] - time[i - 1]) / constant)
        middle = 0.5 * (recording.stress_MPa[i] + recording.stress_MPa[i - 1])
        if np.isfinite(middle) and np.isfinite(out[i - 1]):
            out[i] = out[i - 1] + gone * (middle - out[i - 1])
    return changed(recording, out)


def drift(recording: Recording, size: float, top: float) -> Recording:
    """One peak stress an hour, or a twelfth of one by the end of a short recording."""
    time = recording.time_s - recording.time_s[0]
    speed = size * max(1 / 3600, 0.08 / time[-1]) * peak(recording)
    return changed(recording, recording.stress_MPa + speed * time)


def gain(recording: Recording, size: float, top: float) -> Recording:
    return changed(recording, recording.stress_MPa * (1 + 0.105 * size))


def slip(recording: Recording, size: float, top: float) -> Recording:
    """A tenth of the largest strain, at seven tenths of the first loading."""
    time = recording.time_s
    moment = 0.7 * (time[first_turn(recording) - 1] - time[0])
    slid = np.clip((time - time[0] - moment) / max(0.02 * moment, 1e-9), 0, 1)
    jump = side(recording) * 0.1 * size * amplitude(recording) * slid
    return recording.with_step("slip", {"size": size}, strain=recording.strain + jump)


def section(recording: Recording, size: float, top: float) -> Recording:
    """A cross-section typed half as large, at size 1."""
    return changed(recording, recording.stress_MPa * (1 + size))


def drying(recording: Recording, size: float, top: float) -> Recording:
    """Stiffer by a quarter at the end, steadily: a stress that rises in a hold."""
    time = recording.time_s - recording.time_s[0]
    return changed(
        recording, recording.stress_MPa * (1 + 0.25 * size * time / time[-1])
    )


def changed(recording: Recording, stress: np.ndarray) -> Recording:
    return recording.with_step("made fault", stress_MPa=stress)


FAULTS = {
    "slack": Fault("slack", slack, 0.5, "a gap of 5 % of the largest strain"),
    "offset": Fault("zero_offset", offset, 0.34, "5.5 % of the peak stress"),
    "clip": Fault("load_cell_saturation", clip, 1.0, "at 78 % of the peak stress"),
    "lag": Fault("sensor_lag", lag, 1.0, "0.25 s, or 2 % of the first loading"),
    "drift": Fault("load_cell_drift", drift, 1.0, "one peak an hour, 8 % at least"),
    "gain": Fault("gain_error", gain, 0.34, "10.5 %", own_scale=True),
    "slip": Fault("grip_slip", slip, 0.34, "10 % of the largest strain"),
    "section": Fault("gain_error", section, 0.0, "half of one specimen's", among=True),
    "drying": Fault(UNLISTED, drying, 1.0, "25 % stiffer by the end", held=True),
}


CONTROL = "one recording less"


def one_less(case: Case, rng: np.random.Generator) -> Case:
    """The case without one of its recordings, drawn."""
    out = int(rng.integers(len(case.recordings)))
    left = tuple(r for i, r in enumerate(case.recordings) if i != out)
    specimen = {
        k: v for k, v in case.specimen.items() if any(k == r.name for r in left)
    }
    return Case(case.name, left, specimen=specimen)


def faulty(case: Case, fault: Fault, size: float, rng: np.random.Generator) -> Case:
    """A copy of the case with the fault in `share` of its recordings, drawn."""
    count = len(case.recordings)
    chosen = rng.permutation(count)[: max(1, round(fault.share * count))]
    top = max(peak(r) for r in case.recordings)
    made = tuple(
        fault.make(r, size, top) if i in chosen else r
        for i, r in enumerate(case.recordings)
    )
    return Case(case.name, made, specimen=case.specimen)
