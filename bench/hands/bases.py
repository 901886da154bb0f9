"""The base a case names, at its best: what it leaves of a noise-free stress.

Springs of sixteen straight segments over the strain range, branches on a logarithmic
grid of times, six a decade; all stiffnesses non-negative (Lawson & Hanson 1974). A base
with one branch seeks its time. Where each recording has a specimen of its own, each
has a scale as well.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import minimize_scalar, nnls

from bench.hands import kernels
from bench.hands.families import Array
from bench.hands.noises import Noise
from bench.hands.testing import Setup, simulate

SEGMENTS, PER_DECADE = 16, 6


class Base:
    """Least squares of one base on one set of recordings, in units of the noise."""

    def __init__(self, setup: Setup, noise: Noise, scales: bool) -> None:
        self.setup, self.noise, self.scales = setup, noise, scales
        self.clean = simulate(setup, ())
        self.springs = self._springs()
        times = [c.time_s for c in setup.courses[: setup.n]]
        step = min(float(np.median(np.diff(t))) for t in times)
        span = (
            sum(t[-1] for t in times) if setup.continued else max(t[-1] for t in times)
        )
        low, high = np.log10(step), np.log10(3 * span)
        n = int((high - low) * PER_DECADE) + 1
        self.grid = np.logspace(low, high, n)
        self.one = setup.model.endswith("sls")
        self.fixed: list[tuple[Array, Array]] | None = None
        if not self.one:
            columns = self.springs
            if setup.model.endswith("wiechert"):
                branches = self._branches(self.grid)
                columns = [np.hstack(p) for p in zip(columns, branches, strict=True)]
            self.fixed = self._reduced(columns)

    def _springs(self) -> list[Array]:
        every = [c.strain for c in self.setup.courses[: self.setup.n]]
        if not self.setup.model.startswith("pl-"):
            return [e[:, None] for e in every]
        low = min(float(e.min()) for e in every)
        high = max(float(e.max()) for e in every)
        width = (high - low) / SEGMENTS
        knots = low + width * np.arange(SEGMENTS)
        return [
            np.clip(e[:, None] - knots, 0, width) - np.clip(-knots, 0, width)
            for e in every
        ]

    def _branches(self, taus: Array) -> list[Array]:
        courses = self.setup.courses[: self.setup.n]
        clocks = [np.diff(c.time_s, prepend=c.time_s[0]) for c in courses]
        strains = [c.strain for c in courses]
        if not self.setup.continued:
            return [
                kernels.responses(np.diff(e, prepend=0.0), dt, taus)
                for e, dt in zip(strains, clocks, strict=True)
            ]
        joint = kernels.responses(
            np.diff(np.concatenate(strains), prepend=0.0), np.concatenate(clocks), taus
        )
        return np.split(joint, np.cumsum([len(e) for e in strains])[:-1])

    def _white(self, i: int, x: Array) -> Array:
        x = x if x.ndim > 1 else x[:, None]
        time = self.setup.courses[i].time_s
        return self.noise.whiten(i, time, self.clean[i], x)

    def _reduced(self, columns: list[Array]) -> list[tuple[Array, Array]]:
        parts = []
        for i, x in enumerate(columns):
            q, r = np.linalg.qr(self._white(i, x))
            parts.append((q, r))
        return parts

    def energy(self, stress: list[Array], beside: list[Array] | None = None) -> float:
        """Sum of squares left of `stress`; `beside` is a column free in size, too."""
        white = [self._white(i, s)[:, 0] for i, s in enumerate(stress)]
        other = None
        if beside is not None:
            other = [self._white(i, s)[:, 0] for i, s in enumerate(beside)]
        if self.fixed is not None:
            return self._left(self.fixed, white, other)
        springs = [self._white(i, x) for i, x in enumerate(self.springs)]

        def left(log_tau: float) -> float:
            branch = self._branches(np.array([10**log_tau]))
            parts = [
                np.linalg.qr(np.hstack([springs[i], self._white(i, b)]))
                for i, b in enumerate(branch)
            ]
            return self._left([(p.Q, p.R) for p in parts], white, other)

        grid = np.log10(self.grid)[::3]
        found = np.array([left(x) for x in grid])
        k = int(np.argmin(found))
        low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        fine = minimize_scalar(
            left, bounds=(low, high), method="bounded", options={"xatol": 1e-4}
        )
        return float(min(fine.fun, found[k]))

    def _left(
        self,
        parts: list[tuple[Array, Array]],
        white: list[Array],
        other: list[Array] | None,
    ) -> float:
        """Best sum of squares, with a scale a recording where specimens differ."""
        if other is not None:  # its column comes last
            grown = [
                np.linalg.qr(np.column_stack([q @ r, o]))
                for (q, r), o in zip(parts, other, strict=True)
            ]
            parts = [(p.Q, p.R) for p in grown]
        rows = [r for _, r in parts]
        heads = [q.T @ y for (q, _), y in zip(parts, white, strict=True)]
        rest = sum(float(y @ y - h @ h) for y, h in zip(white, heads, strict=True))
        target, free = np.concatenate(heads), int(other is not None)
        matrix = np.vstack(rows)
        x = _signed_last(matrix, target, free)
        best = float(np.sum((matrix @ x - target) ** 2))
        if self.scales:  # Gauss-Newton, the first recording's scale standing for one
            scales = np.ones(len(rows))
            for _ in range(5):
                change = block_diag(*[(r @ x)[:, None] for r in rows])[:, 1:]
                step = _signed_last(
                    np.hstack([matrix, change]), target, free + len(rows) - 1
                )
                scales[1:] = np.clip(scales[1:] + step[matrix.shape[1] :], 0.3, 3)
                matrix = np.vstack([s * r for s, r in zip(scales, rows, strict=True)])
                x = _signed_last(matrix, target, free)
                now = float(np.sum((matrix @ x - target) ** 2))
                settled = abs(now - best) < 1e-3 * best
                best = min(best, now)
                if settled:
                    break
        return best + max(rest, 0.0)


def _signed_last(matrix: Array, target: Array, free: int) -> Array:
    """Least squares, non-negative but in the last `free` columns."""
    size = np.linalg.norm(matrix, axis=0)
    full = matrix / np.where(size > 0, size, 1.0)
    k = matrix.shape[1] - free
    bound, loose, left = full[:, :k], full[:, k:], target
    if free:  # projected out, put back at the end
        q, _ = np.linalg.qr(loose)
        bound, left = bound - q @ (q.T @ bound), target - q @ (q.T @ target)
    q, r = np.linalg.qr(bound)
    x, _ = nnls(r, q.T @ left, maxiter=50 * max(k, 1))
    if free:
        rest = target - full[:, :k] @ x
        x = np.append(x, np.linalg.lstsq(loose, rest, rcond=None)[0])
    return x / np.where(size > 0, size, 1.0)
