"""A card of a material, whatever code it is of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from softnn.cards import abaqus, ansys, febio
from softnn.cards.given import UNITS, Given
from softnn.contracts import Array, InputError, nearest

READERS = {
    ".inp": abaqus.read,
    ".mac": ansys.read,
    ".ans": ansys.read,
    ".dat": ansys.read,
    ".feb": febio.read,
}
NEAR = 10.0  # times the stress recorded, or a tenth: a unit that fits, no other does


def is_card(name: str) -> bool:
    """Return whether a name is that of a card, with or without `#MATERIAL`.

    >>> is_card("a/card.inp"), is_card("card.feb#tyre"), is_card("yeoh-prony")
    (True, True, False)
    """
    return Path(name.partition("#")[0]).suffix.lower() in READERS


def read_card(name: str, unit: str | None = None) -> Given:
    """Return the card in a file; `FILE#NAME` is one of several materials in it.

    `unit` is that of its stresses, where given. Raises `InputError`.
    """
    file, _, wanted = name.partition("#")
    path = Path(file)
    if not path.is_file():
        raise InputError("no such file", file=path)
    found = READERS[path.suffix.lower()](path)
    names = [one.name for one in found]
    if wanted:
        found = [one for one in found if one.name.lower() == wanted.lower()]
        if not found:
            raise InputError(
                f"no material {wanted!r}{nearest(wanted, names)}; it has "
                f"{', '.join(names)}",
                file=path,
            )
    if len(found) > 1:
        raise InputError(
            f"has {len(found)} materials with a law: {', '.join(names)}; name one, as "
            f"{path.name}#{names[0]}",
            file=path,
        )
    if unit is not None:
        check_unit(unit)
        return replace(found[0], unit=unit)
    return found[0]


def check_unit(unit: str) -> None:
    if unit not in UNITS:
        raise InputError(
            f"no unit of stress {unit!r}{nearest(unit, UNITS)}; allowed: "
            f"{', '.join(UNITS)}"
        )


def with_unit(card: Given, strain: Array, stress_MPa: Array) -> Given:
    """Return the card with its unit, told by recordings where the file does not say it.

    Exactly one unit must bring the card to within `NEAR` times the stress recorded;
    else `InputError` asks for it. A unit that the file says stays, with a note where
    another one alone comes near: a comment may tell of something else.
    """
    good = np.isfinite(strain) & np.isfinite(stress_MPa)
    model = card.base().undamped(strain[good]) * card.young
    size = float(np.linalg.norm(stress_MPa[good])) / max(
        float(np.linalg.norm(model)), 1e-300
    )
    fits = [u for u, one in UNITS.items() if 1 / NEAR < size / one < NEAR]
    if card.unit:
        if len(fits) != 1 or card.unit in fits:
            return card
        note = (
            f"stresses of the card are said to be in {card.unit}, and {fits[0]} alone "
            f"comes near the recordings; if that is meant, say --card-unit {fits[0]}"
        )
        return replace(card, notes=(*card.notes, note))
    if len(fits) != 1:
        why = f"{' and '.join(fits)} would do" if fits else "none brings it near"
        raise InputError(
            f"the card of {card.name} does not say its unit of stress, and the "
            f"recordings do not tell it ({why}); say --card-unit MPa, or one of "
            f"{', '.join(list(UNITS)[1:])}"
        )
    note = f"stresses of the card are in {fits[0]}: no other unit comes near"
    return replace(card, unit=fits[0], notes=(*card.notes, note))
