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
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.materials import MATERIALS, table
from softnn.recording import data_hash
from softnn.study import common
from softnn.study.property_sets import read
from softnn.study.tendon_match import (
    Tendon,
    beside,
    chosen,
    found,
    own_sheets,
    published_sheet,
    tendon_area,
)
from studies.shown.tendon import draw, report


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
        place = common.results_folder(options.smoke, options.publish)
        name = "tendon" if options.data is None else "tendon-own"
        if options.data is not None:
            place = common.RUNS / ("smoke/results" if options.smoke else "results")
        path = common.write_result(
            name, headline, body, seed=options.seed, data=hashes, folder=place
        )
        common.save_figure(draw(rows, tendon, width), name, place)
        print(f"\nresult: {path}")

    return common.guarded(work)


if __name__ == "__main__":
    sys.exit(main())
