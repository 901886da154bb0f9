"""Packages of the extra `rivals`: found or not, and what to do where one is missing."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from softnn.contracts import InputError

INSTALL = "pip install 'softnn[rivals]'"


def present(package: str) -> bool:
    return importlib.util.find_spec(package) is not None


def load(module: str) -> Any:
    """The module, or an `InputError` that says how to get it."""
    package = module.split(".")[0]
    if not present(package):
        raise InputError(f"{package} is not installed; {INSTALL} has it")
    return importlib.import_module(module)
