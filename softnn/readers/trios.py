"""TA Instruments TRIOS, rheometer in axial mode: text of one step, or .xls / .txt.

Raw waveform text: names with units, tab-separated, a tab too many at the end of each
row. Export: `Details`, then a block (a sheet, or `[step]`) a step, each with its own
clock `Step time`; the steps are one test and follow each other without a pause.

In axial steps force is positive in compression and the gap is the specimen's height,
so force changes sign and the gap's change is the elongation. `Normal stress` is
2 F / area (the normal stress difference of a cone, in its manual), so stress is made
from the force. The plate's diameter in the geometry's name is used as the specimen's.
Rotational steps (`Stress`, `Strain`) are shear and read as they are.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from softnn.contracts import InputError
from softnn.readers.assemble import SWEEP, recordings
from softnn.readers.columns import Column
from softnn.readers.header import Entry, entries, header_number
from softnn.readers.numbers import decimal_mark, numbers
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.readers.table import Table, find_tables
from softnn.readers.units import convert, unit_text
from softnn.readers.vocabulary import STEP_CLOCK
from softnn.recording import Recording

NAME = "TA TRIOS"
_FORCES = ("axial force", "normal force")
_SHEAR = {"stress", "strain"}
CLOCKS = ("time", "test time", "step time")
SHEAR = Rules(
    NAME,
    columns={
        "time": CLOCKS,
        "force": (),
        "stress": ("stress", "shear stress"),
        "strain": ("strain", "shear strain"),
        "displacement": (),
    },
    notes=("stress and strain of a rotation: shear",),
)
_TORQUE_Nm = {"n.m": 1.0, "nm": 1.0, "mn.m": 1e-3, "mnm": 1e-3, "un.m": 1e-6,
              "unm": 1e-6, "nn.m": 1e-9}  # fmt: skip
_ANGLE = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180}
_STILL = 1e-3  # of the gap, by which it may move in a test that turns
_SWEEP = {"storage modulus", "loss modulus", "tan delta", "complex viscosity"}


def recognises(source: Source) -> bool:
    names = source.names
    return {"instrument name", "proceduresegments"} <= names or (
        any(f in names for f in _FORCES) and "gap" in names
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    table, decimal = one_test(steps(source), source, options)
    options = replace(options, decimal=decimal)
    if _SHEAR <= {c.plain for c in table.columns}:
        return recordings([table], SHEAR, options, source.path)
    if _turns(table, options):
        return recordings([_sheared(table, decimal)], SHEAR, options, source.path)
    plate = None if options.has_area else _plate(table)
    axial = Rules(
        NAME,
        columns={
            "time": CLOCKS,
            "force": _FORCES,
            "stress": (),
            "strain": (),
            "displacement": ("gap", "displacement"),
        },
        compression=True,
        geometry={"diameter_mm": plate} if plate else {},
        notes=("diameter is the plate's",) if plate else (),
    )
    return recordings([table], axial, options, source.path)


def steps(source: Source) -> list[Table]:
    """The tables of all steps, each carrying the lines of the details.

    Without `Material` in them: it is the plate's.
    """
    tables: list[Table] = []
    details: tuple[Entry, ...] = ()
    for sheet in source.sheets:
        name = sheet.name if not source.is_text else ""
        found = find_tables(sheet.grid, source.path, name)
        if not found:
            details += entries(sheet.grid)
        tables += [replace(t, header=details + t.header) for t in found]
    return [
        replace(t, header=tuple(e for e in t.header if e.key != "Material"))
        for t in tables
    ]


def one_test(
    tables: list[Table], source: Source, options: ReadOptions
) -> tuple[Table, str]:
    """The steps of a test as one table of the columns they share, and decimal mark.

    A clock of the step is made one of the test: each step starts where the one
    before it ended.
    """
    tests = [
        t
        for t in tables
        if not _SWEEP & {c.plain for c in t.columns} and len(t.rows) > 0
    ]
    if not tests:
        raise InputError(
            "holds oscillation or flow only, no history of force and displacement; "
            f"{SWEEP}",
            file=source.path,
        )
    decimal = options.decimal or decimal_mark(tests, source.path)
    shared = [
        c for c in tests[0].columns if all(c in other.columns for other in tests[1:])
    ]
    names = {c.plain for c in shared}
    if not (names & {*_FORCES, "force", "static force"} or names >= _SHEAR):
        raise InputError(
            f"its steps have only {', '.join(map(str, shared)) or 'no column'} in "
            "common, and no force, or stress and strain, of one unit; choose the same "
            "variables for every step in TRIOS, and export the file again",
            file=source.path,
        )
    clock = next((c for c in shared if c.plain in ("time", "test time")), None)
    own = next((c for c in shared if STEP_CLOCK.search(c.plain)), None)
    rows: list = []
    short: list[tuple[int, int]] = []
    offset = 0.0
    for table in tests:
        order = [table.columns.index(c) for c in shared]
        shift = None
        if clock is None and own is not None and len(tests) > 1:
            shift = shared.index(own)
            time, _ = numbers(table, table.columns.index(own), decimal)
        for k, count in table.short:
            lacks = (j for j, i in enumerate(order) if i >= count)
            short.append((len(rows) + k, next(lacks, len(order))))
        for k, row in enumerate(table.rows):
            picked = [row[i] if i < len(row) else "" for i in order]
            if shift is not None:
                picked[shift] = float(time[k]) + offset
            rows.append(picked)
        if shift is not None and len(time):
            offset += float(np.nanmax(time))
    left = len(tables) - len(tests)
    notes = list(tests[0].notes)
    named = [e.value.count("#") + 1 for e in tests[0].header if "segments" in e.key]
    if named and named[0] > len(tables):
        notes.append(f"the details name {named[0]} steps, {len(tables)} are there")
    if len(tests) > 1:
        notes.append(f"{len(tests)} steps joined into one test")
    if left:
        notes.append(f"{left} steps of oscillation left out")
    joined = replace(
        tests[0],
        columns=tuple(shared),
        rows=rows,
        lines=np.concatenate([t.lines for t in tests]),
        short=tuple(short),
        bad=tuple(bad for t in tests for bad in t.bad),
        notes=tuple(notes),
        label="",
        sheet="" if len(tests) > 1 else tests[0].sheet,
    )
    return joined, decimal


def _turns(table: Table, options: ReadOptions) -> bool:
    """Whether a plate turned and the gap stood still: torque and angle are the test."""
    at = {c.plain: i for i, c in enumerate(table.columns)}
    angle = _angle(table)
    if "torque" not in at or angle is None:
        return False
    if options.force or options.displacement:
        return False
    turned, gap = _moves(table, angle), _moves(table, at.get("gap"))
    return turned > _STILL > gap


def _angle(table: Table) -> int | None:
    return next((i for i, c in enumerate(table.columns)
                 if c.plain in ("displacement", "angle", "angular displacement")
                 and unit_text(c.unit).casefold() in _ANGLE), None)  # fmt: skip


def _moves(table: Table, index: int | None) -> float:
    """The range of a column over its largest value."""
    if index is None:
        return 0.0
    values, _ = numbers(table, index, "", skip_bad=True)
    good = values[np.isfinite(values)]
    most = float(np.abs(good).max(initial=0.0))
    return float(np.ptp(good)) / most if most > 0 else 0.0


def _sheared(table: Table, decimal: str) -> Table:
    """The table with shear stress and shear strain, of torque and angle."""
    constants = {}
    for entry in table.header:
        match = re.fullmatch(r"(stress|strain) constant", entry.key.strip().lower())
        number = re.match(r"[\d.,]+(?:[eE][-+]?\d+)?", entry.value)
        if match and number and (value := header_number(number[0])) is not None:
            constants[match[1]] = value
    if len(constants) < 2:
        raise InputError(
            "holds the torque and the angle of a rheometer, and no constants that make "
            "shear of them; add the variables Stress and Strain in TRIOS, and export "
            "the file again",
            file=table.where,
        )
    angle = _angle(table)
    assert angle is not None
    torque = next(i for i, c in enumerate(table.columns) if c.plain == "torque")
    unit = unit_text(table.columns[torque].unit).casefold()
    if unit not in _TORQUE_Nm:
        raise InputError(
            f"torque is in {table.columns[torque].unit!r}; known are N.m, mN.m, uN.m",
            file=table.where,
        )
    turn = _ANGLE[unit_text(table.columns[angle].unit).casefold()]
    stress = numbers(table, torque, decimal)[0] * _TORQUE_Nm[unit] * constants["stress"]
    strain = numbers(table, angle, decimal)[0] * turn * constants["strain"]
    width = len(table.columns)
    rows = [
        [*row[:width], *[""] * (width - len(row)), float(s), float(e)]
        for row, s, e in zip(table.rows, stress, strain, strict=True)
    ]
    return replace(
        table,
        columns=(*table.columns, Column("Stress", "Pa"), Column("Strain", "1")),
        rows=rows,
        notes=(
            *table.notes,
            "shear stress is torque times the header's stress constant, shear strain "
            "is angle times its strain constant",
        ),
        short=(),
    )


def _plate(table: Table) -> float | None:
    """Diameter in mm out of `8.0mm parallel plate, ...`."""
    for entry in table.header:
        match = re.match(r"([\d.]+) ?(mm|cm|in)\b.*\bplate\b", _joined(entry))
        if match and entry.key == "Geometry name" and header_number(match[1]):
            return convert(float(match[1]), match[2], "length", entry.key)
    return None


def _joined(entry: Entry) -> str:
    return f"{entry.value}{entry.unit}" if entry.unit else entry.value
