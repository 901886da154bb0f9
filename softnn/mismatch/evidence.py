r"""How well a set of effects accounts for recordings: its marginal likelihood.

.. math:: y = base + \sum_k c_k(t)\,(1 + w_k \cdot r(x_t)) + v \cdot d(x_t, t) + noise

c_k is what effect k changes of the stress. No law is quite right: w_k, normal with
scale tau, bends each by smooth functions r of the state x (and lets it trail a little),
the form error. v, normal with scale a, is the discrepancy: whatever else there is,
smooth in the state or in the time of single recordings (Kennedy and O'Hagan 2001,
doi:10.1111/1467-9868.00294). Smooth functions are random Fourier features (Rahimi and
Recht 2007). Numbers that the fit leaves free are projected out, w and v are integrated
out exactly; of tau and a the best of a few values counts, with its prior.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs

from softnn.contracts import Array
from softnn.fit import Engine, Fit, Slot, get, span
from softnn.mismatch.specimens import cost, picked, sizes
from softnn.models.unit_kernel import maxwell
from softnn.state import features

BENDS, SHARED, OWN = 30, 40, 5  # functions: of an effect, of the state, of a recording
LENGTH = 1.0  # of the functions of the state, in standard deviations of it
LAGS = (3.0, 30.0)  # typical intervals, by which an effect may trail
FORM = (0.0, 0.03, 0.1, 0.3)  # tau
ELSE = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1)  # a, of the largest stress
SCATTER = (0.0, 0.01, 0.02, 0.04)  # of the stress, between specimens
MISTAKE = (0.03, 0.1, 0.3, 1.0)  # of it, of recordings that are wrong by a scale
# Bends, three kinds of discrepancy, scatter, mistakes.
GRIDS = (FORM, ELSE, ELSE, ELSE, SCATTER, MISTAKE)
OWN_TIME, APART, WRONG = 3, 4, 5  # their places
FORM_PRIOR = 0.1  # half-normal scale of tau
SCATTER_PRIOR = 0.025  # of that scatter: elastomers differ by some per cent
EXACT = 0.88  # prior probability that laws are as they stand, and all there is
ELSE_PRIOR = 0.0003  # of a, where effects are meant to be all there is
CLASS = 0.02  # of the stress: a machine of class 2 errs no more, ISO 7500-1
GAP, MOST_GAPS = 6.0, 3  # typical intervals; of a recording, the longest
FADING = 4  # paces at which what was not written down is forgotten
# Of columns that are nearly one products are known to rounding alone: the least works.
ROUNDING, ROUNDED = (1e-10, 1e-9, 1e-8), 1e-12
SEED = 1


@dataclass(frozen=True)
class Evidence:
    """Logarithms of marginal likelihoods, without the prior of the set.

    `bare`: of the laws as they stand; `alone`: either so, or with the form error and a
    discrepancy that is slight; `beside`: with something else of any size. `form`,
    `beside_size` and `scatter` are the scales of these at their best.
    """

    bare: float
    alone: float
    beside: float
    form: float
    beside_size: float
    scatter: float
    numbers: int  # free ones, of the effects


class Weigher:
    """Weighs fits to one set of recordings."""

    def __init__(self, engine: Engine, base: Fit) -> None:
        self.engine = engine
        rng = np.random.default_rng(SEED)
        x = states(engine)
        self.bends = fourier(x, BENDS, rng)
        self.shared = engine.level * fourier(x, SHARED, rng)
        self.stiffer = base.stress[:, None] * fourier(x, SHARED, rng)
        self.own = engine.level * by_recording(engine)
        self.unseen = unwritten(engine, base)
        self._white: tuple[int, Array, Array, Array] | None = None

    def weigh(self, found: Fit, whole: bool = True) -> Evidence:
        """The evidence of a fit under the noise that the engine weighs by.

        If not `whole`, nothing is worked out of what is beside something else.
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
        q = span(np.concatenate([free, unseen], axis=1))
        # Weights of the scatter are counted from none, not from where the fit has them.
        residual = found.residual + had
        residual = residual - q @ (q.T @ residual)
        mine = np.concatenate([form, apart, wrong], axis=1)
        across = mine.T @ other
        gram = np.block([[mine.T @ mine, across], [across.T, products]])
        taken = np.concatenate([q.T @ mine, q.T @ other], axis=1)
        rounded = ROUNDED * np.diag(gram)  # what is left of large products is not exact
        gram -= taken.T @ taken
        gram[np.diag_indices_from(gram)] += rounded
        right = np.concatenate([residual @ mine, residual @ other])
        unsaid = against(found)
        there = {0: form.shape[1], APART: apart.shape[1], WRONG: wrong.shape[1]}
        widths = [*there.values(), SHARED, SHARED, self.own.shape[1]]
        kinds = np.repeat([*there, 1, 2, 3], widths)  # places in `GRIDS`
        norm = engine.log_norm - 0.5 * len(residual) * np.log(2 * np.pi)
        plain = norm - chosen(found) - 0.5 * float(residual @ residual)

        def value(scales: Sequence[float], free: bool) -> float:
            prior = (scales[0] / FORM_PRIOR) ** 2
            prior += (scales[APART] / SCATTER_PRIOR) ** 2
            slight = [] if free and scales[OWN_TIME] > CLASS else [scales[OWN_TIME]]
            slight += [] if free else scales[1:OWN_TIME]
            prior += sum((a / ELSE_PRIOR) ** 2 for a in slight)
            made = gained(gram, right, np.array(scales)[kinds])
            return plain + made - 0.5 * prior - unsaid * bool(scales[APART])

        nothing = [0] * len(GRIDS)
        nothing[APART] = 2 if there[APART] else 0
        moved = [k for k in range(len(GRIDS)) if there.get(k, 1)]
        place, alone = climb(lambda s: value(s, False), nothing, moved)
        at, beside = place, alone
        if whole:
            more = sum(a <= CLASS for a in GRIDS[OWN_TIME][:-1])  # than a machine has
            wide = [*place[:OWN_TIME], more, *place[APART:]]
            tops = [climb(lambda s: value(s, True), p, moved) for p in (place, wide)]
            at, beside = max(tops, key=lambda top: top[1])
        law = [0] * APART + place[APART:]
        bare = value([g[i] for g, i in zip(GRIDS, law, strict=True)], False)
        return Evidence(
            bare,
            float(np.logaddexp(bare + np.log(EXACT), alone + np.log1p(-EXACT))),
            beside,
            GRIDS[0][place[0]],
            max(ELSE[i] for i in at[1:APART]),
            SCATTER[place[APART]],
            sum(worth(found, s) for s in found.slots),
        )

    def bent(self, change: Array) -> Array:
        """What form errors of scale one would make of an effect (valid, k), MPa."""
        engine = self.engine
        interval = engine.data.scales().interval_s
        time = np.concatenate([c.time_s for c in engine.chunks])[engine.valid]
        late = [
            trailing(change, time, engine.owner, k * interval) - change for k in LAGS
        ]
        return np.concatenate(
            [change[:, None] * self.bends, np.stack(late, axis=1)], axis=1
        )


def climb(
    value: Callable[[Sequence[float]], float],
    start: Sequence[int],
    moved: Sequence[int],
) -> tuple[list[int], float]:
    """The best point of `GRIDS` uphill from `start`, one coordinate at a time.

    `moved`: the coordinates that there are.
    """
    known: dict[tuple[int, ...], float] = {}

    def at(place: Sequence[int]) -> float:
        key = tuple(place)
        if key not in known:
            known[key] = value([g[i] for g, i in zip(GRIDS, key, strict=True)])
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
    """Log evidence of columns with normal weights of these scales, over none.

    `gram` (k, k) and `right` (k,): products of the whitened columns with each other and
    with the residual. Weights integrated out; the textbook's Bayesian linear model.

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
    """How many numbers a slot is paid for as.

    A moment is found to an interval, not to its root: it is two (Zhang and Siegmund
    2007, doi:10.1111/j.1541-0420.2006.00662.x). Scales have a prior of their own.
    """
    if slot.piece < 0:
        return 1
    piece = found.guess.pieces[slot.piece]
    if piece.nuisance or mistaken(found, slot):
        return 0
    law = piece.effect
    return 1 + (slot.name in law.per_recording and slot.name != law.amplitude)


def mistaken(found: Fit, slot: Slot) -> bool:
    """Whether a number is by what scale a recording is wrong: paid by its own prior."""
    piece = found.guess.pieces[slot.piece] if slot.piece >= 0 else None
    return piece is not None and piece.effect.scatter and not piece.nuisance


def against(found: Fit) -> float:
    """Log odds against the specimens that nobody named, if it has any."""
    unsaid = [p for p in found.guess.pieces if p.unsaid]
    counts = [len(p.values[p.effect.amplitude]) for p in unsaid]
    return sum(cost(sizes(n, p.groups)) for n, p in zip(counts, unsaid, strict=True))


def chosen(found: Fit) -> float:
    """Log odds against these recordings being those that are wrong by a scale.

    Their values are paid by a prior of their own.
    """
    wrong = [p for p in found.guess.pieces if p.effect.scatter and not p.nuisance]
    counts = [len(p.values[p.effect.amplitude]) for p in wrong]
    return sum(
        picked(n, sum(map(len, p.groups))) for n, p in zip(counts, wrong, strict=True)
    )


def scattered(found: Fit) -> tuple[Array, Array, Array, Array]:
    """Whitened columns by what is free, and by scales of single recordings.

    The latter (valid, k) are of specimens that nobody named, and of mistakes, each for
    weights that are independent and alike; last, what the fit has of both (valid,).
    Values of specimens are over that of the first, which varies as much as any other.
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
    """Of each effect what it changes of the stress (valid,), MPa, the others there."""
    out = []
    for i, piece in enumerate(found.guess.pieces):
        if piece.nuisance:
            continue
        rest = tuple(p for j, p in enumerate(found.guess.pieces) if j != i)
        without, _ = engine.run(replace(found.guess, pieces=rest), False)
        out.append(found.stress - without)
    return out


def states(engine: Engine) -> Array:
    """State of each sample (valid, features), each of mean 0 and deviation 1.

    Strain and its history, rate and times as `softnn.state` has them; temperature; and
    the place of the recording among all.
    """
    count = len(engine.chunks)
    warm = all(c.temperature_C is not None for c in engine.chunks)
    rows = []
    for r, chunk in enumerate(engine.chunks):
        own = features(chunk, warm=warm)
        rows.append(np.column_stack([own, np.full(len(own), r / count)]))
    x = np.concatenate(rows)[engine.valid]
    spread = x.std(axis=0)
    live = spread > 1e-9 * (np.abs(x).max(axis=0) + 1e-300)
    return (x[:, live] - x[:, live].mean(axis=0)) / spread[live]


def fourier(x: Array, count: int, rng: np.random.Generator) -> Array:
    """Random smooth functions (n, count) of states; sums of them have variance one.

    Each is of one feature of the state, or of two: laws bend by few things at a time,
    and functions of all at once are too many to be met by a few (Duvenaud, Nickisch and
    Rasmussen 2011, additive Gaussian processes).
    """
    wave = rng.standard_normal((x.shape[1], count)) / LENGTH
    of = np.zeros(wave.shape, bool)
    for j in range(count):
        of[rng.permutation(x.shape[1])[: 1 + j % 2], j] = True
    phase = rng.uniform(0, 2 * np.pi, count)
    return np.cos(x @ (wave * of) + phase) * np.sqrt(2 / count)


def by_recording(engine: Engine) -> Array:
    """Smooth functions (valid, k) of the time of each recording, the others zero.

    None is constant: that is an offset, which has a name.
    """
    out = np.zeros((len(engine.target), OWN * len(engine.chunks)))
    for r, chunk in enumerate(engine.chunks):
        known = np.isfinite(engine.data.stress_MPa[r])
        time = chunk.time_s[known] - chunk.time_s[0]
        share = time / max(float(np.ptp(chunk.time_s)), 1e-300)
        half = 1 + np.arange(OWN)  # periods
        waves = np.cos(np.pi * np.outer(share, half))
        rows = engine.owner == r
        out[rows, OWN * r : OWN * (r + 1)] = waves / (1 + half)
    return out


def unwritten(engine: Engine, base: Fit) -> Array:
    """What nobody wrote down (valid, k): any memory of branches after a gap or a pause.

    What strain a specimen saw in a gap of time, or before a recording that goes on from
    another, is not known; what it left fades at the paces of the branches of the base.
    """
    units = base.guess.units
    live = base.guess.stiffness[units.segments :] > 0
    paces = np.array(units.relaxation_times)[live]
    if len(paces) > FADING:
        paces = paces[np.linspace(0, len(paces) - 1, FADING).round().astype(int)]
    clock = np.concatenate([c.time_s for c in engine.chunks])[engine.valid]
    out = [np.zeros((len(clock), 0))]
    for r, chunk in enumerate(engine.chunks):
        time = chunk.time_s
        step = np.diff(time)
        gaps = np.flatnonzero(step > GAP * np.median(step)) + 1
        begins = list(time[gaps[np.argsort(-step[gaps - 1])][:MOST_GAPS]])
        begins += [time[0]] if engine.data.continued and r else []
        # What is carried on is carried through the recordings that follow, too.
        own = engine.owner >= r if engine.data.continued else engine.owner == r
        for begin in begins:
            since = (clock - begin)[:, None]
            fading = np.exp(-np.maximum(since, 0.0) / paces)
            out.append(fading * ((since >= 0) & own[:, None]))
    return np.concatenate(out, axis=1)


def trailing(x: Array, time: Array, owner: NDArray[np.integer], lag_s: float) -> Array:
    """x (valid,) low-passed within each recording, at its typical interval."""
    out = np.empty_like(x)
    for r in np.unique(owner):
        own = owner == r
        step = float(np.median(np.diff(time[own]))) if own.sum() > 1 else lag_s
        keep = float(np.exp(-max(step, 1e-12) / max(lag_s, 1e-12)))
        decay, one = np.full((own.sum(), 1), keep), np.empty((own.sum(), 1))
        maxwell(decay, 1 - decay, x[own], x[own][:1], one)
        out[own] = one[:, 0]
    return out
