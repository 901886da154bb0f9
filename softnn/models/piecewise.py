r"""Piecewise-linear viscoelastic models: many springs in turn, and Maxwell branches.

The lone spring of the standard linear solid or of Wiechert's model is replaced by
springs that engage one after the other as the strain grows (thesis eq. 5.7),

.. math:: \sigma^* = \sum_i k^*_i\, H(\varepsilon - \varepsilon_i)\,
          (\varepsilon - \varepsilon_i),

while the branches stay linear and come from a hold (`softnn.models.relaxation`). The
stress of the branches is subtracted from a tensile curve before the springs are
fitted to what is left (thesis Fig. 5.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solveh_banded
from scipy.optimize import least_squares

from softnn.contracts import Array, Chunk, InputError, Parameter, Parameters
from softnn.models import branches as maxwell
from softnn.models.branches import Update
from softnn.models.linear import (
    Branched,
    Maxwell,
    branch_parameters,
    branch_values,
    values,
)
from softnn.models.relaxation import Relaxation
from softnn.models.segments import Knots, Tolerance

Regression = Literal["segment", "joint"]


class Curve(Protocol):
    """What a fit needs of a recording: time_s, strain and stress_MPa, each (n,)."""

    @property
    def time_s(self) -> Array: ...
    @property
    def strain(self) -> Array: ...
    @property
    def stress_MPa(self) -> Array: ...


class PLWiechert(Branched):
    r"""Springs that engage at `knots`, beside Maxwell branches (thesis eq. 5.8).

    ::

             k*_1   (from strain 0 on)
        +---/\/\/----------+
        |    k*_2   (beyond knots[1])
        +---/\/\/----------+
        |    k_1    eta_1  |
        o---/\/\/----[|----o
        |    k_j    eta_j  |
        +---/\/\/----[|----+

    Each knot is a strain and adds one parameter, the stiffness spring_i [MPa] that
    comes in beyond it; below zero it lets the curve soften. A knot below zero acts
    beyond it in compression; the spring of a knot at zero acts both ways. Branch
    stiffnesses may be negative, as collocation can give them; springs they are then
    no more. In a recording: a curved loading path that shifts with the rate by the
    same amount at every strain, and relaxation in proportion to strain. Taken for:
    true nonlinear viscoelasticity, whose relaxation is not.
    """

    def __init__(
        self,
        knots: ArrayLike = (0.0, 0.2),
        branches: int = 3,
        update: Update = "exact",
    ) -> None:
        super().__init__(update)
        self.knots = np.asarray(knots, dtype=float)
        self.branches = branches
        distinct = np.unique(self.knots).size == self.knots.size
        if not (self.knots.size and distinct and np.isfinite(self.knots).all()):
            raise InputError(
                f"knots are {knots!r}; allowed is one or more distinct strains"
            )
        springs = tuple(
            Parameter(
                f"spring_{i}",
                "MPa",
                -1e6,
                1e6,
                1.0,
                "linear",
                f"engages beyond strain {knot:.6g}",
            )
            for i, knot in enumerate(self.knots, start=1)
        )
        self.springs = [p.name for p in springs]
        self.parameters = (*springs, *self.branch_parameters())
        self.linear = tuple(p.name for p in self.parameters if p.unit == "MPa")

    def branch_parameters(self) -> tuple[Parameter, ...]:
        return branch_parameters(self.branches, low=-1e6)

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        return branch_values(parameters, self.branches)

    def equilibrium(self, parameters: Parameters, strain: Array) -> Array:
        return engaged(self.knots, values(parameters, self.springs), strain)


class PLSLS(PLWiechert):
    """`PLWiechert` with one branch, named as in `StandardLinearSolid` (eq. 5.9).

    Written as a differential equation instead (eq. 5.5 with the springs in it) the
    same network is the Std. Lin. SDS of Austin, Schepelmann and Geyer (2015,
    doi:10.1109/IROS.2015.7354227); `fit_std_lin_sds` fits it as they did.
    """

    def __init__(self, knots: ArrayLike = (0.0, 0.2), update: Update = "exact") -> None:
        super().__init__(knots, 1, update)

    def branch_parameters(self) -> tuple[Parameter, ...]:
        return Maxwell.parameters

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        return Branched.prony(self, parameters)


class SecondOrderExponential(Branched):
    r"""The early rival: two exponentials of strain, no time in it.

    .. math:: \sigma = a\,(e^{b\varepsilon} - 1) + c\,(e^{d\varepsilon} - 1)

    Schepelmann, Geberth and Geyer (2014, doi:10.1109/ICRA.2014.6907513) describe a
    rubber spring so; the -1, added here, makes no strain mean no stress. In a
    recording: one curve for every rate, no loop.
    """

    parameters = (
        Parameter("amplitude_1", "MPa", -1e6, 1e6, 1.0, "linear", "a"),
        Parameter("exponent_1", "-", -1e3, 1e3, -5.0, "linear", "b"),
        Parameter("amplitude_2", "MPa", -1e6, 1e6, 1.0, "linear", "c"),
        Parameter("exponent_2", "-", -1e3, 1e3, 0.5, "linear", "d"),
    )
    linear = ("amplitude_1", "amplitude_2")

    def equilibrium(self, parameters: Parameters, strain: Array) -> Array:
        a, b, c, d = values(parameters, [p.name for p in self.parameters]).T
        return a * np.expm1(b * strain) + c * np.expm1(d * strain)

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        return np.ones((1, 0)), np.ones((1, 0))


def engaged(knots: Array, springs: Array, strain: Array) -> Array:
    """Stress (n, sets) of springs (sets, m) that engage at knots (m,), eq. 5.7.

    Works on running sums of stiffness and stress, so that it costs one search a
    sample however many springs there are.
    """
    out: Array = np.zeros((1, 1))
    zero = knots == 0
    if zero.any():
        out = springs[:, zero].sum(axis=1) * strain
    for side in (1.0, -1.0):
        mine = np.flatnonzero(side * knots > 0)
        if not mine.size:
            continue
        mine = mine[np.argsort(side * knots[mine])]
        at = np.concatenate([[0.0], side * knots[mine]])
        stiffness = np.cumsum(springs[:, mine], axis=1).T  # (m, sets)
        rise = np.diff(at[1:])[:, None] * stiffness[:-1]
        stress = np.concatenate([np.zeros((2, len(springs))), np.cumsum(rise, axis=0)])
        stiffness = np.concatenate([np.zeros((1, len(springs))), stiffness])
        away = side * strain
        place = np.searchsorted(at[1:], away, side="right")  # (n, 1 or sets)
        sets = np.arange(len(springs)) if len(springs) > 1 else 0
        part = stress[place, sets] + stiffness[place, sets] * (away - at[place])
        out = out + side * part
    return np.broadcast_to(out, (len(strain), max(strain.shape[1], len(springs))))


@dataclass(frozen=True)
class PiecewiseFit:
    """A fitted model with its parameters, and the choices it came from."""

    model: Branched
    parameters: dict[str, float]
    choices: dict[str, object] = field(default_factory=dict)

    @property
    def segments(self) -> int:
        return len(self.model.knots) if isinstance(self.model, PLWiechert) else 1

    @property
    def branches(self) -> int:
        return self.model.prony(self.parameters)[0].shape[1]

    def predict(self, curve: Curve) -> Array:
        """Stress (n,), MPa, over the time and strain of a curve, from rest."""
        chunk = Chunk(curve.time_s, curve.strain)
        return self.model.respond(self.parameters, chunk)[0].stress


def branch_stress(
    relaxation: Relaxation, curve: Curve, update: Update = "exact"
) -> Array:
    """Stress (n,) of the branches alone over a curve, MPa."""
    k = np.array([relaxation.stiffness])
    tau = np.array([relaxation.relaxation_time])
    stress, _ = maxwell.respond(k, tau, Chunk(curve.time_s, curve.strain), None, update)
    return stress[:, 0]


@dataclass(frozen=True)
class Skeleton:
    """One stress for each strain, away from zero: strain (m,) rising, weights (m,).

    `side` is -1 for compression: strain and stress are then those with their sign
    turned, so that everything that follows sees tension.
    """

    strain: Array
    stress: Array
    weight: Array
    side: float


def skeleton(strain: Array, stress: Array, points: int = 400) -> Skeleton:
    """The elastic curve behind samples of strain and stress in any order.

    Samples that rise in strain throughout are the curve themselves; others (several
    specimens, unloading, a hold) are averaged over `points` equal steps of strain.
    Samples without a stress, and those on the far side of zero, are left out.
    """
    keep = np.isfinite(stress)
    strain, stress = strain[keep], stress[keep]
    if not strain.size:
        raise InputError("no sample with a stress; a curve to fit is needed")
    side = 1.0 if strain.max() >= -strain.min() else -1.0
    strain, stress = side * strain, side * stress
    strain, stress = strain[strain >= 0], stress[strain >= 0]
    if strain.size < 2 or not strain.max() > 0:
        raise InputError("strain never leaves zero; a curve to fit is needed")
    if (np.diff(strain) > 0).all():
        return Skeleton(strain, stress, np.ones_like(strain), side)
    points = min(points, max(strain.size // 3, 2))
    bins = np.minimum((strain / strain.max() * points).astype(int), points - 1)
    _, index, counts = np.unique(bins, return_inverse=True, return_counts=True)
    means = [np.bincount(index, weights=v) / counts for v in (strain, stress)]
    return Skeleton(means[0], means[1], counts.astype(float), side)


def segment_slopes(curve: Skeleton, knots: Array) -> Array:
    """Slope (m,) of a linear regression within each segment, ends included.

    The thesis's way: segments know nothing of each other, so that the curve joined
    from their slopes may drift off the data.
    """
    x, y, w = curve.strain, curve.stress, curve.weight
    # About the middle, so that the running sums cancel little.
    x, y = x - x.mean(), y - y.mean()
    sums = [
        np.concatenate([[0.0], np.cumsum(v)])
        for v in (w, w * x, w * y, w * x * x, w * x * y)
    ]
    first = np.searchsorted(curve.strain, knots, side="left")
    last = np.append(np.searchsorted(curve.strain, knots[1:], side="right"), len(x))
    s, sx, sy, sxx, sxy = (v[last] - v[first] for v in sums)
    spread = s * sxx - sx * sx
    if not (last - first >= 2).all():
        raise InputError("a segment with fewer than two samples; use fewer segments")
    return (s * sxy - sx * sy) / spread


def joint_slopes(curve: Skeleton, knots: Array) -> Array:
    """Slope (m,) of each segment of the continuous curve nearest to all samples.

    Least squares for the stress at each knot, which is tridiagonal; zero at zero.
    """
    vertices = np.append(knots, max(curve.strain[-1], np.nextafter(knots[-1], np.inf)))
    width = np.diff(vertices)
    place = np.clip(
        np.searchsorted(vertices, curve.strain, "right") - 1, 0, len(knots) - 1
    )
    share = (curve.strain - vertices[place]) / width[place]  # of the vertex above
    w, y = curve.weight, curve.stress
    m = len(vertices)

    def gather(index: NDArray[np.intp], weights: Array) -> Array:
        return np.bincount(index, weights=weights, minlength=m).astype(float)

    diagonal = gather(place, w * (1 - share) ** 2) + gather(place + 1, w * share**2)
    beside = gather(place + 1, w * share * (1 - share))
    right = gather(place, w * y * (1 - share)) + gather(place + 1, w * y * share)
    if not (diagonal[1:] > 0).all():
        raise InputError("a segment without a sample; use fewer segments")
    height = np.zeros(m)
    banded = np.stack([beside[1:], diagonal[1:]])
    height[1:] = solveh_banded(banded, right[1:])
    return np.diff(height) / width


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

    The stress of the branches is subtracted from every curve (unless `subtract` is
    False), what is left is averaged over strain, cut into segments by `knots` (the
    criterion on the slope at a tolerance of 40 % by default), and each segment gets
    its slope; springs are the differences of slopes. Several curves, of several
    specimens or rates, give one set of springs.
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
    """The second half of `fit`: springs for a curve the branches are out of."""
    at = knots(curve.strain, curve.stress)
    if regression not in ("segment", "joint"):
        raise InputError(f"regression {regression!r}; allowed is 'segment', 'joint'")
    slopes = (segment_slopes if regression == "segment" else joint_slopes)(curve, at)
    springs = np.diff(slopes, prepend=0.0)
    model: PLWiechert
    if relaxation.branches == 1:
        model = PLSLS(curve.side * at, update)
        branch = {
            "stiffness": relaxation.stiffness[0],
            "relaxation_time": relaxation.relaxation_time[0],
        }
    else:
        model = PLWiechert(curve.side * at, relaxation.branches, update)
        branch = relaxation.branch_parameters
    parameters = dict(zip(model.springs, springs.tolist(), strict=True))
    choices: dict[str, object] = {"knots": str(knots), "regression": regression}
    return PiecewiseFit(model, parameters | branch, choices)


def sweep(
    curves: Sequence[Curve],
    relaxations: Sequence[Relaxation],
    knots: Sequence[Knots],
    *,
    regression: Regression = "segment",
    update: Update = "exact",
) -> list[list[PiecewiseFit]]:
    """`fit` for every relaxation (outer) and every criterion (inner)."""
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


def fit_std_lin_sds(
    curves: Sequence[Curve], relaxation: Relaxation, knots: Knots
) -> PiecewiseFit:
    """Std. Lin. SDS: springs fitted to the whole stress, the branch put beside them.

    The predecessor (Austin et al. 2015) as the thesis reads it (sections 5.3 and
    5.6): nothing is subtracted, so that what the branch carries is counted twice.
    """
    return fit(curves, relaxation, knots, subtract=False)


def fit_exponential(curves: Sequence[Curve]) -> PiecewiseFit:
    """`SecondOrderExponential` by least squares; amplitudes solved for exactly.

    The exponents are searched from a few starts, per unit of the largest strain.
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
    return PiecewiseFit(SecondOrderExponential(), parameters)
