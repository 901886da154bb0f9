"""Stress of soft materials: models of it, and what a simulation of it left out."""

from softnn.contracts import InputError
from softnn.recording import Geometry, Recording

__version__ = "0.1.0"

__all__ = ["Geometry", "InputError", "Recording", "__version__"]
