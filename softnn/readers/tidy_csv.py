"""Tidy CSV, softnn's own: `time_s,strain,stress_MPa` and more, units in the names."""

from __future__ import annotations

from dataclasses import replace

from softnn.axes import axes_of
from softnn.readers.options import ReadOptions
from softnn.readers.source import Source
from softnn.readers.tidy import read_tidy
from softnn.recording import Recording, Step

NAME = "tidy CSV"


def recognises(source: Source) -> bool:
    first = source.head.split("\n", 1)[0].strip("\ufeff\r ")
    names = [name.strip() for name in first.split(",")]
    return "time_s" in names and axes_of(names) is not None


def read(source: Source, options: ReadOptions) -> list[Recording]:
    about = {"specimen": options.specimen, "material": options.material}
    about["test"] = options.test
    recording = read_tidy(source.path, **about, rate_per_s=options.rate_per_s)
    columns = {name.rsplit("_", 1)[0]: name for name in recording.columns}
    arguments = {"dialect": NAME, "columns": columns, "notes": []}
    return [
        replace(
            recording,
            geometry=options.geometry,
            log=(Step("read", arguments), *recording.log),
        )
    ]
