"""A model compiled and loaded: its C step, called from Python."""

from __future__ import annotations

import ctypes
import os
import tempfile

import numpy as np

from softnn.contracts import Array, InputError
from softnn.export.fmu import library
from softnn.export.parts import Options
from softnn.export.source import c_source
from softnn.model_file import Stored
from softnn.neural import StoredNetwork

_EXTRA = """#include "model.h"
unsigned long model_size(void);
unsigned model_flags(const void *state);
void model_run(void *state, long n, const double *step_s, const double *strain,
               double *stress_MPa);
unsigned long model_size(void) { return sizeof(model_state); }
unsigned model_flags(const void *state)
{
    return ((const model_state *)state)->flags;
}
void model_run(void *state, long n, const double *step_s, const double *strain,
               double *stress_MPa)
{
    long i;
    for (i = 0; i < n; i++) {
        stress_MPa[i] = model_step(state, step_s[i], strain[i], 23.0, 0.0);
    }
}
"""


class Compiled:
    """A model as one step, for a controller or a loop: about a microsecond each.

    `step` and `run` go on from where the last call ended; `reset` begins anew. Models
    that need a temperature get 23 degC. Raises `InputError` without a C compiler and
    for what cannot be stepped.
    """

    def __init__(
        self, model: Stored | StoredNetwork, options: Options | None = None
    ) -> None:
        if model.needs_simulated and getattr(model, "simulation", None) is None:
            raise InputError("this model corrects a simulation and cannot run alone")
        header, source = c_source(model, "model", options)
        built = library({"model.h": header, "model.c": source, "extra.c": _EXTRA})
        handle, path = tempfile.mkstemp(suffix=".so")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(built)
            self._library = ctypes.CDLL(path)
        finally:
            os.unlink(path)  # what is loaded stays
        self._library.model_size.restype = ctypes.c_ulong
        self._step = self._library.model_step
        self._step.restype = ctypes.c_double
        self._step.argtypes = [ctypes.c_void_p] + [ctypes.c_double] * 4
        for function in ("model_init", "model_flags", "model_run"):
            getattr(self._library, function).argtypes = [ctypes.c_void_p]
        double = ctypes.POINTER(ctypes.c_double)
        self._library.model_run.argtypes = [
            ctypes.c_void_p,
            ctypes.c_long,
            *3 * [double],
        ]
        self._state = ctypes.create_string_buffer(self._library.model_size())
        self._place = ctypes.addressof(self._state)
        self.reset()

    def reset(self) -> None:
        """A virgin specimen, at rest at zero strain."""
        self._library.model_init(self._place)

    def step(self, step_s: float, strain: float) -> float:
        """Stress [MPa] at the end of a step, over which strain goes straight."""
        return float(self._step(self._place, step_s, strain, 23.0, 0.0))

    @property
    def flags(self) -> int:
        """The flags of the last step: bits of `softnn.neural.guard`."""
        return int(self._library.model_flags(self._place))

    def run(self, time_s: Array, strain: Array) -> Array:
        """Stress (n,) [MPa] over a history (n,); its first step takes no time."""
        double = ctypes.POINTER(ctypes.c_double)
        step = np.diff(np.ascontiguousarray(time_s, float), prepend=time_s[0])
        strain = np.ascontiguousarray(strain, float)
        out = np.empty(len(strain))
        self._library.model_run(
            self._place,
            len(strain),
            *(a.ctypes.data_as(double) for a in (step, strain, out)),
        )
        return out
