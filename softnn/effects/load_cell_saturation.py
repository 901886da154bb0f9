r"""The stress is clipped at a limit of the load cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Chunk, Effect, Parameter
from softnn.effects._programmes import cycles
from softnn.effects._signs import peak, reach

NEVER_MPa = 1e6
FLAT = (0.02, 3.0)  # of the largest strain; times as wide as other levels
# Limit, as a share of the usual peak stress, and knee. Slight clipping shows as noise
# on the limit, so the usual peak lies below it.
STARTS = ((0.97, 0.0), (0.9, 0.0), (1.0, 0.08), (1.0, 0.0), (1.03, 0.0))


class LoadCellSaturation(Effect):
    r"""Stress beyond the limit of the channel is written down as the limit.

    .. math:: \sigma \to \sigma \,
              \left(1 + |\sigma / L|^{1/k}\right)^{-k}

    limit L in MPa; knee k from 0 (sharp, clip at L) to 0.5 (a long bend). Overload of
    an amplifier, ISO 7500-1.

    In a recording: flat tops at one stress, in every recording that gets there.
    Mistaken for yielding and for a hold.
    """

    stage = "sensor"
    ports = ("stress",)
    parameters: tuple[Parameter, ...] = (
        Parameter("limit_MPa", "MPa", 1e-9, NEVER_MPa, 1.0, "log", "L"),
        Parameter("knee", "-", 0.0, 0.5, 0.0, meaning="rounding of the corner"),
    )
    off = {"limit_MPa": NEVER_MPa}
    amplitude = "limit_MPa"
    shape: tuple[str, ...] = ("knee",)
    spoken = "load-cell saturation"
    where = "at the highest stresses"
    twins = {"tension_only": "tension alone", "nonlinear_elasticity": "a second range"}

    def after(self, p, signal, state):
        return signal.having(
            stress=self.clipped(signal.stress, p["limit_MPa"], p["knee"])
        ), None

    @property
    def second_forms(self):
        return (UnevenLimits(), OwnRange())

    @staticmethod
    def clipped(x, limit, knee):
        hard = np.clip(x, -limit, limit)
        if np.all(knee < 0.01):
            return hard
        share = np.abs(x) / limit
        power = 1 / np.maximum(knee, 0.01)
        # In logarithms, so that a sharp knee does not overflow.
        bend = np.logaddexp(0.0, power * np.log(np.maximum(share, 1e-300))) / power
        soft = np.where(limit >= NEVER_MPa, x, x * np.exp(-bend))
        return np.where(knee >= 0.01, soft, hard)

    def starts(self, scales):
        return [
            {"limit_MPa": float(share * scales.stress_MPa), "knee": k}
            for share, k in STARTS
        ]

    def shown(self, chunks, stress_MPa):
        """Limit [MPa] if one highest stress persists while the strain moves on.

        None where no recording has such a flat top.
        """
        limit = max(map(peak, stress_MPa))
        top = other = 0.0
        for chunk, stress in zip(chunks, stress_MPa, strict=True):
            full = np.abs(stress) >= (1 - 1e-9) * limit
            same = np.append(np.diff(stress) == 0, False) & ~full
            top = max(top, _flat(chunk, full))
            other = max(other, _flat(chunk, same))
        wide, wider = FLAT
        return {"limit_MPa": limit} if top > max(wide, wider * other) else None

    def telltale(self):
        return cycles([0.3, 0.6, 0.6], 0.05)


class UnevenLimits(LoadCellSaturation):
    r"""Separate limits in tension and compression, and a share that gets through.

    .. math:: \sigma \to c(\sigma) + r\,(\sigma - c(\sigma))

    with c the law of `LoadCellSaturation`, of limit L in tension and L_- in
    compression. r is 0 for an amplifier; beside a mechanical overload stop it is the
    share of further load that the cell still bears.
    """

    # No bend as long, and no share as large, as those of a material that softens.
    parameters = (
        LoadCellSaturation.parameters[0],
        Parameter(
            "pushed_MPa", "MPa", 1e-9, NEVER_MPa, 1.0, "log", "L_-, in compression"
        ),
        Parameter("knee", "-", 0.0, 0.25, 0.0, meaning="rounding of the corner"),
        Parameter("beyond", "-", 0.0, 0.5, 0.0, meaning="r"),
    )
    off = {"limit_MPa": NEVER_MPa, "pushed_MPa": NEVER_MPa}
    shape = ("knee", "beyond")

    def after(self, p, signal, state):
        x = signal.stress
        pulled = self.clipped(np.maximum(x, 0), p["limit_MPa"], p["knee"])
        pushed = self.clipped(np.minimum(x, 0), p["pushed_MPa"], p["knee"])
        kept = pulled + pushed
        return signal.having(stress=kept + p["beyond"] * (x - kept)), None

    def starts(self, scales):
        # Round and low enough to move in whichever direction is clipped.
        one, low = float(scales.stress_MPa), float(0.4 * scales.stress_MPa)
        return [
            {"limit_MPa": a, "knee": 0.2, "pushed_MPa": b, "beyond": 0.0}
            for a, b in ((low, one), (one, low))
        ]


class OwnRange(LoadCellSaturation):
    r"""A range set too small for some recordings: each has a limit of its own.

    .. math:: \sigma \to \mathrm{clip}(\sigma, -1/q, 1/q)

    q in 1/MPa; 0 is a range that was wide enough.
    """

    parameters = (
        Parameter("narrowness_per_MPa", "1/MPa", 0.0, 1e9, 1.0, meaning="q, 1 / limit"),
    )
    off = {"narrowness_per_MPa": 0.0}
    amplitude = "narrowness_per_MPa"
    per_recording = ("narrowness_per_MPa",)
    shape = ()
    some = True

    def after(self, p, signal, state):
        limit = 1 / np.maximum(p["narrowness_per_MPa"], 1e-300)
        return signal.having(stress=np.clip(signal.stress, -limit, limit)), None

    def starts(self, scales):
        return [
            {"narrowness_per_MPa": float(min(k / scales.stress_MPa, 1e9))}
            for k in (2.5, 1.25)
        ]


def _flat(chunk: Chunk, at: NDArray[np.bool]) -> float:
    """Longest strain path, over the largest strain, on which `at` always holds."""
    edge = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(int)))
    runs = zip(edge[::2], edge[1::2], strict=True)
    ways = [float(np.ptp(chunk.strain[a:b])) for a, b in runs]
    return max(ways, default=0.0) / max(reach(chunk), 1e-12)
