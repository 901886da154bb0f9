"""What tests of the linear models share."""

from __future__ import annotations

import numpy as np
import pytest

from softnn.contracts import Chunk
from softnn.models import MODELS, PLWiechert, SecondOrderExponential

SLS = {"equilibrium_stiffness": 0.8, "stiffness": 1.7, "relaxation_time": 0.6}

BURGERS = {
    "stiffness": 2.0,
    "relaxation_time": 3.0,
    "retarded_stiffness": 0.7,
    "retardation_time": 0.4,
}

with_a_modulus = pytest.mark.parametrize(
    "model",
    [m for m in MODELS if not isinstance(m, SecondOrderExponential | PLWiechert)],
    ids=lambda m: type(m).__name__,
)


def defaults(model):
    return {p.name: p.default for p in model.parameters}


def wander(n=700, irregular=False, seed=0):
    """A strain history that goes up and down, at constant or random steps."""
    rng = np.random.default_rng(seed)
    time = np.arange(n) * 0.01
    if irregular:
        time = np.cumsum(rng.uniform(0.0, 0.02, n))
    return Chunk(time, 0.3 * np.sin(time) + np.cumsum(rng.normal(0, 1e-3, n)))
