"""How `studies.inputs` shows what it found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.study.common import COLOURS, FAINT
from softnn.study.piecewise import panels
from softnn.study.settings import Settings
from softnn.study.sweep import WHAT

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(found: Sequence[dict[str, Any]], settings: Settings) -> Figure:
    """Generalisation error of each architecture, a panel a material."""
    figure, grid = panels(len(found), height=2.6)
    for axes, one in zip(grid, found, strict=True):
        trials = [t for t in one["trials"] if t["split"] == settings.split]
        names = [t["inputs"] for t in trials]
        height = [100 * t["generalisation_error"] for t in trials]
        best = int(np.argmin(height))
        axes.bar(
            names,
            height,
            width=0.6,
            color=[COLOURS[1] if i == best else COLOURS[0] for i in range(len(names))],
        )
        for i, t in enumerate(trials):
            folds = 100 * np.array(t["nrmse"])
            axes.plot(np.full(len(folds), i), folds, ".", color="#222222", markersize=3)
        axes.set_title(one["material"])
        axes.grid(axis="y", color=FAINT, alpha=0.25, linewidth=0.6)
        axes.tick_params(axis="x", labelsize=7)
    grid[0].set_ylabel(f"NRMSE [%], {WHAT[settings.split]}")
    source = "virtual specimens" if settings.data == "virtual" else settings.data
    figure.suptitle(
        f"{source}: {settings.neurons[0]} neurons, {settings.fraction:.0%} of the "
        "samples; bar: mean, dots: folds",
        fontsize=9,
        x=0.01,
        ha="left",
    )
    return figure
