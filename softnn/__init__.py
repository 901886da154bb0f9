"""Stress of soft materials: models of it, and what a simulation of it left out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softnn.contracts import InputError
from softnn.recording import Geometry, Recording

if TYPE_CHECKING:
    from softnn.mismatch.api import diagnose, load_model, read

__version__ = "0.1.0"

__all__ = [
    "Geometry",
    "InputError",
    "Recording",
    "__version__",
    "diagnose",
    "load_model",
    "read",
]


def __getattr__(name: str) -> Any:
    # What brings compilers and solvers with it is loaded when first asked for.
    if name in ("diagnose", "load_model", "read"):
        from softnn.mismatch import api

        return getattr(api, name)
    raise AttributeError(f"module 'softnn' has no attribute {name!r}")
