"""model.json: a simulation as numbers that anybody can read, and stress from it."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from softnn import glance
from softnn.axes import SPECIMEN, Axes, common
from softnn.contracts import Array, Chunk, Effect, InputError, Parameter
from softnn.effects import effect
from softnn.fit import Guess, Piece
from softnn.fit.point import with_stress
from softnn.models import bases
from softnn.models.base import Base
from softnn.models.bases import number
from softnn.recording import Recording, history_of
from softnn.simulate import Term, simulate
from softnn.state import FEATURES, features

if TYPE_CHECKING:
    from softnn.neural import StoredNetwork

VERSION = 1
KIND, NETWORK = "softnn-model", "softnn-network"
HISTORIES = ("fresh", "continued")
SLACK = 0.01  # of the range of strain; less beyond it needs no warning


@dataclass(frozen=True)
class Correction:
    """A stress, MPa, that a network adds for a residual that no effect explains.

    Features are clipped to the ranges of the training, so a slower or longer recording
    does not extrapolate.
    """

    features: tuple[str, ...]  # of `softnn.state`
    network: Any

    def at(self, x: Array) -> Array:
        """Return the output (n,) of the network for features (n, d)."""
        inputs, target = self.network.inputs, self.network.target
        known = self.network.predict(np.clip(x, inputs.low, inputs.high))
        return np.clip(known, target.low, target.high)

    def with_stress(self, one: float) -> Correction:
        """Return the correction in MPa, if a stress of `one` MPa counted as 1."""
        target = self.network.target
        wider = replace(target, low=one * target.low, high=one * target.high)
        return Correction(self.features, replace(self.network, target=wider))

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready; `from_dict` takes it back."""
        return {"features": list(self.features), "network": self.network.to_dict()}

    @classmethod
    def from_dict(cls, given: Any) -> Correction:
        """Raises `InputError` for features that are not known, or are not as many."""
        from softnn.neural import Network

        known = (*FEATURES, "temperature_C")
        names = given["features"]
        if not isinstance(names, list) or not set(names) <= set(known):
            raise InputError(f"learned: features are {names!r}; allowed: {list(known)}")
        network = Network.from_dict(given["network"])
        if len(network.inputs.low) != len(names):
            raise InputError(
                f"learned: a network of {len(network.inputs.low)} inputs, and "
                f"{len(names)} features"
            )
        return cls(tuple(names), network)


@dataclass(frozen=True, repr=False)
class Stored:
    """A stored model: base, stiffnesses, effects, and a learned correction or None.

    `own` holds, per effect and parameter, the values of single recordings by name.
    `simulation` is the stored model that this model corrects, or None.
    """

    units: Base
    stiffness: Array
    pieces: tuple[Piece, ...]
    own: tuple[dict[str, dict[str, float]], ...]
    needs_simulated: bool
    history: str
    learned: Correction | None = None
    simulation: Stored | StoredNetwork | None = None
    source: dict[str, Any] | None = None  # as the file holds it
    axes: Axes = SPECIMEN  # quantities and units of its strain and MPa

    def __repr__(self) -> str:
        laws = dict.fromkeys(p.effect.id for p in self.pieces)
        base = "another simulation" if self.needs_simulated else self.units.name
        told = ", ".join(laws) or "no effects"
        return f"<Model of {self.axes.stress.name}: {base}; {told}>"

    def _repr_html_(self) -> str:
        return glance.model_html(self, max(self.units.reach, key=abs))

    def simulate(
        self,
        history: Recording | ArrayLike,
        strain: ArrayLike | None = None,
        *,
        temperature_C: ArrayLike | None = None,
        simulated_MPa: Array | None = None,
    ) -> Array:
        """Return the stress (n,) over a strain history, MPa.

        `history` is a recording, whose own stress is not used, or times (n,) [s] with
        `strain` (n,). For a component both are in its own units, those of `axes`.
        Values of single recordings are found by name. A model that corrects a
        simulation from elsewhere needs `simulated_MPa` (n,). Warns where the strain
        leaves the range that the model was made from.
        """
        name, chunk = history_of(history, strain, temperature_C)
        if isinstance(history, Recording):
            common({"the model": self.axes, name: history.axes})
        if self.leaves(chunk):
            warnings.warn(f"{name}: {self.range_told()}", stacklevel=2)
        return self.stress([name], [chunk], [simulated_MPa])[0]

    @property
    def _range(self) -> tuple[float, float]:
        low, high = (self.axes.strain.one * x for x in self.units.reach)
        return low, high

    def leaves(self, chunk: Chunk) -> bool:
        """Whether a strain history leaves the range that the model was made from."""
        low, high = self._range
        slack = SLACK * (high - low)
        far = chunk.strain.min() < low - slack or chunk.strain.max() > high + slack
        return bool(far)

    def range_told(self) -> str:
        """What is said of a strain history that leaves the range."""
        low, high = self._range
        unit = f" {self.axes.strain.unit}" if self.axes.component else ""
        return (
            f"{self.axes.strain.name} beyond {low:.4g} to {high:.4g}{unit}, which the "
            "model was made from"
        )

    def stress(
        self,
        names: Sequence[str],
        chunks: Sequence[Chunk],
        simulated: Sequence[Array | None],
        continued: bool | None = None,
    ) -> list[Array]:
        """Return the stress (n,) of each history, in the units of `axes`.

        A recording unknown by name gets the mean of the known ones (the gap of a strip,
        the scale of a specimen), and no fault of a single recording.
        """
        if self.simulation is not None:
            simulated = self.simulation.stress(names, chunks, simulated, continued)
        x, y = self.axes.strain.one, self.axes.stress.one
        chunks = [replace(c, strain=np.asarray(c.strain) / x) for c in chunks]
        simulated = [None if s is None else np.asarray(s) / y for s in simulated]
        return [y * s for s in self._counted(names, chunks, simulated, continued)]

    def _counted(
        self,
        names: Sequence[str],
        chunks: Sequence[Chunk],
        simulated: Sequence[Array | None],
        continued: bool | None,
    ) -> list[Array]:
        """The same in strain and MPa."""
        follow = self.history == "continued" if continued is None else continued
        terms = []
        for piece, own in zip(self.pieces, self.own, strict=True):
            values = dict(piece.values)
            for name in piece.effect.per_recording:
                values[name] = np.array(
                    [own.get(name, {}).get(n, values[name]) for n in names], float
                )
            terms.append(Term(piece.effect, values))
        out = simulate(self.units, self.stiffness, terms, chunks, follow)
        if self.needs_simulated:
            plain = simulate(self.units, self.stiffness, [], chunks, follow)
            for i, given in enumerate(simulated):
                if given is None:
                    raise InputError(
                        f"{names[i]}: this model corrects a simulation; the recording "
                        f"needs its column {self.axes.simulated}"
                    )
                out[i] = out[i] + given - plain[i]
        if self.learned is not None:
            for i, chunk in enumerate(chunks):
                out[i] = out[i] + self.learned.at(
                    features(chunk, self.learned.features)
                )
        return out


def in_units(guess: Guess, axes: Axes) -> tuple[Guess, Axes]:
    """Return a guess as model.json has it, and its axes: of specimens in MPa.

    `axes` say what counts as 1 in the fit. Of a component that stays so.
    """
    if axes.component:
        return guess, axes
    return with_stress(guess, axes.stress.one), SPECIMEN


def to_dict(
    guess: Guess,
    recordings: Sequence[str],
    history: str,
    needs_simulated: bool,
    learned: Correction | None = None,
    simulation: Mapping[str, Any] | None = None,
    axes: Axes = SPECIMEN,
) -> dict[str, Any]:
    """Return a guess as model.json: readable, and stable under writing and reading.

    `axes` are the quantities and units of a component.
    """

    def unit(p: Parameter) -> str:
        size, name = axes.of(p)
        return name if size == 1 else f"{size:g} {name}"

    effects = []
    for piece in guess.pieces:
        values: dict[str, float] = {}
        own: dict[str, dict[str, float]] = {}
        for p in piece.effect.parameters:
            v = piece.values[p.name]
            if np.ndim(v):
                own[p.name] = {n: float(x) for n, x in zip(recordings, v, strict=True)}
                off = piece.effect.off.get(p.name, p.default)
                usual = piece.nuisance or piece.effect.carries_over
                values[p.name] = float(np.mean(v) if usual else off)
            else:
                values[p.name] = float(v)
        effects.append(
            {
                "effect": piece.effect.id,
                "form": piece.effect.form,
                "values": values,
                "units": {p.name: unit(p) for p in piece.effect.parameters},
                "own": own,
            }
        )
    return {
        "kind": KIND,
        "version": VERSION,
        "history": history,
        "base": {
            **guess.units.to_dict(),
            "stiffness_MPa": [float(k) for k in guess.stiffness],
            "corrects_simulated_MPa": needs_simulated,
        },
        "effects": effects,
        "learned": None if learned is None else learned.to_dict(),
        "simulation": None if simulation is None else dict(simulation),
        **({"axes": axes.to_dict()} if axes.component else {}),
    }


def read_model(path: str | Path) -> Stored | StoredNetwork:
    """Return the model of a model.json, or of the file of a trained network.

    Raises `InputError` naming the fault of the file.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_number)
    except FileNotFoundError:
        raise InputError("no such file", file=path) from None
    except RecursionError:
        raise InputError("not a JSON file: nested too deep", file=path) from None
    except IsADirectoryError:
        raise InputError("is a folder; name the model.json in it", file=path) from None
    except (OSError, ValueError) as error:
        other = path.suffix.lower() not in ("", ".json")
        how = "; the model comes first, then the recordings" if other else f": {error}"
        raise InputError(f"not a JSON file{how}", file=path) from None
    return from_dict(data, path)


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number")


def from_dict(data: Any, path: Path | None = None) -> Stored | StoredNetwork:
    """Return the model that a file holds. Raises `InputError`, which names the file."""
    try:
        if isinstance(data, dict) and data.get("kind") == NETWORK:
            from softnn.neural import stored

            return stored.from_dict(data)
        return _stored(data)
    except InputError as error:
        raise InputError(str(error), file=path) from None
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"cannot be read as a model: {error!r}", file=path) from None


def _stored(data: Any) -> Stored:
    if not isinstance(data, dict) or data.get("kind") != KIND:
        raise InputError(f"no model.json of softnn (kind is not {KIND!r})")
    if data.get("version") != VERSION:
        raise InputError(
            f"version is {data.get('version')!r}; this softnn reads {VERSION}"
        )
    base = data["base"]
    units = bases.from_dict(base)
    stiffness = np.array([number(k) for k in base["stiffness_MPa"]])
    if stiffness.shape != (units.columns,) or not (stiffness >= 0).all():
        raise InputError(
            f"stiffness_MPa must hold {units.columns} numbers of 0 or more"
        )
    pieces, own = [], []
    for entry in data["effects"]:
        law = effect(entry["effect"], entry["form"])
        # A shape parameter added since the file was written has its usual value.
        usual = {k: v for k, v in law.defaults().items() if k in law.shape}
        values = usual | {k: float(v) for k, v in entry["values"].items()}
        law.prepare(values)
        pieces.append(Piece(law, values, ()))
        own.append(_own(law, entry.get("own", {})))
    history = str(data["history"])
    if history not in HISTORIES:
        raise InputError(f"history is {history!r}; allowed: {list(HISTORIES)}")
    learned, inner = data.get("learned"), data.get("simulation")
    return Stored(
        units,
        stiffness,
        tuple(pieces),
        tuple(own),
        bool(base.get("corrects_simulated_MPa", False)),
        history,
        None if learned is None else Correction.from_dict(learned),
        None if inner is None else from_dict(inner),
        data,
        Axes.from_dict(data.get("axes")),
    )


def _own(law: Effect, given: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Return values of single recordings, by parameter and name of the recording."""
    declared = {p.name: p for p in law.parameters}
    out: dict[str, dict[str, float]] = {}
    for name, values in given.items():
        if name not in law.per_recording:
            raise InputError(f"{law.id} has no values of single recordings of {name!r}")
        out[name] = {recording: float(x) for recording, x in values.items()}
        declared[name].check(list(out[name].values()))
    return out
