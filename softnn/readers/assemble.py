"""One table of a file -> one Recording: columns chosen, units converted, gaps named.

What decides, in this order: options of the user, the dialect's rules, the columns'
names and units, the header. Nothing is assumed silently: each choice is written into
the recording's log, and what is missing is an error that names the option.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import Array, InputError
from softnn.readers.chosen import Chosen
from softnn.readers.lacking import Lacking, placed
from softnn.readers.numbers import decimal_mark
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.readers.table import Table, find_tables, has_role
from softnn.readers.vocabulary import TRUE, plain
from softnn.recording import Recording, Step

# Beyond these a unit or the geometry is wrong, not the material: 100 is 10,000 %,
# 20 GPa is beyond any wire.
MAX_STRAIN = 100.0
MAX_STRESS = 20_000.0
DISAGREE = 3.0  # a column against force / area or displacement / length


def assemble(
    table: Table, rules: Rules, options: ReadOptions, decimal: str = "."
) -> Recording:
    """The recording of one table; raises `InputError` naming file, row and column."""
    try:
        return _Assembly(table, rules, options, decimal).recording()
    except InputError as error:
        raise placed(error, table.where) from None


class _Assembly(Chosen):
    """The recording made of the columns."""

    def recording(self) -> Recording:
        table, options = self.table, self.options
        if not table.rows:
            raise InputError("no rows; at least two samples are needed")
        force, stress, strain, elongation, time = self.channels()
        self.check_time(time)
        self.check_size(strain, MAX_STRAIN, "strain", "--length")
        self.check_size(stress, MAX_STRESS, "stress [MPa]", "--area")
        self.note_jumps(strain, "strain")
        self.note_jumps(stress, "stress")
        if "true stress" in self.used:
            # sigma_nominal = sigma_true / stretch, for a volume that stays
            stress = stress / (1 + strain)
        arguments: dict[str, Any] = {
            "dialect": self.rules.dialect,
            "columns": self.used,
            "notes": self.notes,
        }
        if table.sheet:
            arguments["sheet"] = table.sheet
        specimen = options.specimen or table.label or self.header.specimen
        return Recording(
            time_s=time,
            strain=strain,
            stress_MPa=stress,
            temperature_C=self.optional("temperature"),
            force_N=force,
            elongation_mm=elongation,
            name=table.file.name.split(".")[0],
            specimen=specimen,
            material=options.material or self.header.material,
            test=options.test,
            rate_per_s=self.rate(),
            geometry=self.geometry,
            source=str(table.file),
            log=(Step("read", arguments),),
        )

    def channels(self) -> tuple[Array | None, Array, Array, Array | None, Array]:
        """Force, stress, strain, elongation and time; all that lacks is said at once.

        Raises `NoRecording` where there is nothing of a test.
        """
        lacking: Lacking | None = None
        force = stress = strain = elongation = time = None
        try:
            force, stress = self.force_and_stress()
        except Lacking as error:
            lacking = error
        try:
            strain, elongation = self.strain()
        except Lacking as error:
            lacking = error if lacking is None else lacking.and_also(error)
        try:
            time = self.time(strain)
        except Lacking as error:
            lacking = error if lacking is None else lacking.and_also(error)
        if lacking is not None:
            raise lacking
        assert stress is not None
        assert strain is not None
        assert time is not None
        return force, stress, strain, elongation, time

    def force_and_stress(self) -> tuple[Array | None, Array]:
        """Force and stress; the force may be unclear where it is not needed."""
        try:
            force = self.read("force")
        except Lacking as error:
            wanted = self.options.force or self.options.has_area
            if wanted or self.find("stress") is None:
                if self.geometry.area is None:
                    error = error.and_also(Lacking(["area"]))
                raise error from None
            self.notes.append("force left out: its unit is not known")
            force = None
        return force, self.stress(force)

    def optional(self, role: str) -> Array | None:
        """A channel nothing depends on: without a clear unit it is left out."""
        try:
            return self.read(role)
        except InputError as error:
            if getattr(self.options, role):
                raise
            self.notes.append(f"{role} left out: {error}")
            return None

    def stress(self, force: Array | None) -> Array:
        """Force / area when the user gives the section, else stress as recorded."""
        options, area = self.options, self.geometry.area
        if options.has_area and force is not None and not options.stress:
            assert area is not None
            return force / area
        stress = self.read("stress")
        if options.has_area and not options.stress:
            self.notes.append("no force to use the given section on")
        if stress is not None:
            if TRUE.search(plain(self.used["stress"])):
                self.used["true stress"] = self.used.pop("stress")
                self.notes.append("true stress made nominal, volume taken as constant")
            elif force is not None and area is not None:
                self.agree(stress, force / area, "stress", "force / area")
            return stress
        if force is None:
            raise InputError(
                f"no column of force or stress; it has {self.have()}. "
                "Name one with --force or --stress"
            )
        if area is None:
            self.header.refuse_unknown(("area", "width", "thickness", "diameter"))
            raise Lacking(["area"])
        return force / area

    def strain(self) -> tuple[Array, Array | None]:
        """Strain and elongation; from the displacement when a length is given."""
        options = self.options
        elongation: Array | None = None
        if options.length_mm is not None and not options.strain:
            elongation = self.read("displacement")
            if elongation is not None:
                return elongation / options.length_mm, elongation
            self.notes.append("no displacement to use --length on")
        strain = self.read("strain")
        if strain is not None:
            if TRUE.search(plain(self.used["strain"])):
                self.notes.append("true strain made engineering strain, exp(e) - 1")
                strain = np.expm1(np.minimum(strain, 50.0))
            elongation = self.optional("displacement")
            length = self.geometry.length_mm
            if elongation is not None and length is not None:
                extensometer = re.search(
                    r"\b(ave|video|strain \d)\b", plain(self.used["strain"])
                )
                self.agree(
                    strain,
                    elongation / length,
                    "strain",
                    "displacement / length",
                    30.0 if extensometer else DISAGREE,
                )
            return strain, elongation
        length = self.geometry.length_mm
        try:
            elongation = self.read("displacement")
        except Lacking as error:
            if length is None:
                error = error.and_also(Lacking(["length"]))
            raise error from None
        if elongation is None:
            raise InputError(
                f"no column of strain or displacement; it has {self.have()}. "
                "Name one with --strain or --displacement"
            )
        length = self.geometry.length_mm  # a column of height brings its own
        if length is None:
            self.header.refuse_unknown(("length",))
            raise Lacking(["length"])
        return elongation / length, elongation

    def time(self, strain: Array | None) -> Array | None:
        """Time [s]; None where it is made of a strain that lacks something itself."""
        options = self.options
        if options.interval_s is not None:
            self.used["time"] = f"every {options.interval_s:g} s (--interval)"
            return np.arange(float(len(self.table.rows))) * options.interval_s
        time = self.read("time")
        if time is not None:
            return time
        if options.rate_per_s is not None:
            if strain is None:
                return None
            steps = np.abs(np.diff(strain, prepend=strain[:1]))
            if np.isnan(steps).any():
                raise InputError("strain has gaps, so --rate gives no time")
            self.used["time"] = f"strain at {options.rate_per_s:g} 1/s (--rate)"
            return np.asarray(np.cumsum(steps) / options.rate_per_s, dtype=float)
        raise InputError(
            f"no column of time; it has {self.have()}. Name one with --time, or give "
            "--interval SECONDS between samples, or --rate STRAIN_PER_SECOND"
        )

    def rate(self) -> float | None:
        if self.options.rate_per_s is not None:
            return self.options.rate_per_s
        speeds = {s for s in self.header.speeds if s > 0}
        if len(speeds) == 1 and self.geometry.length_mm is not None:
            return speeds.pop() / self.geometry.length_mm
        return None

    # -- checks ---------------------------------------------------------------------

    def check_time(self, time: Array) -> None:
        """Name the row of the file, which a Recording no longer knows."""
        for bad, what in (
            (np.isnan(time), "no time; every row needs one"),
            (
                np.diff(time, prepend=time[:1]) < 0,
                "time goes backwards; sort the rows, split the file where a new test "
                "begins, or replace its clock with --interval SECONDS",
            ),
        ):
            if bad.any():
                raise InputError(
                    what,
                    file=self.table.where,
                    row=int(self.table.lines[int(bad.argmax())]),
                    column=self.used.get("time"),
                )

    def check_size(self, values: Array, limit: float, what: str, option: str) -> None:
        too_large = np.abs(values) > limit
        if too_large.any():
            k = int(too_large.argmax())
            raise InputError(
                f"{what} is {values[k]:.6g}; beyond {limit:g} a unit, the geometry "
                f"({option}) or the value is wrong",
                file=self.table.where,
                row=int(self.table.lines[k]),
            )

    def note_jumps(self, values: Array, what: str) -> None:
        """Single samples far off both neighbours: a fault of the file, left in it."""
        steps = np.diff(values)
        finite = values[np.isfinite(values)]
        if finite.size < 20:
            return
        far = 0.2 * np.ptp(finite)
        alone = (np.abs(steps[:-1]) > far) & (np.abs(steps[1:]) > far)
        alone &= steps[:-1] * steps[1:] < 0
        if alone.any():
            row = int(self.table.lines[int(alone.argmax()) + 1])
            self.notes.append(
                f"{int(alone.sum())} single samples of {what} stand far off their "
                f"neighbours, the first in row {row}"
            )

    def agree(
        self,
        column: Array,
        computed: Array,
        what: str,
        how: str,
        allowed: float = DISAGREE,
    ) -> None:
        """A recorded column against the same made from two others, to catch a unit."""
        good = np.isfinite(column) & np.isfinite(computed)
        if not good.any():
            return
        a = np.percentile(np.abs(column[good]), 90)
        b = np.percentile(np.abs(computed[good]), 90)
        if a > 0 and b > 0 and not 1 / allowed < a / b < allowed:
            raise InputError(
                f"the column of {what} is {a / b:.3g} times {how}: a unit or the "
                f"geometry is wrong. Give the geometry or --unit, or name the column "
                f"to trust with --{what}"
            )


def recordings(
    tables: list[Table], rules: Rules, options: ReadOptions, file: Path
) -> list[Recording]:
    """A recording of every table that is a test; result tables and such are left out.

    Raises `InputError` for the reason the best of them is none.
    """
    if not tables:
        raise InputError(
            "no rows of numbers below column names; expected are columns of time, "
            "force or stress, and displacement or strain",
            file=file,
        )
    decimal = options.decimal or decimal_mark(tables, file)
    chosen = [t for t in tables if _is_test(t, options)]
    if not chosen:
        chosen = [max(tables, key=lambda t: len(t.rows))]
    left_out = len(tables) - len(chosen)
    if left_out:
        note = f"{left_out} further tables are no test and left out"
        rules = replace(rules, notes=(*rules.notes, note))
    return [assemble(table, rules, options, decimal) for table in chosen]


def _is_test(table: Table, options: ReadOptions) -> bool:
    def has(*roles: str) -> bool:
        return any(getattr(options, role) or has_role(table, role) for role in roles)

    timed = has("time") or options.interval_s or options.rate_per_s
    return bool(
        len(table.rows) > 1
        and timed
        and has("force", "stress")
        and has("displacement", "strain")
    )


def read_source(source: Source, rules: Rules, options: ReadOptions) -> list[Recording]:
    """The recordings of all tables of a file, each table a test: what most need."""
    tables = [
        table
        for sheet in source.sheets
        for table in find_tables(
            sheet.grid, source.path, sheet.name if not source.is_text else ""
        )
    ]
    return recordings(tables, rules, options, source.path)
