"""Walter+Bai Dion: semicolons, `C_1_Force[kN]` names with channel numbers, `S/No`.

A trailing semicolon on every row. An extensometer (`C_1_Deform1[mm]`) stands beside
the machine's displacement, which is the one a specimen length belongs to.
"""

from __future__ import annotations

import re

from softnn.readers.assemble import ReadOptions, Rules, read_source
from softnn.readers.source import Source
from softnn.recording import Recording

NAME = "Walter+Bai Dion"


def recognises(source: Source) -> bool:
    return source.is_text and any(
        sum(re.match(r"C_\d+_.*\[.*\]$", str(cell)) is not None for cell in row) >= 2
        for row in source.top
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    return read_source(source, Rules(NAME), options)
