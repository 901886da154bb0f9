"""LabVIEW measurement file (`.lvm`): header, then a column of X and one a channel.

Without a unit of its own `X_Value` is in seconds where `X_Dimension` is time. The row
`Y_Unit_Label` gives the units of the channels. Where no X is written (`X_Columns No`),
`Delta_X` is the time between samples.
"""

from __future__ import annotations

from dataclasses import replace

from softnn.readers.assemble import read_source
from softnn.readers.columns import split_name
from softnn.readers.header import header_number
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.readers.units import parse_unit
from softnn.recording import Recording

NAME = "LabVIEW measurement"


def recognises(source: Source) -> bool:
    return source.is_text and source.head.startswith("LabVIEW Measurement")


def read(source: Source, options: ReadOptions) -> list[Recording]:
    rows = [line.split(source.delimiter) for line in source.lines[:200]]
    said = {row[0].strip(): [c.strip() for c in row[1:]] for row in reversed(rows)}
    names = said.get("X_Value", [])
    units = {
        split_name(name).name: unit
        for name, unit in zip(names, said.get("Y_Unit_Label", []), strict=False)
        if parse_unit(unit) and not split_name(name).unit
    }
    if said.get("X_Dimension", ["Time"])[0].casefold() == "time":
        units["X_Value"] = "s"
    step = next((header_number(c) for c in said.get("Delta_X", []) if c), None)
    if (
        said.get("X_Columns", ["One"])[0] == "No"
        and options.interval_s is None
        and step
    ):
        options = replace(options, interval_s=step)
    rules = Rules(NAME, columns={"time": ("x value",)})
    return read_source(source, rules, replace(options, units=units | options.units))
