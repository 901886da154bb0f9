"""How many segments does a tolerance on the slope give, and how good a fit?

Figs 5.8 to 5.11 of the thesis: segments and NRMSE (eq. 5.10) of PL-SLS and PL-Wiechert
on the mean curve they are fitted to, for tolerances of 10 to 100 %. Beside them, which
the thesis does not have: as many segments put where they fit best, and equal ones.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from softnn.metrics import nrmse
from softnn.models.fit_piecewise import branch_stress, fit_elastic, sweep
from softnn.models.segments import Equal, Knots, Optimal, Tolerance
from softnn.models.skeleton import skeleton
from softnn.study.baselines import MODELS
from softnn.study.piecewise import Case, Work, carry_out
from studies.shown.segments import draw, written

COUNTS = (1, 2, 3, 5, 8, 12, 20, 30, 50)
ENOUGH = 0.01  # NRMSE of a fit that is good enough to stop adding segments


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.segments`; returns the exit code."""
    return carry_out("segments", __doc__, argv, study, draw)


def study(work: Work, case: Case) -> dict[str, Any]:
    """Segments and NRMSE by tolerance, and by count, for both models."""
    curve = case.fitted
    models: dict[str, Any] = {}
    trials: list[dict[str, Any]] = []
    headline: dict[str, Any] = {}
    for model in MODELS:
        relaxation = case.primary(model).relaxation
        began, started = time.perf_counter(), datetime.now()
        (fits,) = sweep([curve], [relaxation], [Tolerance(t) for t in work.tolerances])
        seconds = (time.perf_counter() - began) / len(fits)
        by_tolerance = [
            {
                "tolerance": tolerance,
                "segments": fit.segments,
                "nrmse": nrmse(fit.predict(curve), curve.stress_MPa),
            }
            for tolerance, fit in zip(work.tolerances, fits, strict=True)
        ]
        left = curve.stress_MPa - branch_stress(relaxation, curve)
        elastic = skeleton(curve.strain, left)
        most = len(elastic.strain) // 3
        by_count = []
        for count in [c for c in COUNTS if c <= most]:
            entry: dict[str, Any] = {"segments": count}
            criteria: dict[str, Knots] = {
                "optimal": Optimal(count),
                "equal": Equal(count),
            }
            for kind, criterion in criteria.items():
                fit = fit_elastic(elastic, relaxation, criterion, regression="joint")
                entry[kind] = nrmse(fit.predict(curve), curve.stress_MPa)
            by_count.append(entry)
        models[model] = {
            "branches": relaxation.branches,
            "relaxation": relaxation.to_dict(),
            "by_tolerance": by_tolerance,
            "by_count": by_count,
        }
        trials += [
            {
                "name": f"{model}, tolerance {100 * row['tolerance']:.0f} %",
                "parameters": {"model": model, "tolerance": row["tolerance"]},
                "metrics": {
                    "segments": row["segments"],
                    "nrmse": row["nrmse"],
                    "seconds": seconds,
                },
                "started": started,
                "ended": datetime.now(),
            }
            for row in by_tolerance
        ]
        key = model.lower().replace("-", "_")
        good = [r["segments"] for r in by_tolerance if r["nrmse"] <= ENOUGH]
        headline |= {
            f"{key}_segments_at_10_percent": by_tolerance[0]["segments"],
            f"{key}_segments_at_100_percent": by_tolerance[-1]["segments"],
            f"{key}_nrmse_best": min(r["nrmse"] for r in by_tolerance),
            f"{key}_segments_for_1_percent": min(good) if good else None,
            f"{key}_optimal_segments_for_1_percent": next(
                (r["segments"] for r in by_count if r["optimal"] <= ENOUGH), None
            ),
        }
    text = written(models)
    print(f"\n{case.label}\n\n{text}")
    return {
        "material": case.material,
        "label": case.label,
        "headline": headline,
        "models": models,
        "samples": len(curve),
        "trials": trials,
        "text": text,
    }


if __name__ == "__main__":
    sys.exit(main())
