"""Other measures of strain and stress, by name -> engineering strain, nominal stress.

The stress needs the stretch and, for true stress, a volume that stays.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from softnn.contracts import Array

Conversion = Callable[[Array], Array]

# Plain names (`vocabulary.plain`): what it is called, and the strain it stands for.
STRAIN: tuple[tuple[re.Pattern[str], str, Conversion], ...] = (
    (
        re.compile(r"\bgreen\b|\blagrang\w* strain\b"),
        "Green-Lagrange strain made engineering strain, sqrt(1 + 2 e) - 1",
        lambda e: np.sqrt(np.maximum(1 + 2 * e, 0.0)) - 1,
    ),
    (
        re.compile(
            r"\b(true|wahre?|vraie?|verdadera?|reale?|hencky|log|logarithmic|natural|"
            r"logarithmique|logaritmica|logarithmische)\b|\u771f"
        ),
        "true strain made engineering strain, exp(e) - 1",
        lambda e: np.expm1(np.minimum(e, 50.0)),
    ),
)
# ... and by which factor of the stretch the nominal stress is larger.
STRESS: tuple[tuple[re.Pattern[str], str, Conversion], ...] = (
    (
        re.compile(
            r"\b(second|2nd|2) (pk|piola)\b|\bpk ?(2|ii)\b|\bkirchhoff (2|ii)\b"
        ),
        "second Piola-Kirchhoff stress made nominal",
        lambda stretch: stretch,
    ),
    (
        re.compile(r"\b(true|wahre?|vraie?|verdadera?|reale?|cauchy|hencky)\b|\u771f"),
        "true stress made nominal, volume taken as constant",
        lambda stretch: 1 / stretch,
    ),
)


def measure(
    name: str, known: tuple[tuple[re.Pattern[str], str, Conversion], ...]
) -> tuple[str, Conversion] | None:
    """The note and the conversion of a plain name; None where it is the usual measure.

    >>> told, convert = measure("green strain", STRAIN)
    >>> float(convert(np.array(0.5 * (1.3**2 - 1))).round(9))
    0.3
    >>> measure("engineering strain", STRAIN) is None
    True
    """
    return next((found[1:] for found in known if found[0].search(name)), None)


def unusual(name: str) -> bool:
    """Whether a plain name is that of another measure, which comes after the usual.

    >>> unusual("cauchy stress"), unusual("stress")
    (True, False)
    """
    return measure(name, (*STRAIN, *STRESS)) is not None
