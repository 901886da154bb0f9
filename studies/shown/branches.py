"""How `studies.branches` shows what it found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.models.relaxation import Method, collocation, log_spaced, non_negative
from softnn.study.common import COLOURS, FAINT, INK, markdown, percent
from softnn.study.piecewise import Case, Work, legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHODS: dict[str, Method] = {"collocation": collocation, "non-negative": non_negative}


def written(found: dict[str, Any]) -> str:
    header = ["branches"]
    for method in METHODS:
        header += [f"{method}, RMSE", "held out", "negative k"]
    rows: list[list[Any]] = []
    for row in found["by_branches"]:
        cells: list[Any] = [row["branches"]]
        for method in METHODS:
            one = row[method]
            cells += [percent(one["rmse"]), percent(one["held_out"]), one["negative"]]
        rows.append(cells)
    lines = markdown(header, rows)
    return (
        f"{lines}\n\nthree points: tau of the decaying part "
        f"{found['three_points_tau_s']:.3g} s, RMSE "
        f"{percent(found['three_points_rmse'])}; tau read literally "
        f"{found['literal_tau_s']:.3g} s, RMSE {percent(found['literal_rmse'])}"
    )


def draw(work: Work, cases: list[Case], found: list[dict[str, Any]]) -> Figure:
    """The longest hold of each material and the fits to it, over log time."""
    figure, grid = panels(len(cases))
    for axes, case, one in zip(grid, cases, found, strict=True):
        name, test, fits = one["drawn"]
        since, mean = test.mean
        time, modulus = log_spaced(since, mean, per_decade=30)
        later = time > 0
        axes.semilogx(
            time[later], modulus[later], color=INK, linewidth=4, alpha=0.25,
            label="hold",
        )  # fmt: skip
        fine = np.geomspace(time[later][0], time[-1], 300)
        for colour, style, (label, fit) in zip(
            COLOURS, ("--", "-", ":"), fits.items(), strict=False
        ):
            # The count differs from panel to panel; the legend is for all.
            axes.semilogx(
                fine,
                fit.modulus(fine),
                style,
                color=colour,
                linewidth=1.2,
                label=", ".join(label.split(", ")[:2]),
            )
        axes.set_title(f"{case.material[:20]}: {name}", fontsize=8)
        axes.set_xlabel("time [s]")
        axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    grid[0].set_ylabel("modulus [MPa]")
    legend_below(figure, grid[0], len(grid))
    return figure
