"""How `studies.rates` shows what it found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softnn.study.baselines import MODELS
from softnn.study.common import COLOURS, FAINT, percent
from softnn.study.piecewise import Case, Work, note_errors, panels, speed_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def rows_of(
    model: str, found: dict[str, Any], published: dict[str, Any] | None
) -> list[list[Any]]:
    """The rows of a model: fitted as in the thesis and beyond it, and Table 5.2."""
    thesis, joint = found["fitted_at"], found["joint"]
    rows = [
        _row(f"{model}, k* at {thesis}", found["as_in_thesis"]),
        *(
            [_row("  tau as the text says", found["as_stated"])]
            if found["as_stated"]
            else []
        ),
        _row("  any reading of the branches", found["any_reading"]),
        _row("  branches at the best share of it", found["softened"]),
    ]
    for rate, entry in found["fitted_at_each_rate"].items():
        if rate != thesis:
            rows.append(_row(f"  k* at {rate}", entry))
    if joint:
        sizes = joint["segments"], joint["branches"], "all rates fitted"
        error = percent(joint["nrmse_over_rates"])
        rows.append(["  springs and branches jointly", error, None, *sizes])
    if apart := found["each_rate_from_the_others"]:
        name, error = "  the same, each rate left out in turn", percent(apart["nrmse"])
        rows.append([name, error, None, None, None, "rate not seen"])
    if published:
        error = f"{published['generalisation_error']:.2f} %"
        at = f"{published['tolerance']} %", None, None, "Table 5.2"
        rows.append(["  thesis, its own recordings", error, *at])
    return rows


def _row(name: str, entry: dict[str, Any]) -> list[Any]:
    return [
        name,
        percent(entry["generalisation_error"]),
        percent(entry["tolerance"], 0),
        entry["segments"],
        entry["branches"],
        f"{entry['rule']}, strain {entry['held_strain']:.2f}"
        + (f", times {entry['share']:g}" if entry["share"] != 1 else ""),
    ]


def draw(work: Work, cases: list[Case], found: list[dict[str, Any]]) -> Figure:
    """Curves of all rates, and what the models fitted at one of them predict."""
    figure, grid = panels(len(cases), height=2.7)
    for axes, case, one in zip(grid, cases, found, strict=True):
        for colour, curve in zip(COLOURS, case.curves, strict=False):
            label = speed_label(case, curve)
            fitted = curve is case.fitted
            thin = slice(None, None, max(len(curve) // 200, 1))
            axes.plot(
                curve.strain[thin],
                curve.stress_MPa[thin],
                color=colour,
                linewidth=3,
                alpha=0.3,
                label=label + (" (k*)" if fitted else ""),
            )
            for style, model in zip(("-", ":"), MODELS, strict=True):
                axes.plot(
                    curve.strain[thin],
                    one["drawn"][model].fit.predict(curve)[thin],
                    style,
                    color=colour,
                    linewidth=1,
                )
        low = min(float(c.stress_MPa.min()) for c in case.curves)
        high = max(float(c.stress_MPa.max()) for c in case.curves)
        # A prediction that leaves the page is cut off; its error is in the table.
        axes.set_ylim(low - 0.3 * (high - low), high + 0.3 * (high - low))
        of = [one["models"][model] for model in MODELS]
        note_errors(
            axes,
            {
                "Table 5.2": [m["published"] for m in of],
                "found": [m["as_in_thesis"]["generalisation_error"] for m in of],
            },
        )
        axes.set_title(case.material[:28])
        axes.set_xlabel("strain")
        axes.locator_params(axis="x", nbins=5)
        axes.legend(fontsize=6)
        axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    grid[0].set_ylabel("stress [MPa]")
    figure.suptitle(
        "faint: mean curve; line: PL-SLS; dots: PL-Wiechert, k* from one rate",
        fontsize=9,
        x=0.01,
        ha="left",
    )
    return figure
