r"""One posterior over all that was tried: which effects, if any, and what else.

A hypothesis is a set of effects, alone or beside something that is on no list; the
empty set alone is *nothing is missing*. Its weight is

.. math:: \log w = \frac{c}{T} \left(\log p(y \mid S) - \tfrac{k}{2} \log n\right)
          + \log \pi(S), \quad T = 1 + G / G_0

with k numbers of its own. T coarsens: every law is only nearly right, by an error in
proportion to what it explains, so a likelihood says less the more there is to explain
(Miller and Dunson 2019, doi:10.1080/01621459.2018.1469995); G is what the best
hypothesis gains. The constants are fitted by maximum likelihood to development cases
(`studies.calibrate`). Names, verdict and equivalents are all read off these weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from softnn.contracts import Array
from softnn.mismatch.accounts import Account

NAMED, SURE = 0.5, 0.9  # probabilities from which an effect is named, and said so
LIKELY = 0.1  # of the probability of the best, from which another is as good a reading


@dataclass(frozen=True)
class Constants:
    """Of the posterior; fitted on development families, see `docs/method.md`."""

    power: float = 0.4  # c
    coarse: float = 100.0  # G_0, nats
    first: float = 4.0  # cost of any effect, nats
    more: float = 3.0  # of each further one
    several: float = 0.5  # of values of its own in several recordings
    other: float = 2.0  # of something on no list
    both: float = 3.0  # of that beside effects


CONSTANTS = Constants()


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects, and whether there is something else beside them."""

    account: Account
    other: bool

    @property
    def effects(self) -> frozenset[str]:
        return self.account.effects

    @property
    def evidence(self) -> float:
        own = self.account.evidence
        return own.beside if self.other else own.alone


def features(hypothesis: Hypothesis) -> Array:
    """What the constants weigh: evidence less the price of numbers, and counts."""
    account, count = hypothesis.account, len(hypothesis.effects)
    n = len(account.fit.residual)
    fitted = hypothesis.evidence - 0.5 * account.evidence.numbers * np.log(n)
    several = sum(len(p.groups) > 1 for p in account.fit.guess.pieces if not p.nuisance)
    return np.array(
        [
            fitted,
            float(count > 0),
            max(count - 1, 0),
            several,
            hypothesis.other,
            hypothesis.other and count > 0,
        ],
        float,
    )


def weights(table: Array, constants: Constants = CONSTANTS) -> Array:
    """Log weights (hypotheses,) of `features` (hypotheses, 6), the first of nothing."""
    gain = table[:, 0] - table[0, 0]
    coarse = 1 + max(float(gain.max()), 0.0) / constants.coarse
    costs = [constants.first, constants.more, constants.several]
    costs += [constants.other, constants.both]
    return constants.power * gain / coarse - table[:, 1:] @ np.array(costs)


@dataclass(frozen=True)
class Posterior:
    """Probabilities of the hypotheses tried, the first of them that of nothing."""

    hypotheses: tuple[Hypothesis, ...]
    probability: Array

    @cached_property
    def effects(self) -> dict[str, float]:
        """Probability of each effect, the likeliest first."""
        out: dict[str, float] = {}
        for one, p in zip(self.hypotheses, self.probability, strict=True):
            for name in one.effects:
                out[name] = out.get(name, 0.0) + float(p)
        return dict(sorted(out.items(), key=lambda item: -item[1]))

    @property
    def nothing(self) -> float:
        return float(self.probability[0])

    @cached_property
    def other(self) -> float:
        """Probability of something that is on no list, alone or beside effects."""
        them = [h.other for h in self.hypotheses]
        return float(self.probability[them].sum())

    @property
    def nothing_named(self) -> float:
        """Probability that what is missing is on no list."""
        them = [h.other and not h.effects for h in self.hypotheses]
        return float(self.probability[them].sum())

    @cached_property
    def selected(self) -> frozenset[str]:
        return frozenset(e for e, p in self.effects.items() if p >= NAMED)

    @cached_property
    def best(self) -> Account:
        """The likeliest account of the selected effects; else of what comes nearest."""
        order = np.argsort(-self.probability, kind="stable")
        ranked = [self.hypotheses[i] for i in order]
        near = [h for h in ranked if h.effects == self.selected]
        near += sorted(ranked, key=lambda h: len(h.effects ^ self.selected))
        return near[0].account

    def ways(self) -> list[tuple[frozenset[str], float]]:
        """Sets of effects that share the probability, the likeliest first."""
        total: dict[frozenset[str], float] = {}
        for one, p in zip(self.hypotheses, self.probability, strict=True):
            total[one.effects] = total.get(one.effects, 0.0) + float(p)
        ranked = sorted(total.items(), key=lambda item: -item[1])
        return [(s, p) for s, p in ranked if p >= LIKELY * ranked[0][1]]

    def instead(self, name: str) -> list[str]:
        """Effects that stand in the place of one of the selected in other readings."""
        rest = self.selected - {name}
        return [
            next(iter(s - rest))
            for s, _ in self.ways()
            if name not in s and rest < s and len(s) == len(self.selected)
        ]


def table(accounts: Sequence[Account]) -> list[tuple[Hypothesis, Array]]:
    """Hypotheses with their features: of each set of effects the best form."""
    best: dict[tuple[frozenset[str], bool], tuple[Hypothesis, Array]] = {}
    for account in accounts:
        for other in (False, True):
            one = Hypothesis(account, other)
            row = features(one)
            key = one.effects, other
            if key not in best or row[0] > best[key][1][0]:
                best[key] = one, row
    return list(best.values())


def posterior(
    accounts: Sequence[Account], constants: Constants = CONSTANTS
) -> Posterior:
    """The posterior over the accounts tried, the first of them the base alone."""
    rows = table(accounts)
    w = weights(np.array([row for _, row in rows]), constants)
    p = np.exp(w - w.max())
    return Posterior(tuple(h for h, _ in rows), p / p.sum())
