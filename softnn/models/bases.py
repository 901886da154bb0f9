"""All bases by name: built for recordings, or read from a model.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from softnn.contracts import InputError, nearest
from softnn.models import bergstrom_boyce, hyperelastic, units
from softnn.models.base import Base

BASES = (*units.BASES, *hyperelastic.NAMES, bergstrom_boyce.NAME)
LARGEST = 1e30  # larger numbers in a file are junk


def check(name: str) -> None:
    """Raise `InputError` unless `name` is a base, its options included."""
    if name.split(":")[0] in hyperelastic.NAMES:
        hyperelastic.parsed(name)
    elif name not in BASES:
        raise InputError(
            f"no model {name!r}{nearest(name, BASES)}; allowed: {', '.join(BASES)}, "
            "auto, or a model.json"
        )


def build(
    name: str,
    strain_low: float,
    strain_high: float,
    interval_s: float,
    duration_s: float,
    segments: int = 16,
) -> Base:
    """Return the base `name` over a range of strain and of time [s]."""
    check(name)
    if name.split(":")[0] in hyperelastic.NAMES:
        return hyperelastic.build(name, strain_low, strain_high, interval_s, duration_s)
    if name == bergstrom_boyce.NAME:
        return bergstrom_boyce.build(strain_low, strain_high, interval_s, duration_s)
    return units.build(name, strain_low, strain_high, interval_s, duration_s, segments)


def from_dict(given: Mapping[str, Any]) -> Base:
    """Return the base that a model.json describes. Raises `InputError`."""
    name = str(given["name"])
    if name not in BASES:
        raise InputError(f"no base {name!r}; allowed: {', '.join(BASES)}")
    times = tuple(number(t) for t in given["relaxation_times_s"])
    if name in hyperelastic.NAMES:
        return hyperelastic.from_dict(given, times)
    if name == bergstrom_boyce.NAME:
        return bergstrom_boyce.from_dict(given, times)
    return units.Units(name, tuple(number(k) for k in given["knots"]), times)


def number(value: Any) -> float:
    """Return a finite number of a file. Raises `InputError`."""
    x = float(value)
    if not abs(x) < LARGEST:
        raise InputError(f"{x} is out of range; numbers are finite, below {LARGEST}")
    return x
