"""MTS TestSuite and 793/MPT: `*- (Timed).txt` of a data acquisition.

`Key: value` lines (file path, test, run, date) or the `MTS793|...` line, blank lines,
tab-separated names with trailing blanks, a bare units row. A video extensometer
brings its own clock, `Video Time`, which is not the test's.
"""

from __future__ import annotations

import re

from softnn.readers.assemble import read_source
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.recording import Recording

NAME = "MTS TestSuite"
_HEAD = re.compile(
    r"\AMTS793\||^Test Run:|^Test: *MTS\b|^Data (Header|Acquisition): |"
    r"^File Path:.*\bDAQ\b",
    re.M,
)


def recognises(source: Source) -> bool:
    return source.is_text and _HEAD.search(source.head[:3000]) is not None


def read(source: Source, options: ReadOptions) -> list[Recording]:
    return read_source(source, Rules(NAME), options)
