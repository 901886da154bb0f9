"""What a refit of the base absorbs, and whether the rest can be seen at all.

The refit here is more generous than any base softnn has: 16 equal strain segments
where the model is piecewise linear, 22 relaxation times and the true ones where it has
branches, signs free. An effect whose trace lies in that space, or under the noise,
cannot be found by anybody from these recordings; that is a miss of the programmes, not
of a diagnosis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2, ncx2

from bench.concealed.bases import Base, maxwell
from bench.concealed.programmes import Array, Imposed

SEGMENTS = 16
TIMES_S = np.geomspace(0.05, 600.0, 22)
FINE_TIMES_S = np.geomspace(0.05, 600.0, 70)  # where a model has one branch only
FALSE_ALARM = 0.01
LATE = (1, 3, 10, 30)  # samples, by which another law may trail


@dataclass(frozen=True)
class Refit:
    """What a base can move: its springs (n, k) and unit branches (n, m).

    `single`: of the branches it has one, whose time it chooses; else all at once.
    Rows are the samples of all recordings.
    """

    springs: Array
    branches: Array
    single: bool

    @property
    def columns(self) -> Array:
        return np.column_stack([self.springs, self.branches])

    def choices(self) -> list[list[int]]:
        """Columns that may be used together."""
        k, m = self.springs.shape[1], self.branches.shape[1]
        if self.single:
            return [[*range(k), k + j] for j in range(m)]
        return [list(range(k + m))]


def springs(strain: Array, low: float, high: float, segments: int) -> Array:
    """Unit springs (n, k), each active over its own strain segment."""
    width = high / segments
    columns = [np.clip(strain - k * width, 0, width) for k in range(segments)]
    down = int(np.ceil(-low / width - 1e-6))  # of the same width in compression
    columns += [np.clip(strain + k * width, -width, 0) for k in range(down)]
    return np.column_stack(columns)


def refit(
    model: str,
    programmes: Sequence[Imposed],
    before: Sequence[Array],
    times_s: Sequence[float],
) -> Refit:
    """What `model` can move. `times_s`: the true relaxation times, offered as well.

    `before` is the fine strain before each recording (empty on a virgin specimen), so
    that branches know what went before.
    """
    strain = np.concatenate([p.strain[p.index] for p in programmes])
    fixed = strain[:, np.newaxis]
    if model.startswith("pl-"):
        fixed = springs(strain, float(strain.min()), float(strain.max()), SEGMENTS)
    single = model.endswith("sls")
    grid = np.zeros(0) if model == "hooke" else FINE_TIMES_S if single else TIMES_S
    if model != "hooke":
        grid = np.concatenate([grid, times_s])
    branches = [
        np.concatenate(
            [
                maxwell(np.concatenate([b, p.strain]), t)[len(b) :][p.index]
                for b, p in zip(before, programmes, strict=True)
            ]
        )
        for t in grid
    ]
    return Refit(fixed, np.array(branches).reshape(len(grid), len(strain)).T, single)


def absorb(base: Refit, stress: Array, sigma: Array) -> Array:
    """Residual (n,) of the best non-negative refit of the base to `stress`, MPa."""
    columns = base.columns
    # Reduced by QR: the fits are of as many rows as there are columns.
    q, r = np.linalg.qr(columns / sigma[:, np.newaxis])
    target = q.T @ (stress / sigma)
    best, least = stress, np.inf
    for use in base.choices():
        coefficients, left = nnls(r[:, use], target, maxiter=20 * len(use))
        if left < least:
            best, least = stress - columns[:, use] @ coefficients, left
    return best


def visible_energy(
    base: Refit | None,
    off: Array,
    difference: Array,
    time_s: Sequence[Array],
    sigma: Array,
    correlation_s: float,
) -> float:
    """Squared size of `difference` (n,) that a refit cannot move, in noise units.

    Noncentrality of the likelihood-ratio test that is told the true form. Coloured
    noise is whitened recording by recording. Without a base all of it counts. `off` is
    the stress without the effect: a base of one branch has to follow that, too, with
    the same relaxation time.
    """
    columns = base.columns if base else np.zeros((len(difference), 0))
    rows = np.column_stack([columns, off, difference]) / sigma[:, np.newaxis]
    if correlation_s > 0:
        rows = whiten(rows, time_s, correlation_s)
    r: Array = np.asarray(np.linalg.qr(rows, mode="r"))

    def left(target: Array, use: list[int]) -> float:
        fitted = r[:, use] @ np.linalg.lstsq(r[:, use], target, rcond=1e-9)[0]
        return float(np.sum((target - fitted) ** 2))

    if base is None or not base.single:
        return left(r[:, -1], base.choices()[0] if base else [])
    without = min(left(r[:, -2], use) for use in base.choices())
    return max(
        0.0, min(left(r[:, -2] + r[:, -1], use) for use in base.choices()) - without
    )


def whiten(rows: Array, time_s: Sequence[Array], correlation_s: float) -> Array:
    """Innovations of an Ornstein-Uhlenbeck noise of unit variance, rows (n, k)."""
    out, first = [], 0
    for time in time_s:
        part = rows[first : first + len(time)]
        first += len(time)
        keep = np.exp(-np.diff(time) / correlation_s)[:, np.newaxis]
        out += [part[:1], (part[1:] - keep * part[:-1]) / np.sqrt(1 - keep**2)]
    return np.concatenate(out)


def bent(
    base: Refit | None, others: Sequence[Array], programmes: Sequence[Imposed]
) -> Refit | None:
    """The base, able to move as well whatever other laws of effects could do.

    `others` (n,) each: what an effect does to the stress. Laws are told apart by how
    that is bent by strain, largest strain so far, its own size and time, and by a lag.
    """
    if not others:
        return base
    strain = np.concatenate([p.strain[p.index] for p in programmes])
    largest = np.concatenate(
        [np.maximum.accumulate(np.abs(p.strain))[p.index] for p in programmes]
    )
    time = np.concatenate([p.time_s[p.index] for p in programmes])
    ends = np.cumsum([len(p.index) for p in programmes])[:-1]
    columns = []
    for moved in others:
        own = moved / max(float(np.abs(moved).max()), 1e-300)
        bends = (strain, strain**2, largest, strain * largest, own, abs(own), own**2)
        columns += [moved, *(moved * x for x in (*bends, time, time**2))]
        for samples in LATE:
            parts = [
                np.r_[[p[0]] * samples, p[:-samples]] for p in np.split(moved, ends)
            ]
            columns.append(np.concatenate(parts))
    extra = np.column_stack(columns)
    if base is None:
        return Refit(extra, np.zeros((len(extra), 0)), False)
    return replace(base, springs=np.column_stack([base.springs, extra]))


def power(energy: float, parameters: int) -> float:
    """Chance that the oracle sees it, at one false alarm in a hundred."""
    limit = chi2.ppf(1 - FALSE_ALARM, parameters)
    return float(ncx2.sf(limit, parameters, max(energy, 1e-12)))


def adequate(base: Base, programmes: Sequence[Imposed], sigma: float) -> bool:
    """Whether the piecewise-linear base can stand for this spring.

    What the best 16 segments leave, over all samples, is less than what chance adds to
    the sum of squares of ten parameters: no test can make a finding of it.
    """
    strain = np.concatenate([p.strain[p.index] for p in programmes])
    design = springs(strain, float(strain.min()), float(strain.max()), SEGMENTS)
    none = np.zeros((len(strain), 0))
    sigmas = np.full(len(strain), sigma)
    left = absorb(Refit(design, none, False), base.spring(strain), sigmas)
    return bool(np.sum((left / sigma) ** 2) < 10)
