r"""Bergstroem and Boyce's law on one axis, for an incompressible material.

.. math:: \sigma = \frac{1}{\lambda}\left[\sigma_A(\lambda) + \frac{s E}{3}
          \left(\lambda_e^2 - \lambda_e^{-1}\right)\right], \qquad
          \lambda_e = \lambda / \lambda_v

          \frac{d \ln\lambda_v}{dt} = \dot\gamma_0\,(|\lambda_v - 1| + \xi)^{C}
          \left|\frac{\sigma_B}{s E}\right|^{m} \mathrm{sign}\,\sigma_B

Network A is Yeoh's spring of modulus E, network B neo-Hooke's with a dashpot of which
sigma_B is the true stress. Bergstroem and Boyce 1998,
doi:10.1016/S0022-5096(97)00075-6, with eight chains replaced by Yeoh's polynomial and
the stretch of a chain by that of the axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np

from softnn.contracts import Array, Chunk
from softnn.fit import Data

XI = 0.05  # keeps the flow of what has not flowed finite
THINNEST = 0.02
NEWTON = 30
CLOSE = 1e-9


@numba.njit(cache=True)
def flow(time, stretch, rate, hardening, exponent, out):
    """True stress of network B over s E (n,), by implicit Euler steps."""
    x, last = 0.0, time[0]  # x is the logarithm of the viscous stretch
    for i in range(len(time)):
        step, log = time[i] - last, np.log(stretch[i])
        last = time[i]
        low, high = min(x, log), max(x, log)  # flow never goes past the load
        y = x
        for _ in range(NEWTON):
            if step <= 0 or high - low < CLOSE:
                break
            e = log - y
            b = (np.exp(2 * e) - np.exp(-e)) / 3
            speed = rate * (abs(np.exp(y) - 1) + XI) ** hardening
            g = y - x - step * speed * abs(b) ** exponent * np.sign(b)
            if g > 0:
                high = y
            else:
                low = y
            slope = (
                1
                + step
                * speed
                * exponent
                * abs(b) ** (exponent - 1)
                * (2 * np.exp(2 * e) + np.exp(-e))
                / 3
            )
            new = y - g / slope
            y = new if low < new < high else (low + high) / 2
            if abs(g) < CLOSE:
                break
        x = y
        e = log - x
        out[i] = (np.exp(2 * e) - np.exp(-e)) / 3


@dataclass(frozen=True)
class BergstroemBoyce:
    """The law; modulus E in MPa, rate in 1/s, the others without a unit."""

    modulus_MPa: float
    share: float
    rate_per_s: float
    exponent: float
    hardening: float
    second: float  # C2 over C1 of Yeoh's law, and C3
    third: float

    @classmethod
    def of(cls, x: Array) -> BergstroemBoyce:
        """From the vector of a search: logarithms of the first four."""
        return cls(*(float(v) for v in (*np.exp(x[:4]), *x[4:])))

    @staticmethod
    def starts(data: Data) -> list[Array]:
        scales = data.scales()
        modulus = np.log(scales.stress_MPa / scales.strain)
        middle = float(np.median(scales.duration_s))
        # At a tenth of the largest strain in network B it flows about once a recording.
        return [
            np.array([modulus, np.log(share), speed, np.log(m), -0.5, 0.0, 0.0])
            for share, m in ((1.0, 1.0), (1.0, 4.0))
            for speed in [-np.log(middle) - m * np.log(0.1 * scales.strain)]
        ]

    @staticmethod
    def bounds(data: Data) -> tuple[list[float], list[float]]:
        scales = data.scales()
        modulus = float(np.log(scales.stress_MPa / scales.strain))
        bend = 1 / min(scales.strain, 1.0) ** 2
        low = [modulus - 7, np.log(1e-3), -40.0, 0.0, -2.0, -bend, -bend]
        high = [modulus + 7, np.log(1e3), 60.0, np.log(12), 0.0, bend, bend]
        return low, high

    def stress(self, chunk: Chunk) -> Array:
        """Engineering stress (n,) in MPa."""
        stretch = np.maximum(1 + np.asarray(chunk.strain, float), THINNEST)
        i = stretch**2 + 2 / stretch - 3
        bent = 1 + 2 * self.second * i + 3 * self.third * i**2
        a = (stretch**2 - 1 / stretch) * bent / 3
        b = np.empty(len(stretch))
        flow(
            np.asarray(chunk.time_s, float),
            stretch,
            self.rate_per_s,
            self.hardening,
            self.exponent,
            b,
        )
        return self.modulus_MPa * (a + self.share * b) / stretch

    def predict(self, chunks: Sequence[Chunk]) -> list[Array]:
        return [self.stress(c) for c in chunks]

    def residual(self, data: Data) -> Array:
        """Predicted minus measured stress (valid,), over the largest measured."""
        level = data.scales().stress_MPa
        parts = [
            (self.stress(c) - s)[np.isfinite(s)] / level
            for c, s in zip(data.chunks, data.stress_MPa, strict=True)
        ]
        return np.nan_to_num(np.concatenate(parts), nan=1e3, posinf=1e3, neginf=-1e3)
