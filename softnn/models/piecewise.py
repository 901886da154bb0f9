r"""Piecewise-linear viscoelastic models: many springs in turn, and Maxwell branches.

The lone spring of the standard linear solid or of Wiechert's model is replaced by
springs that engage one after the other as the strain grows (thesis eq. 5.7),

.. math:: \sigma^* = \sum_i k^*_i\, H(\varepsilon - \varepsilon_i)\,
          (\varepsilon - \varepsilon_i),

while the branches stay linear. `softnn.models.fit_piecewise` finds the springs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softnn.contracts import Array, InputError, Parameter, Parameters
from softnn.models.branches import Update
from softnn.models.linear import (
    Branched,
    Maxwell,
    branch_parameters,
    branch_values,
    values,
)


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
    engages beyond it; a negative stiffness softens the curve. A knot below zero acts
    beyond it in compression; the spring of a knot at zero acts both ways. Branch
    stiffnesses may be negative, since collocation can give such values; they then
    stand for no spring. In a recording: a curved loading path that shifts with the
    rate by the same amount at every strain, and relaxation in proportion to strain.
    Mistaken for true nonlinear viscoelasticity, whose relaxation is not proportional.
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
    doi:10.1109/IROS.2015.7354227); `fit_std_lin_sds` of
    `softnn.models.fit_piecewise` fits it as the thesis says they did.
    """

    def __init__(self, knots: ArrayLike = (0.0, 0.2), update: Update = "exact") -> None:
        super().__init__(knots, 1, update)

    def branch_parameters(self) -> tuple[Parameter, ...]:
        return Maxwell.parameters

    def prony(self, parameters: Parameters) -> tuple[Array, Array]:
        return Branched.prony(self, parameters)


class SecondOrderExponential(Branched):
    r"""The early rival: two exponentials of strain, independent of time.

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

    Running sums of stiffness and stress make the cost one search a sample, whatever the
    number of springs. Stress is in the unit of the springs, MPa.
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
