"""model.json: a simulation as numbers that anybody can read, and stress from it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.contracts import Array, Chunk, InputError
from softnn.effects import effect
from softnn.fit import Guess, Piece
from softnn.models.units import Units
from softnn.simulate import Term, simulate

if TYPE_CHECKING:
    from softnn.neural import StoredNetwork

VERSION = 1
KIND, NETWORK = "softnn-model", "softnn-network"


@dataclass(frozen=True)
class Stored:
    """A model as stored: base, stiffnesses, effects, and what was learned, if anything.

    `own` holds, per effect and parameter, the values of single recordings by name.
    `simulation` is the model that this one corrects, where that is a stored one too.
    """

    units: Units
    stiffness: Array
    pieces: tuple[Piece, ...]
    own: tuple[dict[str, dict[str, float]], ...]
    needs_simulated: bool
    history: str
    learned: dict[str, Any] | None = None
    simulation: Stored | StoredNetwork | None = None
    source: dict[str, Any] | None = None  # as the file holds it

    def stress(
        self,
        names: Sequence[str],
        chunks: Sequence[Chunk],
        simulated: Sequence[Array | None],
        continued: bool | None = None,
    ) -> list[Array]:
        """Stress (n,) of each history, MPa. Recordings unknown by name are plain."""
        follow = self.history == "continued" if continued is None else continued
        terms = []
        for piece, own in zip(self.pieces, self.own, strict=True):
            values = dict(piece.values)
            for name in piece.effect.per_recording:
                off = piece.effect.off.get(name)
                plain = values[name] if off is None else off
                values[name] = np.array(
                    [own.get(name, {}).get(n, plain) for n in names], float
                )
            terms.append(Term(piece.effect, values))
        out = simulate(self.units, self.stiffness, terms, chunks, follow)
        if self.simulation is not None:
            simulated = self.simulation.stress(names, chunks, simulated, continued)
        if self.needs_simulated:
            plain = simulate(self.units, self.stiffness, [], chunks, follow)
            for i, given in enumerate(simulated):
                if given is None:
                    raise InputError(
                        f"{names[i]}: this model corrects a simulation; the recording "
                        "needs its column simulated_MPa"
                    )
                out[i] = out[i] + given - plain[i]
        if self.learned is not None:
            from softnn.mismatch.learn import features, within
            from softnn.neural import Network

            network = Network.from_dict(self.learned["network"])
            names_ = tuple(self.learned["features"])
            out = [
                o + within(network, features(c, names_))
                for o, c in zip(out, chunks, strict=True)
            ]
        return out


def to_dict(
    guess: Guess,
    recordings: Sequence[str],
    history: str,
    needs_simulated: bool,
    learned: Mapping[str, Any] | None = None,
    simulation: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """A guess as model.json; readable, and stable under writing and reading."""
    effects = []
    for piece in guess.pieces:
        values: dict[str, float] = {}
        own: dict[str, dict[str, float]] = {}
        for p in piece.effect.parameters:
            v = piece.values[p.name]
            if np.ndim(v):
                own[p.name] = {n: float(x) for n, x in zip(recordings, v, strict=True)}
                values[p.name] = float(piece.effect.off.get(p.name, p.default))
            else:
                values[p.name] = float(v)
        effects.append(
            {
                "effect": piece.effect.id,
                "form": piece.effect.form,
                "values": values,
                "units": {p.name: p.unit for p in piece.effect.parameters},
                "own": own,
            }
        )
    return {
        "kind": KIND,
        "version": VERSION,
        "history": history,
        "base": {
            "name": guess.units.name,
            "knots": [float(k) for k in guess.units.knots],
            "relaxation_times_s": [float(t) for t in guess.units.relaxation_times],
            "stiffness_MPa": [float(k) for k in guess.stiffness],
            "corrects_simulated_MPa": needs_simulated,
        },
        "effects": effects,
        "learned": None if learned is None else dict(learned),
        "simulation": None if simulation is None else dict(simulation),
    }


def read_model(path: str | Path) -> Stored | StoredNetwork:
    """A model.json, or the file of a trained network.

    Raises `InputError` naming what is wrong with it.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError("no such file", file=path) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"not a JSON file: {error}", file=path) from None
    return from_dict(data, path)


def from_dict(data: Any, path: Path | None = None) -> Stored | StoredNetwork:
    if isinstance(data, dict) and data.get("kind") == NETWORK:
        from softnn.neural import stored

        try:
            return stored.from_dict(data)
        except InputError as error:
            raise InputError(str(error), file=path) from None
    if not isinstance(data, dict) or data.get("kind") != KIND:
        raise InputError(f"no model.json of softnn (kind is not {KIND!r})", file=path)
    if data.get("version") != VERSION:
        raise InputError(
            f"version is {data.get('version')!r}; this softnn reads {VERSION}",
            file=path,
        )
    try:
        base = data["base"]
        units = Units(
            str(base["name"]),
            tuple(float(k) for k in base["knots"]),
            tuple(float(t) for t in base["relaxation_times_s"]),
        )
        stiffness = np.array(base["stiffness_MPa"], float)
        pieces, own = [], []
        for entry in data["effects"]:
            law = effect(entry["effect"], entry["form"])
            # A shape that the law has got since the file was written is the usual one.
            usual = {k: v for k, v in law.defaults().items() if k in law.shape}
            values = usual | {k: float(v) for k, v in entry["values"].items()}
            law.prepare(values)
            pieces.append(Piece(law, values, ()))
            own.append(
                {
                    k: {n: float(x) for n, x in v.items()}
                    for k, v in entry.get("own", {}).items()
                }
            )
        history = str(data["history"])
        needs = bool(base.get("corrects_simulated_MPa", False))
        inner = data.get("simulation")
        simulation = None if inner is None else from_dict(inner)
    except InputError as error:
        raise InputError(str(error), file=path) from None
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"cannot be read as a model: {error!r}", file=path) from None
    if stiffness.shape != (units.columns,) or not (stiffness >= 0).all():
        raise InputError(
            f"stiffness_MPa must hold {units.columns} numbers of 0 or more", file=path
        )
    return Stored(
        units,
        stiffness,
        tuple(pieces),
        tuple(own),
        needs,
        history,
        data.get("learned"),
        simulation,
        data,
    )
