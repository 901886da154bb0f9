"""What a refit of the base absorbs, and whether the rest can be seen at all.

The refit here is more generous than any base softnn has: 16 equal strain segments
where the model is piecewise linear, 22 relaxation times where it has branches, signs
free. An effect whose trace lies in that space, or under the noise, cannot be found by
anybody from these recordings; that is a miss of the programmes, not of a diagnosis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2, ncx2

from studies.concealed.bases import Base, maxwell
from studies.concealed.programmes import Array, Imposed

SEGMENTS = 16
TIMES_S = np.geomspace(0.05, 600.0, 22)
FALSE_ALARM = 0.01


def springs(strain: Array, low: float, high: float, segments: int) -> Array:
    """Unit springs (n, k), each active over its own strain segment."""
    width = high / segments
    knots = np.arange(segments) * width
    columns = [np.clip(strain - k, 0, width) for k in knots]
    if low < -1e-6:
        columns += [np.clip(strain - k, low / 3, 0) for k in (0, low / 3, 2 * low / 3)]
    return np.column_stack(columns)


def designs(
    model: str, programmes: Sequence[Imposed], start: Sequence[Array]
) -> list[Array]:
    """Design matrices (samples of all recordings, k) that the model may choose from.

    `start` is the fine strain before each recording (empty on a virgin specimen), so
    that branches know what went before.
    """
    strain = np.concatenate([p.strain[p.index] for p in programmes])
    piecewise = model.startswith("pl-")
    low, high = float(strain.min()), float(strain.max())
    fixed = (
        springs(strain, low, high, SEGMENTS) if piecewise else strain[:, np.newaxis]
    )
    if model == "hooke":
        return [fixed]
    branches = np.column_stack(
        [
            np.concatenate(
                [
                    maxwell(np.concatenate([s, p.strain]), t)[len(s) :][p.index]
                    for s, p in zip(start, programmes, strict=True)
                ]
            )
            for t in TIMES_S
        ]
    )
    if model.endswith("sls"):
        return [np.column_stack([fixed, b]) for b in branches.T]
    return [np.column_stack([fixed, branches])]


def absorb(choices: Sequence[Array], stress: Array, sigma: Array) -> Array:
    """Residual (n,) of the best non-negative refit of the base to `stress`, MPa."""
    best = stress
    for design in choices:
        # Reduced by QR: the fit is of k + 1 rows instead of n.
        q, r = np.linalg.qr(design / sigma[:, np.newaxis])
        coefficients, _ = nnls(r, q.T @ (stress / sigma), maxiter=400)
        residual = stress - design @ coefficients
        if np.sum((residual / sigma) ** 2) < np.sum((best / sigma) ** 2):
            best = residual
    return best


def visible_energy(
    choices: Sequence[Array],
    difference: Array,
    time_s: Sequence[Array],
    sigma: Array,
    correlation_s: float,
) -> float:
    """Squared size of `difference` (n,) outside the base's span, in noise units.

    Noncentrality of the likelihood-ratio test that is told the true form. Coloured
    noise is whitened recording by recording.
    """
    energy = np.inf
    for design in choices or [np.zeros((len(difference), 0))]:
        rows = np.column_stack([design, difference]) / sigma[:, np.newaxis]
        if correlation_s > 0:
            rows = whiten(rows, time_s, correlation_s)
        design, target = rows[:, :-1], rows[:, -1]
        if design.shape[1]:
            target = target - design @ np.linalg.lstsq(design, target, rcond=1e-9)[0]
        energy = min(energy, float(np.sum(target**2)))
    return energy


def whiten(rows: Array, time_s: Sequence[Array], correlation_s: float) -> Array:
    """Innovations of an Ornstein-Uhlenbeck noise of unit variance, rows (n, k)."""
    out, first = [], 0
    for time in time_s:
        part = rows[first : first + len(time)]
        first += len(time)
        keep = np.exp(-np.diff(time) / correlation_s)[:, np.newaxis]
        out += [part[:1], (part[1:] - keep * part[:-1]) / np.sqrt(1 - keep**2)]
    return np.concatenate(out)


def power(energy: float, parameters: int) -> float:
    """Chance that the oracle sees it, at one false alarm in a hundred."""
    limit = chi2.ppf(1 - FALSE_ALARM, parameters)
    return float(ncx2.sf(limit, parameters, max(energy, 1e-12)))


def adequate(base: Base, programmes: Sequence[Imposed], sigma: float) -> bool:
    """Whether the piecewise-linear base can stand for this spring.

    The best 16 segments leave less than a fifth of the noise (rms over the samples).
    """
    strain = np.concatenate([p.strain[p.index] for p in programmes])
    stress = base.spring(strain)
    design = springs(strain, float(strain.min()), float(strain.max()), SEGMENTS)
    left = absorb([design], stress, np.ones_like(stress))
    return bool(np.sqrt(np.mean(left**2)) < 0.2 * sigma)
