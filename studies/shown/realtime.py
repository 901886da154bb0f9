"""How `studies.realtime` shows what it found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.study import common
from softnn.study.realtime_inputs import SCENARIOS, SECONDS, STEP_S, Row, readings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Drawn = dict[tuple[str, str, str], Any]  # by scenario, place and what was fed


NOTHING = (None, None, None)
SEEN = (  # by the thesis, of one network, without values
    ("thesis, Fig. 7.2: derivative", "negative", "never", "both signs", "always")
    + NOTHING,
    ("thesis, Fig. 7.3: 250 mm/min", "stable", "stable", None, "stable") + NOTHING,
)


def one(rows: Sequence[Row], scenario: str, place: str, fed: str) -> Row:
    """The one row of FFRD4 with these."""
    wanted = {"inputs": "FFRD4", "scenario": scenario, "place": place, "fed": fed}
    return next(r for r in rows if wanted.items() <= r.items())


def verdict(rows: Sequence[Row], number: int) -> list[Row]:
    """Five statements of section 7.3, for each reading: how many networks agree."""
    out = []
    for fed in readings(1.0):
        a, b, d = (one(rows, s, "from zero", fed) for s in "abd")
        below = one(rows, "c", "below zero", fed)
        out.append(
            {
                "fed": fed,
                "a_negative_in": a["networks_negative"],
                "b_negative_in": b["networks_negative"],
                "c_negative_share": below["negative"],
                "d_negative_in": d["networks_negative"],
                "nrmse_a": a["nrmse"],
                "nrmse_b": b["nrmse"],
                "nrmse_d": d["nrmse"],
                "networks": number,
            }
        )
    return out


def headline_of(rows: Sequence[Row], neurons: int, number: int) -> Row:
    """The plain reading, the derivative of a sine from zero, beside a constant rate."""
    out: Row = {"neurons": neurons, "networks": number}
    for key, fed in (("varying", "derivative"), ("constant", "constant 250 mm/min")):
        for s in "abd":
            row = one(rows, s, "from zero", fed)
            out[f"{key}_{s}_networks_negative"] = row["networks_negative"]
            out[f"{key}_{s}_negative_share"] = row["negative"]
            out[f"{key}_{s}_nrmse"] = row["nrmse"]
        out[f"{key}_c_negative_share"] = one(rows, "c", "below zero", fed)["negative"]
    plain = [one(rows, s, "from zero", "derivative") for s in "ab"]
    for what in ("negative_flagged", "negative_unloading"):
        shares = [r[what] for r in plain if r[what] is not None]
        out[f"varying_{what}"] = min(shares) if shares else None
    for kind in ("FFRI1", "FFRI2", "FFRI3"):
        for lag in ("controller's sample", "slowest test's sample"):
            some = [r for r in rows if r["inputs"] == kind and r["fed"] == lag]
            some = [
                r for r in some if r["scenario"] in "ab" and r["place"] == "from zero"
            ]
            key = f"{kind}_lag_of_{lag.split(chr(39))[0].replace(' ', '_')}_nrmse"
            out[key] = float(np.mean([r["nrmse"] for r in some]))
    return out


def report(body: Row) -> str:
    """The verdict as a table, below what the thesis saw; shares of time in per cent."""
    header = ["fed as the rate", "a: negative in", "b: in", "d: in", "c: of the time"]
    header += ["NRMSE a", "b", "d"]
    found = [
        [
            v["fed"],
            *(f"{v[f'{s}_negative_in']} of {v['networks']}" for s in "abd"),
            common.percent(v["c_negative_share"], 0),
            *(common.percent(v[f"nrmse_{s}"], 0) for s in "abd"),
        ]
        for v in body["verdict"]
    ]
    return common.markdown(header, [*SEEN, *found])


def draw(drawn: Drawn) -> Figure:
    """Figs 7.2 and 7.3: all networks, the law, with the sine's rate and a constant."""
    figure = common.new_figure(7.2, 4.2)
    grid = figure.subplots(2, 4, sharex=True)
    t = np.arange(0, SECONDS, STEP_S)
    for line, fed in zip(grid, ("derivative", "constant 250 mm/min"), strict=True):
        for axes, name in zip(line, SCENARIOS, strict=True):
            where = "below zero" if name == "c" else "from zero"
            _, _, out, true = drawn[name, where, fed]
            colour = common.COLOURS[1 if fed == "derivative" else 0]
            for stress in out:
                axes.plot(t, stress, color=colour, linewidth=0.6, alpha=0.6)
            axes.plot(t, true, color=common.INK, linewidth=1.2)
            axes.axhline(0, color=common.FAINT, linewidth=0.6)
            axes.set_title(f"({name}) {SCENARIOS[name]:g} mm/min")
        line[0].set_ylabel("stress [MPa]")
        line[-1].text(
            1.02, 0.5, fed, transform=line[-1].transAxes, rotation=-90, va="center"
        )
    for axes in grid[1]:
        axes.set_xlabel("time [s]")
    figure.suptitle("networks (thin), law of the specimens (black)", fontsize=9)
    return figure
