"""Ranges of a joint that clinical studies support, as areas over groups of people."""

from __future__ import annotations

import csv
import io
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.materials import table
from softnn.readers.tidy import read_text

COLUMNS = ("low", "high", "group_low", "group_high", "study")


@dataclass(frozen=True)
class Area:
    """The range of one study for one group: `low` to `high`."""

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
        if min(len(studies_of(areas, age, at)) for age in middles) < query.studies:
            continue
        if good and good[-1][1] == low:
            good[-1] = (good[-1][0], high)
        else:
            good.append((low, high))
    return good


def studies_of(areas: Sequence[Area], group: float, value: float) -> set[str]:
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


def outline(
    areas: Sequence[Area], number: int
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Edges, (x, x) and (y, y), around where areas of `number` studies overlap."""
    xs = sorted({e for a in areas for e in (a.group_low, a.group_high)})
    ys = sorted({e for a in areas for e in (a.low, a.high)})
    inside = np.zeros((len(xs) + 1, len(ys) + 1), bool)
    for i, (x0, x1) in enumerate(pairwise(xs)):
        for j, (y0, y1) in enumerate(pairwise(ys)):
            shared = studies_of(areas, (x0 + x1) / 2, (y0 + y1) / 2)
            inside[i + 1, j + 1] = len(shared) >= number
    upright = np.argwhere(inside[1:] != inside[:-1])
    level = np.argwhere(inside[:, 1:] != inside[:, :-1])
    return [((xs[i], xs[i]), (ys[j - 1], ys[j])) for i, j in upright] + [
        ((xs[i - 1], xs[i]), (ys[j], ys[j])) for i, j in level
    ]
