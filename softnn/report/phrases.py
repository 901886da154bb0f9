"""Numbers and names as a sentence has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def number(value: float | None) -> str:
    """Four digits, or a dash where there is no number."""
    if value is None or not np.isfinite(value):
        return "-"
    return f"{value:.4g}"


def percent(value: float | None) -> str:
    """A fraction in per cent, two digits."""
    if value is None or not np.isfinite(value):
        return "-"
    return f"{100 * value:.0f} %" if value >= 0.1 else f"{100 * value:.2g} %"


def plain(name: str) -> str:
    """The name of an effect as one would say it."""
    return name.replace("_", " ")


def opened(text: str) -> str:
    """A text with a capital letter, to begin a sentence with."""
    return text[:1].upper() + text[1:]


def listed(words: Sequence[str]) -> str:
    """Words in a row.

    >>> listed(["slack", "grip slip", "inertia"])
    'slack, grip slip and inertia'
    """
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last
