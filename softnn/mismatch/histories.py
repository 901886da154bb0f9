"""Input of `softnn simulate`, and warnings where a model does not know it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from softnn.axes import Axes
from softnn.contracts import Chunk, InputError
from softnn.model_file import Stored
from softnn.readers.tidy import numbers, table
from softnn.recording import check_columns

FAR = 20.0  # times the largest strain of a model; beyond that no prediction is made


def outside(flags: Any) -> str:
    """Return how many samples lie outside the training range of a network."""
    from softnn.neural import counted

    count = dict(counted(flags))
    del count["samples"]
    total = count.pop("outside")
    by = ", ".join(f"{word} {n}" for word, n in count.items() if n)
    return f", {total} outside the training" + (f" ({by})" if total else "")


def known_by_name(model: Any) -> list[str]:
    """Return the names of recordings for which a corrected model has own values."""
    own: set[str] = set()
    while isinstance(model, Stored):
        own |= {n for piece in model.own for values in piece.values() for n in values}
        model = model.simulation
    return sorted(own)


def beyond(
    model: Any, names: Sequence[str], chunks: Sequence[Chunk], by_name: bool = True
) -> list[str]:
    """Return warnings, a line each, on what a corrected model does not know here.

    `by_name`: whether values of single recordings are looked up by their names.
    """
    if not isinstance(model, Stored):
        return []
    lines = []
    pairs = zip(names, chunks, strict=True)
    far = [name for name, chunk in pairs if model.leaves(chunk)]
    if far:
        lines.append(f"{_some(far)}: {model.range_told()}")
    own = known_by_name(model)
    new = [name for name in names if name not in own]
    if own and new and by_name:
        lines.append(
            f"{_some(new)}: unknown to the model by name; own values of that recording "
            f"are off (it knows {_some(own)}; --like NAME takes those of one)"
        )
    return lines


def check_reach(model: Any, names: Sequence[str], chunks: Sequence[Chunk]) -> None:
    """Raise `InputError` if strain is so large that it must be in per cent."""
    if not isinstance(model, Stored) or model.axes.component:
        return
    reach = max(abs(x) for x in model.units.reach)
    for name, chunk in zip(names, chunks, strict=True):
        top = float(np.abs(chunk.strain).max())
        if top > FAR * reach:
            raise InputError(
                f"strain reaches {top:.4g}, the model was made from up to {reach:.4g}; "
                "is it in per cent? Divide it by 100. If it is right, say --as-is",
                file=name,
                column="strain",
            )


def _some(names: Sequence[str], most: int = 3) -> str:
    """Return names in a line: the first few, and how many more."""
    shown = ", ".join(" ".join(n.split())[:60] for n in names[:most])
    more = len(names) - most
    return f"{shown} and {more} more" if more > 0 else shown


def read_history(file: Path, axes: Axes) -> pd.DataFrame:
    """Return the columns of a recording; the stress may be missing."""
    frame = table(file)
    for column in axes.columns[:2]:
        if column not in frame:
            raise InputError("no such column", file=file, row=1, column=column)
    known = (*axes.columns, "temperature_C", axes.simulated)
    columns = {c: numbers(frame[c], file) for c in known if c in frame}
    check_columns({c: columns[c] for c in axes.columns[:2]}, str(file), first_row=2)
    return pd.DataFrame(columns)
