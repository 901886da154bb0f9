"""Tidy CSV, softnn's own: `time_s,strain,stress_MPa` and more, units in the names."""

from __future__ import annotations

from dataclasses import replace

from softnn.axes import axes_of
from softnn.contracts import InputError
from softnn.readers.assemble import ROUNDED, read_source
from softnn.readers.clocks import spread
from softnn.readers.options import NO_FORCE, NO_TRAVEL, ReadOptions, Rules
from softnn.readers.source import Source, quantity
from softnn.readers.tidy import read_tidy
from softnn.readers.vocabulary import WHICH, WHOSE, plain
from softnn.recording import Recording, Step

NAME = "tidy CSV"


def recognises(source: Source) -> bool:
    first = source.head.split("\n", 1)[0].strip("\ufeff\r ")
    names = [name.strip() for name in first.split(",")]
    return "time_s" in names and axes_of(names) is not None


def read(source: Source, options: ReadOptions) -> list[Recording]:
    names = [n.strip() for n in source.head.split("\n", 1)[0].split(",")]
    twice = next((n for n in names if n and names.count(n) > 1), None)
    if twice:
        raise InputError(
            f"column {twice!r} is there twice; rename or delete one", file=source.path
        )
    if _changed(source, options) or _with_units(source):
        return read_source(source, Rules(NAME, unitless=True), options)
    about = {"specimen": options.specimen, "material": options.material}
    about["test"] = options.test
    recording = read_tidy(source.path, **about, rate_per_s=options.rate_per_s)
    columns = {name.rsplit("_", 1)[0]: name for name in recording.columns}
    notes = []
    even = spread(recording.time_s)
    if even is not None:
        recording = replace(recording, time_s=even)
        notes.append(ROUNDED.format("time_s"))
    if options.has_area:
        notes.append(NO_FORCE)
    if options.length_mm is not None:
        notes.append(NO_TRAVEL)
    arguments = {"dialect": NAME, "columns": columns, "notes": notes}
    return [
        replace(
            recording,
            geometry=options.geometry,
            log=(Step("read", arguments), *recording.log),
        )
    ]


def _with_units(source: Source) -> bool:
    """Whether the first cells have their unit behind them."""
    cells = (c for line in source.lines[1:60] for c in line.split(","))
    return any(quantity(c.strip()) for c in cells)


def _changed(source: Source, options: ReadOptions) -> bool:
    """Whether the user says of its columns what the file does not."""
    names = source.head.split("\n", 1)[0].split(",")
    axes = axes_of([name.strip("\ufeff\r ") for name in names])
    made = axes is not None and axes.component
    sizes = made and (options.has_area or options.length_mm is not None)
    whose = any(p.search(plain(n)) for n in names for p in (WHOSE, WHICH))
    roles = ("time", "force", "displacement", "strain", "stress", "temperature")
    return bool(
        sizes
        or whose
        or options.units
        or options.decimal == ","
        or options.compression
        or options.zero
        or options.zero_stress
        or options.flip
        or options.skip_bad_cells
        or options.interval_s is not None
        or any(getattr(options, role) for role in roles)
    )
