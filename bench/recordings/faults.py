"""Faults of a rig or a channel, made in copies of real recordings as they happen.

The specimen and its programme stay; what changes is what the machine says about them.
A machine has one load cell, one filter and one grip, so what belongs to them is the
same in all recordings of a case (`Rig`). Each maker returns the faulty recording and
the values that the law of the fault then has, from which an oracle starts
(`bench.recordings.oracle`). How often a name comes with nothing made is seen in a copy
that lacks one recording.

Of what nobody measured, the recording itself is asked:

*Slack*: the crosshead closes the gap at the speed of the first loading, while the cell
shows its noise. All strains are counted from there. A specimen that is pulled and
pushed cannot be loose, so strain must be of one sign.

*Slip*: at constant speed of the crosshead the force falls, and the specimen lags behind
by what has slid (`bench.recordings.slip`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bench.recordings import slip as slips
from bench.recordings.groups import amplitude, holds, rate
from softnn.contracts import Array
from softnn.mismatch.case import Case
from softnn.recording import Recording

SIBLINGS = 4  # specimens, among which one may stand out
UNLISTED = "on no list"  # where nothing new should be named
SLOWEST_S = 1.0  # the slowest filter of a load cell's amplifier, assumed
WARM_S = 600.0  # a cell at the bottom of its range drifts one peak in this, assumed
THIRD = 20**0.5  # standard deviation of third differences of white noise, over its own

Values = dict[str, float]


@dataclass(frozen=True)
class Rig:
    """What all recordings of a case share: the machine, and the clock of the day."""

    recordings: tuple[Recording, ...]

    @cached_property
    def top(self) -> float:
        """Largest stress of all, in MPa or in the unit of a component."""
        return max(peak(r) for r in self.recordings)

    @cached_property
    def loading_s(self) -> float:
        """Time of the fastest first loading."""
        return min(map(slips.loading_s, self.recordings))

    @cached_property
    def longest_s(self) -> float:
        return max(float(r.time_s[-1] - r.time_s[0]) for r in self.recordings)


Make = Callable[[Recording, float, Rig], tuple[Recording, Values]]


@dataclass(frozen=True)
class Fault:
    """A fault: the effect that stands for it, how it is made, and in which recordings.

    `make` takes a recording, the size and the rig. `share` of the recordings have it
    (rounded, at least one), of those that `can`; with `own_scale` it cannot be seen
    where each recording has a scale of its own, with `among` only where `SIBLINGS`
    specimens are there to stand out from, with `held` only in a hold. With `flat` the
    readings stay at one limit, which anybody sees.
    """

    effect: str
    make: Make
    share: float
    says: str
    own_scale: bool = False
    among: bool = False
    held: bool = False
    flat: bool = False
    can: Callable[[Recording], bool] = lambda recording: True

    def shows(self, recordings: Sequence[Recording], specimens: bool) -> bool:
        """Whether such recordings, of a specimen each or of one, can show it."""
        alone = len(recordings) < 2 and self.share < 1.0  # nothing to be out of line of
        few = self.among and not (specimens and len(recordings) >= SIBLINGS)
        lost = self.own_scale and specimens
        still = self.held and not any(map(holds, recordings))
        return any(map(self.can, recordings)) and not (alone or few or lost or still)


@dataclass(frozen=True)
class Made:
    """A faulty case, and the truth: recordings by index, and the values of the law."""

    original: Case
    case: Case
    recordings: tuple[int, ...]
    values: tuple[Values, ...]


def peak(recording: Recording) -> float:
    return float(np.nanquantile(np.abs(recording.stress_MPa), 0.998))


def slack(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """A gap of 5 % of the largest strain, closed at the speed of the first loading."""
    gap = 0.05 * size * amplitude(recording)
    way, time = slips.side(recording), recording.time_s
    to_close = gap / rate(recording)
    early = time <= time[0] + slips.loading_s(recording)
    step = float(np.median(np.diff(time[early]))) if early.sum() > 1 else to_close
    step = max(step, 1e-3 * to_close)
    lead = np.arange(0.0, to_close - 0.5 * step, step)
    quiet = noise(recording.stress_MPa) * np.random.default_rng(len(time)).normal(
        size=len(lead)
    )
    closing = recording.strain[0] + way * gap * lead / to_close
    warm = recording.temperature_C
    return Recording(
        np.concatenate([lead, time - time[0] + to_close]),
        np.concatenate([closing, recording.strain + way * gap]),
        np.concatenate([recording.stress_MPa[0] + quiet, recording.stress_MPa]),
        None if warm is None else np.concatenate([np.full(len(lead), warm[0]), warm]),
        name=recording.name,
        specimen=recording.specimen,
        test=recording.test,
        axes=recording.axes,
    ), {"gap": gap, "toe": 0.0}


def noise(stress: Array) -> float:
    """White noise of a channel, from third differences; 0 for a coarse one."""
    rough = np.abs(np.diff(stress, 3))
    return float(np.nanmedian(rough)) / (0.6745 * THIRD)


def offset(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """The cell was not zeroed before these recordings."""
    by = 0.055 * size * peak(recording)
    return changed(recording, recording.stress_MPa + by), {"offset_MPa": by}


def clip(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """One load cell, one limit."""
    limit = max(1 - 0.22 * size, 0.05) * rig.top
    cut = np.clip(recording.stress_MPa, -limit, limit)
    return changed(recording, cut), {"limit_MPa": limit, "knee": 0.0}


def lag(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """First order; one filter for all recordings."""
    time = recording.time_s
    constant = size * min(0.05 * rig.loading_s, SLOWEST_S)
    stress = recording.stress_MPa
    out = np.array(stress)
    for i in range(1, len(out)):
        step = max(time[i] - time[i - 1], 1e-12)
        # Exact for a stress that is straight between samples.
        behind = constant * (stress[i] - stress[i - 1]) / step
        before = out[i - 1] - stress[i - 1] + behind
        if np.isfinite(before):
            out[i] = stress[i] - behind + before * np.exp(-step / constant)
    values = {"time_constant_s": constant, "quality_squared": 0.0}
    return changed(recording, out), values


def drift(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """One rate, as the cell is one; zeroed before each recording."""
    time = recording.time_s - recording.time_s[0]
    seconds = np.clip(rig.longest_s / 0.08, WARM_S, 3600.0)
    speed = size * rig.top / float(seconds)
    made = changed(recording, recording.stress_MPa + speed * time)
    return made, {"drift_MPa_per_s": speed}


def gain(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """Another calibration for these recordings."""
    error = 0.105 * size
    return changed(recording, recording.stress_MPa * (1 + error)), {"error": error}


def slip(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """A tenth of the largest strain, when the strain first comes to 70 % of that."""
    slid = slips.Slip(slips.NOMINAL * size, 0.014 * rig.loading_s)
    stress, values = slid.of(recording)
    return recording.with_step("slip", {"size": size}, stress_MPa=stress), values


def section(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """A cross-section typed half as large, at size 1."""
    return changed(recording, recording.stress_MPa * (1 + size)), {"error": size}


def drying(recording: Recording, size: float, rig: Rig) -> tuple[Recording, Values]:
    """Stiffer by a quarter by the end of the longest recording, at one rate."""
    time = recording.time_s - recording.time_s[0]
    speed = 0.25 * size / rig.longest_s
    made = changed(recording, recording.stress_MPa * (1 + speed * time))
    return made, {"rate_per_s": speed}


def changed(recording: Recording, stress: Array) -> Recording:
    return recording.with_step("made fault", stress_MPa=stress)


FAULTS = {
    "slack": Fault(
        "slack", slack, 0.5, "a gap of 5 % of the largest strain", can=slips.one_sided
    ),
    "offset": Fault("zero_offset", offset, 0.34, "5.5 % of the peak stress"),
    "clip": Fault("load_cell_saturation", clip, 1.0, "at 78 % of the peak", flat=True),
    "lag": Fault("sensor_lag", lag, 1.0, "5 % of the fastest loading, 1 s at most"),
    "drift": Fault(
        "load_cell_drift",
        drift,
        1.0,
        "8 % of the peak by the end; a peak in 10 minutes at most, in 1 hour at least",
    ),
    "gain": Fault("gain_error", gain, 0.34, "10.5 %", own_scale=True),
    "slip": Fault(
        "grip_slip", slip, 0.34, "10 % of the largest strain", can=slips.possible
    ),
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


def faulty(case: Case, fault: Fault, size: float, rng: np.random.Generator) -> Made:
    """A copy of the case with the fault in `share` of its recordings, drawn."""
    order = rng.permutation(len(case.recordings))
    able = [int(i) for i in order if fault.can(case.recordings[i])]
    chosen = sorted(able[: max(1, round(fault.share * len(order)))])
    rig, recordings = Rig(case.recordings), list(case.recordings)
    values = []
    for i in chosen:
        recordings[i], told = fault.make(recordings[i], size, rig)
        values.append(told)
    made = Case(case.name, tuple(recordings), specimen=case.specimen)
    return Made(case, made, tuple(chosen), tuple(values))
