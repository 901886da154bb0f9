"""Models of `softnn.models` with their parameters, as something to be exported."""

from __future__ import annotations

import numpy as np

from softnn.contracts import InputError, Model, Parameters
from softnn.model_file import Stored
from softnn.models.linear import Branched
from softnn.models.piecewise import PLWiechert, SecondOrderExponential
from softnn.models.units import Units


def stored_of(model: Model, parameters: Parameters) -> Stored:
    """A spring, piecewise or not, beside Maxwell branches, as a stored model.

    From Hooke to PL-Wiechert; `InputError` for others and for several sets of
    parameters. Branch stiffnesses may be negative, as collocation makes them.
    """
    if not isinstance(model, Branched) or isinstance(model, SecondOrderExponential):
        raise InputError(
            f"{type(model).__name__} is no piecewise-linear spring beside branches; "
            "allowed are Hooke to Wiechert, PLSLS and PLWiechert"
        )
    if model.update != "exact":
        raise InputError(f"update is {model.update!r}; only 'exact' can be exported")
    model.check(parameters)
    if any(np.size(v) != 1 for v in parameters.values()):
        raise InputError("several sets of parameters; export one")
    stiffness, times = (v[0] for v in model.prony(parameters))
    knots = np.array([0.0])
    if isinstance(model, PLWiechert):
        knots = np.unique(np.append(model.knots, 0.0))
    ends = np.concatenate([[knots[0] - 1], knots, [knots[-1] + 1]])
    stress = model.equilibrium(parameters, ends[:, None])[:, 0]
    slopes = np.diff(stress) / np.diff(ends)
    name = type(model).__name__.lower()
    units = Units(name, tuple(map(float, ends)), tuple(map(float, times)))
    return Stored(units, np.concatenate([slopes, stiffness]), (), (), False, "fresh")
