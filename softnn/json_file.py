"""JSON as this package writes it: arrays as lists, NaN and infinity as null."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """The value in the types JSON has.

    >>> plain({"a": np.array([1.0, np.nan]), "b": np.int64(2), 3: (True, None)})
    {'a': [1.0, None], 'b': 2, '3': [True, None]}
    """
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value.as_posix() if isinstance(value, Path) else value


def write(path: Path, value: Any) -> None:
    """Write the value, aside first and then renamed: a reader never sees half."""
    write_text(path, json.dumps(plain(value), indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text so that the file is the old one or the new one, never half of it.

    Raises `OSError` and leaves nothing behind, as on a full disk.
    """
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        aside.write_text(text, encoding="utf-8")
        aside.replace(path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise
