r"""Strain that stays when the load is gone, and grows with the largest strain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from softnn.contracts import Array, Effect, Parameter, Signal, increments
from softnn.effects._programmes import cycles
from softnn.effects.cyclic_softening import TravelSoftening


class PermanentSet(Effect):
    r"""Residual strain: the stress-free length grows with the largest strain so far.

    .. math:: \varepsilon_{el} = \varepsilon - a\,
              \left(f + (1 - f) \log_{10}(1 + N)\right) \left[
              \left(\max_{s \le t} \varepsilon^+(s) - y\right)_+^p
              - \left(\max_{s \le t} \varepsilon^-(s) - y\right)_+^p \right]

    a is the ratio of set to largest strain (at strain 1), p its exponent, yield y the
    strain from which the set grows. The share f appears with the first loading. The
    rest comes with N cycles, counted by travel (Derham and Thomas 1977, *Rubber Chem.
    Technol.* 50, 397-402). With `on_return` r above 0 the set appears as the specimen
    comes back, in full at zero: the visible share is 1 - (strain / largest)^(1/r). On
    first loading the set is part of the curve and invisible; on reloading the curve is
    shifted. A strip that has grown longer hangs slack, a shortened block lies loose.
    `buckling` b is the share of reversed strain within the set that reaches neither
    spring nor branches for that reason. The branches see the share v of the set: 1
    where the specimen has changed its length, 0 where only the permanent network has
    set. Dorfmann and Ogden 2004, doi:10.1016/j.ijsolstr.2003.11.014.

    In a recording: stress reaches zero before strain does, and each reloading starts
    later after a larger peak.

    Mistaken for slack (which does not grow), for a zero offset and for slow relaxation
    (which a pause heals).
    """

    stage = "material"
    on_return = True
    ports: tuple[str, ...] = ("strain", "branch_strain")
    parameters: tuple[Parameter, ...] = (
        Parameter("ratio", "-", 0.0, 0.95, 0.1, meaning="set over largest strain at 1"),
        Parameter("exponent", "-", 0.2, 5.0, 1.0, "log", "growth of the set"),
        Parameter(
            "yield_strain",
            "-",
            0.0,
            2.0,
            0.0,
            meaning="where the set begins",
            per_strain=-1,
        ),
        Parameter("on_return", "-", 0.0, 3.0, 0.0, meaning="r, how late it shows"),
        Parameter("buckling", "-", 0.0, 1.0, 0.0, meaning="b, loss when slack"),
        Parameter("viscous_share", "-", 0.0, 1.0, 1.0, meaning="v, of the branches"),
        Parameter("first", "-", 0.0, 1.0, 1.0, meaning="f, share of the first loading"),
    )
    off: Mapping[str, float] = {"ratio": 0.0}
    amplitude = "ratio"
    shape: tuple[str, ...] = (
        "exponent",
        "yield_strain",
        "on_return",
        "buckling",
        "viscous_share",
        "first",
    )
    family = "a shift of strain"
    where = "on unloading and reloading, near zero stress"
    twins = {
        "slack": "cycles to growing strain: a set grows with them, slack does not",
        "zero_offset": "cycles to growing strain from a zeroed load cell",
        "grip_slip": "a second cycle to the same strain",
        "mullins_softening": "reloading to near zero strain, where softening vanishes",
        "nonlinear_viscosity": "the same cycles at rates two decades apart, or a pause",
    }

    @property
    def second_forms(self):
        return (PlasticElement(), CreptSet())

    def before(self, p, signal, state):
        strain, y = signal.strain, p["yield_strain"]
        above, below, counted = (0.0, 0.0, None) if state is None else state
        above = np.maximum.accumulate(np.maximum(np.maximum(strain, 0), above))
        below = np.maximum.accumulate(np.maximum(np.maximum(-strain, 0), below))
        number, counted = TravelSoftening().count({}, signal, counted)
        grown = (p["first"] + (1 - p["first"]) * np.log10(1 + number)) * (
            np.maximum(above - y, 0) ** p["exponent"]
            - np.maximum(below - y, 0) ** p["exponent"]
        )
        largest = np.maximum(np.where(strain >= 0, above, below), 1e-12)
        near = np.clip(np.abs(strain) / largest, 1e-12, 1)
        late = p["on_return"]
        hidden = np.exp(np.log(near) / np.maximum(late, 0.02))
        shift = p["ratio"] * grown * np.where(late >= 0.02, 1 - hidden, 1.0)
        new = _shifted(p, signal, shift)
        # The side to which the specimen has been strained further: it hangs slack, or
        # lies loose between the plates, where it would have to bear the other sign.
        # Within the set only: without a set this is no slender strip (`tension_only`).
        side = np.sign(above - below) * (p["ratio"] > 0)

        def taut(x: Array) -> Array:
            return np.where(side * x < 0, (1 - p["buckling"]) * x, x)

        new = replace(
            new, strain=taut(new.strain), branch_strain=taut(new.branch_strain)
        )
        return new, (above[-1:], below[-1:], counted)

    def starts(self, scales):
        return [
            {
                "ratio": 0.1 * scales.strain ** (1 - p),
                "exponent": p,
                "yield_strain": 0.0,
                "on_return": r,
                "buckling": b,
                "viscous_share": v,
                "first": f,
            }
            for p, r, b, v, f in (
                (1, 0, 0, 1, 1),
                (2, 0, 0, 1, 1),
                (1, 0.1, 0.9, 1, 1),
                (1, 1, 0, 1, 1),
                (1, 0, 0, 0, 1),
                (1, 1, 0, 0, 1),
                (1, 0, 0, 1, 0.5),
                (1, 0.1, 0.9, 1, 0.5),
                (1, 0.1, 0, 0, 0.5),
            )
        ]

    def telltale(self):
        return cycles([0.3, 0.3, 0.6, 0.6], 0.05)


class PlasticElement(PermanentSet):
    r"""A plastic element in parallel to the rest, which keeps a strain when unloaded.

    .. math:: \sigma_p = E g, \qquad
              dg = d\varepsilon - (|d\varepsilon| + \rho\,dt)
                   \left|\frac{g}{y}\right|^{n} \mathrm{sign}\, g

    stiffness E in MPa, yield y as strain of the spring, sharpness n of the yield, pace
    rho in 1/s. With rho 0 the flow is that of a power-law dashpot with travel in place
    of time. It is then the same at every rate, stops in a pause and grows a little at
    each further peak. With rho above 0 fast straining delays the yield. An element that
    yields below 10 % of strain counts as friction, one of a lower power as viscosity.
    Valanis 1971, *Archives of Mechanics* 23, 517-551; Perzyna 1966,
    doi:10.1016/S0065-2156(08)70009-7.
    """

    ports = ("equilibrium",)
    parameters = (
        Parameter("stiffness_MPa", "MPa", 0.0, 1e6, 0.5, meaning="E", per_strain=1),
        Parameter("yield_strain", "-", 0.1, 10.0, 0.3, "log", "y, of the spring", -1),
        Parameter("sharpness", "-", 8.0, 60.0, 12.0, "log", "n, of the yield"),
        Parameter("pace_per_s", "1/s", 0.0, 1e3, 0.0, meaning="rho", per_strain=-1),
    )
    off = {"stiffness_MPa": 0.0}
    amplitude = "stiffness_MPa"
    shape = ("pace_per_s",)
    before = Effect.before

    def after(self, p, signal, state):
        from softnn.effects._kernels import flow

        time, limit, pace = signal.time_s, p["yield_strain"], p["pace_per_s"]
        then, last, carried = (time[0], 0.0, 0.0) if state is None else state
        increment = increments(signal.strain, last)
        travel = np.abs(increment) + pace * increments(time, then)[:, None]
        sets = max(travel.shape[1], limit.size, p["sharpness"].size)
        carried = np.broadcast_to(carried, (sets,)).copy()
        out = np.empty((len(increment), sets))
        flow(travel, increment, limit, limit, p["sharpness"], carried, out)
        new = signal.having(equilibrium=signal.equilibrium + p["stiffness_MPa"] * out)
        return new, (time[-1], signal.strain[-1:], carried)

    def starts(self, scales):
        size = 0.5 * scales.stress_MPa / scales.strain
        return [
            {
                "stiffness_MPa": size,
                "yield_strain": float(np.clip(share * scales.strain, 0.1, 10)),
                "sharpness": 12.0,
            }
            for share in (0.5, 0.75)
        ]


class CreptSet(PermanentSet):
    r"""A set that grows with the time for which the specimen is kept strained.

    .. math:: \dot s = \frac{(a\,|\varepsilon| - s)_+}{\tau}

    ratio a, time tau in s; tension and compression have separate sets. The set grows
    while the network re-forms at the held strain, and stays after unloading. Andrews,
    Tobolsky and Hanson 1946, *J. Appl. Phys.* 17, 352-361.
    """

    parameters = (
        PermanentSet.parameters[0],
        Parameter("time_s", "s", 1e-2, 1e7, 30.0, "log", "tau"),
        PermanentSet.parameters[5],
    )
    shape = ("viscous_share",)

    def before(self, p, signal, state):
        from softnn.effects._kernels import ratchet

        strain, time, tau = signal.strain, signal.time_s, p["time_s"]
        then, up, down = (time[0], None, None) if state is None else state
        step = increments(time, then)
        sets = max(strain.shape[1], tau.size)
        grown = []
        for way, carried in ((1.0, up), (-1.0, down)):
            own = np.zeros((2, sets)) if carried is None else carried.copy()
            out = np.empty((len(time), sets))
            ratchet(step, np.maximum(way * strain, 0.0), tau, own, out)
            grown.append((out, own))
        shift = p["ratio"] * (grown[0][0] - grown[1][0])
        return _shifted(p, signal, shift), (time[-1], grown[0][1], grown[1][1])

    def starts(self, scales):
        middle = float(np.clip(0.2 * np.median(scales.duration_s), 1e-2, 1e7))
        return [{"ratio": 0.15, "time_s": middle, "viscous_share": v} for v in (1, 0)]


def _shifted(p: Mapping[str, Array], signal: Signal, shift: Array) -> Signal:
    """Signal with strains less the set `shift`; the branches see their share."""
    seen = signal.branch_strain - p["viscous_share"] * shift
    return signal.having(strain=signal.strain - shift, branch_strain=seen)
