"""Remarks on a model, for a card or for C."""

from __future__ import annotations

import re

from softnn.model_file import Stored
from softnn.neural import StoredNetwork


def remark(text: object, most: int = 100) -> str:
    """Text from outside for a remark of a C, Abaqus or Ansys file: it ends nothing.

    >>> remark("a */ b\\n#include <x> ** é")
    'a b include x'
    >>> remark("off by 3 %: too much")
    'off by 3 per cent: too much'
    """
    plain = str(text).replace("%", "per cent")  # a sign of its own in some codes
    return " ".join(re.sub(r"[^A-Za-z0-9 ,.;:+()_=-]+", " ", plain).split())[:most]


def described(model: Stored | StoredNetwork) -> str:
    """Return a description of a model, a line for a remark."""
    if isinstance(model, StoredNetwork):
        return f"network {remark(model.architecture)} of {len(model.network.hidden)}"
    effects = ", ".join(piece.effect.id for piece in model.pieces)
    base = remark(model.units.name, 40)
    return f"{base} with {effects}" if effects else base
