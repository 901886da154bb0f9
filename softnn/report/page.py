"""Plain values for the template of a report.

Every figure on the page is one of diagnosis.json; nothing is computed here.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from softnn.axes import Axes
from softnn.contracts import Array, Effect
from softnn.effects import effect
from softnn.models import bergstrom_boyce, hyperelastic
from softnn.report.phrases import listed, number, opened, plain

ROWS = 40  # of the table of regions

VERDICTS = {
    "explained": "Explained",
    "partly_explained": "Explained in part",
    "unexplained": "Not explained by any effect known here",
    "nothing_missing": "Nothing is missing",
    "good_enough": "Good enough",
    "undetermined": "These recordings cannot tell",
}
UNUSED = {
    "specimen": "new specimens",
    "recording": "recordings not used in the fit",
    "stretch": "parts not used in the fit",
}
BASES = {
    "hooke": "Hooke: one spring",
    "sls": "standard linear solid: a spring beside one spring and dashpot",
    "wiechert": "Wiechert: a spring beside several springs and dashpots",
    "pl-sls": "PL-SLS: a piecewise-linear spring beside one spring and dashpot",
    "pl-wiechert": "PL-Wiechert: a piecewise-linear spring beside several springs and "
    "dashpots",
    **hyperelastic.SAID,
    bergstrom_boyce.NAME: bergstrom_boyce.SAID,
}


class Found(Protocol):
    """The parts of a diagnosis that a report needs; arrays are (n,), one a recording.

    Time is in s; strain and stress in MPa are measured, simulated before and after.
    """

    @property
    def result(self) -> dict[str, Any]: ...
    @property
    def axes(self) -> Axes: ...
    @property
    def time_s(self) -> Sequence[Array]: ...
    @property
    def strain(self) -> Sequence[Array]: ...
    @property
    def measured(self) -> Sequence[Array]: ...
    @property
    def before(self) -> Sequence[Array]: ...
    @property
    def after(self) -> Sequence[Array]: ...


def meaning(name: str) -> str:
    """Return the first line of an effect's page."""
    return (inspect.getdoc(type(effect(name))) or "").split("\n", 1)[0]


def verdict(result: Mapping[str, Any]) -> str:
    """Return the verdict in a few words."""
    if result["verdict"] == "undetermined" and result["selected"]:
        return "Likely, not certain"
    return VERDICTS[result["verdict"]]


def contents(result: Mapping[str, Any], axes: Axes) -> dict[str, Any]:
    """Return the values of the template, section by section."""
    regions, advice = result["mismatch"], result["next_recording"]
    return {
        "result": result,
        "verdict": verdict(result),
        "base": BASES.get(result["model"], result["model"]),
        "recordings": result["recordings"],
        "first": _first(result),
        "axes": axes,
        "unused": UNUSED[result["fit"]["heldout_by"]],
        "corrected": _corrected(result),
        "regions": sorted(regions, key=lambda r: -r["share"])[:ROWS],
        "regions_left": max(len(regions) - ROWS, 0),
        "considered": [_considered(row, result) for row in result["candidates"]],
        "sketch": _sketch(advice),
        "explanations": [_explained(e) for e in result["explanations"]],
        "provenance": _provenance(result),
    }


def _first(result: Mapping[str, Any]) -> int:
    """Return the recording drawn first: the one with most of the mismatch."""
    names = [r["name"] for r in result["recordings"]]
    share = dict.fromkeys(names, 0.0)
    for region in result["mismatch"]:
        share[region["recording"]] += region["share"]
    return names.index(max(names, key=share.__getitem__)) if names else 0


def _corrected(result: Mapping[str, Any]) -> str:
    """Return the effects of the corrected model; "" if it is the base."""
    order = [r["effect"] for r in result["candidates"]]
    by = sorted(result["corrected_by"], key=order.index)
    return listed([plain(n) for n in by]) if by else ""


def _considered(row: Mapping[str, Any], result: Mapping[str, Any]) -> dict[str, Any]:
    """Return an effect that was tried, and why it is named or not."""
    name = row["effect"]
    return {
        **row,
        "label": "the simulation alone" if name is None else opened(plain(name)),
        "meaning": "" if name is None else meaning(name),
        "named": name in result["selected"],
    }


def _sketch(advice: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return a drawing of the programme to record, and of the stress predicted."""
    from softnn.report.picture import predicted, sketch

    drawn = advice and advice.get("programme")
    if not (advice and drawn):
        return None
    out = sketch(drawn["time_s"], drawn["strain"])
    out["predicted"] = predicted(drawn["strain"], advice["predictions"])
    return out


def _explained(told: Mapping[str, Any]) -> dict[str, Any]:
    law = effect(told["effect"], told.get("form"))
    rows = []
    for label, p in told["parameters"].items():
        low, high = p["low"], p["high"]
        if low is None or high is None or not np.isfinite([low, high]).all():
            interval = "not determined by these recordings"
        elif low == high:
            interval = "kept at its usual value"
        else:
            interval = f"{number(low)} to {number(high)}"
            if _at_limit(law, label.partition(" of ")[0], p["value"]):
                interval += ", at the limit of its range"
        rows.append(
            {
                "label": label,
                "value": p["value"],
                "interval": interval,
                "unit": p["unit"],
                "meaning": _meaning(law, label.partition(" of ")[0]),
            }
        )
    name = told["effect"]
    return {
        **told,
        "label": opened(plain(name)),
        "says": meaning(name),
        "rows": rows,
    }


def _at_limit(law: Effect, name: str, value: float) -> bool:
    """Return whether a value is an end of its range that is not simply 0 or 1."""
    ends = [e for p in law.parameters if p.name == name for e in (p.low, p.high)]
    return any(e not in (0, 1) and np.isclose(value, e, 1e-3, 0) for e in ends)


def _meaning(law: Effect, name: str) -> str:
    return next((p.meaning for p in law.parameters if p.name == name), "")


def _provenance(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = [
        ("data, SHA-256", result["data_sha256"]),
        ("base", result["model"]),
        *((key, str(value)) for key, value in result.get("provenance", {}).items()),
        *result["software"].items(),
        ("seconds", number(result.get("seconds"))),
    ]
    return rows + [
        (r["name"], r["source"]) for r in result["recordings"] if r["source"]
    ]
