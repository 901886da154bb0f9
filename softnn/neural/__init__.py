"""Neural networks of one layer: input architectures, training, prediction."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

# Read when torch is loaded. Threads that wait by spinning, the default, make training
# ten times slower as soon as anything else runs on the same cores.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
# Without this, rounding depends on the memory address of a matrix, and a network on the
# other networks in its batch. It costs nothing measurable.
os.environ.setdefault("MKL_CBWR", "AVX2,STRICT")

from softnn.neural.fitting import fit_samples, run
from softnn.neural.guard import Seen, counted
from softnn.neural.inputs import (
    ARCHITECTURES,
    PUBLISHED,
    Architecture,
    Samples,
    architecture_of,
    samples,
)
from softnn.neural.levenberg import STEADY, Settings, device_of
from softnn.neural.network import (
    BoundedNetwork,
    Network,
    RecurrentNetwork,
    Scaling,
)
from softnn.neural.stored import StoredNetwork
from softnn.neural.training import Regularisation, Trained, train

if TYPE_CHECKING:
    from softnn.neural.estimator import StressNetwork

__all__ = [
    "ARCHITECTURES",
    "PUBLISHED",
    "STEADY",
    "Architecture",
    "BoundedNetwork",
    "Network",
    "RecurrentNetwork",
    "Regularisation",
    "Samples",
    "Scaling",
    "Seen",
    "Settings",
    "StoredNetwork",
    "StressNetwork",
    "Trained",
    "architecture_of",
    "counted",
    "device_of",
    "fit_samples",
    "run",
    "samples",
    "train",
]


def __getattr__(name: str) -> Any:
    if name == "StressNetwork":  # scikit-learn takes a second to load
        from softnn.neural.estimator import StressNetwork

        return StressNetwork
    raise AttributeError(f"module 'softnn.neural' has no attribute {name!r}")
