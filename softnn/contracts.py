"""The page to read first: what a parameter and a model are, and how input fails.

Units throughout: N, mm, s, MPa, degC; engineering strain and stress, compression
negative. Time is axis 0; every other axis (parameter sets, columns) trails it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class InputError(ValueError):
    """Input that cannot be used, in one line: what came, what is allowed, what to do.

    Commands print it and exit with 2. `row` counts lines of the file from 1, as an
    editor shows them.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | Path | None = None,
        row: int | None = None,
        column: str | None = None,
    ) -> None:
        self.file, self.row, self.column = file, row, column
        place = [str(file)] if file is not None else []
        if row is not None:
            place.append(f"row {row}")
        if column is not None:
            place.append(f"column {column!r}")
        # A name from outside may hold anything; the message stays one line.
        line = ": ".join(filter(None, [", ".join(place), message]))
        super().__init__(" ".join(line.split()))


@dataclass(frozen=True)
class Parameter:
    """One number a model or an effect needs: its range is declared here, once.

    >>> Parameter("relaxation_time", "s", 1e-3, 1e6, 1.0, "log", "of a branch").check(-1)
    Traceback (most recent call last):
    ...
    softnn.contracts.InputError: relaxation_time is -1 s; allowed is 0.001 to 1e+06 s
    """

    name: str
    unit: str
    low: float
    high: float
    default: float
    scale: Literal["linear", "log"] = "linear"
    meaning: str = ""

    def check(self, value: ArrayLike) -> None:
        """Raise `InputError` unless every entry of `value` is within [low, high]."""
        values = np.atleast_1d(np.asarray(value, dtype=float))
        bad = ~((values >= self.low) & (values <= self.high))  # NaN is bad too
        if bad.any():
            unit = "" if self.unit == "-" else f" {self.unit}"
            raise InputError(
                f"{self.name} is {values[bad][0]:.6g}{unit}; "
                f"allowed is {self.low:.6g} to {self.high:.6g}{unit}"
            )


@dataclass(frozen=True)
class Chunk:
    """A stretch of imposed history: `n` samples in time order.

    time_s (n,) never decreases; strain (n,) or (n, sets); temperature_C (n,) or None.
    `branch_strain` is what the viscous branches see; it is `strain` unless somebody
    in front of the model has replaced it.
    """

    time_s: Array
    strain: Array
    temperature_C: Array | None = None
    branch_strain: Array | None = None


@dataclass(frozen=True)
class Response:
    """Stress of a chunk in its two parts, MPa, each (n,) or (n, sets)."""

    equilibrium: Array
    branches: Array

    @property
    def stress(self) -> Array:
        return self.equilibrium + self.branches


State = Any  # whatever a model needs to go on where a chunk ended; opaque outside it
Parameters = Mapping[str, ArrayLike]


class Model(ABC):
    """A causal operator from strain to stress, applied to a chunk with carried state.

    A whole history is one long chunk and runs at array speed; a controller passes
    chunks of one sample. Both give the same numbers. With `state=None` the specimen
    has been at rest at zero strain for ever; the strain of the first sample is then
    reached in a step.

    A parameter may be a number or an array (sets,): then every response is (n, sets).
    Stress is linear in the parameters named in `linear`, for fixed others, so that a
    fit can solve for them exactly.
    """

    parameters: tuple[Parameter, ...]
    linear: tuple[str, ...] = ()

    @abstractmethod
    def respond(
        self, parameters: Parameters, chunk: Chunk, state: State = None
    ) -> tuple[Response, State]:
        """Equilibrium and branch stress over the chunk, and the state at its end."""

    def apply(
        self, parameters: Parameters, chunk: Chunk, state: State = None
    ) -> tuple[Array, State]:
        """Stress (n,) or (n, sets) over the chunk, MPa, and the state at its end."""
        self.check(parameters)
        response, state = self.respond(parameters, chunk, state)
        return response.stress, state

    def check(self, parameters: Parameters) -> None:
        """Raise `InputError` for a missing, unknown or out-of-range parameter."""
        check_parameters(self.parameters, parameters, type(self).__name__)


def check_parameters(
    declared: tuple[Parameter, ...], given: Parameters, owner: str
) -> None:
    """The one check of parameter names and ranges, for models and effects alike."""
    names = [p.name for p in declared]
    for name in given:
        if name not in names:
            raise InputError(f"{owner} has no parameter {name!r}; it has {names}")
    for parameter in declared:
        if parameter.name not in given:
            raise InputError(f"{owner} needs {parameter.name!r} [{parameter.unit}]")
        parameter.check(given[parameter.name])


