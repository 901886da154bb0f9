"""Separable least squares: stiffnesses exactly, the few other parameters by search.

For fixed parameters of the effects the stress is linear, or nearly so, in the
non-negative stiffnesses of the base. Each step solves one bounded least-squares problem
for the stiffnesses and for the change of the other parameters together. This is
Kaufman's form of variable projection (1975, doi:10.1007/BF01932995), damped as in
Levenberg-Marquardt. The new point is judged with its own optimal stiffnesses. Residuals
are whitened by the noise of each recording (level, and correlation in time).
"""

from softnn.fit.engine import Engine, span
from softnn.fit.point import Data, Guess, Piece, Slot, get, put, slots
from softnn.fit.solve import Fit, _bounded, fit

__all__ = [
    "Data",
    "Engine",
    "Fit",
    "Guess",
    "Piece",
    "Slot",
    "_bounded",
    "fit",
    "get",
    "put",
    "slots",
    "span",
]
