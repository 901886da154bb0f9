"""Stress of soft materials: models of it, and what a simulation of it left out."""

from __future__ import annotations

import typing

from softnn.contracts import InputError
from softnn.recording import Geometry, Recording

if typing.TYPE_CHECKING:
    from softnn import neural
    from softnn.mismatch.api import diagnose, load_model, read
    from softnn.mismatch.diagnosis import Diagnosis

__version__ = "0.2.0"

__all__ = [
    "Diagnosis",
    "Geometry",
    "InputError",
    "Recording",
    "__version__",
    "diagnose",
    "load_model",
    "neural",
    "read",
]


# What brings compilers and solvers with it is loaded when first asked for.
_LATER = {
    "Diagnosis": "softnn.mismatch.diagnosis",
    "diagnose": "softnn.mismatch.api",
    "load_model": "softnn.mismatch.api",
    "read": "softnn.mismatch.api",
}


def __getattr__(name: str) -> typing.Any:
    import importlib

    if name == "neural":  # a subpackage, found once it is imported
        return importlib.import_module("softnn.neural")
    if name in _LATER:
        return getattr(importlib.import_module(_LATER[name]), name)
    from softnn.contracts import nearest

    raise AttributeError(
        f"module 'softnn' has no attribute {name!r}{nearest(name, __all__)}"
    )


def __dir__() -> list[str]:
    return sorted(__all__)
