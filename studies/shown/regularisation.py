"""How `studies.regularisation` shows what it found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from softnn.search import Finished
from softnn.study.common import COLOURS, FAINT, new_figure
from softnn.study.material_data import Data
from softnn.study.settings import Settings
from softnn.study.sweep import WHAT

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(
    data: Data,
    settings: Settings,
    ways: Mapping[str, Finished],
    tried: Sequence[Finished],
) -> Figure:
    """Generalisation error against the L2 weight, the other two as lines."""
    figure = new_figure(5.2, 3.2)
    axes = figure.subplots()
    weights = np.array([t.parameters["weight"] for t in tried])
    errors = 100 * np.array([t.value for t in tried])
    order = np.argsort(weights)
    axes.loglog(weights[order], errors[order], "-", color=COLOURS[0], alpha=0.4)
    axes.loglog(weights, errors, "o", color=COLOURS[0], markersize=4, label="L2 trials")
    best = ways["l2"]
    axes.plot(
        best.parameters["weight"],
        100 * best.value,
        "o",
        markersize=11,
        markerfacecolor="none",
        markeredgecolor=COLOURS[1],
        markeredgewidth=1.8,
        label=f"best L2 weight, {best.parameters['weight']:.1e}",
    )
    for name, colour, dashes in (
        ("bayesian", COLOURS[2], "-"),
        ("early-stopping", COLOURS[3], "--"),
    ):
        axes.axhline(100 * ways[name].value, color=colour, linestyle=dashes, label=name)
    low, high = axes.get_ylim()
    ticks = [t for t in (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 100) if low <= t <= high]
    axes.set_yticks(ticks, [f"{t}" for t in ticks])
    axes.minorticks_off()
    axes.set_xlabel("L2 weight (normalised units)")
    axes.set_ylabel(f"NRMSE [%], {WHAT[settings.split]}")
    axes.grid(color=FAINT, alpha=0.25, linewidth=0.6)
    axes.set_title(
        f"{data.label}: {settings.neurons[0]} neurons, "
        f"{settings.fraction:.0%} of the samples"
    )
    axes.legend(fontsize=8)
    return figure


def _name(way: Finished) -> str:
    weight = way.parameters.get("weight")
    return way.parameters["regularisation"] + (f", {weight:.3g}" if weight else "")


def _gamma(way: Finished) -> str:
    gamma = np.array(way.result["gamma"], float)
    mean = f"{gamma.mean():.1f}" if np.isfinite(gamma).all() else "-"
    return f"{mean} of {way.result['parameters']}"


def _key(name: str) -> str:
    return name.replace("-", "_")
