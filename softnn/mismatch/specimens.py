"""Which recordings share a specimen, where no labels say so?

Each recording may have its own specimen, or some may share one; both are equally likely
a priori. The partition prior is a Chinese restaurant process (Pitman 2006,
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
from softnn.fit import Fit, get, span

UNSAID = 1.6  # log odds against either kind that nobody wrote down: one case in six


def cost(sizes: Sequence[int]) -> float:
    """Log odds against unsaid specimens of so many recordings each."""
    if max(sizes) == 1:
        return UNSAID
    return UNSAID + lgamma(sum(sizes) + 1) - sum(map(lgamma, sizes))


def sizes(count: int, groups: Sequence[Sequence[int]]) -> list[int]:
    """Recordings of each specimen; those in no group are of the first."""
    mine = [len(group) for group in groups]
    return [count - sum(mine), *mine]


def picked(count: int, wrong: int) -> float:
    """Log odds against so many of the recordings, and these: some are right, some not.

    How many is as open as which.
    """
    return log(max(count - 1, 1) * comb(count, wrong))


def estimated(found: Fit) -> tuple[Array, Array]:
    """Scales of specimens over the first's (k,), and their precision beside all else.

    They are as good as normal, so that what they are drawn from can be integrated out.
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
    """The likeliest specimens, that of the first recording first.

    `found` has an unsaid scale for each recording but the first. Those of specimens are
    normal with one of `scales`; groups are merged while there are two, the pair that
    leaves most at a time.
    """
    at, known = estimated(found)
    count = len(at) + 1

    def value(groups: Sequence[tuple[int, ...]]) -> float:
        member = np.zeros((count, len(groups)))
        for k, group in enumerate(groups):
            member[list(group), k] = 1.0
        over = member[1:] - member[0]  # scales are over that of the first recording
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
    return max(tried, key=value)


def marginal(at: Array, known: Array, weights: Array) -> float:
    """Log density (to a constant) of scales `at` known to that precision.

    They are `weights` (scales, specimens) times independent standard normals.
    """
    inner = np.eye(weights.shape[1]) + weights.T @ known @ weights
    right = weights.T @ (known @ at)
    gain = right @ np.linalg.solve(inner, right) - at @ known @ at
    return 0.5 * float(gain - np.linalg.slogdet(inner)[1])
