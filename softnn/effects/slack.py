r"""The specimen hangs loose in the grips until its gap is taken up."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Array, Chunk, Effect, Parameter
from softnn.effects._programmes import cycles
from softnn.effects._signs import (
    FEWEST,
    QUIET,
    UNMOVED,
    at_rest,
    minority,
    noise,
    peak,
    reach,
)

LITTLE = 0.01  # share of the least peak stress that counts as no stress yet
TAUT = 0.003  # share of the largest strain that a gap has even in closed grips
# Starts, of the largest strain: from a large one a fit may miss a small gap.
GAPS = (0.04, 0.01)
START = 0.5  # share of the largest strain up to which the first loading is judged
FASTER = 1.3  # ratio of speeds beyond which two loadings are not comparable
MOST = 0.75  # largest share of recordings that may be slack beside taut ones


class Slack(Effect):
    r"""Take-up: no strain reaches the specimen before the gap is closed.

    .. math:: \varepsilon_{spec} = \varepsilon - T(\varepsilon), \qquad
              T = \operatorname{sgn}(\varepsilon) \min(|\varepsilon|, g)

    g is the gap of a recording as strain, 0 to 0.5; in compression it is the way to
    contact. With `toe` w > 0 the corner at g is
    rounded over w g: a foot in place of a dead zone. ASTM D638-14, annex A1 (toe
    compensation).

    In a recording: no stress at first, then the usual curve, shifted. Mistaken for a
    zero offset (present before any strain), for a soft foot of the material (which all
    recordings share) and for a set (which grows).
    """

    stage = "rig"
    ports = ("strain", "branch_strain")
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "gap",
            "-",
            0.0,
            0.5,
            0.03,
            meaning="strain taken up by slack",
            per_strain=-1,
        ),
        Parameter("toe", "-", 0.0, 3.0, 0.0, meaning="width of the foot over the gap"),
    )
    off = {"gap": 0.0}
    amplitude = "gap"
    per_recording = ("gap",)
    carries_over = True  # strips are mounted alike
    shape: tuple[str, ...] = ("toe",)
    family = "a shift of strain"
    where = "at small strain, before the specimen is taut"
    twins = {
        "zero_offset": "a hold at zero strain before loading",
        "permanent_set": "a second loading beyond the first maximum",
        "grip_slip": "several cycles at one amplitude",
    }

    def before(self, p, signal, state):
        gap, toe = p["gap"], p["toe"]

        def taut(strain):
            width = np.maximum(toe * gap, 1e-12)
            size = np.abs(strain)
            x = size - gap
            # Rounded ramp: quadratic over gap -+ width, straight outside.
            soft = np.where(
                x > width, x, np.where(x > -width, (x + width) ** 2 / 4 / width, 0)
            )
            return np.where(gap > 0, np.sign(strain) * np.minimum(soft, size), strain)

        return (
            signal.having(
                strain=taut(signal.strain),
                branch_strain=taut(signal.branch_strain),
            ),
            None,
        )

    @property
    def second_forms(self):
        return (Foot(), GrowingGap(), Backlash())

    def starts(self, scales):
        return [{"gap": share * scales.strain, "toe": 0.0} for share in GAPS]

    def shown(self, chunks, stress_MPa):
        """Gap, as strain, for recordings that strain without stress at the start.

        Other recordings must show stress at once; None where they do not.
        """
        much = max(
            QUIET * max(map(noise, stress_MPa)), LITTLE * min(map(peak, stress_MPa))
        )
        way, more = np.transpose(
            [_taken_up(c, s, much) for c, s in zip(chunks, stress_MPa, strict=True)]
        )
        known = np.flatnonzero(np.isfinite(way))
        if len(known) < FEWEST:
            return None
        # As well as it can be told: the strain by which the stress grows by as much.
        floor = max(
            TAUT * min(map(reach, chunks)), float(np.median((more - way)[known])) / 3
        )
        loose = known[minority(way[known], floor, above=True, most=MOST)]
        if not len(loose):
            return None
        # A channel that lags keeps quiet as well, the longer the faster the strain.
        rate = np.array([_pace(c) for c in chunks])
        loose = loose[rate[loose] < FASTER * rate[np.setdiff1d(known, loose)].max()]
        if not len(loose):
            return None
        gap = np.zeros(len(chunks))
        gap[loose] = way[loose] - np.median(way[np.setdiff1d(known, loose)])
        return {"gap": gap}

    def telltale(self):
        return cycles([0.3, 0.6, 0.6], 0.05)


class Foot(Slack):
    """Slack with a rounded corner from the start of the search.

    A free spring absorbs the gap that all recordings share while the corner is sharp. A
    rounded corner is wider where the gap is wider, so only the corner reveals the size
    of a shared gap.
    """

    def starts(self, scales):
        return [{"gap": GAPS[0] * scales.strain, "toe": 0.3}]


class GrowingGap(Slack):
    r"""A gap that widens with time: a knot that loosens, teeth that cut in.

    .. math:: g(t) = g\,(1 + \rho\,t)

    growth rho in 1/s, the same in all recordings; t since the specimen was mounted.
    """

    parameters = (
        *Slack.parameters,
        Parameter("growth_per_s", "1/s", 0.0, 1e3, 0.01, meaning="rho"),
    )

    def before(self, p, signal, state):
        mounted = signal.begun_s if state is None else state
        t = (signal.time_s - mounted)[:, None]
        wider = {"gap": p["gap"] * (1 + p["growth_per_s"] * t), "toe": p["toe"]}
        return super().before(wider, signal, None)[0], mounted

    def starts(self, scales):
        growth = float(min(2 / np.max(scales.duration_s), 1e3))
        return [
            {"gap": gap * scales.strain, "toe": 0.0, "growth_per_s": growth}
            for gap in GAPS
        ]


class Backlash(Slack):
    r"""Play in the load train: at each turn the gap is crossed before the grip follows.

    .. math:: \varepsilon - s g \;\le\; \varepsilon_{spec} \;\le\;
              \varepsilon + (1 - s)\,g

    and otherwise the specimen stays as it is; seat s is the share of the gap that a
    first pull has to cross. Nordin and Gutman 2002,
    doi:10.1016/S0005-1098(02)00047-X.
    """

    parameters = Slack.parameters[:1] + (
        Parameter("seat", "-", 0.0, 1.0, 0.5, meaning="s, crossed by the first pull"),
    )
    shape = ("seat",)

    def before(self, p, signal, state):
        from softnn.effects._kernels import play

        strains = signal.strain, signal.branch_strain
        behind = p["seat"] * p["gap"]
        ahead = (1 - p["seat"]) * p["gap"]
        sets = max(behind.size, *(x.shape[1] for x in strains))
        carried = np.zeros((2, sets)) if state is None else state
        carried = np.broadcast_to(carried, (2, sets)).copy()
        moved = [np.empty((len(x), sets)) for x in strains]
        for x, inner, out in zip(strains, carried, moved, strict=True):
            play(x, behind, ahead, inner, out)
        return signal.having(strain=moved[0], branch_strain=moved[1]), carried

    def starts(self, scales):
        return [{"gap": GAPS[0] * scales.strain, "seat": 0.5}]


def _taken_up(chunk: Chunk, stress: Array, much: float) -> tuple[float, float]:
    """Strains at which the stress leaves its level at rest by `much`, and by more.

    `much` is in MPa. Both are nan where a recording does not begin at rest, or does not
    reach that stress.
    """
    level = at_rest(chunk, stress)
    if not np.isfinite(level):
        return np.nan, np.nan
    size = np.fmax.accumulate(np.nan_to_num(np.abs(stress - level)))
    way = np.abs(chunk.strain - chunk.strain[0])
    first, more = np.searchsorted(size, [much, 2 * much])
    if more == len(size):
        return np.nan, np.nan
    return float(way[max(first - 1, 0)]), float(way[more])


def _pace(chunk: Chunk) -> float:
    """Return the strain rate [1/s] over the first half of the first loading."""
    size, (_, still) = np.abs(chunk.strain - chunk.strain[0]), UNMOVED
    a = max(int(np.argmax(size > still * reach(chunk))) - 1, 0)
    b = max(int(np.argmax(size > START * reach(chunk))), a + 1)
    seconds = chunk.time_s[b] - chunk.time_s[a]
    return float((size[b] - size[a]) / max(seconds, 1e-9))
