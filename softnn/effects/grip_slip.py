r"""The specimen slips in the grip from some moment on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Array, Chunk, Effect, Parameter
from softnn.effects._programmes import cycles
from softnn.effects._signs import FEWEST, QUIET, minority, noise, reach

SOME = 0.45  # of the recordings, at most: else it is the material
WIDE = 0.03  # of the time of the first loading: a slip takes no longer
BACK = 0.03  # of the largest strain: less is no way back
EVEN, STEADY = 3.0, 1.5  # ratios of the compliances, and speeds, beside it, at most
LOUD, RARE = 8.0, 4.0  # noises, and times what is usual, that it must be
FEW = 40  # samples of the first loading, too few to see a moment in
EVENLY = 0.004  # of the largest strain: as evenly as specimens are strained

EARLY = (0.015, 0.03, 0.045, 0.06, 0.105)  # of a recording: its first loading


class GripSlip(Effect):
    r"""Slip: some of the strain is lost at a moment, for good.

    .. math:: \varepsilon_{spec} = \varepsilon
              - s \,\mathrm{clip}\!\left(\frac{t - t_0}{d}, 0, 1\right)

    slip s as strain, -0.5 to 0.5, moment t0 in s since the recording began, duration d
    in s. Jaw slippage in tension tests of soft strips, ASTM D412-16, section 13.

    In a recording: the stress drops within d and stays low by slope times s; holds and
    later cycles are shifted. Mistaken for a set (which comes back with every new
    maximum), for damage (a factor, not a shift) and for drift (which has no moment).
    """

    stage = "rig"
    ports = ("strain", "branch_strain")
    parameters = (
        Parameter("slip", "-", -0.5, 0.5, 0.05, meaning="strain lost"),
        Parameter("moment_s", "s", 0.0, 1e7, 1.0, meaning="since the recording began"),
        Parameter("duration_s", "s", 1e-3, 1e5, 0.5, "log", meaning="of the slip"),
    )
    off = {"slip": 0.0}
    amplitude = "slip"
    per_recording = ("slip", "moment_s")
    shape = ("duration_s",)
    some = True
    where = "from one moment on, in some recordings"
    twins = {
        "permanent_set": "a cycle to a larger strain: a set grows, a slip does not",
        "load_cell_drift": "an unloaded stretch at the end",
        "slack": "several cycles at one amplitude",
    }

    lasting = True  # what slipped stays lost in the recordings that go on from here

    @property
    def second_forms(self):
        return (RegrippedSlip(),)

    def before(self, p, signal, state):
        begun, earlier, last = (signal.begun_s, 0.0, 0.0) if state is None else state
        if signal.begun_s != begun and self.lasting:
            earlier = earlier + last
        t = (signal.time_s - signal.begun_s)[:, None]
        own = p["slip"] * np.clip((t - p["moment_s"]) / p["duration_s"], 0, 1)
        lost = earlier + own
        return (
            replace(
                signal,
                strain=signal.strain - lost,
                branch_strain=signal.branch_strain - lost,
            ),
            (signal.begun_s, earlier, own[-1:]),
        )

    def starts(self, scales):
        width = float(np.clip(2 * scales.interval_s, 1e-3, 1e5))
        return [
            {
                "slip": 0.06 * scales.strain,
                "moment_s": share * scales.duration_s,
                "duration_s": width,
            }
            for share in (0.5, *EARLY, *np.arange(0.08, 0.98, 0.05))
        ]

    def shown(self, chunks, stress_MPa):
        """Strain with hardly any stress for a moment of the first loading."""
        if len(chunks) < FEWEST:
            return None
        lost, moment = np.transpose(
            [_jump(c, s) for c, s in zip(chunks, stress_MPa, strict=True)]
        )
        odd = minority(lost, EVENLY, above=True, most=SOME)
        if not len(odd):
            return None
        slip = np.zeros(len(chunks))
        slip[odd] = [lost[i] * reach(chunks[i]) for i in odd]
        slip *= [np.sign(c.strain[np.argmax(np.abs(c.strain))]) for c in chunks]
        loading = [WIDE * moment[i] for i in odd]
        return {
            "slip": slip,
            "moment_s": moment,
            "duration_s": float(np.clip(np.median(loading), 1e-3, 1e5)),
        }

    def telltale(self):
        return cycles([0.5, 0.5, 0.6, 0.6], 0.05)


class RegrippedSlip(GripSlip):
    """The same where the specimen is gripped anew between recordings."""

    lasting = False


def _jump(chunk: Chunk, stress: Array) -> tuple[float, float]:
    """Strain lost at once in the first loading, over the largest; and its moment [s].

    Strain that comes with less stress than before it and after it.
    """
    time, strain, force = _first_loading(chunk, stress)
    if len(time) < FEW:
        return 0.0, 0.0
    width = WIDE * (time[-1] - time[0])
    i = np.arange(len(time))
    a, j, b = (np.searchsorted(time, time + k * width) for k in (-2, 1, 3))
    inside = (time - time[0] > 2 * width) & (b < len(time)) & (i - a > 1) & (j - i > 0)
    a, i, j, b = a[inside], i[inside], j[inside], b[inside]
    rises = np.stack([force[i] - force[a], force[b] - force[j]])
    ways = np.stack([strain[i] - strain[a], strain[b] - strain[j]])
    speeds = ways / np.stack([time[i] - time[a], time[b] - time[j]])
    clear = (rises.min(axis=0) > QUIET * noise(stress)) & (ways.min(axis=0) > 0)
    clear &= speeds.max(axis=0) < STEADY * speeds.min(axis=0)
    if not clear.any():
        return 0.0, 0.0
    i, j = i[clear], j[clear]
    soft = ways[:, clear] / rises[:, clear]
    lost = strain[j] - strain[i] - soft.max(axis=0) * (force[j] - force[i])
    even = soft.max(axis=0) < EVEN * soft.min(axis=0)
    loud = lost / soft.max(axis=0) < LOUD * noise(stress)
    usual = float(np.quantile(np.abs(lost), 0.75))
    lost = np.where(even & ~loud & (lost > RARE * usual), lost, 0.0)
    most = float(lost.max())
    if not most > 0:
        return 0.0, 0.0
    whole = np.flatnonzero(lost > 0.9 * most)
    middle = 0.5 * (time[i[whole[0]]] + time[j[whole[-1]]])
    return most / reach(chunk), float(middle - chunk.time_s[0])


def _first_loading(chunk: Chunk, stress: Array) -> tuple[Array, Array, Array]:
    """Time, and strain and stress counted upwards, before strain first comes back."""
    top = reach(chunk)
    side = np.sign(chunk.strain[np.argmax(np.abs(chunk.strain) > BACK * top)])
    strain = side * chunk.strain
    most = np.maximum.accumulate(strain)
    back = most - strain > BACK * top
    end = int(np.argmax(back)) if back.any() else len(back)
    end = int(np.argmax(most[:end] > 0.98 * most[end - 1]))
    good = np.flatnonzero(np.isfinite(stress[:end]))
    return chunk.time_s[good], strain[good], side * stress[good]
