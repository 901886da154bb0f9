"""Which range of a joint serves people of these ages, and how many studies say so?

Section 3.2 of the thesis (Table 3.1, Fig. 3.3): each clinical study gives a range of
motion for a range of ages, an area; where areas of several studies overlap, the range
has their support. `--table` asks a table of your own, in the form of `table_3_1.toml`
or as CSV with the columns low, high, group_low, group_high, study; the groups may be
weights, and the ranges torques, as well.

Of the hip the thesis prints the mean range of motion and the greatest deviation from
it (section 3.2.2), no single studies. Both figures are found for the knee too, and say
what a strip that is laid out for the mean is strained by.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.materials import material
from softnn.study import common
from softnn.study.ranges import (
    Query,
    inwards,
    published,
    read_areas,
    spread,
    supported,
)
from studies.shown.gait import draw, report

SPEED_RPM = 50.0  # of the knee in walking (thesis section 7.4)
STRAIN = 0.5  # working range of a strip (Table 7.3)
LABELS = ("age [years]", "angle of the knee [degree]")
FASTEST_MM_PER_MIN = 500.0  # at which strips were pulled
HIP_DEGREES, HIP_DEVIATION = 44.63, 0.18  # walking over ground, thesis section 3.2.2


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.gait`; returns the exit code."""
    parser = common.parser("gait", __doc__)
    option = parser.add_argument
    option("--table", metavar="FILE", help="areas of your own, TOML or CSV")
    option("--group", nargs=2, type=float, default=(50.0, 70.0), metavar="AGE")
    option("--studies", type=int, default=3, help="that must support the range (3)")
    option("--length", type=float, default=33.0, help="of a strip, mm (33)")
    option("--radius", type=float, help="of the pulley, mm (strain 0.5 at the end)")
    options = parser.parse_args(argv)

    def work() -> None:
        low, high = options.group
        query = Query(low, high, options.studies)
        if not (query.low <= query.high and query.studies >= 1):
            raise InputError(f"{query} asks for nothing; --group LOW HIGH, --studies 1")
        for name in ("length", "radius"):
            value = getattr(options, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"--{name} is {value}; it must be above 0")
        own = options.table is not None
        areas = read_areas(Path(options.table)) if own else published()
        ranges = supported(areas, query)
        widest = max(ranges, key=lambda r: r[1] - r[0]) if ranges else None
        headline: dict[str, Any] = {
            "studies": query.studies,
            "group_low": query.low,
            "group_high": query.high,
            "low": widest[0] if widest else None,
            "high": widest[1] if widest else None,
        }
        body: dict[str, Any] = {
            "areas": [vars(a) for a in areas],
            "ranges": ranges,
            "by_studies": [
                {
                    "studies": n,
                    "ranges": supported(areas, Query(query.low, query.high, n)),
                }
                for n in range(1, len({a.study for a in areas}) + 1)
            ],
        }
        body["motion"] = {"areas": motion(*spread(areas), options.length)}
        if not own:
            hip = motion(HIP_DEGREES, HIP_DEVIATION, options.length)
            knee = body["motion"].pop("areas")
            body["motion"] |= {"knee": knee, "hip, published": hip}
            headline["knee_mean"] = knee["mean"]
            headline["knee_deviation"] = knee["deviation"]
        if widest:
            whole = inwards(*widest)
            headline |= {"low_whole": whole[0], "high_whole": whole[1]}
            body["strip"] = strip(widest, options.length, options.radius)
            headline |= body["strip"]
        print(report(query, body))
        place = common.results_folder(options.smoke, options.publish)
        if own:
            place = common.RUNS / ("smoke/results" if options.smoke else "results")
        name = "gait-own" if own else "gait"
        labels = ("group", "range") if own else LABELS
        path = common.write_result(name, headline, body, folder=place)
        common.save_figure(draw(areas, query, widest, labels), name, place)
        print(f"\nresult: {path}")

    return common.guarded(work)


def motion(mean: float, deviation: float, length_mm: float) -> dict[str, float]:
    """A mean range of motion, and the strip whose working range it is.

    `mean` is in degrees, `deviation` the greatest of a study from it as a fraction:
    the strip is strained by `strain_low` to `strain_high` over the studies.
    """
    return {
        "mean": mean,
        "deviation": deviation,
        "radius_mm": STRAIN * length_mm / math.radians(mean),
        "strain_low": STRAIN * (1 - deviation),
        "strain_high": STRAIN * (1 + deviation),
    }


def strip(
    angles: tuple[float, float], length_mm: float, radius_mm: float | None
) -> dict[str, float]:
    """Strain of a strip on a pulley at the joint, radius x angle / length, motor still.

    Without a radius, the one at which the whole range is the working range.
    """
    turn = math.radians(angles[1] - angles[0])
    radius = STRAIN * length_mm / turn if radius_mm is None else radius_mm
    rate = radius * SPEED_RPM * 2 * math.pi / 60 / length_mm
    return {
        "radius_mm": radius,
        "strain_range": radius * turn / length_mm,
        "rate_at_50_rpm_per_s": rate,
        "rate_over_fastest_test": rate
        / material("NatPolR").rate_per_s(FASTEST_MM_PER_MIN),
    }


if __name__ == "__main__":
    sys.exit(main())
