"""Which column of a table is what, in which unit; its values in base units.

What decides, in this order: options of the user, the dialect's rules, the columns'
names and units.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from softnn.contracts import Array, InputError
from softnn.readers.columns import Column
from softnn.readers.header import header_geometry
from softnn.readers.lacking import Lacking
from softnn.readers.numbers import numbers
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.table import Table
from softnn.readers.units import Unit, parse_unit
from softnn.readers.vocabulary import (
    ABSOLUTE,
    COMPRESSIVE,
    DIMENSION,
    HEIGHT,
    ROLES,
    TRUE,
    plain,
    rank,
)
from softnn.recording import Geometry


class Chosen:
    """Columns of one table by what they are; what was used collects as it goes."""

    def __init__(
        self, table: Table, rules: Rules, options: ReadOptions, decimal: str
    ) -> None:
        self.table, self.rules, self.options = table, rules, options
        self.decimal = decimal
        self.used: dict[str, str] = {}
        self.notes = [*rules.notes, *table.notes]
        self.header = header_geometry(table.header)
        known_geometry = {**self.header.values, **rules.geometry}
        if options.length_mm is None:
            self.notes += self.header.notes
        given = {
            f.name: getattr(options, f.name)
            for f in fields(Geometry)
            if getattr(options, f.name) is not None
        }
        if options.has_area:  # a section given replaces the whole of the file's
            for name in ("area_mm2", "width_mm", "thickness_mm", "diameter_mm"):
                known_geometry.pop(name, None)
        elif "width_mm" in given or "thickness_mm" in given:
            # half a section: the file's own area no longer holds
            known_geometry.pop("area_mm2", None)
        self.geometry = Geometry(**{**known_geometry, **given})

    def candidates(self, role: str) -> list[int]:
        """Columns that may play a role, best first."""
        wanted = getattr(self.options, role)
        columns = self.table.columns
        if wanted:
            hits = [
                i
                for i, c in enumerate(columns)
                if wanted in (c.name, str(c)) or plain(wanted) == c.plain
            ]
            if not hits:
                raise InputError(
                    f"no column {wanted!r} (--{role}); it has {self.have()}"
                )
            return hits[:1]
        if role in self.rules.columns:
            listed = self.rules.columns[role]
            order = {name: k for k, name in enumerate(listed)}
            found = [i for i, c in enumerate(columns) if c.plain in order]
            return sorted(found, key=lambda i: order[columns[i].plain])
        ranked = []
        for i, column in enumerate(columns):
            place = rank(role, column.plain)
            if place is not None and column.plain not in self.rules.ignore:
                ranked.append((TRUE.search(column.plain) is not None, place, i))
        return [i for _, _, i in sorted(ranked)]

    def find(self, role: str) -> tuple[int, Unit] | None:
        """The column of a role with its unit, or None; an unknown unit is an error."""
        dimension = DIMENSION[role]
        unclear: Column | None = None
        for i in self.candidates(role):
            column = self.table.columns[i]
            text = self.unit_of(column, role)
            unit = parse_unit(text)
            if unit is None and not text and dimension == "strain" and self.fractions:
                unit = Unit("strain", 1.0)
            if unit is not None and unit.dimension == dimension:
                if unclear is not None and rank(role, unclear.plain) == 0:
                    self.refuse(unclear, role)
                return i, unit
            if unit is None:
                # a name that may mean strain or length is no sign of one without unit
                vague = rank(role, column.plain) == len(ROLES[role]) - 1
                if text or not vague or role not in ("strain", "displacement"):
                    unclear = unclear or column
            elif getattr(self.options, role):
                raise InputError(
                    f"column {column} is in {text!r}, no unit of {dimension}"
                )
        if unclear is not None:
            self.refuse(unclear, role)
        return None

    def refuse(self, column: Column, role: str) -> None:
        text = self.unit_of(column, role)
        raise Lacking(
            units={column.name: role}, unknown={column.name: text} if text else None
        )

    def unit_of(self, column: Column, role: str) -> str:
        units = self.options.units
        return units.get(column.name) or units.get(role) or column.unit

    @property
    def fractions(self) -> bool:
        """Whether a strain without a unit is a fraction: the others carry theirs."""
        others = [parse_unit(c.unit) for c in self.table.columns if c.unit]
        return self.rules.unitless or sum(u is not None for u in others) >= 2

    def have(self) -> str:
        return ", ".join(str(c) for c in self.table.columns if c.name) or "none"

    def read(self, role: str, label: str = "") -> Array | None:
        """The column of a role in base units, or None when there is none."""
        found = self.find(role)
        if found is None:
            return None
        i, unit = found
        column = self.table.columns[i]
        values, bad = numbers(self.table, i, self.decimal, self.options.skip_bad_cells)
        if bad:
            self.notes.append(f"{bad} cells of {column.name!r} are no numbers: missing")
        infinite = ~np.isfinite(values) & ~np.isnan(values)
        huge = infinite | (np.abs(values) > 1e15)
        if huge.any():
            k = int(huge.argmax())
            raise InputError(
                f"{self.table.cells(i)[k]!r} is too large to be a measurement",
                file=self.table.where,
                row=int(self.table.lines[k]),
                column=column.name,
            )
        values = values * unit.factor + unit.offset
        shown = str(replace(column, unit=self.unit_of(column, role)))
        self.used[label or role] = shown
        if role == "displacement" and ABSOLUTE.search(column.plain):
            first = values[np.isfinite(values)][:1]
            if HEIGHT.search(column.plain):
                values = self.height(values, first, column)
            elif first.size:
                self.notes.append(f"zero of {column.name!r} set to its first value")
                values = values - first[0]
        sign = -1.0 if role != "temperature" and self.flipped(column, role) else 1.0
        return sign * values

    def flipped(self, column: Column, role: str) -> bool:
        if role == "time":
            return False
        if role == "displacement" and HEIGHT.search(column.plain):
            return False  # a gap that closes is compression, whatever the file counts
        return (
            self.rules.compression
            or self.options.compression
            or COMPRESSIVE.search(column.plain) is not None
        )

    def height(self, values: Array, first: Array, column: Column) -> Array:
        """A gap between plates: its change is the elongation, its start the length."""
        if first.size and self.geometry.length_mm is None:
            if not first[0] > 0:
                raise InputError(
                    f"{column.name!r} starts at {first[0]:.6g} mm, no specimen's "
                    "height; give it with --length MM"
                )
            self.geometry = replace(self.geometry, length_mm=float(first[0]))
            self.notes.append(f"length is the first {column.name!r}")
        return values - (first[0] if first.size else 0.0)
