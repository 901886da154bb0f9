"""How many strips of a material are as stiff as a human tendon?

Section 7.2 of the thesis (Tables 7.1, 7.2): the cross-section of each material whose
modulus times area is that of the tendon, E A = E_t A_t, cut into strips of one width,
at full and at half assistance. The area of the tendon is not printed; it is read off
the printed cross-sections, each of which bounds it by its rounding. `--data` does the
same for recordings of your own, with E_small from `softnn.properties`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.contracts import InputError
from softnn.materials import MATERIALS, table
from softnn.recording import data_hash
from softnn.study import common
from softnn.study.property_sets import read
from softnn.study.tendon_match import (
    Row,
    Tendon,
    beside,
    chosen,
    found,
    own_sheets,
    published_sheet,
    tendon_area,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.tendon`; returns the exit code."""
    parser = common.parser("tendon", __doc__)
    human = table("7.1").row(material="Human tendon")
    option = parser.add_argument
    option("--modulus", type=float, default=human["E_small"], help="of the tendon, MPa")
    option("--area", type=float, help="of the tendon, mm2 (read off Table 7.2)")
    option("--width", type=float, help="of a strip, mm (66, as in the thesis)")
    option("--thickness", type=float, help="of a strip of --data, mm")
    option(
        "--data",
        metavar="SOURCE",
        help="a set in SOFTNN_DATA, a folder or a tidy CSV of tensile tests",
    )
    options = parser.parse_args(argv)

    def work() -> None:
        for name in ("modulus", "area", "width", "thickness"):
            value = getattr(options, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"--{name} is {value}; it must be above 0")
        low, high = tendon_area(human["E_small"])
        tendon = Tendon(
            options.modulus,
            (low + high) / 2 if options.area is None else options.area,
            human["relaxation"],
        )
        width = options.width or table("7.2").rows[0]["strip_width"]
        hashes: dict[str, str] = {}
        if options.data is None:
            sheets = [published_sheet(name) for name in MATERIALS]
        else:
            recordings, _ = read(options.data)
            hashes[options.data] = data_hash(recordings)
            sheets = own_sheets(recordings, options.thickness)
        rows = [found(tendon, sheet, width) for sheet in sheets]
        body: dict[str, Any] = {"tendon": vars(tendon), "width_mm": width, "rows": rows}
        headline: dict[str, Any] = {"tendon_area_mm2": tendon.area_mm2}
        as_printed = options.data is None and options.area is None
        if as_printed and (tendon.modulus_MPa, width) == (human["E_small"], 66):
            body |= {"tendon_area_mm2": [low, high]} | beside(tendon, sheets, width)
            headline |= body["agreement"]
        headline |= chosen(rows, tendon)
        print(report(body))
        place = common.results_folder(options.smoke)
        name = "tendon" if options.data is None else "tendon-own"
        if options.data is not None:
            place = common.RUNS / ("smoke/results" if options.smoke else "results")
        path = common.write_result(
            name, headline, body, seed=options.seed, data=hashes, folder=place
        )
        common.save_figure(draw(rows, tendon, width), name, place)
        print(f"\nresult: {path}")

    return common.guarded(work)


# --- shown ----------------------------------------------------------------------------


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


if __name__ == "__main__":
    sys.exit(main())
