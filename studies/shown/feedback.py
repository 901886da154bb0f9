"""How `studies.feedback` shows what it found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from softnn.study.common import COLOURS, FAINT, INK, new_figure, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(body: Mapping[str, Any]) -> Figure:
    """A specimen by the measured and by its own stress; error over samples alone."""
    headline = body["headline"]
    figure = new_figure(8.4, 3.4)
    left, right = figure.subplots(1, 2)
    one = body["specimen"]
    left.plot(one["strain"], one["measured_MPa"], color=INK, lw=3, label="measured")
    left.plot(
        one["strain"],
        one["one_ahead_MPa"],
        color=COLOURS[2],
        lw=1.2,
        label="fed the measured stress",
    )
    left.plot(
        one["strain"], one["alone_MPa"], color=COLOURS[1], label="fed its own stress"
    )
    left.set(xlabel="strain", ylabel="stress [MPa]")
    left.set_title(f"the worst of {one['of']} specimens, {one['name']}")
    top = max(one["measured_MPa"])
    left.set_ylim(max(left.get_ylim()[0], -top), min(left.get_ylim()[1], 2 * top))
    left.legend(fontsize=8)
    steps = [r["samples"] for r in body["ahead"]]
    right.loglog(
        steps,
        [100 * r["nrmse"] for r in body["ahead"]],
        "o-",
        color=COLOURS[0],
        label="after so many samples on its own",
    )
    lines = {
        "nrmse_alone": ("from the start, on its own", COLOURS[1]),
        "nrmse_without_feedback": ("a network without feedback", COLOURS[3]),
        "nrmse_repeated": ("the stress of a sample ago, repeated", FAINT),
    }
    for key, (label, colour) in lines.items():
        right.axhline(100 * headline[key], color=colour, ls="--", lw=1, label=label)
    right.set(xlabel="samples since the last measured stress", ylabel="NRMSE [%]")
    right.set_title(f"measured stress fed back: {percent(headline['nrmse_measured'])}")
    right.set_ylim(top=20 * right.get_ylim()[1])  # room for the legend
    right.legend(fontsize=7, loc="upper left")
    figure.suptitle(body["label"], fontsize=9, x=0.01, ha="left")
    return figure
