"""Walter+Bai Dion: `S/No`, then `C_1_Force[kN]` with channel numbers or `Force [ kN ]`.

A trailing semicolon on every row. An extensometer (`C_1_Deform1[mm]`) stands beside
the machine's displacement, which is the one a specimen length belongs to.
"""

from __future__ import annotations

import re

from softnn.readers.assemble import read_source
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.recording import Recording

NAME = "Walter+Bai Dion"
_CHANNEL = r"C_\d+_.*\[.*\]$"


def recognises(source: Source) -> bool:
    return source.is_text and any(
        sum(re.match(_CHANNEL, str(cell)) is not None for cell in row) >= 2
        or (str(row[0]) == "S/No" and sum(str(cell).endswith("]") for cell in row) >= 2)
        for row in source.top
        if row
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    return read_source(source, Rules(NAME), options)
