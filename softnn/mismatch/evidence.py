r"""How well a set of effects accounts for recordings: its marginal likelihood.

.. math:: y = base + \sum_k c_k(t)\,(1 + w_k \cdot r(x_t)) + v \cdot d(x_t, t) + noise

c_k is the stress that effect k adds. No law is exact. The form error w_k, normal with
scale tau, changes each effect by smooth functions r of the state x and by a small
delay. The discrepancy v, normal with scale a, is any other error that is smooth in the
state or in the time of a recording (Kennedy and O'Hagan 2001,
doi:10.1111/1467-9868.00294). Smooth functions are random Fourier features (Rahimi and
Recht 2007). Free parameters of the fit are projected out; w and v are integrated out
exactly. tau and a take the best of a few values, with their priors. The noise has heavy
tails: see `Linear`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotrf, dtrtrs

from softnn.contracts import Array
from softnn.fit import Engine, Fit, Slot, get, span
from softnn.mismatch.base import CLASS
from softnn.mismatch.discrepancy import (
    by_recording,
    fourier,
    states,
    trailing,
    unwritten,
)
from softnn.mismatch.specimens import cost, picked, sizes
from softnn.mismatch.tails import WIDE, shares

BENDS, SHARED = 30, 40  # functions of the state: form errors, discrepancy
LAGS = (3.0, 30.0)  # delays of an effect, in typical intervals
FORM = (0.0, 0.03, 0.1, 0.3)  # tau, form error relative to the effect
ELSE = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1)  # a, relative to the largest stress
SCATTER = (0.0, 0.01, 0.02, 0.04)  # spread of specimen scales
MISTAKE = (0.03, 0.1, 0.3, 1.0)  # size of the error of a mis-scaled recording
# Form errors, three kinds of discrepancy, specimen scales, mis-scaled recordings.
GRIDS = (FORM, ELSE, ELSE, ELSE, SCATTER, MISTAKE)
OWN_TIME, APART, WRONG = 3, 4, 5  # indices into `GRIDS`
FORM_PRIOR = 0.1  # half-normal scale of tau
SCATTER_PRIOR = 0.025  # of SCATTER: elastomers differ by some per cent
EXACT = 0.88  # prior probability that laws are exact and complete
ELSE_PRIOR = 0.0003  # scale of a, if the effects are meant to explain everything
# Products of nearly equal columns are rounding errors: add the least that works.
ROUNDING, ROUNDED = (1e-10, 1e-9, 1e-8), 1e-12
MOST = 0.03  # largest share of samples that may be outliers
SEED = 1

Top = tuple[list[int], float]  # a point of `GRIDS` and its score


@dataclass(frozen=True)
class Evidence:
    """Logarithms of marginal likelihoods, without the prior of the set, in nats.

    `bare`: exact laws. `alone`: exact laws, or a form error and a slight discrepancy.
    `beside`: a further discrepancy of any size. `form`, `beside_size` and `scatter` are
    the best scales of form error, discrepancy and specimens.
    """

    bare: float
    alone: float
    beside: float
    form: float
    beside_size: float
    scatter: float
    numbers: int  # free parameters of the effects, and springs of a finer base


class Weigher:
    """Computes the evidence of fits to one set of recordings."""

    def __init__(self, engine: Engine, base: Fit) -> None:
        self.engine, self.stiffness = engine, base.guess.stiffness
        rng = np.random.default_rng(SEED)
        x = states(engine)
        self.bends = fourier(x, BENDS, rng)
        self.shared = engine.level * fourier(x, SHARED, rng)
        self.stiffer = base.stress[:, None] * fourier(x, SHARED, rng)
        self.own = engine.level * by_recording(engine)
        self.unseen = unwritten(engine, base)
        self._white: tuple[int, Array, Array, Array] | None = None

    def weigh(self, found: Fit, whole: bool = True) -> Evidence:
        """Return the evidence of a fit under the noise that the engine weighs by.

        Unless `whole`, `beside` is not computed: it is the score with a slight
        discrepancy.
        """
        engine = self.engine
        if self._white is None or self._white[0] != engine.noises:
            both = np.concatenate([self.shared, self.stiffer, self.own], axis=1)
            other, unseen = engine.whiten(both), engine.whiten(self.unseen)
            self._white = engine.noises, other, unseen, other.T @ other
        _, other, unseen, products = self._white
        bent = [self.bent(change) for change in changes(engine, found)]
        form = (
            engine.whiten(np.concatenate(bent, axis=1))
            if bent
            else np.zeros((len(other), 0))
        )
        free, apart, wrong, had = scattered(found)
        # Scales are weighed from zero, not from their fitted values.
        line = Linear(
            found.residual + had,
            np.concatenate([form, apart, wrong], axis=1),
            other,
            products,
            span(np.concatenate([free, unseen], axis=1)),
            engine.begins,
        )
        unsaid = against(found)
        there = {0: form.shape[1], APART: apart.shape[1], WRONG: wrong.shape[1]}
        widths = [*there.values(), SHARED, SHARED, self.own.shape[1]]
        kinds = np.repeat([*there, 1, 2, 3], widths)  # indices into `GRIDS`
        norm = engine.log_norm - 0.5 * len(other) * np.log(2 * np.pi) - chosen(found)

        def value(line: Linear, scales: Array, free: bool) -> float:
            prior = (scales[0] / FORM_PRIOR) ** 2
            prior += (scales[APART] / SCATTER_PRIOR) ** 2
            slight = [] if free and scales[OWN_TIME] > CLASS else [scales[OWN_TIME]]
            slight += [] if free else [*scales[1:OWN_TIME]]
            prior += sum((a / ELSE_PRIOR) ** 2 for a in slight)
            prior += 2 * unsaid * bool(scales[APART])
            return norm + line.value(scales[kinds]) - 0.5 * prior

        def top(line: Linear, free: bool, *starts: Sequence[int]) -> Top:
            tops = [climb(lambda s: value(line, s, free), p, moved) for p in starts]
            return max(tops, key=lambda top: top[1])

        nothing = [0] * len(GRIDS)
        nothing[APART] = 2 if there[APART] else 0
        moved = [k for k in range(len(GRIDS)) if there.get(k, 1)]
        lines, alone = [line], [top(line, False, nothing)]
        beside = alone
        if whole:
            place = alone[0][0]
            more = sum(a <= CLASS for a in GRIDS[OWN_TIME][:-1])  # class of the machine
            wide = [*place[:OWN_TIME], more, *place[APART:]]
            beside = [top(line, True, place, wide)]
            at = beside[0][0]
            # Each of these is a lower bound; the likeliest set of outliers counts.
            for scales in map(scales_at, [at] if at == place else [at, place]):
                lines.append(copy(line))
                if len(lines[-1].excuse(scales[kinds])):
                    alone.append(top(lines[-1], False, place))
                    beside.append(top(lines[-1], True, alone[-1][0], at))
        place, slight = max(alone, key=lambda top: top[1])
        at, any_size = max(beside, key=lambda top: top[1])
        law = scales_at([0] * APART + place[APART:])
        bare = max(value(line, law, False) for line in lines)
        return Evidence(
            bare,
            float(np.logaddexp(bare + np.log(EXACT), slight + np.log1p(-EXACT))),
            any_size,
            GRIDS[0][place[0]],
            max(ELSE[i] for i in at[1:APART]),
            SCATTER[place[APART]],
            sum(worth(found, s) for s in found.slots) + self.further(found),
        )

    def further(self, found: Fit) -> int:
        """Return how many more springs and branches a fit uses on a finer grid."""
        mine, base = found.guess.stiffness, self.stiffness
        if len(mine) == len(base):
            return 0
        return max(int(np.count_nonzero(mine) - np.count_nonzero(base)), 0)

    def bent(self, change: Array) -> Array:
        """Return form errors of scale one of an effect as columns (valid, k), MPa."""
        engine = self.engine
        interval = engine.data.scales().interval_s
        time = np.concatenate([c.time_s for c in engine.chunks])[engine.valid]
        late = [
            trailing(change, time, engine.owner, k * interval) - change for k in LAGS
        ]
        return np.concatenate(
            [change[:, None] * self.bends, np.stack(late, axis=1)], axis=1
        )


class Linear:
    """Linear model of a whitened residual (n,): columns with normal or free weights.

    `mine` and `other` (n, k in all) are the columns with normal weights; `products` are
    the products of `other` with itself. `q` (n, j) spans the columns with free weights.
    Outliers: the density of a sample is a mixture of a narrow and a wide normal. It is
    bounded from below by one normal density for each sample, which touches it at the
    residual (Box and Tiao 1968, doi:10.1093/biomet/55.1.119; Jaakkola and Jordan 2000,
    doi:10.1023/A:1008932416310).
    """

    def __init__(
        self,
        residual: Array,
        mine: Array,
        other: Array,
        products: Array,
        q: Array,
        begins: NDArray[np.bool_],
    ) -> None:
        self.columns, self.q, self.begins = (mine, other), q, begins
        self.residual = residual - q @ (q.T @ residual)
        across = mine.T @ other
        gram = np.block([[mine.T @ mine, across], [across.T, products]])
        self.taken = np.concatenate([q.T @ mine, q.T @ other], axis=1)
        rounded = ROUNDED * np.diag(gram)  # differences of large products are not exact
        gram -= self.taken.T @ self.taken
        gram[np.diag_indices_from(gram)] += rounded
        self.gram = gram
        self.right = np.concatenate([self.residual @ mine, self.residual @ other])
        self.square = float(self.residual @ self.residual)
        self.cost = 0.0  # price of the outliers

    def value(self, scale: Array) -> float:
        """Return the log evidence (to a constant) for weights (k,) of these scales."""
        return gained(self.gram, self.right, scale) - 0.5 * self.square - self.cost

    def left(self, scale: Array) -> Array:
        """Return the residual (n,) at the likeliest weights of these scales."""
        live = np.flatnonzero(scale)
        s, (mine, other) = scale[live], self.columns
        inner = self.gram[np.ix_(live, live)] * np.outer(s, s)
        inner[np.diag_indices_from(inner)] += 1 + ROUNDING[0] * np.diag(inner)
        weight = np.zeros(len(scale))
        weight[live] = s * np.linalg.solve(inner, self.right[live] * s)
        made = mine @ weight[: mine.shape[1]] + other @ weight[mine.shape[1] :]
        return self.residual - made + self.q @ (self.q.T @ made)

    def excuse(self, scale: Array) -> NDArray[np.integer]:
        """Down-weight likely outliers at the best weights of these scales; call once.

        Returns the indices of the outliers.
        """
        z = 0.5 * self.left(scale) ** 2
        share, _ = shares(z, self.begins)
        off = np.flatnonzero(share > 0.5)
        off = np.sort(off[np.argsort(-z[off], kind="stable")][: int(MOST * len(z))])
        if not len(off):
            return off
        can = np.full(len(z), -np.inf)
        can[off] = z[off]
        share, odds = shares(can, self.begins)
        less = share[off] * (1 - WIDE**-2)  # of a square, where the bound touches
        weight = 1 - less
        q = self.q[off]
        inner = np.eye(len(off)) - q @ q.T
        inner[np.diag_indices_from(inner)] += weight / (1 - weight)
        shift = cho_factor(inner, lower=True)
        self.cost = float(less @ z[off]) - odds
        rows = np.concatenate([c[off] for c in self.columns], axis=1) - q @ self.taken
        freed = cho_solve(shift, np.column_stack([rows, self.residual[off]]))
        self.gram = self.gram - rows.T @ freed[:, :-1]
        self.right = self.right - rows.T @ freed[:, -1]
        self.square -= float(self.residual[off] @ freed[:, -1])
        return off


def scales_at(place: Sequence[int]) -> Array:
    """Return the scales at a point of `GRIDS`."""
    return np.array([g[i] for g, i in zip(GRIDS, place, strict=True)])


def climb(
    value: Callable[[Array], float],
    start: Sequence[int],
    moved: Sequence[int],
) -> tuple[list[int], float]:
    """Return the best point of `GRIDS` uphill from `start`, one coordinate at a time.

    `moved`: the coordinates that may change.
    """
    known: dict[tuple[int, ...], float] = {}

    def at(place: Sequence[int]) -> float:
        key = tuple(place)
        if key not in known:
            known[key] = value(scales_at(key))
        return known[key]

    place = list(start)
    while True:
        before = list(place)
        for k in moved:
            for step in (1, -1):
                while 0 <= place[k] + step < len(GRIDS[k]):
                    trial = [*place[:k], place[k] + step, *place[k + 1 :]]
                    if at(trial) <= at(place):
                        break
                    place = trial
        if place == before:
            return place, at(place)


def gained(gram: Array, right: Array, scale: Array) -> float:
    """Return the log evidence gained by columns with normal weights of these scales.

    `gram` (k, k) and `right` (k,) are products of the whitened columns with each other
    and with the residual. The weights are integrated out, as in the Bayesian linear
    model of textbooks.

    >>> gained(np.eye(1), np.array([2.0]), np.array([1.0])).__round__(4)
    0.6534
    """
    live = np.flatnonzero(scale)
    if not len(live):
        return 0.0
    s = scale[live]
    inner = gram[np.ix_(live, live)] * np.outer(s, s)
    most = np.diag(inner).max()
    inner[np.diag_indices_from(inner)] += 1
    for rounding in ROUNDING:
        inner[np.diag_indices_from(inner)] += rounding * most
        low, failed = dpotrf(inner, lower=1)
        if not failed:
            break
    else:
        raise np.linalg.LinAlgError("columns of a discrepancy are no numbers")
    z, _ = dtrtrs(low, right[live] * s, lower=1)
    return float(0.5 * (z @ z) - np.log(np.diag(low)).sum())


def worth(found: Fit, slot: Slot) -> int:
    """Return how many parameters a slot counts as in the price of a model.

    A moment counts twice: its error falls with the sample interval, not with the square
    root of the interval (Zhang and Siegmund 2007,
    doi:10.1111/j.1541-0420.2006.00662.x). Scales count zero: they have their own prior.
    """
    if slot.piece < 0:
        return 1
    piece = found.guess.pieces[slot.piece]
    if piece.nuisance or mistaken(found, slot):
        return 0
    law = piece.effect
    return 1 + (slot.name in law.per_recording and slot.name != law.amplitude)


def mistaken(found: Fit, slot: Slot) -> bool:
    """Return whether a slot is the scale of a mis-scaled recording (it has a prior)."""
    piece = found.guess.pieces[slot.piece] if slot.piece >= 0 else None
    return piece is not None and piece.effect.scatter and not piece.nuisance


def against(found: Fit) -> float:
    """Return the log odds against specimens without labels; 0 if the fit has none."""
    unsaid = [p for p in found.guess.pieces if p.unsaid]
    counts = [len(p.values[p.effect.amplitude]) for p in unsaid]
    return sum(cost(sizes(n, p.groups)) for n, p in zip(counts, unsaid, strict=True))


def chosen(found: Fit) -> float:
    """Return the log odds against this choice of mis-scaled recordings.

    The sizes of their errors have a prior of their own.
    """
    wrong = [p for p in found.guess.pieces if p.effect.scatter and not p.nuisance]
    counts = [len(p.values[p.effect.amplitude]) for p in wrong]
    return sum(
        picked(n, sum(map(len, p.groups))) for n, p in zip(counts, wrong, strict=True)
    )


def scattered(found: Fit) -> tuple[Array, Array, Array, Array]:
    """Whitened columns: free parameters, specimen scales, mis-scaled recordings.

    The last two are (valid, k), for independent weights of equal scale. The fourth
    array (valid,) is the part of the fit that both explain. Specimen scales are
    relative to one specimen, which varies as much as the others.
    """
    first, slots = len(found.guess.stiffness), found.slots
    pieces = found.guess.pieces
    unsaid = [j for j, s in enumerate(slots) if s.piece >= 0 and pieces[s.piece].unsaid]
    wrong = [j for j, s in enumerate(slots) if mistaken(found, s)]
    live = np.ones(found.jacobian.shape[1], bool)
    live[:first] = (found.guess.stiffness > 0) & (not found.fixed_base)
    live[[first + j for j in unsaid + wrong]] = False
    had, out = np.zeros(len(found.residual)), []
    for which in (unsaid, wrong):
        unit = np.array([slots[j].typical for j in which])
        columns = found.jacobian[:, [first + j for j in which]] / unit
        had += columns @ np.array([get(found.guess, slots[j]) for j in which])
        out.append(columns)
    alike = np.linalg.cholesky(np.eye(len(unsaid)) + 1.0)
    return found.jacobian[:, live], out[0] @ alike, out[1], had


def changes(engine: Engine, found: Fit) -> list[Array]:
    """Return the change of stress (valid,), MPa, by each effect beside the others."""
    out = []
    for i, piece in enumerate(found.guess.pieces):
        if piece.nuisance:
            continue
        rest = tuple(p for j, p in enumerate(found.guess.pieces) if j != i)
        without, _ = engine.run(replace(found.guess, pieces=rest), False)
        out.append(found.stress - without)
    return out
