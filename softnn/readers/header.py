"""The lines above a table: geometry, speeds and names, where they say so."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from softnn.contracts import InputError
from softnn.readers.columns import is_number, split_name
from softnn.readers.source import Cell
from softnn.readers.units import parse_unit
from softnn.readers.vocabulary import (
    GEOMETRY,
    LENGTHS,
    MATERIAL,
    NOT_GEOMETRY,
    SPECIMEN,
    SPEED,
    TEST_SPEED,
    plain,
)

SMALLEST_MM, LARGEST_MM = 1e-6, 1e6  # of lengths and, in mm2, of sections

REPEATS = 1.2  # a width measured at three places differs by less

_BARE = re.compile(r"(\D*?[^\s\d=])\s*=?\s*(\d[\d.,]*)\s*(\S+)")  # `Length 40 mm`
_CUT = re.compile(r"[:=]\s*\d+$|\s0$")
_TAIL = re.compile(r"\d+\s*[^\d\s.,]\S*")


@dataclass(frozen=True)
class Entry:
    """One line of a header: `Specimen width; 6; mm`."""

    key: str
    value: str
    unit: str = ""


def entries(rows: Sequence[Sequence[Cell]]) -> tuple[Entry, ...]:
    """Header lines as key, value, unit, whichever way they are written."""
    found = []
    for row in rows:
        cells = [str(c) for c in row]
        filled = [c for c in cells if c]
        if not filled:
            continue
        if len(filled) == 2 and _CUT.search(filled[0]) and _TAIL.fullmatch(filled[1]):
            filled = [",".join(filled)]  # a decimal comma, in a file of commas
        key, rest = filled[0], filled[1:]
        if not rest or (
            ":" in key
            and not key.rstrip().endswith(":")
            and len(rest) == 1
            and parse_unit(rest[0])
        ):
            # `Thickness (1): 0.1 mm` in one cell
            if ":" not in key:
                if (match := _BARE.fullmatch(key)) and parse_unit(match[3]):
                    found.append(Entry(match[1], match[2], match[3]))
                continue
            key, value = key.split(":", 1)
            rest = [value.strip(), *rest]
        key = key.rstrip(": ")
        key = key.rsplit(" : ", 1)[-1]  # Bluehill: `Specimen properties : Width`
        named = split_name(key)
        value, unit = rest[0], rest[1] if len(rest) > 1 else ""
        match = re.fullmatch(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([^\d\s.,].*)", value)
        if match and parse_unit(match[2]):
            value, unit = match[1], match[2]
        if not unit and parse_unit(named.unit):
            key, unit = named.name, named.unit
        found.append(Entry(key, value, unit))
    return tuple(found)


@dataclass(frozen=True)
class Header:
    """Facts of the header: geometry in mm, speeds in mm/s, names."""

    values: dict[str, float]
    unclear: dict[str, Entry]
    speeds: tuple[float, ...]
    specimen: str
    material: str
    notes: tuple[str, ...] = ()  # on lengths
    repeated: tuple[str, ...] = ()  # on sizes of the section

    def refuse_unknown(self, words: tuple[str, ...]) -> None:
        """Raise for a geometry line whose unit is not known, when it is needed."""
        for name, entry in self.unclear.items():
            if name.startswith(words):
                raise InputError(
                    f"the header's {entry.key!r} is {entry.value!r} "
                    f"{entry.unit or '(no unit)'}, no size known here; "
                    f"give --{' in '.join(name.split('_'))}"
                )


def header_geometry(header: tuple[Entry, ...]) -> Header:
    """Length, section, speeds and names out of header lines, where they say so."""
    values: dict[str, float] = {}
    unclear: dict[str, Entry] = {}
    again: dict[str, list[float]] = {}
    speeds: list[float] = []
    main_speeds: list[float] = []
    lengths: list[tuple[int, float, str]] = []
    specimen = material = ""
    for entry in header:
        key = plain(entry.key)
        if SPECIMEN.search(key):
            specimen = specimen or entry.value
        elif MATERIAL.search(key):
            material = material or entry.value
        number = header_number(entry.value)
        if number is None:
            continue
        unit = parse_unit(entry.unit)
        if SPEED.search(key) and unit is not None and unit.dimension == "speed":
            where = main_speeds if TEST_SPEED.search(key) else speeds
            where.append(number * unit.factor)
        if NOT_GEOMETRY.search(key):
            continue
        places = [i for i, p in enumerate(LENGTHS) if p.search(key)]
        if places and unit is not None and unit.dimension == "length":
            lengths.append((places[0], number * unit.factor, entry.key))
        elif places and unit is None:
            unclear.setdefault("length_mm", entry)
        for name, pattern in GEOMETRY.items():
            if places or not pattern.search(key):
                continue
            if name in values:
                if unit is not None and number > 0 and (
                    unit.dimension == ("area" if name == "area_mm2" else "length")
                ):  # fmt: skip
                    again.setdefault(name, [values[name]]).append(number * unit.factor)
                continue
            dimension = "area" if name == "area_mm2" else "length"
            if unit is None or unit.dimension != dimension:
                if unit is None:
                    unclear.setdefault(name, entry)
                continue
            value = number * unit.factor
            if value > 0:  # machines write 0 for "not entered"
                if SMALLEST_MM < value < LARGEST_MM:
                    values[name] = value
                else:
                    unclear.setdefault(name, entry)
            break
    lengths = [found for found in lengths if SMALLEST_MM < found[1] < LARGEST_MM]
    notes: tuple[str, ...] = ()
    if lengths:
        # the first of the surest kind
        _, values["length_mm"], key = min(lengths, key=lambda found: found[0])
        if len({length for _, length, _ in lengths}) > 1:
            notes = (f"of {len(lengths)} lengths in the header, {key!r} is used",)
    repeated: tuple[str, ...] = ()
    for name, several in again.items():
        if max(several) > REPEATS * min(several):
            what, unit_ = name.split("_")
            told = ", ".join(f"{v:g}" for v in several[:4])
            repeated += (f"{what} is {told} {unit_} in the header; the first is used",)
    return Header(
        values,
        unclear,
        tuple(main_speeds or speeds),
        specimen,
        material,
        notes,
        repeated,
    )


def header_number(text: str) -> float | None:
    """A number of a header, in either decimal mark, or None.

    >>> header_number("0,399"), header_number("strip 7")
    (0.399, None)
    """
    if not text or not is_number(text):
        return None
    # A lone comma in a header is a decimal one: no specimen is 1,000 mm wide.
    if "," in text and "." not in text and text.count(",") == 1:
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return None
