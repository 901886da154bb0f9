"""Templates of C: blocks with a heading, and places to fill in.

A block begins with a line ``/*@ HEADING */``; ``{place}`` is a place for a value.
Numbers are written so that a C compiler reads the same double back; names from outside
pass through `identifier` or `remark`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import numpy as np

from softnn.contracts import InputError

FOLDER = Path(__file__).parent / "templates"
_HEADING = re.compile(r"^/\*@ (.+?) \*/\n", re.M)
_PLACE = re.compile(r"\{(\w+)\}")


def template(name: str) -> str:
    """A whole template, as it lies in the folder."""
    return (FOLDER / name).read_text(encoding="utf-8")


@cache
def blocks(name: str) -> dict[str, str]:
    """Blocks of a template by heading; ``A = B`` repeats what B has.

    >>> sorted(blocks("effects/gain_error.c"))
    ['GainError after']
    """
    parts = _HEADING.split(template(name))
    found: dict[str, str] = {}
    for heading, text in zip(parts[1::2], parts[2::2], strict=True):
        new, same, old = heading.partition(" = ")
        if not same:
            found[heading] = text
        elif old in found:
            found[new] = found[old]
        else:
            for key in [k for k in found if k.split()[0] == old]:
                found[" ".join([new, *key.split()[1:]])] = found[key]
    return found


def fill(text: str, places: Mapping[str, object]) -> str:
    """The text with its places filled: numbers as literals, arrays as lists."""

    def one(match: re.Match[str]) -> str:
        value = places[match[1]]
        if isinstance(value, str):
            return value
        return (
            literals(value) if isinstance(value, np.ndarray | list) else literal(value)
        )

    return _PLACE.sub(one, text)


def literal(value: object) -> str:
    """A number as C has it.

    >>> literal(0.1), literal(-2.0), literal(3), literal(1e300)
    ('0.1', '(-2.0)', '3', '1e+300')
    """
    if isinstance(value, int | np.integer):
        return str(int(value))
    number = float(value)  # type: ignore[arg-type]
    if not np.isfinite(number):
        raise InputError(
            f"the model holds {number}, which is no number to compute with"
        )
    text = repr(number)
    return f"({text})" if number < 0 else text


def literals(values: Iterable[object]) -> str:
    """Numbers of an array, row by row, in lines of a readable length."""
    rows = [
        "{" + literals(v) + "}" if np.ndim(v) else literal(v)  # type: ignore[arg-type]
        for v in values
    ]
    lines, line = [], ""
    for row in rows:
        if line and len(line) + len(row) > 80:
            lines.append(line)
            line = ""
        line += row + ", "
    return "\n        ".join(part.rstrip() for part in [*lines, line]).rstrip(",")


def identifier(name: str) -> str:
    """A name from outside as a C identifier and file name, in lower case.

    >>> identifier("Foam 3 (new).json"), identifier("3*/"), identifier("..")
    ('foam_3_new_json', 'm_3', 'model')
    """
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:40].rstrip("_")
    if not plain:
        return "model"
    return plain if plain[0].isalpha() else f"m_{plain}"


def indented(text: str, by: int = 4) -> str:
    """Lines moved to the right; empty ones stay empty."""
    return "".join(
        " " * by + line if line.strip() else line
        for line in text.splitlines(keepends=True)
    )
