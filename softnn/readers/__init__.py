"""File -> Recording: one dialect a file; the only place where units change.

`read` looks at a file's content, never at its name, and asks the dialects of
`READERS` in turn whether they know it. A dialect is a module with `NAME`,
`recognises(source)` and `read(source, options)`; to add one, write the file and name
it in the tuple, before `generic`, which takes any table.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from softnn.contracts import InputError
from softnn.readers import (
    bluehill,
    cellscale,
    dma850,
    eplexor,
    generic,
    lab_template,
    labview,
    mts,
    shimadzu,
    tidy_csv,
    trios,
    walter_bai,
    wavematrix,
    zwick,
)
from softnn.readers.lacking import placed
from softnn.readers.options import ReadOptions
from softnn.readers.source import open_source
from softnn.recording import Recording

READERS = (
    tidy_csv,
    wavematrix,
    lab_template,
    labview,
    cellscale,
    walter_bai,
    mts,
    dma850,
    trios,
    eplexor,
    zwick,
    bluehill,
    shimadzu,
    generic,
)

__all__ = ["READERS", "ReadOptions", "read"]


def read(
    path: str | Path, options: ReadOptions | None = None, **given: Any
) -> list[Recording]:
    """The recordings in one file of a testing machine, text or workbook, maybe gzip.

    `given` are fields of `ReadOptions` (`length_mm=33, area_mm2=18 ...`), for what
    the file does not say. The first log step of each recording holds the dialect,
    the columns used and notes on every choice made.

    Raises `InputError`, one line with file, row and column: for a file that cannot
    be read, an unknown unit, a missing time, section or length, naming the option.
    """
    path = Path(path)
    options = replace(options or ReadOptions(), **given)
    source = open_source(path)
    for dialect in READERS:
        if dialect.recognises(source):
            try:
                return _named(dialect.read(source, options))
            except InputError as error:
                raise placed(error, path) from None
    raise AssertionError("the generic reader takes every file")


def _named(found: list[Recording]) -> list[Recording]:
    """Recordings of one file get names of their own."""
    if len(found) < 2:
        return found
    return [
        replace(r, name=f"{r.name}-{i}", specimen=r.specimen or str(i))
        for i, r in enumerate(found, start=1)
    ]
