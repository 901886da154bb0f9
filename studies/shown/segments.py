"""How `studies.segments` shows what it found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softnn.study.baselines import MODELS
from softnn.study.common import COLOURS, FAINT, markdown, percent
from softnn.study.piecewise import Case, Work, legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def written(models: dict[str, Any]) -> str:
    """Tolerance against segments and NRMSE, and the counts beside it."""
    header = ["tolerance"]
    header += [f"{m}, {what}" for m in MODELS for what in ("segments", "NRMSE")]
    columns = [models[m]["by_tolerance"] for m in MODELS]
    rows = []
    for group in zip(*columns, strict=True):
        row = [percent(group[0]["tolerance"], 0)]
        for entry in group:
            row += [entry["segments"], percent(entry["nrmse"])]
        rows.append(row)
    first = markdown(header, rows)
    header = ["segments"]
    header += [f"{m}, {kind}" for m in MODELS for kind in ("optimal", "equal")]
    rows = []
    for group in zip(*(models[m]["by_count"] for m in MODELS), strict=False):
        row = [group[0]["segments"]]
        for entry in group:
            row += [percent(entry["optimal"]), percent(entry["equal"])]
        rows.append(row)
    return f"{first}\n\n{markdown(header, rows)}"


def draw(work: Work, cases: list[Case], found: list[dict[str, Any]]) -> Figure:
    """NRMSE against segments: the criterion at every tolerance, the optimum beside."""
    figure, grid = panels(len(cases))
    for axes, case, one in zip(grid, cases, found, strict=True):
        for colour, model in zip(COLOURS, MODELS, strict=False):
            rows = one["models"][model]["by_tolerance"]
            axes.loglog(
                [r["segments"] for r in rows],
                [100 * r["nrmse"] for r in rows],
                "o" if model == "PL-SLS" else "s",
                color=colour,
                markersize=4,
                label=f"{model}, tolerance 10-100 %",
            )
            counts = one["models"][model]["by_count"]
            axes.loglog(
                [r["segments"] for r in counts],
                [100 * r["optimal"] for r in counts],
                "-",
                color=colour,
                linewidth=1,
                label=f"{model}, optimal cuts",
            )
            row = case.published("5.1", model)
            if row:
                axes.plot(
                    row["segments"],
                    row["nrmse"],
                    "*",
                    color=colour,
                    markersize=9,
                    markeredgecolor="#222222",
                    label=f"{model}, Table 5.1",
                )
        axes.set_title(case.material[:28])
        axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
        axes.set_xlabel("strain segments")
        low = min(
            100 * r["nrmse"] for m in MODELS for r in one["models"][m]["by_tolerance"]
        )
        axes.set_ylim(bottom=max(low / 2, 5e-3))
    grid[0].set_ylabel("NRMSE [%]")
    legend_below(figure, grid[0], len(grid))
    return figure
