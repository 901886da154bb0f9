"""Effects between the machine's strain and the specimen's: slack and grip slip."""

from __future__ import annotations

import numpy as np

from bench.concealed.planting import Context, Planted
from bench.concealed.programmes import STEP_S, Array, Imposed


def slack(c: Context) -> Planted:
    """Take-up of 2-8 % of the largest strain; the strip straightens gradually."""
    form = c.pick("crimped", "curled")
    gaps = [c.pace.peak * c.amount(0.02, 0.08) for _ in c.programmes]
    width = c.rng.uniform(0.08, 0.15)

    def rig(i: int, programme: Imposed, strain: Array) -> Array:
        gap = gaps[i]
        if form == "crimped":  # fibres of scattered length come taut one by one
            w = width * gap
            return w * (np.logaddexp(0, (strain - gap) / w) - np.logaddexp(0, -gap / w))
        # A curled strip bends open as it is pulled: a hyperbola.
        w = 2 * width * gap
        return (np.hypot(strain - gap, w) + strain - np.hypot(gap, w)) / 2

    return Planted("slack", form, {"gap": gaps, "width": width}, rig=rig)


def grip_slip(c: Context) -> Planted:
    """6-14 % of the largest strain lost from a moment under load on."""
    form = c.pick("sudden", "creeping")
    which = c.some(c.rng.uniform(0.3, 0.5))
    when: dict[int, float] = {}
    size: dict[int, float] = {}
    for i in which:
        strain = c.programmes[i].strain
        # Not at the very end: a slip that nothing follows leaves no trace.
        taut = np.flatnonzero(strain[: int(0.7 * len(strain))] > 0.5 * strain.max())
        taut = taut if len(taut) else np.flatnonzero(strain > 0.5 * strain.max())
        when[i] = float(c.rng.choice(taut)) * STEP_S
        size[i] = c.pace.peak * c.amount(0.06, 0.14)
    lasting = c.rng.uniform(0.1, 0.5) if form == "sudden" else c.rng.uniform(1.0, 4.0)

    def rig(i: int, programme: Imposed, strain: Array) -> Array:
        if i not in when:
            return strain
        t = programme.time_s - when[i]
        if form == "sudden":
            return strain - size[i] * (1 + np.tanh(2 * (t / lasting - 1))) / 2
        return strain - size[i] * -np.expm1(-np.maximum(t, 0) / lasting)

    return Planted(
        "grip_slip",
        form,
        {"size": size, "when_s": when, "lasting_s": lasting},
        rig=rig,
    )
