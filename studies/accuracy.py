"""How well can PL-SLS and PL-Wiechert fit one tensile curve at best?

Table 5.1 and Figs 5.12 to 5.15 of the thesis, with the changes of accuracy and of
complexity (eqs 5.11, 5.12), the published values beside, and the models they are to
beat: Std. Lin. SDS, the second-order exponential, and a curve without time.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.metrics import delta_accuracy, delta_complexity, nrmse
from softnn.models.fit_piecewise import (
    Fit,
    PiecewiseFit,
    fit,
    fit_exponential,
    fit_std_lin_sds,
    sweep,
)
from softnn.models.segments import Equal, Optimal, Tolerance
from softnn.study.baselines import MODELS, TOLERANCES
from softnn.study.common import COLOURS, FAINT, INK, markdown, percent
from softnn.study.piecewise import Case, Work, carry_out, legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FEW = 20  # segments of the models that are compared at one complexity


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.accuracy`; returns the exit code."""
    return carry_out("accuracy", __doc__, argv, study, draw)


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


def written(
    best: dict[str, Any], improvement: dict[str, float], rivals: dict[str, float]
) -> str:
    rows = []
    for model in MODELS:
        one = best[model]
        rows.append(
            [
                model,
                percent(one["nrmse"]),
                one["segments"],
                percent(one["tolerance"], 0),
                one["branches"],
            ]
        )
        rows.append(
            [
                f"{model}, optimal cuts",
                percent(one["nrmse_of_few_segments"]),
                one["few_segments"],
                None,
                one["branches"],
            ]
        )
        if "published" in one:
            p = one["published"]
            rows.append(
                [
                    f"{model}, thesis",
                    percent(p["nrmse"]),
                    p["segments"],
                    percent(p["tolerance"], 0),
                    p["branches"],
                ]
            )
    rows += [[name, percent(error), None, None, None] for name, error in rivals.items()]
    lines = markdown(["model", "NRMSE", "segments", "tolerance", "branches"], rows)
    changes = (
        f"accuracy {improvement['delta_accuracy_percent']:+.0f} %, "
        f"complexity {improvement['delta_complexity_percent']:+.0f} %"
    )
    if "published_delta_accuracy_percent" in improvement:
        changes += (
            f" (thesis: {improvement['published_delta_accuracy_percent']:+.0f} %, "
            f"{improvement['published_delta_complexity_percent']:+.0f} %)"
        )
    return f"{lines}\n\nPL-Wiechert against PL-SLS: {changes}"


def draw(work: Work, cases: list[Case], found: list[dict[str, Any]]) -> Figure:
    """The curve, and both models at their best tolerance."""
    figure, grid = panels(len(cases))
    for axes, case, one in zip(grid, cases, found, strict=True):
        curve = case.fitted
        step = max(len(curve) // 200, 1)
        axes.plot(
            curve.strain[::step],
            curve.stress_MPa[::step],
            color=INK,
            linewidth=3,
            alpha=0.3,
            label="mean curve",
        )
        for colour, style, model in zip(COLOURS, ("-", "--"), MODELS, strict=False):
            axes.plot(
                curve.strain[::step],
                one["drawn"][model],
                style,
                color=colour,
                linewidth=1,
                label=model,
            )
        axes.set_title(case.material[:28])
        axes.set_xlabel("strain")
        axes.locator_params(axis="x", nbins=5)
        axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    grid[0].set_ylabel("stress [MPa]")
    legend_below(figure, grid[0], len(grid))
    return figure


if __name__ == "__main__":
    sys.exit(main())
