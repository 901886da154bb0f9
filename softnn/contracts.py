"""The page to read first: what a parameter, a model and an effect are; how input fails.

Units throughout: N, mm, s, MPa, degC; engineering strain and stress, compression
negative. Time is axis 0; every other axis (parameter sets, columns) trails it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class InputError(ValueError):
    """Input that cannot be used. The message has the value, the allowed, and a fix.

    Commands print it in one line and exit with 2. `row` counts lines of the file from
    1, as an editor shows them.
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


def increments(x: Array, before: ArrayLike) -> Array:
    """What each sample (n, ...) adds to that before it, the first to `before`.

    `np.diff` with `prepend`, in a third of the time.

    >>> increments(np.array([1.0, 3.0, 2.0]), 0.0).tolist()
    [1.0, 2.0, -1.0]
    """
    out = np.empty(x.shape)
    np.subtract(x[:1], before, out=out[:1])
    np.subtract(x[1:], x[:-1], out=out[1:])
    return out


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return a hint at the nearest allowed name, or "" if none is near.

    >>> nearest("mullin_softening", ["slack", "mullins_softening"])
    " (did you mean 'mullins_softening'?)"
    >>> nearest("x", ["slack"])
    ''
    """
    near = get_close_matches(name, list(allowed), 1, 0.5)
    return f" (did you mean {near[0]!r}?)" if near else ""


STRESSES = 1e4  # MPa: the largest stress of a recording, or the inverse of the least


@dataclass(frozen=True)
class Parameter:
    """One number a model or an effect needs: its range is declared here, once.

    Fits count the largest stress as 1. In MPa the range of a stress is wider, by what
    the largest stress of a soft material may be: `STRESSES`.

    >>> Parameter("relaxation_time", "s", 1e-3, 1e6, 1.0, "log").check(-1)
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
    per_strain: int = 0  # power of strain it is divided by: -1 is a strain itself

    @property
    def per_stress(self) -> int:
        """Power of stress that it is divided by: -1 is a stress itself.

        >>> Parameter("drift", "MPa/s", 0, 1, 0).per_stress
        -1
        """
        return ("1/MPa" in self.unit) - ("MPa" in self.unit.replace("1/MPa", ""))

    @property
    def allowed(self) -> tuple[float, float]:
        """Least and largest value in MPa, s and degC.

        >>> Parameter("modulus", "MPa", 0.01, 100, 1).allowed
        (1e-06, 1000000.0)
        """
        wide = STRESSES if self.per_stress else 1.0
        low = self.low / wide if self.low > 0 else self.low * wide
        return low, self.high * wide

    def check(self, value: ArrayLike) -> None:
        """Raise `InputError` unless every entry of `value` is `allowed`."""
        low, high = self.allowed
        values = np.atleast_1d(np.asarray(value, dtype=float))
        bad = ~((values >= low) & (values <= high))  # NaN is bad too
        if bad.any():
            unit = "" if self.unit == "-" else f" {self.unit}"
            raise InputError(
                f"{self.name} is {values[bad][0]:.6g}{unit}; "
                f"allowed is {low:.6g} to {high:.6g}{unit}"
            )


# Weights and strains, each (n,) or (n, sets): stress is the weighted sum of what
# branches give for each strain.
Parts = tuple[tuple[Array, Array], ...]


@dataclass(frozen=True)
class Chunk:
    """A stretch of imposed history: `n` samples in time order.

    time_s (n,) never decreases; strain (n,) or (n, sets); temperature_C (n,) or None.
    `branch_strain` is what the viscous branches see; it is `strain` unless somebody
    in front of the model has replaced it. `branch_parts` as in a `Signal`.
    """

    time_s: Array
    strain: Array
    temperature_C: Array | None = None
    branch_strain: Array | None = None
    branch_parts: Parts = ()


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


@dataclass(frozen=True)
class Signal:
    """What passes from rig to sensor, sample by sample: the ports an effect may wrap.

    time_s (n,) and temperature_C (n,) or None; all others (n, sets). `begun_s` is the
    time at which the recording began (a later chunk of it, or a specimen that goes on
    from another recording, cannot tell from time_s). A `before` hook
    sees the strains only; an `after` hook of the material changes `equilibrium` and
    `branches`; one of the sensor changes `stress`, their sum once the material is done.
    Where there are `branch_parts`, branches follow these in place of `branch_strain`.
    """

    time_s: Array
    strain: Array
    branch_strain: Array
    begun_s: float = 0.0
    temperature_C: Array | None = None
    equilibrium: Array | None = None
    branches: Array | None = None
    stress: Array | None = None
    branch_time_s: Array | None = None  # by which branches relax; None: time_s
    branch_parts: Parts = ()

    def having(self, **changes: Any) -> Signal:
        """The same with other fields: `dataclasses.replace`, in a third of the time."""
        new = object.__new__(Signal)
        new.__dict__.update(self.__dict__, **changes)
        return new

    @property
    def branch_clock(self) -> Array:
        """The time (n, 1 or sets) by which branches relax."""
        own = self.branch_time_s
        return self.time_s[:, None] if own is None else own


@dataclass(frozen=True)
class Scales:
    """Typical sizes in a set of recordings: where a search for an effect may start.

    `duration_s` (recordings,) is one value a recording; all others are numbers.
    """

    strain: float  # largest absolute strain
    stress_MPa: float  # largest absolute stress, a high quantile
    interval_s: float  # typical time between samples
    duration_s: Array
    cycles: float = 1.0  # typical number of reversals / 2 in a recording
    temperature_C: float = 0.0  # range of temperature; 0 without the channel
    side: int = 0  # 1 where all is tension, -1 compression, 0 where strain is of both


class Effect(ABC):
    """One piece of physics that a simulation can leave out: a causal operator.

    It acts before the model (on the strain that reaches springs and branches) or
    after it (on their stresses), at its `stage` alone. So effects compose in the order
    rig, material, sensor. Both hooks take a signal and a state, as a model does. State
    None is a virgin specimen; the returned state continues with the next chunk. Hooks
    get checked parameters as arrays that broadcast along `sets`.
    """

    stage: Literal["rig", "material", "sensor"]
    ports: tuple[str, ...]  # the signals it wraps
    parameters: tuple[Parameter, ...]
    off: Mapping[str, float]  # the values at which it vanishes exactly
    amplitude: str  # the parameter its size is proportional to, at least nearly
    per_recording: tuple[str, ...] = ()  # each recording has its own value of these
    carries_over: bool = False  # whether values of some recordings predict others
    some: bool = False  # a mistake in some recordings, hardly ever in most of them
    contains: tuple[str, ...] = ()  # ids of simpler laws that this one can become
    shape: tuple[str, ...] = ()  # at their defaults until the effect is chosen
    scatter: bool = False  # a scale, by which specimens of one material differ
    unmoved: bool = False  # whether it is visible before the strain moves
    needs_temperature: bool = False
    # Whether the stress at one moment changes the result at that moment alone.
    pointwise: bool = True
    on_return: bool = False  # whether only returning strain can show it
    on_reloading: bool = False  # whether viscosity looks alike until the second loading
    spoken: str = ""  # its name in "NAME was left out"; empty: the id in words
    family: str = ""  # what it has in common with laws that may take its place
    where: str = ""  # where in a recording it shows, in the words of the field
    twins: Mapping[str, str] = {}  # id of a lookalike -> the test that separates them
    exempt: Mapping[str, str] = {}  # generic test -> why it cannot hold here
    of_card: bool = False  # comes with a material card; no search tries it
    unknown: frozenset[str] = frozenset()  # forms that a trial keeps from the search

    @property
    def id(self) -> str:
        """The public name, that of the file."""
        return type(self).__module__.rsplit(".", 1)[-1]

    @property
    def form(self) -> str:
        """The form of the law, where an effect has several."""
        return type(self).__name__

    @property
    def second_forms(self) -> tuple[Effect, ...]:
        """Other laws for the same physics, tried once the effect is suspected."""
        return ()

    @property
    def forms(self) -> tuple[Effect, ...]:
        """Every law of it that a search may try."""
        every = (self, *self.second_forms)
        return tuple(
            law for law in every if law.form not in self.unknown and not law.of_card
        )

    def before(
        self, p: Mapping[str, Array], signal: Signal, state: State
    ) -> tuple[Signal, State]:
        """Change `strain` or `branch_strain` on its way to the model."""
        return signal, state

    def after(
        self, p: Mapping[str, Array], signal: Signal, state: State
    ) -> tuple[Signal, State]:
        """Change `equilibrium`, `branches` (material) or `stress` (sensor)."""
        return signal, state

    @abstractmethod
    def starts(self, scales: Scales) -> list[dict[str, Any]]:
        """Return parameter values of a clear but not extreme effect, to start from.

        The first is what a test plants. Values of `per_recording` parameters may be
        arrays (recordings,).
        """

    def closer(self, scales: Scales) -> list[list[dict[str, Any]]]:
        """More starts, in lists of one shape each, once the effect is suspected.

        Needed by effects with a moment, for example, found only from a nearby start.
        """
        return []

    @abstractmethod
    def telltale(self) -> Chunk:
        """Return a strain programme that separates the effect from others."""

    def shown(
        self, chunks: Sequence[Chunk], stress_MPa: Sequence[Array]
    ) -> dict[str, Any] | None:
        """Return values that recordings show by themselves, for any material.

        None if they do not. Used if no candidate model reaches the noise.
        """
        return None

    def possible(
        self,
        values: Mapping[str, Any],
        chunks: Sequence[Chunk],
        stress: Sequence[Array],
    ) -> NDArray[np.bool]:
        """Return the recordings (n,) in which the effect can have these values."""
        return np.ones(len(chunks), bool)

    def within(self, scales: Scales) -> Effect:
        """The same law, its ranges narrowed to what such recordings could show."""
        return self

    def narrowed(self, name: str, low: float = -np.inf, high: float = np.inf) -> Effect:
        """The same law with a narrower range, of a decade at least, of a log scale."""
        law = copy(self)
        law.parameters = tuple(
            replace(
                q,
                low=float(np.clip(low, q.low, q.high / 10)),
                high=float(np.clip(high, 10 * q.low, q.high)),
            )
            if q.name == name
            else q
            for q in self.parameters
        )
        return law

    @property
    def acts_before(self) -> bool:
        """Whether it changes the strain that the model gets."""
        return type(self).before is not Effect.before

    def prepare(self, parameters: Parameters) -> dict[str, Array]:
        """Checked parameters as arrays (1,) or (sets,), as the hooks want them."""
        check_parameters(self.parameters, parameters, self.id)
        return {k: np.atleast_1d(np.asarray(v, float)) for k, v in parameters.items()}

    def defaults(self) -> dict[str, float]:
        """The default of every parameter, with those of `off` switched off."""
        return {p.name: p.default for p in self.parameters} | dict(self.off)
