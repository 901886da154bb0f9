"""JSON as this package writes it: numpy numbers as Python's, no number as null."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """The value in the types JSON has.

    >>> plain({"a": np.float64(1), "b": (float("nan"), np.int64(2))})
    {'a': 1.0, 'b': [None, 2]}
    """
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def write(path: Path, value: Any) -> None:
    """Write the value, aside first and then renamed: a reader never sees half."""
    text = json.dumps(plain(value), indent=1, allow_nan=False) + "\n"
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.write_text(text, encoding="utf-8")
    aside.replace(path)
