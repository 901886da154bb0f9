"""How `studies.accuracy` shows what it found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softnn.study.baselines import MODELS
from softnn.study.common import COLOURS, FAINT, INK, markdown, percent
from softnn.study.piecewise import Case, Work, legend_below, note_errors, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        best = [one["best"][model] for model in MODELS]
        note_errors(
            axes,
            {
                "Table 5.1": [b.get("published", {}).get("nrmse") for b in best],
                "found": [b["nrmse"] for b in best],
            },
        )
        axes.set_title(case.material[:28])
        axes.set_xlabel("strain")
        axes.locator_params(axis="x", nbins=5)
        axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    grid[0].set_ylabel("stress [MPa]")
    legend_below(figure, grid[0], len(grid))
    return figure
