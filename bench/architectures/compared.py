"""Neurons and regularisation compared: a table, what was left out, and a figure.

It is of trials on the points of `bench.architectures.trials.tabulated`, all of them (a
grid) or some, as the result file keeps trials.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.architectures.trials import WAYS, WEIGHT
from softnn.neural import PUBLISHED
from softnn.study.common import COLOURS, FAINT, markdown, new_figure, percent
from softnn.study.settings import Settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Row = Mapping[str, Any]
METHODS = WAYS["regularisation"]
GRID = "grid-all"  # the published result
ENOUGH = 1.01  # an error on the plateau, over the least of its line


def method_of(row: Row) -> str | None:
    """The way of regularisation of a trial; None if it is on no grid."""
    how = row["regularisation"]
    if how == f"l2={WEIGHT!r}":
        return "l2"
    return how if how in METHODS else None


def points(trials: Sequence[Row]) -> dict[tuple[str, str, int], Row]:
    """Trials on the grid, by inputs, regularisation and neurons."""
    return {
        (t["inputs"], how, t["neurons"]): t
        for t in trials
        if t["inputs"] in PUBLISHED
        and t["lag_s"] is None
        and (how := method_of(t)) is not None
    }


def counts(trials: Sequence[Row]) -> list[int]:
    """Neuron counts on the grid."""
    return sorted({count for _, _, count in points(trials)})


def table(trials: Sequence[Row], of: Sequence[int] | None = None) -> str:
    """NRMSE by random folds; in brackets the folds judged, where not all of them."""
    found, columns = points(trials), counts(trials) if of is None else of
    rows = []
    for name in PUBLISHED:
        for how in METHODS:
            cells = [_cell(found.get((name, how, count))) for count in columns]
            if any(cells):
                rows.append([name, how, *cells])
    return markdown(["inputs", "regularisation", *map(str, columns)], rows)


def _cell(row: Row | None) -> str | None:
    if row is None:
        return None
    folds = row["stopped_after"]
    return f"{percent(row['random'])}" + (f" ({folds})" if folds is not None else "")


def left_out(trials: Sequence[Row], settings: Settings) -> str:
    """In words: how much of the full grid these trials are."""
    found = points(trials)
    number = len(settings.neurons)
    kinds = len(PUBLISHED) * len(METHODS)
    folds = [
        settings.folds if t["stopped_after"] is None else t["stopped_after"]
        for t in found.values()
    ]
    whole = sum(t["stopped_after"] is None for t in found.values())
    every = kinds * number * settings.folds
    tried = ", ".join(map(str, counts(trials)))
    return (
        f"Of the full grid ({len(PUBLISHED)} inputs, {len(METHODS)} ways, {number} "
        f"counts, {settings.folds} folds: {every} networks by random folds) "
        f"{sum(folds)} were trained: {len(found)} points at {tried} neurons, {whole} "
        f"of them on every fold, {len(found) - whole} stopped after fewer by "
        f"successive halving; {number - len(counts(trials))} counts were left out."
    )


def published(results: Path, label: str) -> list[Row] | None:
    """Trials of the published grid on a material, if it has been made."""
    file = results / f"{GRID}.json"
    if not file.exists():
        return None
    for one in json.loads(file.read_text(encoding="utf-8"))["materials"]:
        if one["label"] == label:
            return list(one["trials"])
    return None


def text(trials: Sequence[Row], settings: Settings, results: Path, label: str) -> str:
    """The table, what was left out, and the published grid at the same counts."""
    parts = [
        "NRMSE by random folds, by neurons; (n): stopped after n folds",
        table(trials),
        left_out(trials, settings),
    ]
    grid = published(results, label)
    if grid is not None:
        parts += [
            "The published grid at the same counts, every fold "
            f"(studies/results/{GRID}.json has all counts):",
            table(grid, counts(trials)),
        ]
    return "\n\n".join(parts)


# --- of a whole grid ------------------------------------------------------------------


def plateau(errors: Mapping[int, float]) -> int:
    """Return the fewest neurons whose error is above the least by 1 % at most.

    >>> plateau({1: 0.3, 2: 0.1004, 3: 0.1, 4: 0.1009}), plateau({1: 0.1, 2: 0.3})
    (2, 1)
    """
    least = min(errors.values())
    return min(n for n, e in errors.items() if e <= ENOUGH * least)


Line = Mapping[int, float]
"""Error by neurons."""


def lines(
    trials: Sequence[Row], by: str = "random"
) -> dict[tuple[str, str], dict[int, float]]:
    """Error by neurons, by inputs and regularisation; whole trials alone.

    `by` is "random" for random folds, "unseen" for rates never seen.
    """
    found: dict[tuple[str, str], dict[int, float]] = {}
    for (name, how, count), t in sorted(points(trials).items()):
        if t["stopped_after"] is None:
            found.setdefault((name, how), {})[count] = t[by]
    return found


def least(line: Line) -> str:
    """Return the least error of a line, its neurons, and the fewest as good, in words.

    >>> least({1: 0.3, 2: 0.1004, 3: 0.1})
    '10.00 % (3, 2)'
    """
    count = min(line, key=lambda n: line[n])
    return f"{percent(line[count])} ({count}, {plateau(line)})"


def middle(line: Line) -> str | None:
    """Return the median over neurons of a line."""
    return percent(float(np.median(list(line.values()))), 1)


def summary(
    materials: Sequence[Mapping[str, Any]],
    say: Callable[[Line], str | None] = least,
    by: str = "random",
) -> str:
    """Return a table with a row a line and a column a material; `say` fills a cell."""
    every = {m["material"]: lines(m["trials"], by) for m in materials}
    rows = [
        [name, how, *(say(of[name, how]) for of in every.values())]
        for name in PUBLISHED
        for how in METHODS
    ]
    return markdown(["inputs", "regularisation", *every], rows)


def draw(materials: Sequence[Mapping[str, Any]]) -> Figure:
    """Error against neurons, a row a material, a panel an input; choice ringed."""
    figure = new_figure(9.6, 1.9 * len(materials) + 0.6)
    grid = figure.subplots(len(materials), len(PUBLISHED), squeeze=False, sharey="row")
    for panels, one in zip(grid, materials, strict=True):
        every = lines(one["trials"])
        for axes, name in zip(panels, PUBLISHED, strict=True):
            for colour, how in zip(COLOURS, METHODS, strict=False):
                line = every[name, how]
                x, y = np.array(list(line)), 100 * np.array(list(line.values()))
                axes.plot(x, y, ".-", color=colour, lw=1, markersize=3, label=how)
                best, begins = int(np.argmin(y)), plateau(line)
                about = {"color": colour, "markerfacecolor": "none", "markersize": 8}
                axes.plot(x[best], y[best], "o", **about)
                axes.plot(begins, 100 * line[begins], "|", **about, markeredgewidth=2)
            axes.set_title(f"{one['material']}, {name}")
            axes.set_xticks(x[x % 5 == 0])
            axes.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
        panels[0].set_ylim(bottom=0)
        panels[0].set_ylabel("NRMSE [%]")
    for axes in grid[-1]:
        axes.set_xlabel("neurons")
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    figure.suptitle(
        "random folds; ring: least error, bar: fewest neurons within 1 % of it",
        fontsize=9,
        x=0.01,
        ha="left",
    )
    return figure
