"""A column's name with its unit, and what counts as a number."""

from __future__ import annotations

import re
from dataclasses import dataclass

from softnn.readers.source import NUMBER, Cell
from softnn.readers.units import WEIGHTS, parse_unit
from softnn.readers.vocabulary import plain

_BRACKETS = re.compile(r"^(.*?)\s*[\[({]([^\[\](){}]*)[\])}]\s*\.?$", re.DOTALL)
# `Load (N)` in the names of an R data frame is `Load..N.`.
_DOTS = re.compile(r"^(\S*?[^.\s])\.{1,2}([^.\s]+(?:\.[^.\s]+)?)\.$")
_DOTS_ALONE = re.compile(r"^(\S*[^.\s])(\.{4})$")
_BREAK = re.compile(
    r"(?<=\S)(?:\s*/\s*|\s+in\s+|\s*,\s*|\s+-\s+|\s*:\s+|_|\.(?=[A-Za-z%]+$))(?=\S+$)"
)


@dataclass(frozen=True)
class Column:
    """A column's name and its unit as written, "" where none is."""

    name: str
    unit: str

    @property
    def plain(self) -> str:
        return plain(self.name)

    def __str__(self) -> str:
        bare = not self.unit or self.name[:1] + self.name[-1:] in ("[]", "()")
        return self.name if bare else f"{self.name} [{self.unit}]"


def is_number(cell: Cell) -> bool:
    """Whether a cell holds a number, in either decimal mark.

    >>> is_number(1.0), is_number("1,5e-05"), is_number("(N)"), is_number("")
    (True, True, False, False)
    """
    return not isinstance(cell, str) or NUMBER.fullmatch(cell) is not None


def split_name(text: str) -> Column:
    """A name with its unit: `Force (kN)`, `C_1_Temps[s]`, `Force_N`, `Kraft in N`.

    Loose forms count only when the last word is a unit; brackets always do.

    >>> split_name("Force (kN)"), split_name("Size_mm")
    (Column(name='Force', unit='kN'), Column(name='Size', unit='mm'))
    >>> split_name("Spannung in N/mm2"), split_name("Speed_mm/s")
    (Column(name='Spannung', unit='N/mm2'), Column(name='Speed', unit='mm/s'))
    >>> split_name("Load..N."), split_name("Strain.mm.mm.")
    (Column(name='Load', unit='N'), Column(name='Strain', unit='mm/mm'))
    """
    text = text.strip()
    match = _BRACKETS.match(text)
    if match and match[1].strip():
        return Column(match[1].strip(), match[2].strip() or "-")
    for at in _BREAK.finditer(text):  # the first: `Spannung in N/mm2` is no area
        unit = text[at.end() :]
        # `Strain_1` is a name with a number, not a strain in units of one.
        if (parse_unit(unit) or unit in WEIGHTS) and not unit.isdigit():
            return Column(text[: at.start()].strip(), unit)
    match = _DOTS.match(text)
    for unit in (match[2], match[2].replace(".", "/")) if match else ():
        if match and parse_unit(unit):
            return Column(match[1], unit)
    match = _DOTS_ALONE.match(text)
    if match:  # `Strain (%)` or `Strain (-)`: nothing tells which
        return Column(match[1], match[2])
    return Column(text, "")
