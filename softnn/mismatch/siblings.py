"""Recordings of one programme beside each other: which are out of line?

Where no law here comes near a material, what a rig or a channel did to some recordings
is lost in what the law misses in all. Recordings of one programme miss the same at the
same place of it. So what they could share is taken out, and an effect that then sets
some of them apart from the others is there, whatever the material does.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from softnn.contracts import Array, Chunk, Effect
from softnn.effects._signs import FEWEST, minority
from softnn.fit import Engine, Fit, Piece, span
from softnn.mismatch.forms import distortions, free_columns
from softnn.mismatch.locate import turns
from softnn.mismatch.screen import Screen, only, start_pieces

BAND = 0.05  # of the largest strain: less is no way back
ALIKE = (0.15, 1.5)  # difference of strain between two turns, ratio of their times
AGREE = 0.8  # of the ways between turns that must be alike (a pull to failure is not)
PLACES = (4, 20, 80)  # of what is shared: a way at least, at most, in all
SHARE = 0.15  # of what is not shared, that an effect must take up
RIDGE = 1e-6  # of the normal equations of the amplitudes


def odd_ones(engine: Engine, found: Fit, pool: Sequence[Effect]) -> Piece | None:
    """The effect of the pool that sets some siblings apart, with their values."""
    family = siblings(engine)
    if len(family) < FEWEST:
        return None
    columns = [shared(engine, family), distortions(engine, found)]
    screen = Screen(engine, found)
    screen.q = span(
        np.concatenate([free_columns(found), *map(engine.whiten, columns)], axis=1)
    )
    screen.residual = found.residual - screen.q @ (screen.q.T @ found.residual)
    own = np.isin(engine.owner, family)
    best, most = None, SHARE * float(np.sum(screen.residual[own] ** 2))
    for law in pool:
        if law.amplitude not in law.per_recording:
            continue
        for piece in start_pieces(engine, law):
            atoms = screen.atoms(piece)[:, family]
            factors, gain = _amplitudes(atoms, screen.residual)
            odd = minority(factors)
            if gain > most and len(odd):
                best, most = only(piece, family[odd]), gain
    return best


def siblings(engine: Engine) -> Array:
    """Indices of the recordings of one programme, the largest such set."""
    top = engine.data.scales().strain
    ways = [_ways(c, top) for c in engine.chunks]
    sets = [[j for j, b in enumerate(ways) if _alike(a, b)] for a in ways]
    return np.array(max(sets, key=len), int)


def shared(engine: Engine, family: Array) -> Array:
    """Changes of stress (valid, k) that siblings have at one place of the programme.

    A place is how many ways between turns are gone, and how much of the present one.
    """
    top = engine.data.scales().strain
    longest = float(engine.data.scales().duration_s.max())
    gone = [_gone(c, top, longest) for c in engine.chunks]
    ways = int(max(g.max() for g in gone))
    each = int(np.clip(PLACES[2] // ways, *PLACES[:2]))
    place = np.concatenate(gone)[engine.valid] * each
    left = np.minimum(place.astype(int), ways * each - 1)
    columns = np.zeros((len(place), ways * each + 1))
    row = np.arange(len(place))
    columns[row, left] = 1 - (place - left)
    columns[row, left + 1] = place - left
    columns[~np.isin(engine.owner, family)] = 0.0
    return columns[:, columns.any(axis=0)]


def _ways(chunk: Chunk, top: float) -> Array:
    """Strain and time (ways, 2) between one turn and the next."""
    turn = _turns(chunk.strain, top)
    return np.stack([np.diff(chunk.strain[turn]), np.diff(chunk.time_s[turn])], axis=1)


def _turns(strain: Array, top: float) -> Array:
    """Indices of turning points, without a first one that leads nowhere."""
    out = turns(strain, BAND * top)
    if len(out) > 2 and abs(strain[out[1]] - strain[0]) < BAND * top:
        out = np.delete(out, 1)
    return out


def _alike(a: Array, b: Array) -> bool:
    """Whether two programmes are one; the first way, to the specimen, may differ."""
    n = min(len(a), len(b))
    if n < 2 or abs(len(a) - len(b)) > 1:
        return False
    strain, time = np.moveaxis(np.stack([a[1:n], b[1:n]]), 2, 0)
    apart, ratio = ALIKE
    same = np.abs(np.diff(strain, axis=0)[0]) < apart * np.abs(strain).max(axis=0)
    same &= time.max(axis=0) < ratio * time.min(axis=0)
    return bool(same.mean() >= AGREE)


def _gone(chunk: Chunk, top: float, longest: float) -> Array:
    """Ways gone (n,), with the part of the present one, by strain and by time."""
    strain, time = chunk.strain, chunk.time_s
    step = np.abs(np.diff(strain)) / top + np.diff(time) / longest
    arc = np.concatenate([[0.0], np.cumsum(step)])
    out = np.zeros(len(arc))
    for k, (a, b) in enumerate(pairwise(_turns(strain, top))):
        part = (arc[a : b + 1] - arc[a]) / max(arc[b] - arc[a], 1e-12)
        out[a : b + 1] = k + part
    return out


def _amplitudes(atoms: Array, residual: Array) -> tuple[Array, float]:
    """Multiples (recordings,) of the atoms that fit the residual; gain of chi2."""
    norm = np.linalg.norm(atoms, axis=0) + 1e-300
    unit = atoms / norm
    gram = unit.T @ unit + RIDGE * np.eye(len(norm))
    right = unit.T @ residual
    found = np.linalg.solve(gram, right)
    return found / norm, float(right @ found)
