"""Which recordings differ from their replicates by a gap or a slip?

Replicates follow one programme, so errors of laws are equal in all of them; a gap or a
slip in one recording is not. The residuals of replicates are compared point by point
along the stretches between turning points. A regression explains their differences from
the mean by gaps and slips of single recordings. Terms are added one by one while the
odds grow.

Free in each recording are its zero, the scale of first loading, the scale of later
loading, and the scale of the shared error. The differences left over are normal with
unknown variance. Their spectrum gives the number of independent values (Satterthwaite
1946, doi:10.2307/3002019). The odds are those of two regressions (Schwarz 1978,
doi:10.1214/aos/1176344136).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from scipy.special import expit, logsumexp

from softnn.contracts import Array, Chunk, Effect
from softnn.effects import EFFECTS
from softnn.effects._signs import FEWEST, reach
from softnn.fit import Data, Engine, Fit, Guess, Piece, span
from softnn.mismatch.faults import Fault
from softnn.mismatch.screen import bounds, pieces_at
from softnn.mismatch.specimens import UNSAID, picked
from softnn.state import turns

BAND = 0.05  # of the range of strain; a smaller reversal is no turning point
LIKE = 0.15  # relative difference in time and strain allowed between replicates
SAME = 0.05  # that of the strain where factors are tested: strain scales stress too
POINTS = 20  # points compared along a stretch
SEEN = 1e-6  # of the stress; a smaller change is not visible
LARGER = (1.5, 2.0, 3.0, 5.0)  # times the first start: a kink moves with its size
GRIPS = 0.01  # of the largest strain: error of an extensometer of class 1, ISO 9513
FORCES = 0.01  # error of a force of class 1, ISO 7500-1
SPREADS = 2.0 ** np.arange(-2, 4)  # spreads between replicates, relative to `GRIPS`
APART = (0.03, 0.1, 0.3)  # sizes of gaps and slips, of the largest strain


class Replicates:
    """Groups of recordings of one programme, and the points where they are compared.


    A group has at least `fewest` recordings: of two, either may be wrong. `like` is the
    relative difference of strain allowed in a group.
    """

    def __init__(
        self, engine: Engine, fewest: int = FEWEST, like: float = LIKE
    ) -> None:
        self.engine = engine
        self.times, self.at, turned = [], [], {}
        every = zip(engine.chunks, engine.data.stress_MPa, strict=True)
        for r, (chunk, stress) in enumerate(every):
            valid = np.isfinite(stress)
            turn = turns(chunk.strain, BAND * float(np.ptp(chunk.strain)))
            time, steps = chunk.time_s, (np.arange(POINTS) + 0.5) / POINTS
            spans = np.diff(time[turn])
            self.times.append(time[valid])
            self.at.append((time[turn[:-1], None] + spans[:, None] * steps).ravel())
            if len(turn) > 1 and valid.sum() > 1:
                turned[r] = spans, chunk.strain[turn]
        self.groups = [g for g in _like(turned, like) if len(g) >= fewest]

    def along(self, recording: int, values: Array) -> Array:
        """Return values (valid, ...) of a recording at its points (points, ...)."""
        time, at = self.times[recording], self.at[recording]
        mine = values[self.engine.owner == recording]
        after = np.clip(np.searchsorted(time, at), 1, len(time) - 1)
        gap = np.maximum(time[after] - time[after - 1], 1e-300)
        share = np.clip((at - time[after - 1]) / gap, 0.0, 1.0)
        share = share.reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray((1 - share) * mine[after - 1] + share * mine[after])

    def inside(self, group: Sequence[int]) -> NDArray[np.bool]:
        """Return a mask (points,) of those at which all recordings have stress left."""
        return np.logical_and.reduce([self.at[r] <= self.times[r][-1] for r in group])

    def counted(self, recording: int) -> Array:
        """Return the weight (points,) of the samples that each point stands for."""
        place = self.along(recording, np.arange(len(self.engine.target), dtype=float))
        return self.along(recording, self.engine.share) * np.abs(np.gradient(place))


@dataclass(frozen=True)
class Term:
    """One change of one recording: the effect, its start, and the recording."""

    effect: str
    start: int
    recording: int


@dataclass(frozen=True)
class Found:
    """Terms, their multiples (terms,) of the starts, and their log odds over none."""

    terms: tuple[Term, ...]
    sizes: Array
    odds: float


class Group:
    """Differences of replicates from their mean, and the change by each start; both
    without the part that zeros and scales explain."""

    def __init__(
        self,
        replicates: Replicates,
        group: Sequence[int],
        stress: Array,
        changes: Mapping[str, Array],
    ) -> None:
        self.recordings = tuple(group)
        engine = replicates.engine
        left, measured = (
            np.array([replicates.along(r, values) for r in group])
            for values in (engine.target - stress, engine.target)
        )
        usual = measured.mean(axis=0)
        fresh = np.arange(len(usual)) < POINTS  # fresh and softened stiffness both vary
        alike = left.mean(axis=0)  # the shared error scales with the specimen, too
        own = [np.ones_like(usual), usual * fresh, usual * ~fresh, alike]
        self.free = span(np.column_stack(own))
        self.left = self._rid(left - alike)
        self.least = (SEEN * float(np.linalg.norm(usual))) ** 2
        self.changes = {
            effect: np.array([self._rid(replicates.along(r, c).T) for r in group])
            for effect, c in changes.items()
        }  # (recordings, starts, points)

    def _rid(self, rows: Array) -> Array:
        return np.asarray(rows - (rows @ self.free) @ self.free.T)

    def column(self, term: Term) -> Array:
        """Return the change (recordings, points) of the differences by a term."""
        i = self.recordings.index(term.recording)
        change = self.changes[term.effect][i, term.start]
        out = np.tile(-change / len(self.recordings), (len(self.recordings), 1))
        out[i] += change
        return out

    def gains(
        self, effect: str, left: Array, low: Array, high: Array
    ) -> tuple[Array, Array]:
        """Return the best multiples (recordings, starts) and the squares they remove.

        Each is for a change of one recording alone.
        """
        changes = self.changes[effect]
        dot = np.einsum("rsp,rp->rs", changes, left)
        size = (1 - 1 / len(self.recordings)) * (changes**2).sum(axis=-1)
        by = np.clip(dot / np.where(size > self.least, size, np.inf), low, high)
        return by, np.asarray(by * (2 * dot - by * size))


class Regression:
    """Regression of differences between replicates on effects of single recordings."""

    def __init__(self, engine: Engine, guess: Guess) -> None:
        self.engine, self.pieces = engine, dict[str, list[Piece]]()
        data, scales = engine.data, engine.data.scales()
        changes, self.may = {}, dict[str, NDArray[np.bool]]()
        for law in (one.within(scales) for one in EFFECTS if own(one)):
            starts = [*law.starts(scales), *(law.closer(scales) or [[]])[0]]
            larger = (starts[0][law.amplitude] * by for by in LARGER)
            starts += [starts[0] | {law.amplitude: size} for size in larger]
            pieces = self.pieces[law.id] = pieces_at(engine, law, starts)
            changes[law.id] = engine.by_each(guess, pieces)
            every = (p.effect.possible(p.values, *_channels(data)) for p in pieces)
            self.may[law.id] = np.array(list(every)).T  # (recordings, starts)
        replicates, stress = Replicates(engine), engine.run(guess, False)[0]
        self.groups = [Group(replicates, g, stress, changes) for g in replicates.groups]
        self.ends = {effect: bounds(pieces) for effect, pieces in self.pieces.items()}

    def forward(self, effects: frozenset[str]) -> Found:
        """Return the likeliest terms of these effects, added one by one."""
        best = Found((), np.zeros(0), 0.0)
        while more := self._next(best, effects):
            tried = self.fitted((*best.terms, more))
            if not tried.odds > best.odds:
                break
            best = tried
        return best

    def _next(self, found: Found, effects: frozenset[str]) -> Term | None:
        """Return the term that removes most, in recordings without this effect."""
        taken = {(t.effect, t.recording) for t in found.terms}
        best, most = None, 0.0
        for group, left in zip(self.groups, self.left(found), strict=True):
            squares = float((left**2).sum())
            for effect in effects:
                _, gains = group.gains(effect, left, *self.ends[effect])
                gains *= self.may[effect][list(group.recordings)]
                for i, r in enumerate(group.recordings):
                    start = int(gains[i].argmax())
                    share = gains[i, start] / max(squares, 1e-300)
                    if (effect, r) not in taken and share > most:
                        best, most = Term(effect, start, r), float(share)
        return best

    def left(self, found: Found) -> list[Array]:
        """Return the differences of each group, less the contribution of the terms."""
        out = []
        for group in self.groups:
            left = group.left.copy()
            for term, size in zip(found.terms, found.sizes, strict=True):
                if term.recording in group.recordings:
                    left -= size * group.column(term)
            out.append(left)
        return out

    def fitted(self, terms: tuple[Term, ...]) -> Found:
        """Return the terms at their best sizes, with their odds."""
        sizes = np.zeros(len(terms))
        for group in self.groups:
            mine = [i for i, t in enumerate(terms) if t.recording in group.recordings]
            if mine:
                columns = [group.column(terms[i]).ravel() for i in mine]
                ends = [self.ends[terms[i].effect][:, terms[i].start] for i in mine]
                low, high = np.transpose(ends)
                found = lsq_linear(
                    np.transpose(columns), group.left.ravel(), (low, high)
                )
                sizes[mine] = found.x
        found = Found(terms, sizes, 0.0)
        return replace(found, odds=self._odds(found))

    def _odds(self, found: Found) -> float:
        gain = count = 0.0
        for group, left in zip(self.groups, self.left(found), strict=True):
            before, after = float((group.left**2).sum()), float((left**2).sum())
            many = min(independent(group.left), independent(left))
            if min(before, after) > 0:
                gain += 0.5 * many * np.log(before / after)
                count += many
        each = 0.5 * np.log(max(count, 2.0))
        for effect in {t.effect for t in found.terms}:
            mine = [t for t in found.terms if t.effect == effect]
            law = self.pieces[effect][0].effect
            # A moment counts as two parameters (`evidence.worth`).
            numbers = 2 * len(law.per_recording) - 1
            gain -= each * numbers * len(mine)
        return float(gain)

    def beyond(self, found: Found) -> Found:
        """Return the terms that exceed the usual error of a strain."""
        pairs = zip(found.terms, found.sizes, strict=True)
        large = [
            abs(self.size(t, s)) > GRIPS * reach(self.engine.chunks[t.recording])
            for t, s in pairs
        ]
        terms = tuple(t for t, keep in zip(found.terms, large, strict=True) if keep)
        return replace(found, terms=terms, sizes=found.sizes[large])

    def faulty(self, found: Found, effect: str) -> float:
        """Return the probability that sizes of an effect exceed scatter of specimens.

        No two strips are gripped alike. Either all sizes are half-normal, with a
        half-normal spread of scale `GRIPS`, or those of the terms have their own size.
        """
        mine = {t.recording for t in found.terms if t.effect == effect}
        some, rest = [], []
        for group, left in zip(self.groups, self.left(found), strict=True):
            sizes, gains = group.gains(effect, left, *self.ends[effect])
            gains *= self.may[effect][list(group.recordings)]
            for i, r in enumerate(group.recordings):
                if r not in mine:
                    term = Term(effect, int(gains[i].argmax()), r)
                    by = float(sizes[i, term.start])
                    rest.append(self._relative(group, left, term, by))
            for term, by in zip(found.terms, found.sizes, strict=True):
                if term.effect == effect and term.recording in group.recordings:
                    some.append(self._relative(group, left, term, float(by)))
        prior = np.log(SPREADS) - 0.5 * SPREADS**2
        prior -= logsumexp(prior)

        def density(size: float | None) -> float:
            every = [
                _half_normal(rest, GRIPS * s) + _half_normal(some, size or GRIPS * s)
                for s in SPREADS
            ]
            return float(logsumexp(np.array(every) + prior))

        apart = logsumexp([density(size) for size in APART]) - np.log(len(APART))
        price = UNSAID + picked(len(some) + len(rest), len(some))
        return float(expit(apart - density(None) - price))

    def _relative(
        self, group: Group, left: Array, term: Term, by: float
    ) -> tuple[float, float]:
        """Return the size of a term over the largest strain, and its standard error.

        The residual has one variance and fewer independent values than points.
        """
        reached = reach(self.engine.chunks[term.recording])
        squares = float((group.column(term) ** 2).sum())
        each = float((left**2).sum()) / max(independent(left), 1.0)
        error = self.size(term, np.sqrt(each / max(squares, group.least)))
        return abs(self.size(term, by)) / reached, abs(error) / reached

    def size(self, term: Term, by: float) -> float:
        """Return the amplitude of a term, `by` times its start."""
        piece = self.pieces[term.effect][term.start]
        value = piece.values[piece.effect.amplitude][term.recording]
        return float(value * by)

    def piece(self, found: Found, effect: str) -> Piece:
        """Return the effect with its values in the recordings that have it."""
        first = self.pieces[effect][0]
        law, values = first.effect, dict(first.values)
        for name in law.per_recording:
            values[name] = np.full(len(self.engine.chunks), law.off.get(name, 0.0))
        mine = {
            t.recording: (t.start, s)
            for t, s in zip(found.terms, found.sizes, strict=True)
            if t.effect == effect
        }
        for r, (start, size) in mine.items():
            for name in law.per_recording:
                value = self.pieces[effect][start].values[name][r]
                values[name][r] = value * (size if name == law.amplitude else 1.0)
        return replace(first, values=values, groups=tuple((r,) for r in sorted(mine)))


def independent(left: Array) -> float:
    """Return the number of independent differences among (recordings, points)."""
    power = (np.abs(np.fft.rfft(left, axis=1)[:, 1:]) ** 2).sum(axis=0)
    if not power.sum() > 0:
        return 0.0
    many = power.sum() ** 2 / (power**2).sum()
    return float(2 * many * (len(left) - 1))


def are_specimens(engine: Engine) -> bool:
    """Return whether stresses of replicates differ by factors, as of specimens.

    The odds are those of two regressions of the measured stress on the mean of the
    replicates, with and without a factor for each; zeros are free. Factors must scatter
    by more than the error of a force, `FORCES`.
    """
    replicates = Replicates(engine, fewest=2, like=SAME)
    gain = count = numbers = 0.0
    factors = [np.zeros(0)]
    for group in replicates.groups:
        measured = np.array([replicates.along(r, engine.target) for r in group])
        usual = measured.mean(axis=0)
        zero = np.full_like(usual, 1 / np.sqrt(len(usual)))
        usual, apart = usual - zero * (zero @ usual), measured - usual
        apart -= np.outer(apart @ zero, zero)
        factor = apart @ usual / max(float(usual @ usual), 1e-300)
        left = apart - np.outer(factor, usual)
        before, after = float((apart**2).sum()), float((left**2).sum())
        many = min(independent(apart), independent(left))
        if min(before, after) > 0:
            gain += 0.5 * many * np.log(before / after)
            count += many
        numbers += len(group) - 1
        factors.append(factor)
    scatter = np.concatenate(factors)
    large = scatter.size > 0 and np.sqrt(np.mean(scatter**2)) > FORCES
    return bool(large and gain > 0.5 * numbers * np.log(max(count, 2.0)))


def stand_out(engine: Engine, found: Fit) -> list[Fault]:
    """Return faults that recordings have and their replicates have not."""
    if not Replicates(engine).groups:
        return []
    guess, shared = alike(found.guess)
    regression = Regression(engine, guess)
    every = frozenset(regression.pieces)
    best = regression.forward(every)
    large = regression.beyond(best)
    out = []
    for effect in sorted({t.effect for t in large.terms}):
        odds = best.odds - regression.forward(every - {effect}).odds
        piece = regression.piece(large, effect)
        if effect in shared:  # plus the part that all recordings share
            piece = _together(shared[effect], piece)
        chance = float(expit(odds)) * regression.faulty(large, effect)
        out.append(Fault(piece, chance))
    return out


def _half_normal(sizes: Sequence[tuple[float, float]], spread: float) -> float:
    """Return the log density (to a constant) of sizes, both signs taken together.

    `sizes` are pairs of a size and its standard error.
    """
    size, error = np.array(sizes).reshape(-1, 2).T
    wide = np.hypot(spread, error)
    return float(-(0.5 * (size / wide) ** 2 + np.log(wide)).sum())


def own(law: Effect) -> bool:
    """Return whether an effect has a size in each recording, not a scale or a zero."""
    return law.amplitude in law.per_recording and not (law.scatter or law.unmoved)


def _channels(data: Data) -> tuple[Sequence[Chunk], Sequence[Array]]:
    return data.chunks, data.stress_MPa


def alike(guess: Guess) -> tuple[Guess, dict[str, Piece]]:
    """Return the guess in which effects of recordings have their smallest size in all.

    Also returns these effects, if the smallest size is not zero.
    """
    pieces, shared = [], {}
    for piece in guess.pieces:
        if own(piece.effect) and not piece.nuisance:
            name = piece.effect.amplitude
            size = np.array(piece.values[name], float)
            least = size[np.abs(size).argmin()]
            if least == piece.effect.off[name]:
                continue
            values = piece.values | {name: np.full(len(size), least)}
            piece = shared[piece.effect.id] = replace(piece, values=values)
        pieces.append(piece)
    return replace(guess, pieces=tuple(pieces)), shared


def _together(all_have: Piece, more: Piece) -> Piece:
    """Return the effect that all recordings share plus the excess of some of them."""
    name = more.effect.amplitude
    values = dict(all_have.values)
    for other in more.effect.per_recording:
        values[other] = np.array(values[other], float)
    values[name] += more.values[name]
    return replace(all_have, values=values)


def _like(turned: Mapping[int, tuple[Array, Array]], like: float) -> list[list[int]]:
    """Return replicates: recordings with turning points at like times and strains."""
    reach = max((float(np.ptp(x)) for _, x in turned.values()), default=0.0)

    def near(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
        if len(one[0]) != len(other[0]):
            return False
        off = np.abs(one[0] - other[0]).sum(), np.abs(one[1] - other[1]).max()
        return bool(off[0] <= LIKE * one[0].sum() and off[1] <= like * reach)

    groups: list[list[int]] = []
    for r, mine in turned.items():
        group = next((g for g in groups if near(turned[g[0]], mine)), None)
        if group is None:
            groups.append([r])
        else:
            group.append(r)
    return groups
