"""Springs and branches of piecewise-linear models, fitted to recordings.

`fit` is the method of the thesis (Fig. 5.6). It takes the branches from a hold
(`softnn.models.relaxation`), subtracts their stress from a tensile curve, and cuts the
remaining curve into segments, each with its slope. `fit_jointly` needs no hold: it
finds springs and branches together from curves of several rates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares, nnls

from softnn.contracts import Array, Chunk, InputError, Model
from softnn.models import branches as maxwell
from softnn.models.branches import Update
from softnn.models.piecewise import PLSLS, PLWiechert, SecondOrderExponential, engaged
from softnn.models.relaxation import Relaxation
from softnn.models.segments import Knots, Optimal, Tolerance
from softnn.models.skeleton import Skeleton, joint_slopes, segment_slopes, skeleton

Regression = Literal["segment", "joint"]


class Curve(Protocol):
    """What a fit needs of a recording: time_s, strain and stress_MPa, each (n,)."""

    @property
    def time_s(self) -> Array: ...
    @property
    def strain(self) -> Array: ...
    @property
    def stress_MPa(self) -> Array: ...


@dataclass(frozen=True)
class Fit:
    """A model with its parameters, fitted."""

    model: Model
    parameters: dict[str, float]

    def predict(self, curve: Curve) -> Array:
        """Stress (n,), MPa, over the time and strain of a curve, from rest."""
        chunk = Chunk(curve.time_s, curve.strain)
        return self.model.respond(self.parameters, chunk)[0].stress


@dataclass(frozen=True)
class PiecewiseFit:
    """Springs (m,) [MPa] that engage at knots (m,) as strains, and the branches.

    `how` they were made is kept with them. The fit stays in arrays: the thesis's
    criterion gives hundreds of segments, and a study makes thousands of fits. `model`
    and `parameters` give the same fit in the form of the contract.
    """

    knots: Array
    springs: Array
    relaxation: Relaxation
    how: str
    update: Update = "exact"

    @property
    def segments(self) -> int:
        return len(self.knots)

    @property
    def branches(self) -> int:
        return self.relaxation.branches

    @cached_property
    def model(self) -> PLWiechert:
        if self.branches == 1:
            return PLSLS(self.knots, self.update)
        return PLWiechert(self.knots, self.branches, self.update)

    @cached_property
    def parameters(self) -> dict[str, float]:
        named = dict(zip(self.model.springs, self.springs.tolist(), strict=True))
        if self.branches > 1:
            return named | self.relaxation.branch_parameters
        (k,), (tau,) = self.relaxation.stiffness, self.relaxation.relaxation_time
        return named | {"stiffness": k, "relaxation_time": tau}

    def predict(self, curve: Curve, viscous: Array | None = None) -> Array:
        """Stress (n,), MPa, over the time and strain of a curve, from rest.

        `viscous` (n,) is the stress of the branches on that curve, where it is known.
        """
        strain = np.asarray(curve.strain, dtype=float)[:, None]
        elastic = engaged(self.knots, self.springs[None, :], strain)[:, 0]
        if viscous is None:
            viscous = branch_stress(self.relaxation, curve, self.update)
        return elastic + viscous


def branch_stress(
    relaxation: Relaxation, curve: Curve, update: Update = "exact"
) -> Array:
    """Stress (n,) of the branches alone over a curve, MPa."""
    k = np.array([relaxation.stiffness])
    tau = np.array([relaxation.relaxation_time])
    stress, _ = maxwell.respond(k, tau, Chunk(curve.time_s, curve.strain), None, update)
    return stress[:, 0]


def fit(
    curves: Sequence[Curve],
    relaxation: Relaxation,
    knots: Knots | None = None,
    *,
    regression: Regression = "segment",
    subtract: bool = True,
    update: Update = "exact",
) -> PiecewiseFit:
    """PL-SLS or PL-Wiechert (by the branches of `relaxation`) as in thesis Fig. 5.6.

    The stress of the branches is subtracted from every curve, unless `subtract` is
    False. The remaining stress is averaged over strain and cut into segments by
    `knots`, by default the criterion on the slope at a tolerance of 40 %. Each segment
    gets the slope of its regression; springs [MPa] are the differences of slopes.
    Several curves, of several specimens or rates, give one set of springs.
    """
    left = [
        np.asarray(c.stress_MPa, dtype=float)
        - (branch_stress(relaxation, c, update) if subtract else 0.0)
        for c in curves
    ]
    if not left:
        raise InputError("no curves; at least one is needed")
    strains = [np.asarray(c.strain, dtype=float) for c in curves]
    return fit_elastic(
        skeleton(np.concatenate(strains), np.concatenate(left)),
        relaxation,
        knots or Tolerance(0.4),
        regression=regression,
        update=update,
    )


def fit_elastic(
    curve: Skeleton,
    relaxation: Relaxation,
    knots: Knots,
    *,
    regression: Regression = "segment",
    update: Update = "exact",
) -> PiecewiseFit:
    """Return the springs for an elastic curve; the branches are those of `relaxation`.

    This is the second half of `fit`, for a curve from which the branch stress is
    already subtracted.
    """
    at = knots(curve.strain, curve.stress)
    if regression not in ("segment", "joint"):
        raise InputError(f"regression {regression!r}; allowed is 'segment', 'joint'")
    slopes = (segment_slopes if regression == "segment" else joint_slopes)(curve, at)
    springs = np.diff(slopes, prepend=0.0)
    how = f"{knots}, {regression} regression"
    return PiecewiseFit(curve.side * at, springs, relaxation, how, update)


def sweep(
    curves: Sequence[Curve],
    relaxations: Sequence[Relaxation],
    knots: Sequence[Knots],
    *,
    regression: Regression = "segment",
    update: Update = "exact",
) -> list[list[PiecewiseFit]]:
    """Return the results of `fit` for every relaxation (outer) and criterion (inner).

    The branch stress of each relaxation is computed only once.
    """
    strains = np.concatenate([np.asarray(c.strain, dtype=float) for c in curves])
    fits = []
    for relaxation in relaxations:
        left = [c.stress_MPa - branch_stress(relaxation, c, update) for c in curves]
        curve = skeleton(strains, np.concatenate(left))
        fits.append(
            [
                fit_elastic(curve, relaxation, k, regression=regression, update=update)
                for k in knots
            ]
        )
    return fits


def fit_jointly(
    curves: Sequence[Curve],
    branches: int,
    knots: Knots | None = None,
    times_s: ArrayLike | None = None,
    update: Update = "exact",
) -> PiecewiseFit:
    r"""Springs and branches together, from curves at several rates: no hold needed.

    For given knots and relaxation times the stress is linear in every stiffness. One QR
    factorisation eliminates the springs exactly. The branches follow by non-negative
    least squares. They are added one at a time, up to `branches`; each time the one of
    `times_s` that leaves the smallest error is chosen. The sum of squared NRMSE is
    minimised, so every curve has the same weight. A hold may be among the curves.

    knots: on the mean curve; 30 optimal segments by default. times_s: three a decade
    by default, from a hundredth of the shortest curve to ten times the longest.

    Curves of a single rate cannot tell a branch from a spring: the fit is then one of
    many.
    """
    if branches < 1 or not curves:
        raise InputError(
            f"{branches} branches, {len(curves)} curves; one or more of each is needed"
        )
    strain = np.concatenate([np.asarray(c.strain, dtype=float) for c in curves])
    stress = np.concatenate([np.asarray(c.stress_MPa, dtype=float) for c in curves])
    mean = skeleton(strain, stress)
    cut = knots or Optimal(min(30, len(mean.strain) // 4))
    at = cut(mean.strain, mean.stress)
    tau = default_times(curves) if times_s is None else np.asarray(times_s, float)
    if branches > tau.size:
        raise InputError(f"{branches} branches of {tau.size} relaxation times")
    design = np.vstack([_design(c, at, mean.side, tau, update) for c in curves])
    triangle = np.asarray(np.linalg.qr(design, mode="r"))
    m = len(at)
    left, target = triangle[m:, m:-1], triangle[m:, -1]
    chosen = _forward(left, target, branches)
    k, _ = nnls(left[:, chosen], target)
    rest = triangle[:m, -1] - triangle[:m, m:-1][:, chosen] @ k
    springs = solve_triangular(triangle[:m, :m], rest)
    found = Relaxation(
        0.0, tuple(k.tolist()), tuple(tau[chosen].tolist()), "joint least squares"
    )
    how = f"{cut}, with the branches"
    return PiecewiseFit(mean.side * at, springs, found, how, update)


def default_times(curves: Sequence[Curve], per_decade: int = 3) -> Array:
    """Return relaxation times (j,) [s] that curves of these lengths can resolve.

    There are `per_decade` times a decade, from a hundredth of the shortest curve to ten
    times the longest.
    """
    lengths = [float(c.time_s[-1] - c.time_s[0]) for c in curves]
    low, high = min(lengths) / 100, max(lengths) * 10
    return np.geomspace(low, high, int(np.log10(high / low) * per_decade) + 1)


def _design(
    curve: Curve, knots: Array, side: float, times: Array, update: Update
) -> Array:
    """Columns of springs (m), branches (j) and measured stress, over its size."""
    strain = np.asarray(curve.strain, dtype=float)
    stress = np.asarray(curve.stress_MPa, dtype=float)
    keep = np.isfinite(stress)
    springs = np.maximum(side * strain[:, None] - knots, 0)
    springs[:, 0] = side * strain
    chunk = Chunk(curve.time_s, strain)
    tau = times[:, None]
    units, _ = maxwell.respond(np.ones_like(tau), tau, chunk, None, update)
    size = np.sqrt(np.sum(stress[keep] ** 2)) or 1.0
    return np.column_stack([side * springs, units, stress])[keep] / size


def _forward(left: Array, target: Array, branches: int) -> list[int]:
    chosen: list[int] = []
    for _ in range(branches):
        errors = {
            j: nnls(left[:, [*chosen, j]], target)[1]
            for j in range(left.shape[1])
            if j not in chosen
        }
        chosen.append(min(errors, key=lambda j: errors[j]))
    return sorted(chosen)


def fit_std_lin_sds(
    curves: Sequence[Curve], relaxation: Relaxation, knots: Knots
) -> PiecewiseFit:
    """Std. Lin. SDS: springs fitted to the whole stress, the branch added beside them.

    The predecessor (Austin et al. 2015) as the thesis reads it (sections 5.3 and 5.6).
    Nothing is subtracted from the curve, so the stress of the branch counts twice.
    """
    return fit(curves, relaxation, knots, subtract=False)


def fit_exponential(curves: Sequence[Curve]) -> Fit:
    """Fit `SecondOrderExponential` by least squares; amplitudes are solved exactly.

    The exponents are searched from a few starts, per unit of the largest strain. Raises
    `InputError` where the strain never leaves zero.
    """
    strain = np.concatenate([np.asarray(c.strain, dtype=float) for c in curves])
    stress = np.concatenate([np.asarray(c.stress_MPa, dtype=float) for c in curves])
    keep = np.isfinite(stress) & np.isfinite(strain)
    x, y = strain[keep], stress[keep]
    reach = np.abs(x).max(initial=0.0)
    if not reach > 0:
        raise InputError("strain never leaves zero; a curve to fit is needed")
    x = x / reach

    def amplitudes(exponents: Array) -> tuple[Array, Array]:
        basis = np.expm1(x[:, None] * exponents)
        solved = np.linalg.lstsq(basis, y, rcond=1e-12)[0]
        return solved, basis @ solved - y

    starts = [(-10.0, 1.0), (-3.0, 3.0), (-30.0, -1.0), (1.0, 5.0)]
    found = [
        least_squares(lambda e: amplitudes(e)[1], s, bounds=(-60, 20)) for s in starts
    ]
    exponents = min(found, key=lambda f: f.cost).x
    a = amplitudes(exponents)[0]
    names = [p.name for p in SecondOrderExponential.parameters]
    b = exponents / reach
    parameters = dict(zip(names, map(float, (a[0], b[0], a[1], b[1])), strict=True))
    return Fit(SecondOrderExponential(), parameters)
