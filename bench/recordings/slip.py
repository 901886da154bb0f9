"""What a recording would be, had the specimen slipped in its grip.

The crosshead goes on at its speed, so the strain that the machine counts is unchanged.
The specimen slides out by s within a fraction of a second. The force falls, and from
then on the specimen sees the strain less s. What it then bears is read off the
recording itself, on the same branch: in a ramp, the stress that this ramp had at the
smaller strain. So the noise stays that of the recording.

Where the recording does not say, this is assumed:

- below the strain at which a ramp begins, its stress goes on straight, as steep as over
  its first s;
- after a turn the ramp before and the ramp after disagree on what the smaller strain
  means; the difference dies away over the ramp, in proportion to strain;
- in a hold, what the slip took from the stress relaxes in proportion to the stress;
- a loose specimen bears no less than the least that it bore in the recording: a strip
  buckles, and a platen lifts off.

A slip cannot be made so where a specimen is pulled and pushed (its grip slides back),
where too few samples tell the branch, or where the stress does not rise all along it
(a joint that slides already).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bench.recordings.groups import REVERSAL, amplitude, first_turn
from softnn.contracts import Array
from softnn.recording import Recording, bridged

BAND = 0.005  # of the range of strain: less is no motion
LONG = 10.0  # times the usual stay in a band: a hold
FEW = 24  # samples that tell a branch
ONE_WAY = 0.03  # of the largest strain: less on the other side does not count
NOMINAL, MOMENT = 0.1, 0.7  # slid, and strain at that moment, of the largest strain
RISES = 0.01  # of the largest stress, which the nominal slip takes at least


def side(recording: Recording) -> float:
    """1 in tension, -1 in compression."""
    strain = recording.strain
    return float(np.sign(strain[np.nanargmax(np.abs(strain))]))


def one_sided(recording: Recording) -> bool:
    """Whether a specimen is only pulled, or only pushed."""
    along = side(recording) * recording.strain
    return float(-np.nanmin(along)) <= ONE_WAY * amplitude(recording)


def loading_s(recording: Recording) -> float:
    """Time of the first loading, to its largest strain, s; never zero."""
    size = np.nan_to_num(np.abs(recording.strain[: first_turn(recording)]))
    top = int(np.argmax(size >= (1 - BAND) * size.max()))
    taken = float(recording.time_s[top] - recording.time_s[0])
    return taken or float(np.median(np.diff(recording.time_s)))


@dataclass(frozen=True)
class Segment:
    """Samples `first` to `last`, the end of one being the beginning of the next."""

    first: int
    last: int
    held: bool

    @property
    def rows(self) -> slice:
        return slice(self.first, self.last + 1)


class Ramp:
    """Stress over strain of one ramp, also a little before it began."""

    def __init__(self, strain: Array, stress: Array, most: float) -> None:
        self.way = 1.0 if strain[-1] >= strain[0] else -1.0
        on = np.maximum.accumulate(self.way * strain)
        good = np.isfinite(stress) & np.append(True, np.diff(on) > 0)
        # Where nothing was measured, nothing can be taken.
        self.x: Array = on[good] if good.any() else np.zeros(1)
        self.y: Array = stress[good] if good.any() else np.zeros(1)
        reach = min(most, float(np.ptp(self.x))) if len(self.x) > 1 else 0.0
        self.low = self._slope(self.x[0], self.x[0] + reach) if reach else 0.0
        self.high = self._slope(self.x[-1] - reach, self.x[-1]) if reach else 0.0

    def _slope(self, a: float, b: float) -> float:
        ya, yb = np.interp([a, b], self.x, self.y)
        return float(yb - ya) / (b - a)

    def at(self, strain: Array) -> Array:
        """Stress (n,) at these strains (n,)."""
        x = self.way * strain
        inside = np.interp(x, self.x, self.y)
        under, over = np.minimum(x - self.x[0], 0), np.maximum(x - self.x[-1], 0)
        return np.asarray(inside + self.low * under + self.high * over)


@dataclass(frozen=True)
class Slip:
    """A slip by `share` of the largest strain within `duration_s` [s].

    It begins when the strain first comes to `MOMENT` of the largest.
    """

    share: float
    duration_s: float

    def of(self, recording: Recording) -> tuple[Array, dict[str, float]]:
        """Stress (n,) after the slip, and the values of its law."""
        way, time = side(recording), recording.time_s - recording.time_s[0]
        strain = way * bridged(recording.strain, recording.time_s)
        stress = way * recording.stress_MPa
        most = self.share * float(np.abs(strain).max())
        moment = float(time[np.argmax(strain >= MOMENT * strain.max())])
        slid = most * np.clip((time - moment) / self.duration_s, 0, 1)
        gone = taken(segments(time, strain), strain, stress, slid)
        made = np.maximum(stress - gone, np.nanmin(stress))
        return np.where(slid > 0, way * made, recording.stress_MPa), {
            "slip": way * most,
            "moment_s": moment,
            "duration_s": self.duration_s,
        }


def possible(recording: Recording) -> bool:
    """Whether the recording tells what a slip would do, and that the force falls."""
    if not one_sided(recording):
        return False
    way = side(recording)
    strain = way * bridged(recording.strain, recording.time_s)
    stress = way * recording.stress_MPa
    top = float(strain.max())
    at = int(np.argmax(strain >= MOMENT * top))
    parts = segments(recording.time_s, strain)
    mine = next(p for p in parts if p.last > at or p.last == len(strain) - 1)
    if mine.held or mine.last - mine.first < FEW:
        return False
    ramp = Ramp(strain[mine.rows], stress[mine.rows], NOMINAL * top)
    after = np.linspace(strain[at], strain[mine.last], FEW)
    falls = ramp.at(after) - ramp.at(after - NOMINAL * top)
    least = RISES * float(np.nanmax(np.abs(stress)))
    return bool(min(falls[0], np.quantile(falls, 0.2)) > least)


def taken(parts: list[Segment], strain: Array, stress: Array, slid: Array) -> Array:
    """Stress (n,) that a slip takes away; strain and stress positive as in loading."""
    out = np.zeros(len(strain))
    ramp, left, most = None, 0.0, float(slid.max())
    for part in parts:
        x, y, s = strain[part.rows], stress[part.rows], slid[part.rows]
        if not part.held:
            ramp = Ramp(x, y, most)
            mine = ramp.at(x) - ramp.at(x - s)
            gone = np.abs(x - x[0]) / max(abs(float(x[-1] - x[0])), 1e-300)
            mine = mine + (left - mine[0]) * np.clip(1 - gone, 0, 1)
        elif ramp is None:
            mine = np.zeros(len(x))
        else:
            mine = left + ramp.at(x[0] - s[:1]) - ramp.at(x[0] - s)
            top = np.nanmax(np.abs(stress))
            if abs(y[0]) > RISES * top:
                mine = mine * np.clip(np.nan_to_num(y / y[0], nan=1.0), 0, 1)
        out[part.rows] = mine
        left = float(mine[-1])
    return out


def segments(time: Array, strain: Array) -> list[Segment]:
    """Ramps and holds: between turns of the strain, and where it stands still."""
    span = float(np.ptp(strain))
    held = _held(time, strain, BAND * span)
    cuts = set(_turns(strain, REVERSAL * span)) | {0, len(strain) - 1}
    for first, last in held:
        cuts = {c for c in cuts if not first < c < last} | {first, last}
    order = sorted(cuts)
    still = {first for first, _ in held}
    return [Segment(a, b, a in still) for a, b in pairwise(order)]


def _turns(strain: Array, back: float) -> list[int]:
    """Samples where the strain turns and then goes back by so much."""
    out, way, best = [], 0, 0
    for i, x in enumerate(strain):
        if way == 0:
            if abs(x - strain[0]) > back:
                way, best = (1 if x > strain[0] else -1), i
        elif way * (x - strain[best]) >= 0:
            best = i
        elif way * (strain[best] - x) > back:
            out.append(best)
            way, best = -way, i
    return out


def _held(time: Array, strain: Array, band: float) -> list[tuple[int, int]]:
    """First and last samples of holds: long stays within a band of strain."""
    edges, first = [0], 0
    for i, x in enumerate(strain):
        if abs(x - strain[first]) > band:
            edges.append(i)
            first = i
    edges.append(len(strain) - 1)
    stays = [(a, b) for a, b in pairwise(edges) if b > a]
    took = np.array([time[b] - time[a] for a, b in stays])
    usual = float(np.median(took))
    out: list[tuple[int, int]] = []
    for (a, b), seconds in zip(stays, took, strict=True):
        if seconds <= LONG * usual or b - a < 5:
            continue
        if b < len(strain) - 1:
            b -= 1  # the sample that left the band
        if out and a - out[-1][1] <= 1:
            out[-1] = out[-1][0], b
        else:
            out.append((a, b))
    # A slow ramp stays long in every band, and yet gets on.
    return [(a, b) for a, b in out if abs(strain[b] - strain[a]) <= 3 * band]
