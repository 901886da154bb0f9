"""Predictions of a left-out rate by piecewise-linear models."""

from __future__ import annotations

from typing import Any

from softnn.metrics import generalisation_error, nrmse
from softnn.models.fit_piecewise import fit_jointly, fit_std_lin_sds
from softnn.models.segments import Equal
from softnn.study.baselines import JOINT_BRANCHES, rate_errors
from softnn.study.piecewise import Case, speed_label


def error_by_rate(model: str, case: Case) -> dict[str, Any] | None:
    """Return NRMSE of each rate predicted by a joint fit to the others, as fractions.

    None with fewer than three rates: a fit to one rate cannot separate a branch from a
    spring.
    """
    if len(case.curves) < 3:
        return None
    errors = {}
    for left_out in case.curves:
        others = [c for c in case.curves if c is not left_out]
        fit = fit_jointly(others, JOINT_BRANCHES[model])
        errors[speed_label(case, left_out)] = nrmse(
            fit.predict(left_out), left_out.stress_MPa
        )
    return {"nrmse": generalisation_error(list(errors.values())), "by_rate": errors}


def std_lin_sds(case: Case) -> float:
    """Generalisation error of the predecessor, fitted as PL-SLS is in the thesis."""
    segments = Equal(min(20, len(case.fitted) // 3))
    relaxation = case.primary("PL-SLS").relaxation
    fit = fit_std_lin_sds([case.fitted], relaxation, segments)
    return generalisation_error(rate_errors(fit, case.curves))
