r"""Force from accelerating mass between load cell and specimen."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import Chunk

SLOWEST_S = 1.0  # period of the slowest rig on the specimen


class Inertia(Effect):
    r"""Mass of grip and specimen times acceleration.

    .. math:: \sigma \to \sigma + m\,\ddot\varepsilon

    m in MPa s2: moving mass times gauge length over cross-section. Acceleration is the
    second difference of strain, centred. Dynamic correction of load cells, ISO 4965-1.

    In a recording: spikes at reversals, and at high frequency a force opposed to the
    strain. Mistaken for a lag and for stiffness that depends on rate.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "mass",
            "MPa s2",
            0.0,
            1e3,
            1e-3,
            meaning="mass x length / area",
            per_strain=1,
        ),
    )
    off = {"mass": 0.0}
    amplitude = "mass"

    def within(self, scales):
        """Return the law with masses that swing on such a specimen once a second.

        Grips and load cells move faster; a larger mass stands for something else.
        """
        stiffness = scales.stress_MPa / scales.strain
        return self.narrowed("mass", high=(SLOWEST_S / (2 * np.pi)) ** 2 * stiffness)

    where = "at reversals and at high frequency"
    exempt = {
        "refine": "strain that is straight between samples has no acceleration there",
        "causal": "acceleration at a sample needs the next sample's strain",
        "chunked": "acceleration at a sample needs the next sample's strain",
    }
    twins = {
        "sensor_lag": "a fast reversal, and a sine at two frequencies",
        "relaxation_branch": "a sine at two frequencies",
    }

    @property
    def second_forms(self):
        return (CompliantMount(), RingingMount(), BluntTurns())

    @staticmethod
    def kicks(signal, state):
        """Return the change of the strain rate at each sample (n, sets), 1/s."""
        t, e = signal.time_s, signal.strain
        kick = np.zeros_like(e)
        if len(t) > 2:
            rate = np.diff(e, axis=0) / np.maximum(np.diff(t), 1e-12)[:, None]
            kick[1:-1] = np.diff(rate, axis=0)
            if state is None:  # it was at rest before the first sample
                kick[0] = rate[0]
        return kick

    def acceleration(self, signal, state):
        """Return the second difference of strain (n, sets), 1/s2."""
        step = np.maximum(np.diff(signal.time_s), 1e-12)
        gap = np.ones(len(signal.time_s))
        if len(gap) > 2:
            gap[0], gap[1:-1] = step[0], (step[1:] + step[:-1]) / 2
        return self.kicks(signal, state) / gap[:, None]

    def after(self, p, signal, state):
        force = p["mass"] * self.acceleration(signal, state)
        return signal.having(stress=signal.stress + force), True

    def starts(self, scales):
        # A tenth of the peak stress at a sine of 8 samples a quarter period.
        highest = scales.strain * (2 * np.pi / (32 * scales.interval_s)) ** 2
        return [{"mass": float(min(0.1 * scales.stress_MPa / highest, 1e3))}]

    def telltale(self):
        time = np.arange(0, 20, 0.02)
        return Chunk(time, 0.3 * (1 - np.cos(2 * np.pi * time**2 / 20)) / 2)


class CompliantMount(Inertia):
    r"""Inertia behind a compliant mount: a soft load cell, a clamp, a long rod.

    .. math:: \tau \dot f + f = m\,\ddot\varepsilon, \quad \sigma \to \sigma + f

    The inertial force at a reversal arrives late and rounded; the force of the specimen
    does not. Without this form a search adds a sensor lag to explain the delay.
    """

    parameters = Inertia.parameters + (
        Parameter("mount_s", "s", 1e-4, 10.0, 0.01, "log", "tau, of what gives way"),
    )
    shape = ("mount_s",)

    def after(self, p, signal, state):
        from softnn.effects._kernels import first_order

        force = self.acceleration(signal, state)
        tau = p["mount_s"]
        sets = max(force.shape[1], tau.size)
        force = np.ascontiguousarray(np.broadcast_to(force, (len(force), sets)))
        if state is None:
            state = (signal.time_s[0], np.zeros((2, sets)))
        last, rest = state
        rest = np.broadcast_to(rest, (2, sets)).copy()
        out = np.empty_like(force)
        step = increments(signal.time_s, last)
        first_order(step, force, tau, rest[0], rest[1], out)
        new = signal.having(stress=signal.stress + p["mass"] * out)
        return new, (signal.time_s[-1], rest)

    def starts(self, scales):
        late = float(np.clip(0.5 * scales.interval_s, 2e-4, 5.0))
        return [s | {"mount_s": late} for s in super().starts(scales)]


class RingingMount(Inertia):
    r"""Inertia with mass and mount that ring at their resonance.

    .. math:: \ddot f + 2 \zeta \omega \dot f + \omega^2 f
              = \omega^2 m\,\ddot\varepsilon,
              \quad \omega = 2 \pi f_0

    resonance f_0 in Hz, damping zeta; each change of strain rate is a kick. Load cells,
    Fujii 2003, doi:10.1088/0957-0233/14/9/313.
    """

    parameters = Inertia.parameters + (
        Parameter("resonance_Hz", "Hz", 1e-2, 1e4, 20.0, "log", "f_0"),
        Parameter("damping", "-", 0.01, 2.0, 0.2, "log", "zeta"),
    )
    shape = ("resonance_Hz", "damping")

    def after(self, p, signal, state):
        from softnn.effects._kernels import ringing

        kick = self.kicks(signal, state)
        omega, zeta = 2 * np.pi * p["resonance_Hz"], p["damping"]
        sets = max(kick.shape[1], omega.size, zeta.size)
        kick = np.ascontiguousarray(np.broadcast_to(kick, (len(kick), sets)))
        last, carried = (
            (signal.time_s[0], np.zeros((2, sets))) if state is None else state
        )
        carried = np.broadcast_to(carried, (2, sets)).copy()
        out = np.empty_like(kick)
        step = increments(signal.time_s, last)
        omega, zeta = np.broadcast_to(omega, (sets,)), np.broadcast_to(zeta, (sets,))
        ringing(step, kick, omega, zeta, carried, out)
        new = signal.having(stress=signal.stress + p["mass"] * out)
        return new, (signal.time_s[-1], carried)

    def starts(self, scales):
        return [
            s | {"resonance_Hz": float(np.clip(k / scales.interval_s, 0.1, 1e3))}
            for s in super().starts(scales)
            for k in (0.1, 0.4)
        ]


class BluntTurns(Inertia):
    r"""Inertia with strain linear between samples and reversals of finite duration.

    .. math:: f(t) = m \sum_j \Delta\dot\varepsilon_j \, k_w(t - t_j)

    A sample holds the force at its instant, not the mean since the last sample. So
    the force of a short reversal does not depend on the sampling interval. k_w is a
    bell (Matern 5/2) of width w on both sides (Gustafsson 1996,
    doi:10.1109/78.492552: filtering forwards and backwards adds no delay).
    """

    parameters = Inertia.parameters + (
        Parameter("width_s", "s", 1e-4, 10.0, 0.02, "log", "w"),
    )
    shape = ("width_s",)

    def after(self, p, signal, state):
        from softnn.effects._kernels import turning

        kick = self.kicks(signal, state)
        width = p["width_s"]
        sets = max(kick.shape[1], width.size)
        kick = np.ascontiguousarray(np.broadcast_to(kick, (len(kick), sets)))
        out = np.empty_like(kick)
        turning(increments(signal.time_s, signal.time_s[0]), kick, width, out)
        return signal.having(stress=signal.stress + p["mass"] * out), True

    def starts(self, scales):
        return [
            s | {"width_s": float(np.clip(k * scales.interval_s, 2e-4, 5.0))}
            for s in super().starts(scales)
            for k in (1.0, 0.2)
        ]
