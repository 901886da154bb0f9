"""The tolerance at which a piecewise-linear model fits a curve best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softnn.metrics import nrmse
from softnn.models.fit_piecewise import PiecewiseFit, sweep
from softnn.models.segments import Tolerance
from softnn.study.baselines import TOLERANCES
from softnn.study.piecewise import Case


@dataclass(frozen=True)
class Best:
    """The fits of a model at every tolerance, and the one of least NRMSE."""

    fits: list[PiecewiseFit]
    errors: list[float]
    tolerances: tuple[float, ...]

    @property
    def at(self) -> int:
        return int(np.argmin(self.errors))

    @property
    def error(self) -> float:
        return self.errors[self.at]


def best_of(case: Case, model: str, tolerances: tuple[float, ...] = TOLERANCES) -> Best:
    """A model on the curve the thesis fits it to, at every tolerance."""
    curve, relaxation = case.fitted, case.primary(model).relaxation
    (row,) = sweep([curve], [relaxation], [Tolerance(t) for t in tolerances])
    errors = [nrmse(f.predict(curve), curve.stress_MPa) for f in row]
    return Best(row, errors, tolerances)
