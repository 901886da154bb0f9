"""A component's diagnosis in its own units: counted on the way in, told on the way out.

Effects and bases know strain and MPa. A case of a component is diagnosed in round
numbers of its units (`softnn.axes`), which a model file keeps, and every figure that
comes out is turned back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softnn.axes import Axes, common
from softnn.contracts import Array
from softnn.effects import effect
from softnn.mismatch.case import Case
from softnn.recording import Recording


def counted(case: Case) -> tuple[Case, Axes]:
    """The case as strain and MPa, and the axes that say what these are."""
    axes = common({r.name: r.axes for r in case.recordings})
    if not axes.component:
        return case, axes

    def largest(channel: str) -> float:
        return max(
            float(np.nanmax(np.abs(getattr(r, channel)))) for r in case.recordings
        )

    axes = axes.counted(largest("strain"), largest("stress_MPa"))
    return on(case, axes), axes


def on(case: Case, axes: Axes) -> Case:
    """The case with its channels counted on these axes."""

    def scaled(recording: Recording) -> Recording:
        return replace(
            recording,
            strain=recording.strain / axes.strain.one,
            stress_MPa=recording.stress_MPa / axes.stress.one,
        )

    simulated = case.simulated_MPa
    return replace(
        case,
        recordings=tuple(scaled(r) for r in case.recordings),
        simulated_MPa=None
        if simulated is None
        else tuple(s / axes.stress.one for s in simulated),
    )


def tell(result: dict[str, Any], axes: Axes) -> None:
    """Turn the figures of a diagnosis.json into own units, in place.

    Keys that name a unit name the right one then: `torque_Nm`, not `stress_MPa`.
    """
    result["axes"] = {a: [b.name, b.unit] for a, b in _pair(axes)}
    if not axes.component:
        return
    x, y = axes.strain, axes.stress
    noise = result["noise"]
    for key in ("sigma", "step"):
        noise[f"{key}_{y.unit}"] = noise.pop(f"{key}_MPa") * y.one
    for region in result["mismatch"]:
        region[x.column] = [v * x.one for v in region.pop("strain")]
        rate = [v * x.one for v in region.pop("rate_per_s")]
        region[axes.rate_key] = rate
    for told in result["explanations"]:
        law = effect(told["effect"], told["form"])
        declared = {p.name: p for p in law.parameters}
        for name, numbers in told["parameters"].items():
            size, numbers["unit"] = axes.of(declared[name.split(" of ")[0]])
            for key in ("value", "low", "high"):
                numbers[key] *= size
    period = (result["structure"] or {}).get("period")
    if period and period["axis"] == "strain":
        period |= {"axis": x.name, "period": period["period"] * x.one, "unit": x.unit}


def labelled(model: Mapping[str, Any], axes: Axes) -> dict[str, Any]:
    """A model file that says what its strain and MPa are."""
    if not axes.component:
        return dict(model)
    effects = []
    for entry in model["effects"]:
        law = effect(entry["effect"], entry["form"])
        units = {}
        for p in law.parameters:
            size, unit = axes.of(p)
            units[p.name] = unit if size == 1 else f"{size:g} {unit}"
        effects.append({**entry, "units": units})
    return {**model, "effects": effects, "axes": axes.to_dict()}


def back(arrays: list[Array], one: float) -> list[Array]:
    """Arrays in own units."""
    return arrays if one == 1 else [a * one for a in arrays]


def _pair(axes: Axes) -> tuple[tuple[str, Any], ...]:
    return ("strain", axes.strain), ("stress", axes.stress)
