"""Any delimited text or worksheet: delimiter, decimal mark, encoding, names, units.

This reader comes last. It takes every table whose columns name a quantity with a unit,
in the name or in a row below it. The names may be English, German, French, Spanish,
Italian, Chinese or Japanese.
"""

from __future__ import annotations

from softnn.readers.assemble import read_source
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.recording import Recording

NAME = "delimited table"


def recognises(source: Source) -> bool:
    return True


def read(source: Source, options: ReadOptions) -> list[Recording]:
    return read_source(source, Rules(NAME), options)
