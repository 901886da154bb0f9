"""Models of the contract, from springs and dashpots to piecewise-linear ones."""

from softnn.models.linear import (
    Burgers,
    Hooke,
    KelvinVoigt,
    Maxwell,
    StandardLinearSolid,
    Wiechert,
)
from softnn.models.piecewise import PLSLS, PLWiechert, SecondOrderExponential

MODELS = (
    Hooke(),
    KelvinVoigt(),
    Maxwell(),
    StandardLinearSolid(),
    Burgers(),
    Wiechert(),
    PLSLS(),
    PLWiechert(),
    SecondOrderExponential(),
)

__all__ = [
    "MODELS",
    "PLSLS",
    "Burgers",
    "Hooke",
    "KelvinVoigt",
    "Maxwell",
    "PLWiechert",
    "SecondOrderExponential",
    "StandardLinearSolid",
    "Wiechert",
]
