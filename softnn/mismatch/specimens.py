"""Which recordings share a specimen, where no labels say so?

Each recording may have its own specimen, or some may share a specimen; both are equally
likely a priori. The partition prior is a Chinese restaurant process (Pitman 2006,
doi:10.1007/b11601500): the next recording joins a specimen in proportion to its size.
Two specimens in seven recordings give scales that agree in some recordings and differ
in others; seven separate specimens would not.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb, lgamma, log

import numpy as np

from softnn.contracts import Array
from softnn.fit import Data, Fit, get, span

UNSAID = 1.6  # log odds against unlabelled specimens or mistakes: one case in six


def cost(sizes: Sequence[int]) -> float:
    """Return the log odds against unlabelled specimens of these sizes."""
    if max(sizes) == 1:
        return UNSAID
    return UNSAID + lgamma(sum(sizes) + 1) - sum(map(lgamma, sizes))


def sizes(count: int, groups: Sequence[Sequence[int]]) -> list[int]:
    """Return the number of recordings of each specimen; the first has the rest."""
    mine = [len(group) for group in groups]
    return [count - sum(mine), *mine]


def by_stiffness(
    data: Data, groups: Sequence[tuple[int, ...]]
) -> list[tuple[int, ...]]:
    """Return specimens from soft to stiff: an order without regard to names.

    The stiffness is the ratio of the RMS of stress and strain over the recordings.
    """

    def stiffness(group: tuple[int, ...]) -> float:
        stress = np.concatenate([data.stress_MPa[r] for r in group])
        strain = np.concatenate([data.chunks[r].strain for r in group])
        known = np.isfinite(stress)
        square = float(strain[known] @ strain[known])
        return float(stress[known] @ stress[known]) / max(square, 1e-300)

    return sorted(groups, key=stiffness)


def besides_middle(
    data: Data, groups: Sequence[tuple[int, ...]]
) -> list[tuple[int, ...]]:
    """Return the specimens but that of median stiffness, to which scales refer."""
    middle = by_stiffness(data, groups)[(len(groups) - 1) // 2]
    return [g for g in groups if g != middle]


def picked(count: int, wrong: int) -> float:
    """Return the log odds against this choice of `wrong` recordings out of `count`.

    Every number of wrong recordings is equally likely, and so is every choice.
    """
    return log(max(count - 1, 1) * comb(count, wrong))


def estimated(found: Fit) -> tuple[Array, Array]:
    """Return specimen scales relative to one specimen (k,), and their precision (k, k).

    They are nearly normal, so their distribution over specimens can be integrated out.
    """
    slots, pieces = found.slots, found.guess.pieces
    mine = [j for j, s in enumerate(slots) if s.piece >= 0 and pieces[s.piece].nuisance]
    first = len(found.guess.stiffness)
    columns = np.zeros(found.jacobian.shape[1], bool)
    columns[[first + j for j in mine]] = True
    apart = found.jacobian[:, columns] / [slots[j].typical for j in mine]
    q = span(found.jacobian[:, ~columns])
    apart = apart - q @ (q.T @ apart)
    return np.array([get(found.guess, slots[j]) for j in mine]), apart.T @ apart


def shared(found: Fit, scales: Sequence[float]) -> list[tuple[int, ...]]:
    """Return the likeliest groups of recordings by specimen; scales refer to the first.

    `found` has an unlabelled scale for each recording but one. Scales of specimens are
    normal with one of `scales`. Groups are merged down to two, each time the pair that
    leaves the highest score.
    """
    at, known = estimated(found)
    count = len(at) + 1
    piece = next(p for p in found.guess.pieces if p.nuisance)
    own = [r for (r,) in piece.groups]
    order = [*(r for r in range(count) if r not in own), *own]  # the reference first

    def value(groups: Sequence[tuple[int, ...]]) -> float:
        member = np.zeros((count, len(groups)))
        for k, group in enumerate(groups):
            member[list(group), k] = 1.0
        over = member[1:] - member[0]
        return max(marginal(at, known, s * over) for s in scales if s) - cost(
            [len(g) for g in groups]
        )

    groups: list[tuple[int, ...]] = [(r,) for r in range(count)]
    tried = [groups]
    while len(groups) > 2:
        merged = [
            sorted([g for g in groups if g not in (a, b)] + [tuple(sorted(a + b))])
            for a, b in combinations(groups, 2)
        ]
        groups = max(merged, key=value)
        tried.append(groups)
    likeliest = max(tried, key=value)
    return [tuple(sorted(order[i] for i in group)) for group in likeliest]


def marginal(at: Array, known: Array, weights: Array) -> float:
    """Return the log density (to a constant) of scales `at` (k,) of precision `known`.

    The scales are `weights` (k, specimens) times independent standard normals.
    """
    inner = np.eye(weights.shape[1]) + weights.T @ known @ weights
    right = weights.T @ (known @ at)
    gain = right @ np.linalg.solve(inner, right) - at @ known @ at
    return 0.5 * float(gain - np.linalg.slogdet(inner)[1])
