r"""The specimen slips in the grip from some moment on."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Chunk, Effect, Parameter, increments
from softnn.effects._programmes import cycles
from softnn.effects._signs import FEWEST, QUIET, minority, noise, reach

SOME = 0.45  # share of recordings that may slip; beyond it the material is the cause
WIDE = 0.03  # of the time of the first loading: a slip takes no longer
BACK = 0.03  # of the largest strain: a smaller return is no unloading
EVEN, STEADY = 3.0, 1.5  # ratios of the compliances, and speeds, beside it, at most
LOUD, RARE = 8.0, 4.0  # least size of a slip, in noise levels and usual steps
FEW = 24  # samples of the first loading; fewer do not resolve a moment
YIELDS = 0.15  # share of the load that the second half of the loading must add
STILL = 0.1  # share of the slip that strain may move around it, and stress answer
EVENLY = 0.004  # of the largest strain: as evenly as specimens are strained

# How long a slip may last, in two intervals; shares of a recording between moments.
CLOSER = ((1.0, 0.005), (5.0, 0.02), (25.0, 0.04))
FIRST = 0.01  # of a recording, between moments that are asked at first


class GripSlip(Effect):
    r"""Slip: some of the strain is lost at a moment, for good.

    .. math:: \varepsilon_{spec} = \varepsilon
              - s \,\mathrm{clip}\!\left(\frac{t - t_0}{d}, 0, 1\right)

    slip s as strain, -10 to 10, moment t0 in s since the recording began, duration d
    in s. Jaw slippage in tension tests of soft strips, ASTM D412-16, section 13.

    In a recording: the stress drops within d and stays low by slope times s; holds and
    later cycles are shifted. Mistaken for a set (which comes back with every new
    maximum), for damage (a factor, not a shift) and for drift (which has no moment).
    """

    stage = "rig"
    ports = ("strain", "branch_strain")
    parameters: tuple[Parameter, ...] = (
        Parameter("slip", "-", -10.0, 10.0, 0.05, meaning="strain lost", per_strain=-1),
        Parameter("moment_s", "s", 0.0, 1e7, 1.0, meaning="since the recording began"),
        Parameter("duration_s", "s", 1e-3, 1e5, 0.5, "log", meaning="of the slip"),
    )
    off = {"slip": 0.0}
    amplitude = "slip"
    per_recording: tuple[str, ...] = ("slip", "moment_s")
    shape: tuple[str, ...] = ("duration_s",)
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
        return (RegrippedSlip(), CreepingGrip())

    def before(self, p, signal, state):
        begun, earlier, last = (signal.begun_s, 0.0, 0.0) if state is None else state
        if signal.begun_s != begun and self.lasting:
            earlier = earlier + last
        t = (signal.time_s - signal.begun_s)[:, None]
        own = p["slip"] * np.clip((t - p["moment_s"]) / p["duration_s"], 0, 1)
        lost = earlier + own
        return (
            signal.having(
                strain=signal.strain - lost,
                branch_strain=signal.branch_strain - lost,
            ),
            (signal.begun_s, earlier, own[-1:]),
        )

    def within(self, scales):
        """Return the law with the sign of slip that the load allows.

        A specimen in tension slips out of the grip, one in compression into it.
        """
        if not scales.side:
            return self
        law, slip = copy(self), self.parameters[0]
        ends = sorted([0.0, scales.side * max(slip.high, -slip.low)])
        law.parameters = (
            replace(slip, low=ends[0], high=ends[1]),
            *self.parameters[1:],
        )
        return law

    def starts(self, scales):
        return self.at((0.5, *np.arange(FIRST, 0.98, FIRST)), scales)

    def closer(self, scales):
        return [
            self.at(np.arange(step / 2, 1, step), scales, times)
            for times, step in CLOSER
        ]

    def at(self, shares, scales, times=1.0):
        """Return starts with the slip at these shares of each recording.

        The durations are `times` as long as the shortest, two sampling intervals.
        """
        width = float(np.clip(2 * times * scales.interval_s, 1e-3, 1e5))
        return [
            {
                "slip": 0.06 * (scales.side or 1) * scales.strain,
                "moment_s": share * scales.duration_s,
                "duration_s": width,
            }
            for share in shares
        ]

    def shown(self, chunks, stress_MPa):
        """Slip, moment and duration where strain grows suddenly at almost no stress.

        Only the first loading is searched; None where too many recordings or none show
        it.
        """
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

    def possible(self, values, chunks, stress):
        """Return (n,) whether each recording bears load at the moment of its slip.

        A specimen without load hangs loose and cannot slip.
        """
        moments = np.broadcast_to(values["moment_s"], len(chunks))
        return np.array(
            [
                float(moment) > _loaded(c, s)
                for moment, c, s in zip(moments, chunks, stress, strict=True)
            ]
        )

    def telltale(self):
        return cycles([0.5, 0.5, 0.6, 0.6], 0.05)


class RegrippedSlip(GripSlip):
    """Grip slip where the specimen is gripped anew between recordings."""

    lasting = False


class CreepingGrip(GripSlip):
    r"""A specimen that creeps out of its grips, faster at larger strain.

    .. math:: \dot s = r\,|\varepsilon_{spec}|^n \operatorname{sgn} \varepsilon_{spec}

    rate r in 1/s at a strain of 1, exponent n: 1 creeps steadily, a large one holds up
    to some strain and gives way there. Power law of Norton 1929, *The Creep of Steel at
    High Temperatures*, for the friction in the jaws.
    """

    parameters = (
        Parameter("rate_per_s", "1/s", 0.0, 1e6, 0.01, meaning="r, at a strain of 1"),
        Parameter("exponent", "-", 1.0, 20.0, 3.0, "log", "n"),
    )
    off = {"rate_per_s": 0.0}
    amplitude = "rate_per_s"
    per_recording = ()
    shape = ()
    some = False
    where = "little by little, at large strain the most"
    within, possible = Effect.within, Effect.possible

    def before(self, p, signal, state):
        from softnn.effects._kernels import flow

        rate, power = p["rate_per_s"], p["exponent"]
        time, strains = signal.time_s, (signal.strain, signal.branch_strain)
        sets = max(rate.size, power.size, *(x.shape[1] for x in strains))
        if state is None:
            state = time[0], [(0.0, np.zeros(sets))] * 2
        step = increments(time, state[0])[:, None]
        slow = 1 / np.maximum(rate, 1e-300)
        moved, inner = [], []
        for x, (last, carried) in zip(strains, state[1], strict=True):
            carried = np.broadcast_to(carried, (sets,)).copy()
            out = np.empty((len(x), sets))
            increment = increments(x, last)
            flow(step, increment, slow, np.ones(1), power, carried, out)
            moved.append(np.where(rate > 0, out, x))  # sums are not exact
            inner.append((x[-1:], carried))
        new = signal.having(strain=moved[0], branch_strain=moved[1])
        return new, (time[-1], inner)

    def starts(self, scales):
        slip = 0.1 * scales.strain / float(np.max(scales.duration_s))
        return [
            {"rate_per_s": float(min(slip / scales.strain**n, 1e6)), "exponent": n}
            for n in (6.0, 2.0)
        ]

    def closer(self, scales):
        return []


def _loaded(chunk: Chunk, stress: Array) -> float:
    """Return the time [s] at which a specimen bears `YIELDS` of its largest load."""
    load = np.nan_to_num(np.abs(stress - stress[np.isfinite(stress)][0]))
    return float(chunk.time_s[np.argmax(load >= YIELDS * load.max())] - chunk.time_s[0])


def _jump(chunk: Chunk, stress: Array) -> tuple[float, float]:
    """Largest sudden loss of strain in the first loading, and its moment [s].

    The loss is a share of the largest strain.
    """
    top, level = reach(chunk), noise(stress)
    found = (0.0, 0.0)
    for whole, lost_in in ((False, _in_motion), (True, _at_rest)):
        time, strain, force = _first_loading(chunk, stress, whole)
        if len(time) < FEW:
            continue
        step = float(np.median(np.diff(time)))
        width = max(WIDE * (time[-1] - time[0]), 1.01 * step)
        i = np.arange(len(time))
        a, j, b = (np.searchsorted(time, time + k * width) for k in (-2, 1, 3))
        inside = (time - time[0] > 2 * width) & (b < len(time)) & (i - a > 1)
        edges = np.stack([a, i, j, b])[:, inside & (j > i)]
        lost = lost_in(time, strain, force, edges, level)
        most = float(lost.max(initial=0.0))
        if most > max(found[0], EVENLY) * top:
            moments = edges[1:3, lost > 0.9 * most]
            middle = 0.5 * (time[moments[0, 0]] + time[moments[1, -1]])
            found = (most / top, float(middle - chunk.time_s[0]))
    return found


def _in_motion(
    time: Array, strain: Array, force: Array, edges: NDArray[np.integer], level: float
) -> Array:
    """Strain that comes with less stress than the strain before and after it."""
    a, i, j, b = edges
    rises = np.stack([force[i] - force[a], force[b] - force[j]])
    ways = np.stack([strain[i] - strain[a], strain[b] - strain[j]])
    took = np.stack([time[i] - time[a], time[b] - time[j]])
    speeds = ways / np.where(took > 0, took, np.inf)  # time stamps may repeat
    clear = (rises.min(axis=0) > QUIET * level) & (ways.min(axis=0) > 0)
    clear &= took.min(axis=0) > 0
    clear &= speeds.max(axis=0) < STEADY * speeds.min(axis=0)
    if not clear.any():
        return np.zeros(len(i))
    soft = ways / np.where(clear, rises, 1.0)
    softer = soft.max(axis=0)
    lost = strain[j] - strain[i] - softer * (force[j] - force[i])
    usual = float(np.quantile(np.abs(lost[clear]), 0.75))
    clear &= softer < EVEN * soft.min(axis=0)
    clear &= lost > np.maximum(LOUD * level * softer, RARE * usual)
    return np.where(clear, lost, 0.0)


def _at_rest(
    time: Array, strain: Array, force: Array, edges: NDArray[np.integer], level: float
) -> Array:
    """Return the strain that moves between two rests under load at almost no stress."""
    a, i, j, b = edges
    way = strain[j] - strain[i]
    beside = np.maximum(np.abs(strain[i] - strain[a]), np.abs(strain[b] - strain[j]))
    most = np.maximum.accumulate(force - force[0])
    load = most[i]
    # As stiff as the loading was; what relaxes meanwhile is no answer.
    due = load * way / np.maximum(strain[i] - strain[0], 1e-12)
    half = np.searchsorted(np.maximum.accumulate(strain), 0.5 * (strain[i] + strain[0]))
    clear = load - most[half] > YIELDS * load  # what slides moves at one stress
    clear &= (beside < STILL * way) & (due > LOUD * level)
    return np.where(clear & (force[j] - force[i] < STILL * due), way, 0.0)


def _first_loading(
    chunk: Chunk, stress: Array, whole: bool
) -> tuple[Array, Array, Array]:
    """Return time [s], strain and stress [MPa] before strain first comes back.

    Strain and stress are positive in the direction of loading; `whole` keeps a rest at
    the end.
    """
    top = reach(chunk)
    side = np.sign(chunk.strain[np.argmax(np.abs(chunk.strain) > BACK * top)])
    strain = side * chunk.strain
    most = np.maximum.accumulate(strain)
    back = most - strain > BACK * top
    end = int(np.argmax(back)) if back.any() else len(back)
    if not whole:
        end = int(np.argmax(most[:end] > 0.98 * most[end - 1]))
    good = np.flatnonzero(np.isfinite(stress[:end]))
    return chunk.time_s[good], strain[good], side * stress[good]
