"""Does a recording stand apart from its replicates?

Recordings of one programme go through the same, and what laws get wrong is the same in
all of them; what one has alone, a gap or a slip, is not. So what a fit leaves is held
against what it leaves of replicates, stretch by stretch between turning points, with
and without what it has of single recordings. Zeros of recordings are free, and scales
of the first loading, of what comes after, and of what is wrong in all of them.
The differences are normal, of any variance, with as many independent values as their
spectrum says (Satterthwaite 1946, doi:10.2307/3002019), so that the odds are those of
two regressions (Schwarz 1978, doi:10.1214/aos/1176344136).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from softnn.contracts import Array, Effect
from softnn.fit import Engine, Fit, Piece, fit, span
from softnn.mismatch.accounts import REFITTED
from softnn.mismatch.evidence import worth
from softnn.mismatch.faults import Fault, on
from softnn.mismatch.posterior import Posterior
from softnn.mismatch.screen import only
from softnn.mismatch.specimens import UNSAID, picked
from softnn.state import turns

BAND = 0.05  # of the range of strain: less is no turn
LIKE = 0.15  # of the time, and of the strain, by which replicates may differ
POINTS = 20  # at which a stretch is looked at


class Replicates:
    """Recordings of one programme, and what a simulation leaves of each along it."""

    def __init__(self, engine: Engine) -> None:
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
        self.groups = _like(turned)

    def spread(self, group: Sequence[int], stress: Array) -> tuple[float, float]:
        """By what replicates differ in what is left, and how many values that is."""
        engine = self.engine
        left, measured = (
            np.array([self._along(r, values) for r in group])
            for values in (engine.target - stress, engine.target)
        )
        usual = measured.mean(axis=0)
        fresh = np.arange(len(usual)) < POINTS  # and softened: specimens differ in both
        alike = left.mean(axis=0)  # what is wrong scales with the specimen, too
        own = [np.ones_like(usual), usual * fresh, usual * ~fresh, alike]
        free = span(np.column_stack(own))
        left = left - alike
        left -= (left @ free) @ free.T
        power = (np.abs(np.fft.rfft(left, axis=1)[:, 1:]) ** 2).sum(axis=0)
        if not power.sum() > 0:
            return 0.0, 0.0
        many = power.sum() ** 2 / (power**2).sum()
        return float((left**2).sum()), float(2 * many * (len(group) - 1))

    def _along(self, recording: int, values: Array) -> Array:
        mine = values[self.engine.owner == recording]
        return np.interp(self.at[recording], self.times[recording], mine)

    def asked(self, found: Fit, index: int) -> tuple[float, Piece]:
        """Log odds that a piece is not alike in all replicates, and the piece.

        It is without recordings that only laws put it in.
        """
        engine, piece = self.engine, found.guess.pieces[index]
        rest = [p for i, p in enumerate(found.guess.pieces) if i != index]
        guess, fixed = replace(found.guess, pieces=tuple(rest)), found.fixed_base
        less = fit(engine, guess, fixed_base=fixed, iterations=REFITTED)
        off, _ = engine.run(guess, False)
        before = [
            min(self.spread(g, s) for s in (less.stress, off)) for g in self.groups
        ]
        slots = [s for s in found.slots if s.piece == index]

        def odds(kept: set[int]) -> float:
            there = np.isin(engine.owner, list(kept))
            stress = np.where(there, found.stress, off)
            gain = count = 0.0
            for group, (old, many) in zip(self.groups, before, strict=True):
                new, more = self.spread(group, stress)
                if min(old, new) > 0:
                    gain += 0.5 * min(many, more) * np.log(old / new)
                    count += min(many, more)
            own = (s for s in slots if not s.recordings or kept & set(s.recordings))
            each = 0.5 * np.log(max(count, 2.0))
            price = UNSAID + picked(len(engine.chunks), len(kept))
            return float(gain - price - each * sum(worth(found, s) for s in own))

        kept, told = on(piece), {r for group in self.groups for r in group}
        best = odds(kept) if kept & told else -np.inf
        while len(kept & told) > 1:
            fewer = [kept - {r} for r in sorted(kept & told)]
            worths = [odds(k) for k in fewer]
            if max(worths) <= best:
                break
            best, kept = max(worths), fewer[int(np.argmax(worths))]
        return best, only(piece, np.array(sorted(kept)))


def stand_out(
    engine: Engine, probable: Posterior, proposed: Sequence[Fit] = ()
) -> list[Fault]:
    """What recordings have that their replicates have not, if any have.

    Asked of the fits of the posterior, the likeliest first, and of those `proposed`.
    """
    replicates = Replicates(engine)
    if not replicates.groups:
        return []
    asked: dict[str, tuple[float, Piece]] = {}
    order = np.argsort(-probable.probability, kind="stable")
    likely = [probable.hypotheses[i].account.fit for i in order]
    for one in (*proposed, *likely):
        for index, piece in enumerate(one.guess.pieces):
            if (
                piece.effect.id not in asked
                and _own(piece.effect)
                and not piece.nuisance
            ):
                asked[piece.effect.id] = replicates.asked(one, index)
    if not asked:
        return []
    every = np.array([0.0, *(odds for odds, _ in asked.values())])
    odds, piece = max(asked.values(), key=lambda pair: pair[0])
    return [Fault(piece, float(np.exp(odds - np.logaddexp.reduce(every))))]


def _own(law: Effect) -> bool:
    """Whether an effect has a size in each recording that is no scale and no zero."""
    return law.amplitude in law.per_recording and not (law.scatter or law.unmoved)


def _like(turned: Mapping[int, tuple[Array, Array]]) -> list[list[int]]:
    """Replicates: as many turns, after about as long, and at about the same strain."""
    reach = max((float(np.ptp(x)) for _, x in turned.values()), default=0.0)

    def alike(one: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
        if len(one[0]) != len(other[0]):
            return False
        off = np.abs(one[0] - other[0]).sum(), np.abs(one[1] - other[1]).max()
        return bool(off[0] <= LIKE * one[0].sum() and off[1] <= LIKE * reach)

    groups: list[list[int]] = []
    for r, mine in turned.items():
        group = next((g for g in groups if alike(turned[g[0]], mine)), None)
        if group is None:
            groups.append([r])
        else:
            group.append(r)
    return [g for g in groups if len(g) > 1]
