r"""The load cell wanders with time."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Array, Chunk, Effect, Parameter
from softnn.effects._programmes import ramps
from softnn.effects._signs import noise, peak, reach

MUCH = (0.02, 5.0)  # least total drift, as a share of the peak stress and in noises
OUT, HOME = 0.5, 0.15  # shares of the largest strain: loaded from, returned below
LIKE = 0.05  # share of the largest strain by which peaks and returns may differ
IDLE = 0.02  # share of the peak stress; a specimen that changes less bears no load
RETURNS = 4  # fewest returns that show that the stress does not settle
STEADILY = (0.6, 0.15)  # slope of the later half, and scatter, over the whole change
ALL = 0.8  # least share of the suitable recordings that must show the drift


class LoadCellDrift(Effect):
    r"""Stress that grows with time, whatever the specimen does.

    .. math:: \sigma \to \sigma + a\,t

    drift a in MPa/s, one for all recordings; t since the recording began, where the
    cell was zeroed. Temperature drift of strain gauges, OIML R 60.

    In a recording: slow, the same loaded or not, and largest in the longest recording.
    Mistaken for a very long relaxation time (which needs load) and for a zero offset.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters: tuple[Parameter, ...] = (
        Parameter("drift_MPa_per_s", "MPa/s", -1e3, 1e3, 1e-4, meaning="a"),
    )
    off = {"drift_MPa_per_s": 0.0}
    amplitude = "drift_MPa_per_s"
    spoken = "load-cell drift"
    where = "late in long recordings, loaded or not"
    twins = {
        "relaxation_branch": "a long stretch without load",
        "zero_offset": "a longer recording",
        "thermal_softening": "a stretch without load while the temperature changes",
    }

    @property
    def second_forms(self):
        return (OwnDrift(), WarmUp(), OwnWarmUp())

    def after(self, p, signal, state):
        t = (signal.time_s - signal.begun_s)[:, None]
        return signal.having(stress=signal.stress + self.wander(p, t)), None

    def wander(self, p, t):
        return p["drift_MPa_per_s"] * t

    def starts(self, scales):
        longest = float(np.max(scales.duration_s))
        return [{"drift_MPa_per_s": float(min(0.08 * scales.stress_MPa / longest, 1))}]

    def shown(self, chunks, stress_MPa):
        """Drift [MPa/s] that returns to one strain show and that does not settle.

        None where fewer than most of the suitable recordings show it.
        """
        speeds, sure = [], 0
        for chunk, stress in zip(chunks, stress_MPa, strict=True):
            speed, change = _creeping(chunk, stress)
            if np.isnan(speed):
                continue
            share, noises = MUCH
            speeds.append(speed)
            sure += change > max(share * peak(stress), noises * noise(stress))
        if not speeds or sure < ALL * len(speeds) or np.ptp(np.sign(speeds)):
            return None
        return {"drift_MPa_per_s": float(np.median(speeds))}

    def telltale(self):
        return ramps([0, 0.5, 0.5, 0, 0, 0, 0.5, 0], 0.1)


class OwnDrift(LoadCellDrift):
    """A drift with its own rate in each recording."""

    per_recording = ("drift_MPa_per_s",)

    def starts(self, scales):
        size = 0.05 * scales.stress_MPa / np.maximum(scales.duration_s, 1e-9)
        return [{"drift_MPa_per_s": np.minimum(size, 1.0)}]


class WarmUp(LoadCellDrift):
    r"""Drift that dies away as the cell warms up: a tau (1 - exp(-t / tau))."""

    parameters = LoadCellDrift.parameters + (
        Parameter("warm_up_s", "s", 1e-2, 1e7, 100.0, "log", "tau"),
    )

    def wander(self, p, t):
        return p["drift_MPa_per_s"] * p["warm_up_s"] * -np.expm1(-t / p["warm_up_s"])

    def starts(self, scales):
        longest = float(np.max(scales.duration_s))
        tau = float(np.clip(0.5 * longest, 1e-2, 1e7))
        return [start | {"warm_up_s": tau} for start in super().starts(scales)]


class OwnWarmUp(WarmUp, OwnDrift):
    """Warm-up drift: a size for each recording, one time constant for all."""


def _creeping(chunk: Chunk, stress: Array) -> tuple[float, float]:
    """Drift [MPa/s] at one strain, cycle after cycle, and the total change [MPa].

    The rate is 0 where the change slows down, as a material that nears its steady state
    does. It is nan where too few cycles are alike. It is also nan where the stress
    drifts against the direction of the load, as relaxation does, unless the specimen
    bears no stress at the return.
    """
    rows = _returns(chunk, stress)
    if len(rows) < RETURNS:
        return np.nan, 0.0
    time, level, back, peaks, spans = np.array(rows).T
    if max(np.ptp(back), np.ptp(peaks)) > LIKE:
        return np.nan, 0.0
    slope, level_0 = np.polyfit(time, level, 1)
    late = slice(len(time) // 2, None)
    later = np.polyfit(time[late], level[late], 1)[0]
    change = slope * np.ptp(time)
    scatter = np.std(level - slope * time - level_0)
    steady, straight = STEADILY
    side = np.sign(chunk.strain[np.argmax(np.abs(chunk.strain))])
    if slope * side < 0 and np.median(spans) > IDLE:
        return np.nan, 0.0
    if later * np.sign(slope) < steady * abs(slope) or scatter > straight * abs(change):
        return 0.0, 0.0
    return float(slope), float(abs(change))


def _returns(chunk: Chunk, stress: Array) -> list[tuple[float, ...]]:
    """Return one row for each return to small strain.

    A row holds time [s], stress [MPa], strain, the peak before as a share of the
    largest strain, and the change of stress there as a share of its peak.
    """
    strain = (chunk.strain - chunk.strain[0]) / max(reach(chunk), 1e-12)
    size = np.abs(strain)
    where = np.where(size > OUT, 1, np.where(size < HOME, -1, 0))
    known = np.flatnonzero(where)
    swings = np.flatnonzero(np.diff(where[known])) + 1
    rows: list[tuple[float, ...]] = []
    for visit in np.split(known, swings)[1:]:
        if where[visit[0]] > 0:
            top = float(size[visit].max())
            continue
        low = strain[visit][np.argmin(size[visit])]
        visit = visit[np.isfinite(stress[visit])]
        near = visit[np.abs(strain[visit] - low) < 0.5 * LIKE]
        if len(near):
            home = stress[visit[np.abs(strain[visit] - low) < LIKE]]
            span = float(np.ptp(np.quantile(home, [0.1, 0.9]))) / peak(stress)
            middle = chunk.time_s[near[len(near) // 2]]
            rows.append((middle, float(np.median(stress[near])), low, top, span))
    return rows
