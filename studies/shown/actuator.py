"""How `studies.actuator` shows what it found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from softnn.actuator import Walk
from softnn.contracts import Array
from softnn.study import common
from softnn.study.strips import Row, TORQUE_Nm

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def report(rows: Sequence[Row], checks: Row, steps: Row, fast: float) -> str:
    """Errors by model, Table 7.3 against itself, and what a step costs."""
    table = common.markdown(
        ["model of the strips", "rms error", "largest", "of it the estimate's"],
        [
            [
                r["model"],
                common.percent(r["rms_error"]),
                common.percent(r["largest_error"], 1),
                common.percent(r["rms_of_estimate"]),
            ]
            for r in rows
        ],
    )
    areas = ", ".join(
        f"{checks[f'area_{k}_mm2']:.0f} mm2 ({k.replace('_', ' ')}): pulley of "
        f"{checks[f'radius_{k}_mm']:.3g} mm, {checks[f'turn_{k}_degree']:.3g} degrees"
        for k in ("printed", "20_mm", "66_mm")
    )
    return "\n\n".join(
        [
            table,
            f"15 Nm through 1/81 takes {checks['current_A']:.3g} A and "
            f"{checks['heat_W']:.3g} W; at 24 V the knee then turns with "
            f"{checks['speed_rpm']:.3g} rpm at most, of 50 wanted",
            f"eight strips at strain 0.5: {areas}",
            f"C step: corrected model {steps['corrected']['mean']:.0f} ns, network "
            f"{steps['network']['mean']:.0f} ns; a loop: {fast:.0f} times real time",
        ]
    )


def draw(walks: dict[str, Walk], goal: Array) -> Figure:
    """Torque at the knee by what the controller takes the strips for; its error."""
    figure = common.new_figure(7.2, 4.0)
    top, bottom = figure.subplots(2, 1, sharex=True)
    last = min(len(goal), 3000)
    for i, (name, found) in enumerate(walks.items()):
        colour = common.COLOURS[i % len(common.COLOURS)]
        style: Any = {"linewidth": 1, "color": colour}
        style["linestyle"] = "-" if i < len(common.COLOURS) else ":"
        t = found.time_s[:last]
        top.plot(t, found.torque_Nm[:last], **style)
        off = 100 * (found.torque_Nm - goal)[:last] / TORQUE_Nm
        bottom.plot(t, off, label=name, **style)
    top.plot(t, goal[:last], "--", color=common.INK, linewidth=1)
    top.set(ylabel="torque [Nm]", title="wanted (dashed) and what the strips give")
    bottom.set(xlabel="time [s]", ylabel="error [% of 15 Nm]")
    figure.legend(loc="outside right upper", fontsize=8, title="taken for")
    return figure
