"""Neural networks of one tanh layer: input architectures, training, prediction."""

from softnn.neural.inputs import ARCHITECTURES, Architecture, Samples, samples
from softnn.neural.levenberg import Settings
from softnn.neural.network import Network, Scaling
from softnn.neural.training import Regularisation, Trained, train

__all__ = [
    "ARCHITECTURES",
    "Architecture",
    "Network",
    "Regularisation",
    "Samples",
    "Scaling",
    "Settings",
    "Trained",
    "samples",
    "train",
]
