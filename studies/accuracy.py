"""How well can PL-SLS and PL-Wiechert fit one tensile curve at best?

Table 5.1 and Figs 5.12 to 5.15 of the thesis, with the changes of accuracy and of
complexity (eqs 5.11, 5.12), the published values beside, and the models they are to
beat: Std. Lin. SDS, the second-order exponential, and a curve without time.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from softnn.metrics import delta_accuracy, delta_complexity, nrmse
from softnn.models.fit_piecewise import (
    Fit,
    PiecewiseFit,
    fit,
    fit_exponential,
    fit_std_lin_sds,
)
from softnn.models.segments import Equal, Optimal
from softnn.study.baselines import MODELS
from softnn.study.piecewise import Case, Work, carry_out
from softnn.study.tolerances import Best, best_of
from studies.shown.accuracy import draw, written

FEW = 20  # segments of the models that are compared at one complexity


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.accuracy`; returns the exit code."""
    return carry_out("accuracy", __doc__, argv, study, draw)


def study(work: Work, case: Case) -> dict[str, Any]:
    """Best tolerance of both models, the improvement, and the rivals."""
    curve = case.fitted
    found = {model: best_of(case, model, work.tolerances) for model in MODELS}
    best = {model: entry(case, model, one) for model, one in found.items()}
    trials = [
        {
            "name": f"{model}, tolerance {100 * t:.0f} %",
            "parameters": {"model": model, "tolerance": t},
            "metrics": {"nrmse": e, "segments": f.segments},
        }
        for model, one in found.items()
        for t, e, f in zip(one.tolerances, one.errors, one.fits, strict=True)
    ]
    sls, wiechert = (best[m] for m in MODELS)
    improvement = {
        "delta_accuracy_percent": delta_accuracy(wiechert["nrmse"], sls["nrmse"]),
        "delta_complexity_percent": delta_complexity(
            wiechert["segments"], sls["segments"]
        ),
    }
    published = case.published("5.1", "improvement")
    if published:
        improvement["published_delta_accuracy_percent"] = published["delta_accuracy"]
        improvement["published_delta_complexity_percent"] = published[
            "delta_complexity"
        ]
    rivals = rivals_of(case)
    trials += [
        {"name": name, "parameters": {"model": name}, "metrics": {"nrmse": error}}
        for name, error in rivals.items()
    ]
    headline = {
        f"{model.lower().replace('-', '_')}_{key}": best[model][key]
        for model in MODELS
        for key in ("nrmse", "segments", "nrmse_of_few_segments")
    }
    for model in MODELS:
        if "published" in best[model]:
            headline[f"{model.lower().replace('-', '_')}_nrmse_no_worse"] = bool(
                best[model]["nrmse"] <= best[model]["published"]["nrmse"]
            )
    headline |= {k: v for k, v in improvement.items() if not k.startswith("published")}
    text = written(best, improvement, rivals)
    print(f"\n{case.label}\n\n{text}")
    return {
        "material": case.material,
        "label": case.label,
        "headline": headline,
        "best": best,
        "improvement": improvement,
        "rivals": rivals,
        "fitted_rate_per_s": curve.rate_per_s,
        "trials": trials,
        "text": text,
        "drawn": {
            model: one.fits[one.at].predict(curve)[:: max(len(curve) // 200, 1)]
            for model, one in found.items()
        },
    }


def entry(case: Case, model: str, best: Best) -> dict[str, Any]:
    """The best fit as it is reported, with a fit of few segments beside it."""
    curve, relaxation = case.fitted, case.primary(model).relaxation
    few = Optimal(min(FEW, len(curve) // 3))
    parsimonious = fit([curve], relaxation, few, regression="joint")
    made: dict[str, Any] = {
        "nrmse": best.error,
        "segments": best.fits[best.at].segments,
        "tolerance": best.tolerances[best.at],
        "branches": relaxation.branches,
        "negative_branches": relaxation.negative,
        "nrmse_of_few_segments": nrmse(parsimonious.predict(curve), curve.stress_MPa),
        "few_segments": parsimonious.segments,
    }
    published = case.published("5.1", model)
    if published:
        made["published"] = {
            "nrmse": published["nrmse"] / 100,
            "segments": published["segments"],
            "tolerance": published["tolerance"] / 100,
            "branches": published.get("branches", 1),
        }
    return made


def rivals_of(case: Case) -> dict[str, float]:
    """NRMSE of what came before, at `FEW` segments where there are segments."""
    curve = case.fitted
    relaxation = case.primary("PL-SLS").relaxation
    few = Equal(min(FEW, len(curve) // 3))
    fits: dict[str, PiecewiseFit | Fit] = {
        f"Std. Lin. SDS, {few}": fit_std_lin_sds([curve], relaxation, few),
        f"PL-SLS, {few}": fit([curve], relaxation, few),
        "second-order exponential": fit_exponential([curve]),
    }
    return {k: nrmse(f.predict(curve), curve.stress_MPa) for k, f in fits.items()}


if __name__ == "__main__":
    sys.exit(main())
