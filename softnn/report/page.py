"""What stands on the page of a diagnosis, as plain values for its template."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from softnn.axes import Axes
from softnn.contracts import Array, Effect
from softnn.effects import effect
from softnn.plausible import understood
from softnn.recording import Recording
from softnn.report import where
from softnn.report.phrases import listed, number, percent, plain

ROWS = 40  # of the table of regions
WORSE = 0.98  # of the base's error on recordings left out: no better than without

VERDICTS = {
    "explained": "Explained",
    "partly_explained": "Explained in part",
    "unexplained": "Not explained by any effect known here",
    "nothing_missing": "Nothing is missing",
    "undetermined": "Not certain",
}
BASES = {
    "hooke": "Hooke: one spring",
    "sls": "standard linear solid: a spring beside one spring and dashpot",
    "wiechert": "Wiechert: a spring beside several springs and dashpots",
    "pl-sls": "PL-SLS: a piecewise-linear spring beside one spring and dashpot",
    "pl-wiechert": "PL-Wiechert: a piecewise-linear spring beside several springs and "
    "dashpots",
}


class _Case(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def recordings(self) -> tuple[Recording, ...]: ...
    @property
    def notes(self) -> tuple[str, ...]: ...


class Found(Protocol):
    """What a report needs of a diagnosis; arrays are (n,), one a recording.

    Time in s, strain, stress in MPa measured and simulated before and after.
    """

    @property
    def case(self) -> _Case: ...
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
    """What an effect is, in the first line of its own page."""
    return (inspect.getdoc(type(effect(name))) or "").split("\n", 1)[0]


def contents(found: Found) -> dict[str, Any]:
    """Values of the template, section by section."""
    result, case = found.result, found.case
    first, _, rest = _sentences(result["summary"])
    return {
        "result": result,
        "verdict": VERDICTS[result["verdict"]],
        "answer": first,
        "further": rest,
        "base": BASES.get(result["model"], result["model"]),
        "recordings": [_about(r) for r in case.recordings],
        "axes": found.axes,
        "where": where.sentences(
            result["mismatch"], len(case.recordings), found.axes.strain
        ),
        "regions": sorted(result["mismatch"], key=lambda r: -r["share"])[:ROWS],
        "regions_left": max(len(result["mismatch"]) - ROWS, 0),
        "considered": _considered(result, len(case.recordings) > 1),
        "readings": _readings(result),
        "programmes": _programmes(result),
        "explanations": [_explained(e) for e in result["explanations"]],
        "warnings": _warnings(case),
        "provenance": _provenance(result, case),
    }


def _sentences(summary: str) -> tuple[str, str, str]:
    """The first sentence of a summary, and the others."""
    parts = re.split(r"(?<=[.!?])( +)(?=[A-Z])", summary, maxsplit=1)
    return (parts[0], "", "") if len(parts) == 1 else (parts[0], parts[1], parts[2])


def _about(r: Recording) -> dict[str, Any]:
    return {
        "name": r.name,
        "samples": len(r),
        "understood": understood(r),
        "specimen": r.specimen,
    }


def _considered(result: Mapping[str, Any], several: bool) -> list[dict[str, Any]]:
    """Every effect that was tried, and why it is not the answer, or that it is."""
    rows = result["candidates"]
    base = next(r["heldout_nrmse"] for r in rows if r["effect"] is None)
    best = max(rows, key=lambda r: r["evidence"])
    same = {e: x["effect"] for x in result["explanations"] for e in x["equivalent"]}
    out = []
    for row in rows:
        name, error = row["effect"], row["heldout_nrmse"]
        if name in result["selected"]:
            why = "named"
        elif name is None:
            why = (
                "enough by itself"
                if result["verdict"] == "nothing_missing"
                else f"leaves an error of {percent(error)}"
            )
        elif name in same:
            why = f"cannot be told from {plain(same[name])} here"
        elif error > WORSE * base:
            what = "recordings" if several else "what was"
            why = f"foretells {what} left out no better than the base alone"
        elif row is best or best["effect"] is None:
            why = "too little gained, or not clearly enough, for its numbers"
        else:
            why = (
                f"takes the error to {percent(error)}; {plain(best['effect'])} "
                f"takes it to {percent(best['heldout_nrmse'])}"
            )
        out.append(
            {
                **row,
                "label": "the base alone" if name is None else plain(name),
                "meaning": "" if name is None else meaning(name),
                "why": why,
            }
        )
    return out


def _readings(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Sets of effects that share the probability, and what is left over."""
    beside = result.get("probabilities", {})
    out = []
    for way in result.get("ways", []):
        names = [plain(n) for n in way["effects"]]
        if names:
            label = listed(names)
        elif beside.get("on_no_list", 0.0) > beside.get("nothing", 0.0):
            label = "something that is on no list"
        else:
            label = "nothing is missing"
        out.append({"label": label, "probability": way["probability"]})
    return out


def _programmes(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Strain programmes on which the effects to be told apart show, drawn."""
    from softnn.report.picture import sketch

    advice = result["next_recording"]
    names = advice["separates"][:2] if advice else []
    return [
        {"label": plain(name), "name": name, **sketch(effect(name).telltale())}
        for name in names
    ]


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
        rows.append(
            {
                "label": label,
                "value": p["value"],
                "interval": interval,
                "unit": p["unit"],
                "meaning": _meaning(law, label.partition(" of ")[0]),
            }
        )
    return {**told, "label": plain(told["effect"]), "says": meaning(told["effect"])} | {
        "rows": rows
    }


def _meaning(law: Effect, name: str) -> str:
    return next((p.meaning for p in law.parameters if p.name == name), "")


def _warnings(case: _Case) -> list[str]:
    """What a reader must know of the input before believing the answer."""
    out = list(case.notes)
    if len(case.recordings) == 1:
        out.append(
            "One recording: nothing can be checked on another. Errors on what was left "
            "out are of parts of it."
        )
    for r in case.recordings:
        missing = int((~np.isfinite(r.strain) | ~np.isfinite(r.stress_MPa)).sum())
        if missing:
            out.append(f"{r.name}: {missing} of {len(r)} samples miss a value.")
        read = [s for s in r.log if s.name == "read"]
        out += [f"{r.name}: {n}" for s in read for n in s.arguments.get("notes", [])]
    return out


def _provenance(result: Mapping[str, Any], case: _Case) -> list[tuple[str, str]]:
    from importlib.metadata import version
    from platform import python_version

    run = result.get("provenance", {})
    rows = [
        ("data, SHA-256", result["data_sha256"]),
        ("base", result["model"]),
        *((key, str(value)) for key, value in run.items()),
        ("Python", python_version()),
        *((name, version(name)) for name in ("numpy", "scipy")),
        ("seconds", number(result.get("seconds"))),
    ]
    return rows + [(r.name, r.source) for r in case.recordings if r.source]
