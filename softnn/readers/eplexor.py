"""Netzsch (GABO) Eplexor: `Exported Data` sheet with static and dynamic columns.

A sweep over frequency and temperature has moduli and no history; it is refused. A
static test of the machine (`F stat.`, `Strain stat`, `Stress stat`, `Time`) is read,
`Lo` being the specimen's length.
"""

from __future__ import annotations

from softnn.contracts import InputError
from softnn.readers.assemble import read_source
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.recording import Recording

NAME = "GABO Eplexor"


def recognises(source: Source) -> bool:
    return {"f stat", "strain stat"} <= source.names or (
        {"f dyn", "strain dyn"} <= source.names
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    if {"f dyn", "tan delta"} & source.names and {"f", "F"} & source.names:
        raise InputError(
            "is a dynamic sweep (storage and loss modulus over frequency), no history "
            "of stress in time; export a static test, relaxation or ramp",
            file=source.path,
        )
    rules = Rules(
        NAME,
        columns={
            "force": ("f stat",),
            "strain": ("strain stat",),
            "stress": ("stress stat",),
        },
    )
    return read_source(source, rules, options)
