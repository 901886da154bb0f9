"""Features of a recording, columns of the effects, and how either becomes a name.

Features are what a regression on state may use. Columns are the changes of stress that
softnn's own effects make at the values their searches start from, so a method that
picks a column has picked an effect.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.rivals.folds import SHARED
from bench.rivals.naming import UNMAPPED
from softnn.contracts import Array, Chunk, Effect
from softnn.effects._kernels import reversals
from softnn.fit import Data, Engine, Fit, Guess, Piece

STATE = (
    "strain",
    "rate",
    "largest_strain",
    "direction",
    "simulated",
    "time",
    "cycles",
    "acceleration",
)
WARM = "temperature_C"
MEMORIES_S = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)

# What a term is taken for, by the features in it. Strain and simulated stress beside
# another feature only say that the effect grows with them, and do not count.
RULES: dict[frozenset[str], str] = {
    frozenset(): "zero_offset",
    frozenset({"strain"}): "nonlinear_elasticity",
    frozenset({"simulated"}): "gain_error",
    frozenset({"strain", "simulated"}): "gain_error",
    frozenset({"largest_strain"}): "permanent_set",
    frozenset({"largest_strain", "direction"}): "mullins_softening",
    frozenset({"direction"}): "friction_hysteresis",
    frozenset({"rate"}): "sensor_lag",
    frozenset({"rate", "strain"}): "strain_dependent_relaxation",
    frozenset({"rate", "direction"}): "nonlinear_viscosity",
    frozenset({"time"}): "load_cell_drift",
    frozenset({"cycles"}): "cyclic_softening",
    frozenset({"acceleration"}): "inertia",
    frozenset({WARM}): "thermal_softening",
}
FACTORS = {"strain", "simulated"}


def meaning(features: Iterable[str], pool: Collection[str]) -> str:
    """The effect that a term of these features stands for, or `UNMAPPED`.

    >>> meaning(["strain", "largest_strain", "direction"], ["mullins_softening"])
    'mullins_softening'
    >>> meaning(["time", "cycles"], ["load_cell_drift"])
    'unmapped'
    """
    whole = frozenset(features)
    name = RULES.get(whole) or RULES.get(whole - FACTORS if whole - FACTORS else whole)
    return UNMAPPED if name is None or name not in pool else name


@dataclass(frozen=True)
class Features:
    """Values (valid, k), each scaled to at most 1, and their names; memories apart."""

    names: tuple[str, ...]
    values: Array
    memories: Array  # (valid, m): strain as it was, fading at several speeds


@dataclass(frozen=True)
class Dictionary:
    """Columns (valid, m), MPa, of root mean square 1, and whose each of them is."""

    values: Array
    effects: tuple[str, ...]  # (m,)
    own: NDArray[np.integer]  # (m,) recording it belongs to alone, or SHARED

    def take(self, which: Array | NDArray[np.integer]) -> Dictionary:
        kept = np.asarray(which, int)
        return Dictionary(
            self.values[:, kept], tuple(self.effects[i] for i in kept), self.own[kept]
        )


def features(engine: Engine, plain: Array) -> Features:
    """Of the recordings, and of the stress `plain` (valid,) that the base gives."""
    data = engine.data
    warm = all(c.temperature_C is not None for c in engine.chunks)
    use_warm = warm and data.scales().temperature_C > 0.5
    names = STATE + ((WARM,) if use_warm else ())
    tables, memories = [], []
    for r, chunk in enumerate(engine.chunks):
        valid = np.isfinite(data.stress_MPa[r])
        table = {k: v[valid] for k, v in state(chunk).items()}
        table["simulated"] = plain[engine.owner == r]
        tables.append(np.stack([table[n] for n in names], axis=1))
        memories.append(memory(chunk)[valid])
    values = np.concatenate(tables)
    if use_warm:
        values[:, -1] -= values[:, -1].mean()
    top = np.abs(values).max(axis=0)
    return Features(
        names, values / np.where(top > 0, top, 1.0), np.concatenate(memories)
    )


def state(chunk: Chunk) -> dict[str, Array]:
    """State features (n,) of a recording, in their own units, all but `simulated`."""
    time, strain = chunk.time_s - chunk.time_s[0], np.asarray(chunk.strain, float)
    step = np.maximum(np.diff(time, prepend=time[0]), 1e-9)
    rate = np.diff(strain, prepend=strain[0]) / step
    if len(rate) > 1:
        rate[0] = rate[1]
    moving = np.abs(rate)
    typical = float(np.median(moving[moving > 0])) if (moving > 0).any() else 1.0
    closed, half = np.zeros((2, len(strain), 1))
    reversals(strain[:, None], 0.1, np.zeros(1), np.zeros((1, 7)), closed, half)
    table = {
        "strain": strain,
        "rate": rate,
        "largest_strain": np.maximum.accumulate(np.abs(strain)),
        "direction": np.where(moving > 0.02 * typical, np.sign(rate), 0.0),
        "time": time,
        "cycles": np.log10(1 + (closed + half)[:, 0] / 2),
        "acceleration": np.gradient(rate) / np.maximum(np.gradient(time), 1e-9)
        if len(rate) > 1
        else 0 * rate,
    }
    if chunk.temperature_C is not None:
        warm = chunk.temperature_C
        known = np.isfinite(warm)
        table[WARM] = (
            np.interp(time, time[known], warm[known]) if known.any() else 0 * time
        )
    return table


def memory(chunk: Chunk) -> Array:
    """Strain through first-order lags of `MEMORIES_S`, (n, lags): what has gone by."""
    step = np.diff(chunk.time_s, prepend=chunk.time_s[0])
    out = np.zeros((len(step), len(MEMORIES_S)))
    for j, time in enumerate(MEMORIES_S):
        keep = np.exp(-step / time)
        y = 0.0
        for i, (k, x) in enumerate(zip(keep, chunk.strain, strict=True)):
            y = k * y + (1 - k) * x
            out[i, j] = y
    return out


def dictionary(engine: Engine, base: Fit, pool: Iterable[Effect]) -> Dictionary:
    """Columns of every effect in the pool, from each start of each of its forms."""
    guess, plain = base.guess, base.stress
    columns: list[Array] = []
    effects: list[str] = []
    own: list[int] = []
    seen: dict[tuple[str, int], list[Array]] = {}
    for effect in pool:
        for law in effect.forms:
            for piece in starts(engine.data, law):
                with_it = Guess(guess.units, guess.stiffness, guess.pieces + (piece,))
                change = engine.run(with_it, False)[0] - plain
                for g in piece.groups or ((SHARED,),):
                    whose = int(g[0])
                    column = (
                        change if whose == SHARED else change * (engine.owner == whose)
                    )
                    size = float(np.sqrt(np.mean(column**2)))
                    if not size > 1e-9 * engine.level:
                        continue
                    column = column / size
                    alike = seen.setdefault((effect.id, whose), [])
                    if any(abs(np.mean(column * c)) > 0.9999 for c in alike):
                        continue
                    alike.append(column)
                    columns.append(column)
                    effects.append(effect.id)
                    own.append(whose)
    values = np.stack(columns, axis=1) if columns else np.zeros((len(plain), 0))
    return Dictionary(values, tuple(effects), np.array(own, int))


def starts(data: Data, law: Effect) -> list[Piece]:
    """A piece for each start of an effect, switched on in every recording."""
    count = len(data.chunks)
    out = []
    for start in law.starts(data.scales()):
        values: dict[str, Any] = law.defaults() | dict(start)
        for p in law.parameters:
            inside = np.clip(values[p.name], p.low, p.high)
            values[p.name] = (
                np.broadcast_to(inside, (count,)).astype(float)
                if p.name in law.per_recording
                else float(inside)
            )
        groups = tuple((r,) for r in range(count)) if law.per_recording else ()
        out.append(Piece(law, values, (), groups))
    return out


def shares(x: Array, target: Array, names: Sequence[str]) -> dict[str, float]:
    """How much worse (n, m) columns account for the target without those of a name.

    As shares of all such losses: columns that lean on each other may have coefficients
    of any size, so sizes say nothing.
    """
    gram, right = x.T @ x, x.T @ target
    whose = np.array(names, dtype=object)

    def gone(kept: NDArray[np.bool]) -> float:
        if not kept.any():
            return 0.0
        part = gram[np.ix_(kept, kept)]
        part = part + np.diag(1e-9 * np.diag(part) + 1e-300)
        return float(right[kept] @ np.linalg.solve(part, right[kept]))

    whole = gone(np.ones(len(names), bool))
    return normalised(
        {n: max(whole - gone(whose != n), 0.0) for n in sorted(set(names))}
    )


def normalised(sizes: Mapping[str, float]) -> dict[str, float]:
    total = sum(sizes.values())
    if not total > 0:
        return {}
    return {n: v / total for n, v in sorted(sizes.items(), key=lambda i: -i[1])}
