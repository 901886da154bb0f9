"""Numbers and names as a sentence has them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softnn.effects import EFFECTS


def number(value: float | None) -> str:
    """Return four digits, or a dash if there is no number."""
    if value is None or not np.isfinite(value):
        return "-"
    return f"{value:.4g}"


def percent(value: float | None) -> str:
    """Return a fraction in per cent, two digits."""
    if value is None or not np.isfinite(value):
        return "-"
    return f"{100 * value:.0f} %" if value >= 0.1 else f"{100 * value:.2g} %"


def sure(probability: float) -> str:
    """Return a probability for a text; never 0 or 100 %.

    >>> sure(0.9996), sure(0.934), sure(0.002)
    ('over 99 %', '93 %', 'under 1 %')
    """
    if probability > 0.99:
        return "over 99 %"
    return "under 1 %" if probability < 0.01 else f"{100 * probability:.0f} %"


def promise(probability: float | None) -> str:
    """Return how likely a recording settles the question, if that is known.

    >>> promise(0.7)
    'That settles it with a probability of 70 %.'
    """
    if probability is None:
        return "There the likely models differ most; whether that settles it is open."
    return f"That settles it with a probability of {sure(probability)}."


def plain(name: str) -> str:
    """Return the name of an effect, from its id, as a sentence has it.

    It fits into "NAME was left out". Other names are words with underscores.

    >>> plain("mullins_softening"), plain("tension_only")
    ('Mullins softening', 'tension-only behaviour')
    """
    spoken = {law.id: law.spoken for law in EFFECTS}
    return spoken.get(name) or name.replace("_", " ").replace("mullins", "Mullins")


def opened(text: str) -> str:
    """Return the text with a capital letter, to begin a sentence."""
    return text[:1].upper() + text[1:]


def listed(words: Sequence[str]) -> str:
    """Return words joined by commas and "and".

    >>> listed(["slack", "grip slip", "inertia"])
    'slack, grip slip and inertia'
    """
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last
