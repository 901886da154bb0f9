r"""The stress channel trails the strain channel."""

from __future__ import annotations

import numpy as np

from softnn.contracts import Effect, Parameter, increments
from softnn.effects._programmes import cycles

LONGEST_S = 1.0  # the slowest filter that a load cell is read through


class SensorLag(Effect):
    r"""Lag of the stress channel, of first or second order (an amplifier's filter).

    .. math:: Q^2 \tau^2 \ddot\sigma_{out} + \tau \dot\sigma_{out} + \sigma_{out}
              = \sigma

    time_constant tau in s is the mean delay; the square of the quality factor Q is 0
    for one pole, 1/4 for two alike, 1/3 in Bessel's filter, 1/2 in Butterworth's. Exact
    for stress that is straight between samples; the channel has settled when a
    recording begins. Doebelin, *Measurement Systems*, ch. 3.

    In a recording: the loop runs the wrong way round or is too wide, more so at higher
    rates; reversals of stress come late. Mistaken for slack (the same at every rate)
    and for a viscous branch (whose stress leads, not trails).
    """

    stage = "sensor"
    ports = ("stress",)
    pointwise = False
    parameters: tuple[Parameter, ...] = (
        Parameter("time_constant_s", "s", 0.0, LONGEST_S, 0.2, meaning="mean delay"),
        Parameter("quality_squared", "-", 0.0, 1.0, 0.0, meaning="0 one pole, 1/4 two"),
    )
    off = {"time_constant_s": 0.0}
    amplitude = "time_constant_s"
    shape: tuple[str, ...] = ("quality_squared",)
    where = "after every change of rate, growing with rate"
    twins = {
        "relaxation_branch": "a sine at two frequencies",
        "slack": "ramps at rates two decades apart",
        "inertia": "a sine at two frequencies",
    }

    @property
    def second_forms(self):
        return (Delay(), DelayedLag())

    def after(self, p, signal, state):
        from softnn.effects._kernels import second_order

        tau, quality, x = p["time_constant_s"], p["quality_squared"], signal.stress
        sets = max(x.shape[1], tau.size, quality.size)
        x = np.ascontiguousarray(np.broadcast_to(x, (len(x), sets)))
        if state is None:
            state = signal.time_s[0], np.stack([x[0], x[0], 0.0 * x[0]])
        last, rest = state
        rest = np.broadcast_to(rest, (3, sets)).copy()
        step = increments(signal.time_s, last)
        out = np.empty_like(x)
        second_order(step, x, tau, quality, rest[0], rest[1], rest[2], out)
        return signal.having(stress=out), (signal.time_s[-1], rest)

    def starts(self, scales):
        return [
            {"time_constant_s": float(min(k * scales.interval_s, LONGEST_S))}
            for k in (3.0, 1.0)
        ]

    def telltale(self):
        return cycles([0.3, 0.6, 0.6], 0.2)


class Delay(SensorLag):
    r"""A pure delay of the stress channel: the channels did not start together.

    .. math:: \sigma_{out}(t) = \sigma(t - \tau)
    """

    parameters = SensorLag.parameters[:1]
    shape: tuple[str, ...] = ()

    def after(self, p, signal, state):
        tau = p["time_constant_s"]
        time, x = signal.time_s, signal.stress
        if state is not None:
            time = np.concatenate([state[0], time])
            kept = np.broadcast_to(state[1], (len(state[1]), x.shape[1]))
            x = np.concatenate([kept, x])
        out = np.concatenate(
            [
                _at(
                    signal.time_s - d,
                    time,
                    x if tau.size == 1 or x.shape[1] == 1 else x[:, i : i + 1],
                )
                for i, d in enumerate(tau)
            ],
            axis=1,
        )
        keep = max(int(np.searchsorted(time, time[-1] - LONGEST_S)) - 1, 0)
        return signal.having(stress=out), (time[keep:], x[keep:])


class DelayedLag(Delay):
    r"""A delay, then a lag of second order: filters of many poles and running means.

    .. math:: \sigma_1(t) = \sigma(t - T), \quad
              Q^2 \tau^2 \ddot\sigma_{out} + \tau \dot\sigma_{out} + \sigma_{out}
              = \sigma_1

    time_constant T in s; pole is tau as a share of it.
    """

    parameters = Delay.parameters + (
        Parameter("pole", "-", 0.0, 10.0, 1.0, meaning="tau over T"),
        SensorLag.parameters[1],
    )
    shape = SensorLag.shape

    def after(self, p, signal, state):
        waiting, settled = (None, None) if state is None else state
        signal, waiting = super().after(p, signal, waiting)
        lag = p | {"time_constant_s": p["time_constant_s"] * p["pole"]}
        signal, settled = SensorLag.after(self, lag, signal, settled)
        return signal, (waiting, settled)

    def starts(self, scales):
        more = {"pole": 1.0, "quality_squared": 0.0}
        return [start | more for start in super().starts(scales)]


def _at(when, time, x):
    """X (n, m) at times `when`, linear between samples, constant before the first."""
    if len(time) == 1:
        return np.repeat(x, len(when), axis=0)
    i = np.clip(np.searchsorted(time, when, side="right") - 1, 0, len(time) - 2)
    gap = np.maximum(time[i + 1] - time[i], 1e-300)
    share = np.clip((when - time[i]) / gap, 0.0, 1.0)[:, None]
    return x[i] * (1 - share) + x[i + 1] * share
