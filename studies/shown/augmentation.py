"""How `studies.augmentation` shows what it found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softnn.study.common import markdown, percent


def headline_of(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """How many networks it helps, and how many it harms, by more than the error."""
    gaps = [(row["gain"], row["gain_error"]) for row in rows]
    return {
        "networks": len(rows),
        "helped": sum(gain > error for gain, error in gaps),
        "harmed": sum(gain < -error for gain, error in gaps),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Errors without and with what is simulated, a row a network."""
    return markdown(
        ["material", "inputs", "unseen", "without", "with", "gain", "error"],
        [
            [
                row["label"],
                row["inputs"],
                row["unseen"],
                *(percent(float(np.mean(row[k])), 1) for k in ("without", "with")),
                percent(row["gain"], 1),
                percent(row["gain_error"], 1),
            ]
            for row in rows
        ],
    )
