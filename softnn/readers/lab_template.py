"""Lab template of key;value lines: `PARAMETER;INFO;URL`, then a table.

Units stand in the names and keys, `Specimen Cross-section (cm^2);0.18`. Strains
without a unit are fractions; true and engineering values stand side by side, and the
engineering ones are used.
"""

from __future__ import annotations

from softnn.readers.assemble import read_source
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.recording import Recording

NAME = "lab template (key;value)"


def recognises(source: Source) -> bool:
    if not source.is_text or not source.top:
        return False
    first = [str(c).casefold() for c in source.top[0]]
    return first[:2] == ["parameter", "info"]


def read(source: Source, options: ReadOptions) -> list[Recording]:
    return read_source(source, Rules(NAME, unitless=True), options)
