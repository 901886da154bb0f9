"""Instron Bluehill (2, 3, Universal): raw data and result exports, any language.

Names row, then a units row in parentheses; before them nothing, blank lines, result
tables (`Results Table 1`) or lines such as `Specimen properties : Width,"6.0",mm`.
A leading column holds the specimen's number (`1,Time,...` over `"",...`); several
specimens follow one another. Delimiter and decimal mark follow the computer's
settings, Chinese exports come in GB18030.
"""

from __future__ import annotations

import re

from softnn.readers.assemble import read_source
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.readers.units import parse_unit
from softnn.recording import Recording

NAME = "Instron Bluehill"


def recognises(source: Source) -> bool:
    if re.search(r"^\W*(Results Table \d|Specimen properties ?:)", source.head, re.M):
        return True
    rows = [[str(c) for c in row if c != ""] for row in source.top]
    return any(
        len(row) >= 2
        and all(re.fullmatch(r"\(.+\)", c) for c in row)
        and sum(parse_unit(c) is not None for c in row) * 2 >= len(row)
        for row in rows
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    return read_source(source, Rules(NAME), options)
