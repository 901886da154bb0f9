"""Instron WaveMatrix: `*.steps.tracking.csv`, with its side-cars beside it.

Units stand in the quoted names, header rows end with a comma. Position is the
actuator's own, force often not zeroed: the first is set to zero at the first sample,
the second is left. `NAME.specimen.txt` beside `NAME.steps.tracking.csv` gives the
section, `NAME.log` the specimen. Trends (a row a cycle) hold no history in time.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from softnn.contracts import InputError
from softnn.readers.assemble import read_source
from softnn.readers.header import entries, header_geometry
from softnn.readers.options import ReadOptions, Rules, name_of
from softnn.readers.source import Source, decode
from softnn.recording import Recording

NAME = "Instron WaveMatrix"
_LOG = re.compile(r"^[\d/.\-]+,[\d:. APM]+,([^,\n]*),([^,\n]*),\d{5},", re.M)
_SPECIMEN = re.compile(r"\A\s*Specimen Type:.*\n(?:[^\n]*:[^\n]*\n?)+\s*\Z")
_SIDE_CAR_BYTES = 100_000


def recognises(source: Source) -> bool:
    if not source.is_text:
        return False
    head = source.head
    names = ("total time", "total cycles", "elapsed cycles", "step")
    return (
        _LOG.match(head) is not None
        or _SPECIMEN.match(head) is not None
        or (
            sum(n in source.names for n in names) >= 2
            and re.search(r"(Elapsed|Total) Cycle", head) is not None
        )
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    if _LOG.match(source.head):
        raise InputError(
            "is a WaveMatrix log, without measurements; "
            "name the .steps.tracking.csv beside it",
            file=source.path,
        )
    if _SPECIMEN.match(source.head):
        raise InputError(
            "is a WaveMatrix specimen file, without measurements; name the "
            ".steps.tracking.csv beside it, which then takes its geometry from here",
            file=source.path,
        )
    if re.search(r":(Maximum|Minimum)\b", source.head.split("\n")[0]):
        raise InputError(
            "holds WaveMatrix trends, a maximum and minimum a cycle and no history; "
            "name the .steps.tracking.csv beside it",
            file=source.path,
        )
    stem = re.sub(r"(\.steps)?(\.tracking)?(\.csv)?(\.gz)?$", "", source.path.name)
    section = header_geometry(
        entries(
            [[line] for line in _side_car(source, f"{stem}.specimen.txt").split("\n")]
        )
    )
    log = _LOG.match(_side_car(source, f"{stem}.log"))
    notes = [f"section from {stem}.specimen.txt"] if section.values else []
    if log:
        notes.append(f"log of {log[1]}, {log[2]}")
    rules = Rules(
        NAME,
        columns={"time": ("total time", "elapsed time", "time")},
        geometry=section.values,
        notes=tuple(notes),
    )
    return [
        replace(r, name=r.name.replace(name_of(source.path), stem, 1))
        for r in read_source(source, rules, options)
    ]


def _side_car(source: Source, name: str) -> str:
    path = Path(source.path).with_name(name)
    try:
        with path.open("rb") as stream:
            return decode(stream.read(_SIDE_CAR_BYTES), path)
    except (OSError, ValueError):
        return ""  # a side-car is a help, not a need
