"""Results of the study of architectures as text, as a table and as a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.architectures.choices import (
    USES,
    described,
    folds_of,
    paired,
    rival_of,
    standard_error,
)
from softnn.study.common import COLOURS, FAINT, INK, markdown, new_figure, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WORDS = {"rate": "by unseen rate", "recording": "by unseen recording"}
SHAPES = "osD^vP*hp"
BESIDE = {"PL-SLS": "X", "PL-Wiechert": "P", "gradient": "s"}
FACES = {"as in the thesis": "white", "any reading of the holds": "#bbbbbb"}
WORST = 2.0  # NRMSE beyond which nothing is drawn


def answers(one: Mapping[str, Any]) -> list[str]:
    """What to take for each use, a line each, from a material of the result file.

    Errors are of folds drawn anew, with one standard error over folds.
    """
    return [_of_use(use, one) for use in USES]


def _of_use(use: str, one: Mapping[str, Any]) -> str:
    chosen, mine = one["choices"][use], folds_of(one["choices"][use]["anew"], use)
    means = {
        "random": "For recordings you have",
        "unseen": f"For a {one['unseen']} never seen",
    }[use]
    judged = "by random folds" if use == "random" else WORDS[one["unseen"]]
    error = _pm(float(mine.mean()), standard_error(mine))
    text = [f"**{means}**: {chosen['words']}. NRMSE {error} {judged}."]
    ties, best = chosen.get("ties", 1), chosen.get("best")
    if ties > 1 and best is not None and described(best) == chosen["words"]:
        others = "1 other ties" if ties == 2 else f"{ties - 1} others tie"
        text.append(f"It is the best network of the search; {others} with it.")
    elif ties > 1 and best is not None:
        text.append(
            f"It has the fewest weights of {ties} that tie with the best "
            f"({described(best)})."
        )
    rival = rival_of(one["baselines"], use)
    if rival is None:
        return " ".join(text)
    error = percent(float(np.mean(rival[use])), 1) or "-"
    text.append(f"Best other model: {rival['model']}, {error}.")
    if use == "unseen":  # folds drawn anew are other ones where they are random
        gap, within = paired(mine, np.array(rival[use]))
        if abs(gap) <= within:
            text.append(f"The two tie (difference {_pm(gap, within)}).")
        else:
            verdict = "better" if gap < 0 else "worse"
            text.append(
                f"The network is {verdict} by {_pm(abs(gap), within)} of the stress."
            )
    return " ".join(text)


def _pm(mean: float, error: float, digits: int = 1) -> str:
    both = (f"{100 * value:.{digits}f}" for value in (mean, error))
    return " \N{PLUS-MINUS SIGN} ".join(both) + " %"


def table(
    front: Sequence[Mapping[str, Any]],
    beside: Sequence[Mapping[str, Any]],
    unseen: str = "unseen",
) -> str:
    """The front, as the result file keeps it, and what stands beside, as Markdown."""
    rows = [[described(t), *(percent(t[use]) for use in USES)] for t in front]
    for model in beside:
        rows.append([model["model"], *(_mean(model[use]) for use in USES)])
    return markdown(["model", "random folds", unseen], rows)


def _mean(errors: Sequence[float] | str) -> str | None:
    return None if isinstance(errors, str) else percent(float(np.mean(errors)))


# --- figure ---------------------------------------------------------------------------


def draw(found: Sequence[Mapping[str, Any]]) -> Figure:
    """Both errors of every trial, the front as a line, a panel a material."""
    columns = min(len(found), 3)
    rows = -(-len(found) // columns)
    figure = new_figure(max(5.6, 3.4 * columns), 3.3 * rows + 1.2)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(found) :]:
        axes.set_visible(False)
    for axes, one in zip(panels, found, strict=False):
        _panel(axes, one)
    handles: dict[str, Any] = {}
    for axes in panels[: len(found)]:
        handles |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower center",
        ncols=3 if columns < 3 else 5,
        fontsize=7,
    )
    return figure


def _panel(axes: Axes, one: Mapping[str, Any]) -> None:
    from matplotlib.ticker import LogLocator

    colours = [*COLOURS, INK, FAINT, "#8b5a2b"]
    names = dict.fromkeys(t["inputs"] for t in one["trials"])
    for i, name in enumerate(names):
        mine = [t for t in one["trials"] if t["inputs"] == name]
        whole = [t for t in mine if t["stopped_after"] is None]
        rest = [t for t in mine if t["stopped_after"] is not None]
        about: dict[str, Any] = {
            "color": colours[i],
            "marker": SHAPES[i],
            "linestyle": "none",
        }
        axes.plot(*_points(rest), markersize=2.5, alpha=0.3, zorder=1, **about)
        axes.plot(*_points(whole), markersize=4.5, label=name, zorder=3, **about)
    line = np.array([_point(t) for t in one["front"]])
    axes.plot(*line.T, "-", color=INK, linewidth=1, label="front", zorder=2)
    for model in one["baselines"]:
        values = [model[use] for use in USES]
        if any(isinstance(v, str) for v in values):
            continue
        kind = next(k for k in BESIDE if model["model"].startswith(k))
        way = model["model"].partition(", ")[2]
        axes.plot(
            *(100 * float(np.mean(v)) for v in values),
            BESIDE[kind],
            markersize=8,
            markerfacecolor=FACES.get(way, "#ffe14d"),
            markeredgecolor=INK,
            label=model["model"],
            linestyle="none",
            zorder=4,
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    axes.set_title(fill(one["label"], 42), fontsize=8)
    axes.set_xlabel("NRMSE by random folds [%]")
    axes.set_ylabel(f"NRMSE {WORDS[one['unseen']]} [%]")
    axes.grid(color=FAINT, alpha=0.25, linewidth=0.6, which="both")


def _point(trial: Mapping[str, Any]) -> tuple[float, float]:
    return 100 * trial["random"], 100 * trial["unseen"]


def _points(trials: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
    shown = [_point(t) for t in trials if max(t["random"], t["unseen"]) < WORST]
    return [x for x, _ in shown], [y for _, y in shown]
