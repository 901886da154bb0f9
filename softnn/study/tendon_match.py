"""What `studies.tendon` computes: the section of a material that matches a tendon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softnn import prepare, properties
from softnn.contracts import InputError
from softnn.materials import MATERIALS, material, table
from softnn.recording import Recording
from softnn.study.property_sets import kind_of

ASSISTANCE = (1.0, 0.5)
COLUMNS = {  # of Table 7.2, by what it is called here
    "area_factor": ("area_factor",),
    "stiffness_factor": ("stiffness_factor", "stiffness_factor_half"),
    "area_new_mm2": ("area_new", "area_new_half"),
    "strips": ("strips", "strips_half"),
}
Row = dict[str, Any]


@dataclass(frozen=True)
class Tendon:
    """A tendon to be matched: modulus [MPa], area [mm2], relaxed share in per cent."""

    modulus_MPa: float
    area_mm2: float
    relaxation_percent: float | None = None


@dataclass(frozen=True)
class Sheet:
    """A material as it comes: modulus [MPa], thickness [mm], area of a specimen."""

    name: str
    modulus_MPa: float
    thickness_mm: float
    area_mm2: float
    relaxation_percent: float | None = None


def match(
    tendon: Tendon,
    sheet: Sheet,
    width_mm: float,
    assistance: float = 1.0,
    area_factor: float | None = None,
) -> Row:
    """Factors, area [mm2] and strips, none of them rounded.

    `area_factor` is how many areas of a specimen stand for that of the tendon; the
    rest of the area is the factor of stiffness. Same length as the tendon assumed.

    >>> one = match(Tendon(300.0, 50.0), Sheet("x", 10.0, 1.5, 9.0), 66.0, 0.5)
    >>> one["area_new_mm2"], round(one["strips"], 3), round(one["area_factor"], 3)
    (750.0, 7.576, 5.556)
    """
    area = assistance * tendon.modulus_MPa * tendon.area_mm2 / sheet.modulus_MPa
    factor = tendon.area_mm2 / sheet.area_mm2 if area_factor is None else area_factor
    return {
        "area_factor": factor,
        "stiffness_factor": area / (factor * sheet.area_mm2),
        "area_new_mm2": area,
        "strips": area / (width_mm * sheet.thickness_mm),
    }


# --- materials ------------------------------------------------------------------------


def published_sheet(name: str) -> Sheet:
    """A material of the thesis: Table 7.1, area of Table 7.2, width of a specimen."""
    row, area = table("7.1").row(material=name), table("7.2").row(material=name)
    return Sheet(
        name,
        row["E_small"],
        area["area_old"] / material(name).width_mm,
        area["area_old"],
        row["relaxation"],
    )


def own_sheets(
    recordings: Sequence[Recording], thickness_mm: float | None
) -> list[Sheet]:
    """Median E_small of each material at its slowest rate, and how much it relaxes."""
    groups: dict[str, list[Recording]] = {}
    for r in recordings:
        groups.setdefault(r.material or r.name, []).append(r)
    sheets = []
    for name, group in groups.items():
        pulled = [r for r in group if (r.test or kind_of(r)) == "tensile"]
        if not pulled:
            continue
        slowest = min(r.rate_per_s or np.inf for r in pulled)
        slow = [r for r in pulled if (r.rate_per_s or np.inf) == slowest]
        moduli = [properties.elastic(prepare.specimen(r)).E_small_MPa for r in slow]
        thick = thickness_mm or slow[0].geometry.thickness_mm
        if not thick:
            raise InputError(f"{name}: no thickness in its recordings; --thickness")
        held = [r for r in group if (r.test or kind_of(r)) == "relaxation"]
        relaxed = [properties.relaxation(r).relaxed_percent for r in held]
        area = slow[0].geometry.area_mm2 or thick
        sheets.append(
            Sheet(
                name,
                float(np.median(moduli)),
                thick,
                area,
                float(np.median(relaxed)) if relaxed else None,
            )
        )
    if not sheets:
        raise InputError("no tensile recording in it; a modulus needs one")
    return sheets


def found(tendon: Tendon, sheet: Sheet, width_mm: float) -> Row:
    """One material: what matches the tendon at full and at half assistance."""
    each = [match(tendon, sheet, width_mm, a) for a in ASSISTANCE]
    return {
        "material": sheet.name,
        "E_small_MPa": sheet.modulus_MPa,
        "area_old_mm2": sheet.area_mm2,
        "thickness_mm": sheet.thickness_mm,
        "relaxation_percent": sheet.relaxation_percent,
        "area_factor": each[0]["area_factor"],
        "stiffness_factor": [e["stiffness_factor"] for e in each],
        "area_new_mm2": [e["area_new_mm2"] for e in each],
        "strips": [round(e["strips"]) for e in each],
        "strips_unrounded": [e["strips"] for e in each],
    }


# --- beside the published table -------------------------------------------------------


def tendon_area(modulus_MPa: float) -> tuple[float, float]:
    """The areas [mm2] of the tendon that every printed cross-section allows."""
    low, high = [], []
    for name in MATERIALS:
        row = table("7.2").row(material=name)
        share = table("7.1").row(material=name)["E_small"] / modulus_MPa
        low.append((row["area_new"] - 0.5) * share)
        high.append((row["area_new"] + 0.5) * share)
    if max(low) > min(high):
        raise InputError("no area of the tendon agrees with all rows of Table 7.2")
    return max(low), min(high)


def beside(tendon: Tendon, sheets: Sequence[Sheet], width_mm: float) -> Row:
    """Table 7.2, figure by figure, and what its factors say of the tendon's area."""
    figures: list[Row] = []
    bounds: dict[str, list[tuple[float, float]]] = {"nearest": [], "upwards": []}
    for sheet in sheets:
        row = table("7.2").row(material=sheet.name)
        factor, old = row["area_factor"], sheet.area_mm2
        bounds["nearest"].append(((factor - 0.5) * old, (factor + 0.5) * old))
        bounds["upwards"].append(((factor - 1) * old, factor * old))
        for a, assistance in enumerate(ASSISTANCE):
            plain = match(tendon, sheet, width_mm, assistance)
            given = match(tendon, sheet, width_mm, assistance, factor)
            for what, keys in COLUMNS.items():
                if a >= len(keys):
                    continue
                # The second factor is what the printed first one leaves.
                value = (given if what == "stiffness_factor" else plain)[what]
                figures.append(
                    {
                        "material": sheet.name,
                        "what": keys[a],
                        "found": value,
                        "published": row[keys[a]],
                        "agrees": rounds_to(value, row[keys[a]]),
                    }
                )
    areas = {
        how: [max(b[0] for b in each), min(b[1] for b in each)]
        for how, each in bounds.items()
    }
    agreement: Row = {}
    for what in ("area_factor", "stiffness_factor", "area_new", "strips"):
        own = [f["agrees"] for f in figures if f["what"].removesuffix("_half") == what]
        agreement[f"{what}_agree"] = sum(own)
        agreement[f"{what}_of"] = len(own)
    return {
        "figures": figures,
        "areas_behind_area_factor_mm2": areas,
        "agreement": agreement,
        "explained": explained(tendon, areas),
    }


def rounds_to(value: float, printed: float) -> bool:
    """Whether a number is printed so, to the nearest whole one; a half goes both ways.

    >>> rounds_to(24.5, 25), rounds_to(24.5, 24), rounds_to(5.73, 7)
    (True, True, False)
    """
    return abs(value - printed) <= 0.5 + 1e-9


def explained(tendon: Tendon, areas: Mapping[str, Sequence[float]]) -> list[str]:
    """Why a printed figure is not this one."""
    (a, b), (c, d) = areas["nearest"], areas["upwards"]
    return [
        f"The printed factors of area belong to a tendon of {a:.1f} to {b:.1f} mm2 if "
        f"they are rounded ({c:.1f} to {d:.1f} rounded up); the printed cross-sections "
        f"belong to {tendon.area_mm2:.2f} mm2. Two areas of the tendon were used. The "
        "cross-sections do not depend on the factors, whose product is the same.",
        "Strips are rounded to the nearest whole one, so some bundles are softer than "
        "the tendon by up to half a strip.",
        "Modulus times area is matched, so the bundle is as stiff as a tendon of the "
        "length of the strips, 33 mm; for another length the strips scale with it.",
    ]


def chosen(rows: Sequence[Row], tendon: Tendon) -> Row:
    """The materials that come nearest: the fewest strips, the likest relaxation."""
    out: Row = {"fewest_strips": min(rows, key=lambda r: r["strips_unrounded"][0])}
    relaxing = [r for r in rows if r["relaxation_percent"] is not None]
    if relaxing and tendon.relaxation_percent is not None:
        goal = tendon.relaxation_percent
        out["likest_relaxation"] = min(
            relaxing, key=lambda r: abs(r["relaxation_percent"] - goal)
        )
    return {key: row["material"] for key, row in out.items()}
