"""Which column of a table is what, in which unit; its values in base units.

What decides, in this order: options of the user, the dialect's rules, the columns'
names and units.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from softnn.contracts import Array, InputError
from softnn.plausible import marks
from softnn.readers.clocks import clock, is_clock, since_an_epoch
from softnn.readers.columns import Column, split_name
from softnn.readers.guess import strain_unit
from softnn.readers.header import header_geometry
from softnn.readers.lacking import USUAL, Lacking
from softnn.readers.measures import unusual
from softnn.readers.numbers import numbers
from softnn.readers.options import ReadOptions, Rules, is_called
from softnn.readers.table import Table
from softnn.readers.units import READINGS, WEIGHTS, Unit, parse_unit
from softnn.readers.vocabulary import (
    ABSOLUTE,
    AXIS,
    COMPRESSIVE,
    DIMENSION,
    DIRECTION,
    GAUGE,
    HEIGHT,
    LOADED,
    MOVED,
    ROLES,
    STRETCH,
    plain,
    rank,
)
from softnn.recording import Geometry
from softnn.start import start

# What loggers write where there is no reading, and how far off all others it must be.
SENTINELS = (-999.0, -9999.0, -99999.0, -999.25, 999.0, 9999.0, 99999.0, 999999.0,
             -32768.0, 32767.0, 1e10, -1e10, 1e20, -1e20, 1e30, -1e30)  # fmt: skip
FAR = 5.0
APART = 0.2  # of the smaller section, by which two ways to say it are told
DIFFERS = 0.02  # of the range, by which two columns say different things


def called(columns: Sequence[Column], wanted: str) -> list[int]:
    """Columns that a user's name means, or the only one that begins with it."""
    hits: list[int] = []
    for name in (wanted, plain(wanted), split_name(wanted).plain):
        hits = hits or [
            i for i, c in enumerate(columns) if name in (c.name, str(c), c.plain)
        ]
    near = [i for i, c in enumerate(columns) if c.plain.startswith(f"{plain(wanted)} ")]
    return hits or (near if len(near) == 1 else [])


class Chosen:
    """Columns of one table by their quantity; keeps a list of those that were used."""

    def __init__(
        self,
        table: Table,
        rules: Rules,
        options: ReadOptions,
        decimal: str,
        first: int = 0,
    ) -> None:
        self.first = first  # row at which the recording starts
        self.table, self.rules, self.options = table, rules, options
        self.decimal = decimal
        self.used: dict[str, str] = {}
        self.names: dict[str, str] = {}  # plain, of the columns used
        self.cells: dict[int, Array] = {}  # of columns that were used
        self.notes = [*rules.notes, *table.notes]
        self.header = header_geometry((*table.header, *table.constants()))
        known_geometry = {**self.header.values, **rules.geometry}
        if options.length_mm is None:
            self.notes += self.header.notes
        if not options.has_area:
            self.notes += self.header.repeated
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
        try:
            self.geometry.check("of the header", APART)
        except InputError as error:
            told = str(error).replace("leave the wrong one out", "")
            self.notes.append(f"{told}{self.geometry.area:.4g} mm2 is used")
        half = [n for n in ("width", "thickness") if f"{n}_mm" in given]
        if options.has_area and len(half) == 1:
            self.notes.append(
                f"--{half[0]} is not used: the section is given by "
                + ("--area" if options.area_mm2 is not None else "--diameter")
            )
        # What is given for this file alone comes first.
        self.units = sorted(
            (
                (key, of, name, unit)
                for key, unit in options.units.items()
                for of, name in self.meant(key)
            ),
            key=lambda given: not given[1],
        )
        self.typed: set[str] = set()  # keys of units that named a column, or a role

    def meant(self, key: str) -> list[tuple[bool, str]]:
        """The column that a unit was given for, and whether of this file alone."""
        file, mark, name = key.partition(":")
        if mark and is_called(self.table.file, file):
            return [(True, name.strip())]
        return [(False, key)]

    def candidates(self, role: str) -> list[int]:
        """Columns that may play a role, best first; empty ones only by name."""
        if getattr(self.options, role):
            return self.ranked(role)
        return [i for i in self.ranked(role) if self.table.filled(i)]

    def empty(self, *roles: str) -> str:
        """What to do where a column has the name of a role, and no value; "" else."""
        for role in roles:
            for i in self.ranked(role):
                if self.table.filled(i):
                    continue
                how = (
                    "; if it holds formulas, open the workbook in a spreadsheet "
                    "program and save it there: then it holds their values"
                    if self.table.sheet
                    else ""
                )
                return f"column {str(self.table.columns[i])!r} has no values{how}"
        return ""

    def ranked(self, role: str) -> list[int]:
        """Columns by name and unit, whatever they hold."""
        wanted = getattr(self.options, role)
        columns = self.table.columns
        if wanted:
            hits = called(columns, wanted)
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
        if self.table.nameless:
            units = [parse_unit(c.unit) for c in columns]
            wanted = DIMENSION[role]
            return [
                i
                for i, u in enumerate(units)
                if u is not None and u.dimension == wanted
            ]
        ranked = []
        axes = self.axes_told(role)
        for i, column in enumerate(columns):
            place = rank(role, column.plain)
            if place is not None and column.plain not in self.rules.ignore:
                stamps = role == "time" and is_clock(self.table.cells(i))
                other = column.plain not in axes
                ranked.append((other, unusual(column.plain), stamps, place, i))
        return [i for *_, i in sorted(ranked)]

    def axes_told(self, role: str) -> set[str]:
        """Plain names of columns that the header calls the axis of the load or travel.

        As in `Load Cell Axis: Fz`.
        """
        words = {"force": LOADED, "displacement": MOVED}.get(role)
        if words is None:
            return set()
        return {
            plain(split_name(entry.value).name)
            for entry in self.table.header
            if AXIS.search(plain(entry.key)) and words.search(plain(entry.key))
        }

    def find(self, role: str) -> tuple[int, Unit] | None:
        """The column of a role with its unit, or None; an unknown unit is an error."""
        dimension = DIMENSION[role]
        unclear: Column | None = None
        for i in self.candidates(role):
            column = self.table.columns[i]
            text = self.unit_of(column, role)
            unit = self.implied(i, role, text) or parse_unit(text)
            if unit is None and not text and dimension == "strain" and self.fractions:
                # Numbers that may be per cent are asked for, unless a dialect knows.
                likely = strain_unit(self.values_of(column))
                if self.rules.unitless or likely == "mm/mm":
                    unit = Unit("strain", 1.0)
            if unit is not None and unit.dimension == dimension:
                if unclear is not None and rank(role, unclear.plain) == 0:
                    self.refuse(unclear, role)
                return i, unit
            if unit is None:
                # a name that may mean strain or length is no sign of one without unit
                if text or not self.vague(role, column):
                    unclear = unclear or column
            elif getattr(self.options, role):
                raise InputError(
                    f"column {column} is in {text!r}, no unit of {dimension}"
                )
        if unclear is not None:
            self.refuse(unclear, role)
        return None

    def vague(self, role: str, column: Column) -> bool:
        """Whether a name may mean strain or length, or is but a letter."""
        place, name = rank(role, column.plain), column.plain
        if role == "strain":
            return place in (2, 4)
        if role == "displacement":
            last = place == len(ROLES[role]) - 1
            return last or len(name) == 1 or STRETCH.search(name) is not None
        return role == "stress" and len(name) == 1

    def implied(self, i: int, role: str, text: str) -> Unit | None:
        """The unit that a name and its values have, where none is written.

        Clocks, counts since an epoch, stretch ratios, and the grams of a scale.
        """
        column = self.table.columns[i]
        if role == "time":
            if is_clock(self.table.cells(i)):
                return Unit("time", 1.0)
            if not text:
                values, _ = numbers(self.table, i, self.decimal, skip_bad=True)
                epoch = since_an_epoch(values)
                # A name that is but a unit: `seconds`, `millis`.
                return (
                    parse_unit(column.name) if epoch is None else Unit("time", epoch[0])
                )
        if role == "force" and text.casefold() in WEIGHTS:
            return parse_unit(WEIGHTS[text.casefold()])
        if role == "strain" and STRETCH.search(column.plain):
            plain_unit = parse_unit(text)
            if not text or (plain_unit is not None and plain_unit.dimension == role):
                factor = 1.0 if plain_unit is None else plain_unit.factor
                values, _ = numbers(self.table, i, self.decimal, skip_bad=True)
                ratio = start(values) * factor > 0.5
                return Unit("strain", factor, -1.0 if ratio else 0.0)
        return None

    def refuse(self, column: Column, role: str) -> None:
        text = self.unit_of(column, role)
        if text.casefold() in READINGS:
            raise InputError(
                f"column {column.name!r} is in {text!r}, a reading that softnn cannot "
                f"calibrate; multiply it by its calibration, save it in {USUAL[role]} "
                "and name the unit in its heading"
            )
        raise Lacking(
            units={column.name: role},
            unknown={column.name: text} if text else None,
            values={column.name: self.values_of(column)},
        )

    def values_of(self, column: Column) -> Array:
        """The numbers (n,) of a column, whatever its unit; NaN where there are none."""
        i = self.table.columns.index(column)
        try:
            return numbers(self.table, i, self.decimal, skip_bad=True)[0]
        except InputError:
            return np.full(len(self.table.rows), np.nan)

    def unit_of(self, column: Column, role: str) -> str:
        """The unit of a column: given by its name, or by its role, or in the file."""
        for own in (True, False):
            here = [(k, n, u) for k, of, n, u in self.units if of == own]
            for key, name, unit in here:
                if name in (column.name, str(column)) or plain(name) == column.plain:
                    self.typed.add(key)
                    return unit
            for key, name, unit in here:
                if name == role:
                    self.typed.add(key)
                    return unit
        return column.unit

    def in_vain(self) -> list[str]:
        """Units given that no column of this table is read by."""
        named = {
            key
            for key, _, name, _ in self.units
            for c in self.table.columns
            if name in (c.name, str(c)) or plain(name) == c.plain
        }
        return [key for key, *_ in self.units if key not in self.typed | named]

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
        if role == "time" and is_clock(self.table.cells(i)):
            self.used[label or role] = str(column)
            return self.clocked(i, column)
        values, bad = numbers(self.table, i, self.decimal, self.options.skip_bad_cells)
        if bad:
            self.notes.append(f"{bad} cells of {column.name!r} are no numbers: missing")
        if role != "time":
            values = self.without_sentinels(values, column)
        infinite = ~np.isfinite(values) & ~np.isnan(values)
        huge = infinite | (np.abs(values) > (1e19 if role == "time" else 1e15))
        if huge.any():
            k = int(huge.argmax())
            raise InputError(
                f"{self.table.cells(i)[k]!r} is too large to be a measurement",
                file=self.table.where,
                row=int(self.table.lines[k]),
                column=column.name,
            )
        self.cells[i] = values
        epoch = since_an_epoch(values) if role == "time" else None
        if epoch is not None:
            # Before the factor: nanoseconds since 1970 leave no digits for the rest.
            values = values - values[np.isfinite(values)][0]
            text = self.unit_of(column, role)
            how = text or epoch[1]
            self.notes.append(f"{column.name!r} is {how}; time begins at the first row")
        values = values * unit.factor + unit.offset
        text = self.unit_of(column, role)
        shown = str(replace(column, unit=text))
        self.used[label or role] = shown
        self.names[label or role] = column.plain
        self.note_rivals(role, i, values)
        if role == "strain" and unit.offset == -1:
            self.notes.append(f"{column.name!r} is a stretch ratio: 1 subtracted")
        if role == "force" and text.casefold() in WEIGHTS:
            self.notes.append(
                f"{column.name!r} in {text} is taken as {WEIGHTS[text.casefold()]}"
            )
        if role == "displacement" and ABSOLUTE.search(column.plain):
            if HEIGHT.search(column.plain):
                values = self.height(values, column)
            elif np.isfinite(values).any():
                self.notes.append(f"zero of {column.name!r} set to its first value")
                values = values - start(values[self.first :])
        sign = -1.0 if role != "temperature" and self.flipped(column, role) else 1.0
        return sign * values

    def without_sentinels(self, values: Array, column: Column) -> Array:
        """The values (n,) without the numbers that loggers write for no reading."""
        for one in SENTINELS:
            at = values == one
            rest = values[~at & np.isfinite(values)]
            if at.any() and len(rest) and FAR * np.abs(rest).max() < abs(one):
                self.notes.append(
                    f"{at.sum()} cells of {column.name!r} are {one:g}, far off all "
                    "others, as loggers write where there is no reading: missing"
                )
                values = np.where(at, np.nan, values)
        if self.options.skip_bad_cells and (at := marks(values)).any():
            self.notes.append(
                f"{at.sum()} cells of {column.name!r} are {values[at][0]:g}, far off "
                "all others: missing (--skip-bad-cells)"
            )
            values = np.where(at, np.nan, values)
        return values

    def note_rivals(self, role: str, used: int, values: Array) -> None:
        """A note on columns that might as well be meant, and hold something else."""
        if getattr(self.options, role) or role in self.rules.columns or role == "time":
            return
        if self.table.nameless:
            return
        place, rivals = rank(role, self.table.columns[used].plain), []
        for i in self.candidates(role):
            column = self.table.columns[i]
            unit = parse_unit(self.unit_of(column, role))
            if i == used or unit is None or unit.dimension != DIMENSION[role]:
                continue
            if unusual(column.plain):
                continue
            gauge = role == "displacement" and GAUGE.search(column.plain)
            if rank(role, column.plain) != place and not gauge:
                continue
            other = numbers(self.table, i, self.decimal, skip_bad=True)[0] * unit.factor
            good = np.isfinite(values) & np.isfinite(other)
            if good.any():
                a, b = (v[good] - v[good][0] for v in (values, other))
                differs = np.abs(a - b).max() > DIFFERS * np.ptp(a) > 0
            if good.any() and differs:
                rivals.append(str(column))
        if self.table.columns[used].plain in self.axes_told(role):
            self.notes.append(f"{self.used[role]!r} is the axis that the header names")
            return
        if rivals and role in ("strain", "force"):
            self.refuse_directions(used, role)
        if rivals:
            self.notes.append(
                f"{self.used[role]!r} is taken as {role}, not {', '.join(rivals[:3])}"
                f"{' and others' if len(rivals) > 3 else ''}, which differ; another "
                f"one is named with --{role}"
            )

    def refuse_directions(self, used: int, role: str) -> None:
        """Raise where strains or forces of several directions stand side by side."""
        columns = [self.table.columns[i] for i in self.candidates(role)]
        if not DIRECTION.search(self.table.columns[used].plain):
            return
        several = {m[1] or m[2]: c for c in columns if (m := DIRECTION.search(c.plain))}
        if len(several) > 1:
            names = [c.name for c in several.values()]
            options = [f"--{role} {shlex.quote(name)}" for name in names[:3]]
            raise InputError(
                f"{role}s of {len(several)} directions: {', '.join(map(repr, names))}; "
                f"name the one along the pull with {' or '.join(options)}"
            )

    def flipped(self, column: Column, role: str) -> bool:
        """Whether the values change sign; the user may turn one axis by itself."""
        if role == "time":
            return False
        axis = "strain" if role in ("strain", "displacement") else "stress"
        turned = self.options.flips(axis, self.table.file)
        return self.compressive(column, role) != turned

    def compressive(self, column: Column, role: str) -> bool:
        """Whether compression counts as positive in a column."""
        if role == "displacement" and HEIGHT.search(column.plain):
            return False  # a gap that closes is compression, whatever the file counts
        return (
            self.rules.compression
            or self.options.compression
            or COMPRESSIVE.search(column.plain) is not None
        )

    def clocked(self, i: int, column: Column) -> Array:
        """A column of times of day, in seconds since its first."""
        try:
            values, notes = clock(self.table.cells(i), self.unit_of(column, "time"))
        except InputError as error:
            row = None if error.row is None else int(self.table.lines[error.row])
            text = str(error).replace("COLUMN", column.name)
            if error.row is not None:
                text = text.partition(": ")[2]
            raise InputError(
                text, file=self.table.where, row=row, column=column.name
            ) from None
        self.notes += [f"{column.name!r}: {note}" for note in notes]
        self.cells[i] = values
        return values

    def height(self, values: Array, column: Column) -> Array:
        """A gap between plates: its change is the elongation, its start the length."""
        first = start(values[self.first :])
        length = self.geometry.length_mm
        if length is not None and not 0.9 < first / length < 1.1:
            self.notes.append(
                f"{column.name!r} starts at {first:.4g} mm, and the length is said to "
                f"be {length:.4g} mm"
            )
        if first > 0 and length is None:
            self.geometry = replace(self.geometry, length_mm=first)
            self.notes.append(f"length is the first {column.name!r}, {first:.6g} mm")
        return values - first
