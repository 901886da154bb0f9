"""How `studies.tendon` shows what it found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from softnn.materials import MATERIALS, table
from softnn.study import common
from softnn.study.tendon_match import Row, Tendon

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def report(body: Row) -> str:
    """The table of strips and, where it was made, what agrees with Table 7.2."""
    header = ["material", "E_small", "new area", "at 50 %", "strips", "at 50 %", "S.R."]
    rows = []
    for r in body["rows"]:
        areas, strips = r["area_new_mm2"], r["strips"]
        relaxed = r["relaxation_percent"]
        rows.append(
            [
                r["material"],
                f"{r['E_small_MPa']:.3g} MPa",
                f"{areas[0]:.0f} mm2",
                f"{areas[1]:.0f} mm2",
                strips[0],
                strips[1],
                None if relaxed is None else f"{relaxed:.0f} %",
            ]
        )
    out = [
        f"tendon: {body['tendon']['modulus_MPa']:.4g} MPa, "
        f"{body['tendon']['area_mm2']:.4g} mm2; strips {body['width_mm']:g} mm wide",
        common.markdown(header, rows),
    ]
    if "agreement" in body:
        a = body["agreement"]
        out += [
            "; ".join(
                f"{w}: {a[f'{w}_agree']} of {a[f'{w}_of']} as printed"
                for w in ("area_factor", "stiffness_factor", "area_new", "strips")
            ),
            *body["explained"],
        ]
    return "\n\n".join(out)


def draw(rows: Sequence[Row], tendon: Tendon, width_mm: float) -> Figure:
    """Strips at full and half assistance, and how much each material relaxes."""
    figure = common.new_figure(7.2, 3.0)
    left, right = figure.subplots(1, 2, width_ratios=(3, 2))
    place = np.arange(len(rows))
    for a, label in enumerate(("full", "half")):
        values = [r["strips_unrounded"][a] for r in rows]
        left.bar(
            place + 0.4 * a - 0.2, values, 0.38, color=common.COLOURS[a], label=label
        )
    known = table("7.2").rows if rows[0]["material"] in MATERIALS else ()
    for a, key in enumerate(("strips", "strips_half")):
        at = {r["material"]: r[key] for r in known}
        x = [i + 0.4 * a - 0.2 for i, r in enumerate(rows) if r["material"] in at]
        y = [at[r["material"]] for r in rows if r["material"] in at]
        if y and width_mm == 66:
            left.plot(x, y, "_", color=common.INK, label=(None, "Table 7.2")[a])
    left.set(yscale="log", ylabel=f"strips of {width_mm:g} mm", ylim=(5, None))
    left.set_xticks(place, [r["material"][:9] for r in rows])
    left.legend(title="assistance", ncols=3, fontsize=8)
    relaxing = [r for r in rows if r["relaxation_percent"] is not None]
    for i, r in enumerate(sorted(relaxing, key=lambda r: r["relaxation_percent"])):
        x, y = r["strips_unrounded"][0], r["relaxation_percent"]
        right.plot(x, y, "o", color=common.COLOURS[0])
        side = {"ha": "right" if i % 2 else "left", "textcoords": "offset points"}
        right.annotate(r["material"][:9], (x, y), (-6 if i % 2 else 6, -3), **side)
    if tendon.relaxation_percent is not None:
        right.axhline(tendon.relaxation_percent, color=common.COLOURS[1])
        right.text(
            0.98,
            tendon.relaxation_percent + 1,
            "human tendon",
            transform=right.get_yaxis_transform(),
            ha="right",
        )
    right.set(xscale="log", xlabel="strips, full assistance", ylabel="relaxed [%]")
    right.margins(x=0.25)
    return figure
