r"""A relaxation time that the simulation lacks."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import ramps


class RelaxationBranch(Effect):
    r"""One more Maxwell branch, in parallel.

    .. math:: \dot\sigma_b + \sigma_b/\tau = E\,\dot\varepsilon

    stiffness E in MPa, relaxation time tau in s; updated exactly for strain that is
    straight between samples. Ferry, *Viscoelastic Properties of Polymers*, 1980, ch. 3.

    In a recording: stress that falls in holds at a pace the simulation does not have,
    loops at rates near 1/tau. Mistaken for friction (the same at every rate), for drift
    (which goes on without load) and for a sensor that lags.
    """

    stage = "material"
    ports = ("branches",)
    parameters: tuple[Parameter, ...] = (
        Parameter("stiffness_MPa", "MPa", 0.0, 1e6, 0.3, meaning="E", per_strain=1),
        Parameter("relaxation_time_s", "s", 1e-4, 1e7, 3.0, "log", "tau"),
    )
    off = {"stiffness_MPa": 0.0}
    amplitude = "stiffness_MPa"
    spoken = "a relaxation branch"
    where = "in holds and after every change of rate"
    twins = {
        "friction_hysteresis": "the same cycle at rates two decades apart",
        "load_cell_drift": "a long stretch without load",
        "sensor_lag": "ramps at rates two decades apart",
        "nonlinear_viscosity": "holds at several strains",
    }

    @property
    def second_forms(self):
        return (SpreadBranch(), TwoBranches())

    def after(self, p, signal, state):
        from softnn.effects._kernels import maxwell

        last_time, last, carried = (
            (signal.time_s[0], 0.0, 0.0) if state is None else state
        )
        step = increments(signal.time_s, last_time)
        increment = increments(signal.branch_strain, last)
        tau = p["relaxation_time_s"]
        sets = max(increment.shape[1], tau.size)
        carried = np.broadcast_to(carried, (sets,)).copy()
        out = np.empty((len(step), sets))
        maxwell(step, increment, tau, carried, out)
        new = signal.having(branches=signal.branches + p["stiffness_MPa"] * out)
        return new, (signal.time_s[-1], signal.branch_strain[-1:], carried)

    def starts(self, scales):
        longest = 2 * float(np.max(scales.duration_s))
        times = np.geomspace(2 * scales.interval_s, longest, 8)
        size = 0.3 * scales.stress_MPa / scales.strain
        return [
            {"stiffness_MPa": size, "relaxation_time_s": float(np.clip(t, 1e-4, 1e7))}
            for t in (times[4], *times)
        ]

    def telltale(self):
        return ramps([0, 0.5, 0.5, 0.2, 0.2, 0.5, 0], [0.5, 1, 0.1, 1, 0.02, 0.1])


SPREAD = np.array([-1.5, -0.75, 0.0, 0.75, 1.5])  # standard deviations
TIMES_S = (1e-6, 1e9)  # of its branches


class SpreadBranch(RelaxationBranch):
    r"""A branch with a spread of relaxation times, like a stretched exponential.

    .. math:: E \sum_k w_k\, e^{-t / \tau_k}, \quad
              \log_{10} \tau_k = \log_{10} \tau + s\,z_k

    width s in decades, w_k of a normal law at z_k. Kohlrausch 1854,
    doi:10.1002/andp.18541670103; a log-normal spectrum after Wiechert 1893.
    """

    parameters = (
        *RelaxationBranch.parameters,
        Parameter("width_decades", "-", 0.0, 1.5, 0.5, meaning="s"),
    )
    shape: tuple[str, ...] = ("width_decades",)

    def parts(self, p):
        """Pairs of share of the stiffness and relaxation time [s], one per branch."""
        weight = np.exp(-(SPREAD**2) / 2)
        times = [
            p["relaxation_time_s"] * 10 ** (z * p["width_decades"]) for z in SPREAD
        ]
        return zip(weight / weight.sum(), times, strict=True)

    def after(self, p, signal, state):
        total, states = signal.branches, []
        for k, (share, time) in enumerate(self.parts(p)):
            own = {
                "stiffness_MPa": share * p["stiffness_MPa"],
                "relaxation_time_s": np.clip(time, *TIMES_S),
            }
            new, last = super().after(own, signal, state and state[k])
            total = total + (new.branches - signal.branches)
            states.append(last)
        return signal.having(branches=total), states


class TwoBranches(SpreadBranch):
    r"""Two times: share w of the stiffness relaxes `ratio` times as slowly."""

    parameters = (
        *RelaxationBranch.parameters,
        Parameter("share", "-", 0.0, 1.0, 0.5, meaning="w"),
        Parameter("ratio", "-", 2.0, 1e4, 10.0, "log", "of the times"),
    )
    shape = ("share", "ratio")

    def parts(self, p):
        time = p["relaxation_time_s"]
        return ((1 - p["share"], time), (p["share"], p["ratio"] * time))
