"""A page for each effect: with and without it, and the effects that look alike."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from softnn.contracts import Array, Chunk, Effect
from softnn.effects import EFFECTS, effect
from softnn.fit import Data
from softnn.models.units import Units
from softnn.report.phrases import number, opened, plain
from softnn.simulate import Term, simulate
from softnn.study.common import markdown as table
from studies.site import maths
from studies.site.chart import Curve, chart

TITLE = "What effects look like"
# A soft rubber that bears compression too: stiffer with strain, two branches.
MATERIAL = Units("pl-wiechert", (-1.0, 0.0, 0.4, 1.0), (0.3, 5.0))
STIFFNESS_MPa = np.array([0.8, 0.9, 1.4, 0.5, 0.4])
WARMING_C = 20.0  # over a recording, where an effect needs it
STAGES = {
    "rig": "the rig: they change the strain of the specimen",
    "material": "the material: they change its stress",
    "sensor": "the sensor: they change the recorded stress",
}
LOOKS = ("second", "third", "fourth")


def nav() -> list[dict[str, str]]:
    """An entry of the menu for each effect, in the order in which they act."""
    return [{opened(plain(e.id)): f"gallery/{e.id}.md"} for e in EFFECTS]


def pages() -> dict[str, str]:
    """Markdown of every page, by path."""
    made = {f"gallery/{law.id}.md": _page(law) for law in EFFECTS}
    made["gallery/index.md"] = _index()
    return made


def _index() -> str:
    text = [
        f"# {TITLE}",
        "This page is for those who look at a curve and ask what it shows. Each effect "
        "is simulated with and without, on the recording that shows it best. Its page "
        "has the equation, the effects that look alike, and the recording that "
        "separates them.",
    ]
    for stage, what in STAGES.items():
        text.append(f"## Effects of {what}")
        for law in (e for e in EFFECTS if e.stage == stage):
            first = (inspect.getdoc(type(law)) or "").split("\n", 1)[0]
            text += [
                f"### [{opened(plain(law.id))}]({law.id}.md)",
                f"{first} It shows {law.where}.",
                _with_and_without(law),
            ]
    return "\n\n".join(text) + "\n"


def _page(law: Effect) -> str:
    doc = (inspect.getdoc(type(law)) or "").split("\n", 1)
    others = [t for t in law.twins if alike(law, effect(t))]
    text = [
        f"# {opened(plain(law.id))}",
        f"{doc[0]} It shows {law.where}.",
        _with_and_without(law),
        maths.markdown(doc[1].strip()),
        "## What it is mistaken for",
        _confounders(law, others),
        table(
            ["effect", "alike here", "separated by"],
            [
                [
                    f"[{plain(t)}]({t}.md)",
                    f"{100 * (alike(law, effect(t)) or 0):.0f} %",
                    apart,
                ]
                for t, apart in law.twins.items()
            ],
        )
        if law.twins
        else "No other effect on softnn's list.",
        "*Alike here*: the share of this effect's change of stress that the other "
        "effect explains on this recording, scaled to fit, before any stiffness is "
        "refitted. At 100 % this recording cannot separate them; the last column "
        "names one that can."
        if law.twins
        else "",
        "## Parameters",
        table(
            ["parameter", "unit", "least", "most", "usual", "meaning"],
            [
                [
                    plain(p.name),
                    p.unit,
                    number(p.low),
                    number(p.high),
                    number(p.default),
                    p.meaning,
                ]
                for p in law.parameters
            ],
        ),
    ]
    if law.second_forms:
        text.append("## Other forms")
        for other in law.second_forms:
            text.append(f"### {other.form}")
            text.append(maths.markdown(inspect.getdoc(type(other)) or ""))
    return "\n\n".join(t for t in text if t) + "\n"


def telltale(law: Effect) -> Chunk:
    """Its telltale recording, on which it is warm where the effect needs that."""
    chunk = law.telltale()
    warm = 23 + WARMING_C * chunk.time_s / max(float(chunk.time_s[-1]), 1e-300)
    return chunk if chunk.temperature_C is not None else replace(
        chunk, temperature_C=warm
    )  # fmt: skip


@cache
def clean(name: str) -> Array:
    """Stress (n,) [MPa] on the telltale of an effect, without it."""
    return simulate(MATERIAL, STIFFNESS_MPa, [], [telltale(effect(name))])[0]


@cache
def changed(name: str, on: str) -> Array:
    """Stress (n,) [MPa] with the effect `name` on the telltale of the effect `on`.

    The effect has the size at which a search begins.
    """
    law, chunk = effect(name), telltale(effect(on))
    scales = Data(("",), (chunk,), (clean(on),)).scales()
    values: Mapping[str, Any] = law.defaults() | law.starts(scales)[0]
    one = {k: float(np.ravel(v)[0]) for k, v in values.items()}
    return simulate(MATERIAL, STIFFNESS_MPa, [Term(law, one)], [chunk])[0]


def alike(law: Effect, other: Effect) -> float | None:
    """Return the share of the change by `law` that `other`, scaled, explains.

    Both act on the telltale of `law`. None if one of them changes nothing there.
    """
    own, its = (changed(e.id, law.id) - clean(law.id) for e in (law, other))
    if not (own @ own > 0 and its @ its > 0):
        return None
    with_it = max(float(own @ its), 0.0)
    return with_it**2 / float((own @ own) * (its @ its))


def _with_and_without(law: Effect) -> str:
    chunk, before, after = telltale(law), clean(law.id), changed(law.id, law.id)
    strain = np.asarray(chunk.strain)
    name = plain(law.id)
    curves = (("without", before, "first"), (f"with {name}", after, "second"))
    return (
        '<div class="charts">'
        + chart(
            [Curve(label, strain, y, look) for label, y, look in curves],
            "strain [-]",
            "stress [MPa]",
            f"Stress over strain, with and without {name}",
        )
        + chart(
            [Curve(label, chunk.time_s, y, look) for label, y, look in curves],
            "time [s]",
            "stress [MPa]",
            f"Stress over time, with and without {name}",
        )
        + "</div>"
    )


def _confounders(law: Effect, others: list[str]) -> str:
    """Return a chart of the change by the effect, and by up to two others, scaled."""
    if not others:
        return ""
    time, own = telltale(law).time_s, changed(law.id, law.id) - clean(law.id)
    nearest = sorted(others, key=lambda t: -(alike(law, effect(t)) or 0))[:2]
    curves = [Curve(plain(law.id), time, own, LOOKS[0])]
    for name, look in zip(nearest, LOOKS[1:], strict=False):
        its = changed(name, law.id) - clean(law.id)
        scaled = its * float(own @ its) / float(its @ its)
        curves.append(Curve(f"{plain(name)}, scaled", time, scaled, look))
    return chart(
        curves,
        "time [s]",
        "change of stress [MPa]",
        f"Change of stress by {plain(law.id)}, and by effects that look alike",
    )
