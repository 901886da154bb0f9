r"""The specimen slips in the grip from some moment on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softnn.contracts import Effect, Parameter
from softnn.effects._programmes import cycles
from softnn.effects._signs import FEWEST, WIDE, jump, minority, reach

SOME = 0.45  # of the recordings, at most: else it is the material
STEADY = 0.004  # of the largest strain: as evenly as specimens are strained

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
            [jump(c, s) for c, s in zip(chunks, stress_MPa, strict=True)]
        )
        odd = minority(lost, STEADY, above=True, most=SOME)
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
