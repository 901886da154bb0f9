r"""A dashpot whose flow is not proportional to stress."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import ramps

LASTING = 100.0  # longest recordings; a slower flow loses less than 1 % in any


class NonlinearViscosity(Effect):
    r"""An element of spring and Eyring dashpot in parallel to the rest.

    .. math:: \sigma_v = E g, \qquad
              \dot g = \dot\varepsilon - \frac{g_0}{\tau} \sinh\frac{g}{g_0}

    stiffness E in MPa, time tau in s of the flow at low stress, threshold g0 as strain
    of the spring (stress E g0), above which flow is exponential. An element that needs
    more than a hundred times the longest recording to flow back counts as plastic
    (`permanent_set`).
    Eyring 1936, doi:10.1063/1.1749836.

    In a recording: a loop whose height grows with the logarithm of rate, holds that
    relax fast at first and then by equal steps per decade. Mistaken for friction (the
    limit of small g0), a linear branch (large g0) and finite strain.
    """

    stage = "material"
    ports = ("branches",)
    parameters: tuple[Parameter, ...] = (
        Parameter("stiffness_MPa", "MPa", 0.0, 1e6, 0.5, meaning="E", per_strain=1),
        Parameter("time_s", "s", 1e-3, 1e9, 100.0, "log", "tau"),
        Parameter(
            "threshold", "-", 1e-5, 10.0, 0.03, "log", "g0, strain of the spring", -1
        ),
    )
    off = {"stiffness_MPa": 0.0}
    amplitude = "stiffness_MPa"
    contains: tuple[str, ...] = ("relaxation_branch",)
    family = "viscosity that depends on strain or rate"
    where = "in loops and holds, growing slowly with rate"
    twins = {
        "friction_hysteresis": "the same cycle at rates two decades apart",
        "finite_strain": "the same strain at rates two decades apart",
        "strain_dependent_relaxation": "holds at one strain reached at different rates",
        "relaxation_branch": "holds at several strains",
    }

    @property
    def second_forms(self):
        return (PowerLawViscosity(), ThinningBranches())

    def within(self, scales):
        return self.narrowed("time_s", high=LASTING * float(np.max(scales.duration_s)))

    def exponent(self, p):
        return np.zeros(1)

    def after(self, p, signal, state):
        from softnn.effects._kernels import flow

        last_time, last, carried = (
            (signal.time_s[0], 0.0, 0.0) if state is None else state
        )
        step = increments(signal.time_s, last_time)
        increment = increments(signal.branch_strain, last)
        shape = (p["time_s"], p["threshold"], self.exponent(p))
        sets = max(increment.shape[1], *(a.size for a in shape))
        carried = np.broadcast_to(carried, (sets,)).copy()
        out = np.empty((len(step), sets))
        flow(step[:, None], increment, *shape, carried, out)
        new = signal.having(branches=signal.branches + p["stiffness_MPa"] * out)
        return new, (signal.time_s[-1], signal.branch_strain[-1:], carried)

    def starts(self, scales):
        size = 0.5 * scales.stress_MPa / scales.strain
        middle = float(np.median(scales.duration_s))
        return [
            {
                "stiffness_MPa": size,
                "time_s": float(np.clip(time * middle, 1e-3, 1e9)),
                "threshold": float(np.clip(share * scales.strain, 1e-5, 10)),
            }
            for share, time in (
                (0.05, 1.0),
                (0.05, 10.0),
                (0.05, 0.1),
                (0.05, 100.0),
                (0.015, 10.0),
                (0.015, 100.0),
                (0.15, 0.3),
                (0.15, 3.0),
            )
        ]

    def telltale(self):
        return ramps([0, 0.6, 0.6, 0.1, 0.1, 0.6, 0], [0.5, 1, 0.5, 1, 0.02, 0.02])


class PowerLawViscosity(NonlinearViscosity):
    r"""The same element with Norton's dashpot.

    .. math:: \dot g = \dot\varepsilon - \frac{g_0}{\tau}
              \left|\frac{g}{g_0}\right|^{n} \mathrm{sign}\, g

    For a large exponent flow starts at a yield strain; `permanent_set` covers that.
    Norton 1929, *The Creep of Steel at High Temperatures*.
    """

    parameters = NonlinearViscosity.parameters + (
        Parameter("exponent", "-", 1.0, 6.0, 4.0, "log", "n of the flow law"),
    )

    def exponent(self, p):
        return p["exponent"]

    def starts(self, scales):
        return [s | {"exponent": 4.0} for s in super().starts(scales)]


class ThinningBranches(NonlinearViscosity):
    r"""All branches flow faster when the specimen is strained faster.

    .. math:: \dot\xi = 1 + (\lambda|\dot\varepsilon|)^{m}, \quad
              \text{branches relax in } \xi \text{ in place of } t

    thinning lambda in s. Their viscosity is that of Cross 1965,
    doi:10.1016/0095-8522(65)90022-X. For m = 1 the clock is Valanis' intrinsic time
    (1971, *Archives of Mechanics* 23, 517-551), of which a share is travel: quick
    loops no longer depend on the rate.
    """

    ports = ("branch_strain",)
    parameters = (
        Parameter("thinning_s", "s", 0.0, 1e7, 10.0, meaning="lambda", per_strain=1),
        Parameter("exponent", "-", 0.2, 1.0, 1.0, "log", "m"),
    )
    off = {"thinning_s": 0.0}
    amplitude = "thinning_s"
    contains = ()
    shape = ("exponent",)
    after = Effect.after
    within = Effect.within

    def before(self, p, signal, state):
        time, m = signal.branch_clock, p["exponent"]
        last, gone, strain = (time[:1], time[:1], 0.0) if state is None else state
        step = increments(time, last)
        travel = np.abs(increments(signal.branch_strain, strain))
        more = (p["thinning_s"] * travel) ** m * step ** (1 - m)
        more = np.where(step > 0, more, 0.0)  # a step relaxes nothing
        passed = gone + np.cumsum(step + more, axis=0)
        passed = np.where(p["thinning_s"] == 0, time, passed)  # to the last bit
        new = signal.having(branch_time_s=passed)
        return new, (time[-1:], passed[-1:], signal.branch_strain[-1:])

    def starts(self, scales):
        middle = float(np.median(scales.duration_s))
        slow = middle / max(4 * scales.cycles * scales.strain, 1e-6)
        return [
            {"thinning_s": float(np.clip(r * slow, 0, 1e7)), "exponent": 1.0}
            for r in (1.0, 0.1)
        ]
