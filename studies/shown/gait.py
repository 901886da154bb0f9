"""How `studies.gait` shows what it found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from softnn.study import common
from softnn.study.ranges import Area, Query, outline

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def report(query: Query, body: dict[str, Any]) -> str:
    """What is supported, by how many studies, and what it asks of a strip."""
    rows = [
        [n["studies"], "; ".join(f"{a:g} to {b:g}" for a, b in n["ranges"]) or None]
        for n in body["by_studies"]
    ]
    out = [
        f"group {query.low:g} to {query.high:g}",
        common.markdown(["studies", "range they all contain"], rows),
    ]
    if s := body.get("strip"):
        out.append(
            f"a strip on a pulley of {s['radius_mm']:.3g} mm is strained by "
            f"{s['strain_range']:.3g}, at 50 rpm by {s['rate_at_50_rpm_per_s']:.3g}/s: "
            f"{s['rate_over_fastest_test']:.3g} times the fastest tensile test"
        )
    out.append(motions(body["motion"]))
    return "\n\n".join(out)


def motions(found: Mapping[str, Mapping[str, float]]) -> str:
    """Mean ranges of motion, and the strips that are laid out for them."""
    header = ["joint", "mean range [degree]", "greatest deviation", "pulley [mm]"]
    rows = [
        [
            name,
            f"{m['mean']:.4g}",
            common.percent(m["deviation"], 0),
            f"{m['radius_mm']:.3g}",
            f"{m['strain_low']:.2f} to {m['strain_high']:.2f}",
        ]
        for name, m in found.items()
    ]
    return common.markdown([*header, "strain over the studies"], rows)


def draw(
    areas: Sequence[Area],
    query: Query,
    widest: tuple[float, float] | None,
    labels: tuple[str, str],
) -> Figure:
    """Fig. 3.3: areas over each other; a line around what three (dotted: two) share."""
    from matplotlib.patches import Rectangle

    figure = common.new_figure(7.2, 3.6)
    axes = figure.subplots()
    for i, a in enumerate(areas):
        box = ((a.group_low, a.low), a.group_high - a.group_low, a.high - a.low)
        colour = common.COLOURS[i % len(common.COLOURS)]
        label = f"{a.group_low:g}-{a.group_high:g}, study {a.study[:20]}"
        axes.add_patch(Rectangle(*box, color=colour, alpha=0.25, lw=0, label=label))
    for number, style in ((2, ":"), (3, "-")):
        for x, y in outline(areas, number):
            axes.plot(x, y, style, color=common.INK, linewidth=1.2)
    if widest:
        x = (query.low, query.high)
        text = f"{query.studies} studies, {query.low:g} to {query.high:g}: "
        text += f"{widest[0]:g} to {widest[1]:g}"
        axes.fill_between(x, *widest, hatch="//", fc="none", ec=common.INK, lw=0)
        axes.set_title(text)
    axes.autoscale_view()
    axes.margins(0.03)
    axes.set(xlabel=labels[0], ylabel=labels[1])
    figure.legend(loc="outside right upper", fontsize=8, title="group")
    return figure
