"""Regions of a mismatch in words: the branch, its cycles, its strains, its share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from softnn.axes import Axis
from softnn.report.phrases import listed, opened

LEAST = 0.01  # of the mismatch, below which a region is not put into words
MOST = 6  # sentences


def sentences(
    regions: Sequence[Mapping[str, Any]], recordings: int, axis: Axis
) -> list[str]:
    """Return sentences on regions, alike in branch and sign, the heaviest first.

    >>> one = {"branch": "unloading", "sign": "simulation too stiff", "recording": "a"}
    >>> sentences([one | {"cycle": c, "strain": [0.1, 0.5], "share": 0.2}
    ...            for c in (2, 3, 5)], 1, Axis("strain", "-"))
    ['Unloading of cycles 2-3 and 5, strain 0.1 to 0.5: 60 % (simulation too stiff).']
    """
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for region in regions:
        groups.setdefault((region["branch"], region["sign"]), []).append(region)
    several = any(r["cycle"] > 1 for r in regions)
    said = []
    for (branch, sign), own in groups.items():
        share = sum(r["share"] for r in own)
        if share < LEAST:
            continue
        most = max(r["share"] for r in own)
        heavy = [r for r in own if r["share"] >= LEAST * most]
        low = min(r[axis.column][0] for r in heavy)
        high = max(r[axis.column][1] for r in heavy)
        names = {r["recording"] for r in heavy}
        place = opened(branch)
        if several and branch != "first loading":
            place += f" of {numbers({r['cycle'] for r in heavy})}"
        if recordings > 1 and len(names) < recordings:
            place += f" in {_some(sorted(names))}"
        span = f"{axis.name} {low:.2g} to {high:.2g}"
        span += "" if axis.unit == "-" else f" {axis.unit}"
        text = f"{place}, {span}: {100 * share:.0f} % ({sign})."
        said.append((share, text))
    return [text for _, text in sorted(said, reverse=True)[:MOST]]


def numbers(cycles: set[int]) -> str:
    """Cycles in a row.

    >>> numbers({1, 2, 3, 7})
    'cycles 1-3 and 7'
    >>> numbers({4})
    'cycle 4'
    """
    ordered = sorted(cycles)
    runs = []
    for _, group in groupby(enumerate(ordered), lambda item: item[1] - item[0]):
        run = [c for _, c in group]
        runs.append(f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}")
    return f"{'cycle' if len(ordered) == 1 else 'cycles'} {listed(runs)}"


def _some(names: Sequence[str], most: int = 3) -> str:
    if len(names) > most:
        return f"{len(names)} recordings"
    return ", ".join(names)
