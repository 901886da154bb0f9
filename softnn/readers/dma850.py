"""TA Instruments DMA850 (TRIOS .xls or .txt): ramps and holds, a sheet a step.

All steps share the clock `Time`; the details give clamp and specimen, `Length`
"29.0063 mm". Force and displacement are positive in tension. What not every step
carries, as often the strain, is made from force, displacement and geometry.
"""

from __future__ import annotations

import re
from dataclasses import replace

from softnn.readers.assemble import recordings
from softnn.readers.options import ReadOptions, Rules
from softnn.readers.source import Source
from softnn.readers.trios import one_test, steps
from softnn.recording import Recording

NAME = "TA DMA850"


def recognises(source: Source) -> bool:
    names = source.names
    return "instrument type" in names and any(
        re.match(r"(discovery )?dma ?\d*", name) for name in names
    )


def read(source: Source, options: ReadOptions) -> list[Recording]:
    rules = Rules(
        NAME,
        columns={
            "time": ("time", "test time", "step time"),
            "force": ("force", "axial force", "static force"),
            "stress": ("stress", "static stress"),
            "strain": ("strain", "static strain"),
            "displacement": ("displacement", "static displacement"),
        },
    )
    table, decimal = one_test(steps(source), source, options)
    return recordings([table], rules, replace(options, decimal=decimal), source.path)
