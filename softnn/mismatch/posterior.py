r"""One posterior over all that was tried: which effects, if any, and what else.

A hypothesis is a set of effects, alone or beside something that is on no list; the
empty set alone is *nothing is missing*. Its value v is its log evidence less `number`
log n / 2 for each number of its own. Every law is only nearly right, so that a value is
wrong by an error with heavy tails, and by more where it explains more:

.. math:: P(S) \propto e^{-\pi(S)}
          \left(1 + \frac{v_{max} - v(S)}{s + r\sqrt{g(S)}}\right)^{-k}

with g what the hypothesis itself gains over nothing, whose logarithm of likelihood has
a standard deviation of sqrt(2 g). For small differences it is the likelihood to a
power, less the more is explained (Miller and Dunson 2019,
doi:10.1080/01621459.2018.1469995); for large ones it grows as a power only, as odds do
under an error of Student's kind. The constants are fitted by maximum likelihood to
development cases (`bench.calibrate`). Names, verdict and equivalents are all read off
these probabilities.
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

    tail: float = 3.03  # k
    number: float = 0.506  # of (log n) / 2, the price of a number
    error: float = 0.493  # s, nats
    share: float = 0.371  # r, of the root of what is gained
    first: float = 7.33  # cost of any effect, nats
    more: float = 3.05  # of each further one
    several: float = 0.729  # of values of its own in several recordings
    other: float = 1.79  # of something on no list
    both: float = 7.82  # of that beside effects


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
    """What the constants weigh (7,): evidence, price of the numbers, counts."""
    account, count = hypothesis.account, len(hypothesis.effects)
    n = len(account.fit.residual)
    several = sum(len(p.groups) > 1 for p in account.fit.guess.pieces if not p.nuisance)
    return np.array(
        [
            hypothesis.evidence,
            0.5 * account.evidence.numbers * np.log(n),
            float(count > 0),
            max(count - 1, 0),
            several,
            hypothesis.other,
            hypothesis.other and count > 0,
        ],
        float,
    )


def probabilities(table: Array, constants: Constants = CONSTANTS) -> Array:
    """Of hypotheses with these `features` (hypotheses, 7), the first of nothing."""
    k = constants
    gain = table[:, 0] - k.number * table[:, 1]
    own = np.maximum(gain - gain[0], 0.0)
    behind = (gain.max() - gain) / (k.error + k.share * np.sqrt(own))
    costs = np.array([k.first, k.more, k.several, k.other, k.both])
    log = -k.tail * np.log1p(behind) - table[:, 2:] @ costs
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


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
            if key not in best or row[0] - row[1] > best[key][1][0] - best[key][1][1]:
                best[key] = one, row
    return list(best.values())


def posterior(
    accounts: Sequence[Account], constants: Constants = CONSTANTS
) -> Posterior:
    """The posterior over the accounts tried, the first of them the base alone."""
    rows = table(accounts)
    p = probabilities(np.array([row for _, row in rows]), constants)
    return Posterior(tuple(h for h, _ in rows), p)
