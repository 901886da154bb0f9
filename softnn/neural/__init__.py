"""Neural networks of one layer: input architectures, training, prediction."""

import os

# Read when torch is loaded. Threads that wait by spinning, the default, make training
# ten times slower as soon as anything else runs on the same cores.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from softnn.neural.fitting import fit_samples, run
from softnn.neural.guard import Seen, counted
from softnn.neural.inputs import (
    ARCHITECTURES,
    PUBLISHED,
    Architecture,
    Samples,
    samples,
)
from softnn.neural.levenberg import Settings
from softnn.neural.network import Network, Scaling
from softnn.neural.stored import StoredNetwork
from softnn.neural.training import Regularisation, Trained, train

__all__ = [
    "ARCHITECTURES",
    "PUBLISHED",
    "Architecture",
    "Network",
    "Regularisation",
    "Samples",
    "Scaling",
    "Seen",
    "Settings",
    "StoredNetwork",
    "Trained",
    "counted",
    "fit_samples",
    "run",
    "samples",
    "train",
]
