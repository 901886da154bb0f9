"""Which range of a joint serves people of these ages, and how many studies say so?

Section 3.2 of the thesis (Table 3.1, Fig. 3.3): each clinical study gives a range of
motion for a range of ages, an area; where areas of several studies overlap, the range
has their support. `--table` asks a table of your own, in the form of `table_3_1.toml`
or as CSV with the columns low, high, group_low, group_high, study; the groups may be
weights, and the ranges torques, as well.
"""

from __future__ import annotations

import csv
import io
import math
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.contracts import InputError
from softnn.materials import material, table
from softnn.readers.tidy import read_text
from softnn.study import common

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = ("low", "high", "group_low", "group_high", "study")
SPEED_RPM = 50.0  # of the knee in walking (thesis section 7.4)
STRAIN = 0.5  # working range of a strip (Table 7.3)
LABELS = ("age [years]", "angle of the knee [degree]")
FASTEST_MM_PER_MIN = 500.0  # at which strips were pulled


@dataclass(frozen=True)
class Area:
    """What one study says of one group: `low` to `high`, for the group's own range."""

    low: float
    high: float
    group_low: float
    group_high: float
    study: str


@dataclass(frozen=True)
class Query:
    """For the group from `low` to `high`: what at least `studies` of them support."""

    low: float
    high: float
    studies: int


def supported(areas: Sequence[Area], query: Query) -> list[tuple[float, float]]:
    """Ranges that, at every point of the group, that many different studies contain.

    A study counts once, however many of its groups a point lies in.

    >>> two = [Area(0, 9, 0, 50, "a"), Area(3, 12, 0, 30, "b"), Area(1, 8, 30, 50, "c")]
    >>> supported(two, Query(0, 50, 2))
    [(3, 8)]
    """
    ends = [e for a in areas for e in (a.group_low, a.group_high)]
    inside = [e for e in ends if query.low < e < query.high]
    cuts = sorted({query.low, *inside, query.high})
    middles = [(a + b) / 2 for a, b in pairwise(cuts)] or cuts
    edges = sorted({e for a in areas for e in (a.low, a.high)})
    good: list[tuple[float, float]] = []
    for low, high in pairwise(edges):
        at = (low + high) / 2
        if min(len(who(areas, age, at)) for age in middles) < query.studies:
            continue
        if good and good[-1][1] == low:
            good[-1] = (good[-1][0], high)
        else:
            good.append((low, high))
    return good


def who(areas: Sequence[Area], group: float, value: float) -> set[str]:
    """The studies whose areas contain a point."""
    return {
        a.study
        for a in areas
        if a.group_low <= group <= a.group_high and a.low <= value <= a.high
    }


def inwards(low: float, high: float) -> tuple[int, int]:
    """Whole numbers of a range, none of them outside it.

    >>> inwards(4.5, 63.5)
    (5, 63)
    """
    return math.ceil(low), math.floor(high)


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
        if widest:
            whole = inwards(*widest)
            headline |= {"low_whole": whole[0], "high_whole": whole[1]}
            body["strip"] = strip(widest, options.length, options.radius)
            headline |= body["strip"]
        print(report(query, body))
        place = common.results_folder(options.smoke)
        if own:
            place = common.RUNS / ("smoke/results" if options.smoke else "results")
        name = "gait-own" if own else "gait"
        labels = ("group", "range") if own else LABELS
        path = common.write_result(name, headline, body, folder=place)
        common.save_figure(draw(areas, query, widest, labels), name, place)
        print(f"\nresult: {path}")

    return common.guarded(work)


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


def published() -> list[Area]:
    """The areas of Table 3.1."""
    return [_area(row) for row in table("3.1").rows]


def read_areas(path: Path) -> list[Area]:
    """Areas of a file of the user's; `InputError` names the row that is none."""
    text = read_text(path)
    areas: list[Area] = []
    try:
        if path.suffix.lower() == ".toml":
            rows = list(tomllib.loads(text)["rows"])
        else:
            rows = list(csv.DictReader(io.StringIO(text)))
    except (tomllib.TOMLDecodeError, csv.Error, KeyError, TypeError) as error:
        raise InputError(f"not a table of areas: {error!r}", file=path) from None
    for i, row in enumerate(rows):
        try:
            area = _area(row) if "age_range" in row else _line(row)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"area {i + 1} is none ({error!r}); needed {', '.join(COLUMNS)}, or "
                "knee_range, age_range and study",
                file=path,
            ) from None
        numbers = (area.low, area.high, area.group_low, area.group_high)
        if not np.isfinite(numbers).all() or not (
            area.low < area.high and area.group_low <= area.group_high
        ):
            raise InputError(f"area {i + 1} has no extent: {numbers}", file=path)
        areas.append(area)
    if not areas:
        raise InputError("no areas in it", file=path)
    return areas


def _area(row: Any) -> Area:
    low, high = map(float, row["knee_range"])
    young, old = map(float, row["age_range"])
    return Area(low, high, young, old, str(row["study"]))


def _line(row: Any) -> Area:
    low, high, young, old = (float(row[c]) for c in COLUMNS[:4])
    return Area(low, high, young, old, str(row["study"]).strip())


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
    return "\n\n".join(out)


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


def outline(
    areas: Sequence[Area], number: int
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Edges, (x, x) and (y, y), around where areas of `number` studies overlap."""
    xs = sorted({e for a in areas for e in (a.group_low, a.group_high)})
    ys = sorted({e for a in areas for e in (a.low, a.high)})
    inside = np.zeros((len(xs) + 1, len(ys) + 1), bool)
    for i, (x0, x1) in enumerate(pairwise(xs)):
        for j, (y0, y1) in enumerate(pairwise(ys)):
            shared = who(areas, (x0 + x1) / 2, (y0 + y1) / 2)
            inside[i + 1, j + 1] = len(shared) >= number
    upright = np.argwhere(inside[1:] != inside[:-1])
    level = np.argwhere(inside[:, 1:] != inside[:, :-1])
    return [((xs[i], xs[i]), (ys[j - 1], ys[j])) for i, j in upright] + [
        ((xs[i - 1], xs[i]), (ys[j], ys[j])) for i, j in level
    ]


if __name__ == "__main__":
    sys.exit(main())
