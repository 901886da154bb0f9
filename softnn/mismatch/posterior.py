r"""One posterior over all that was tried: which effects, if any, and what else.

A hypothesis is a set of effects, or something on no list, or that nothing is missing.
Beside effects there may be something on no list, too: their evidence is that of both
cases together, the second `both` nats less likely. The value v of a hypothesis is its
log evidence less `number` log n / 2 for each number of its own. Every law is only
nearly right, so that a value is wrong by an error with heavy tails, and by more where
it explains more:

.. math:: P(S) \propto e^{-\pi(S) - h(z)}, \quad
          z = \frac{v_{max} - v(S)}{1 + s + r\sqrt{g(S)}}, \quad
          h(z) = \begin{cases} z & z \le k \\ k\,(1 + \log(z / k)) & z > k \end{cases}

with g what the effects of the hypothesis gain over nothing: the logarithm of their
likelihood has a standard deviation of sqrt(2 g). For small differences it is the
likelihood to a power of one at most, the less the more is explained (Miller and Dunson
2019, doi:10.1080/01621459.2018.1469995); large ones count as a power of themselves
only, as odds do under an error of Student's kind. k is another for nothing, where no
law can be wrong, but noise. The constants are fitted by maximum likelihood to
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
from softnn.mismatch.evidence import mistaken

NAMED, SURE = 0.5, 0.9  # probabilities from which an effect is named, and said so
LIKELY = 0.1  # of the probability of the best, from which another is as good a reading


@dataclass(frozen=True)
class Constants:
    """Of the posterior; fitted on development families, see `docs/method.md`."""

    tail: float = 1.444  # k
    noise: float = 6.871  # k of nothing
    number: float = 0.557  # of (log n) / 2, the price of a number
    error: float = 0.0971  # s
    share: float = 0.0503  # r, of the root of what effects gain
    both: float = 6.237  # of something else beside effects, in their evidence
    first: float = 4.577  # cost of any effect, nats
    more: float = 3.192  # of each further one
    own: float = 0.0359  # of (log n) / 2, of a number that is of single recordings
    other: float = 2.333  # of something on no list


CONSTANTS = Constants()


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects; or none, and either nothing or something on no list."""

    account: Account
    other: bool = False

    @property
    def effects(self) -> frozenset[str]:
        return self.account.effects


def features(hypothesis: Hypothesis) -> Array:
    """What the constants weigh (7,): evidence, price of the numbers, counts."""
    account, count = hypothesis.account, len(hypothesis.effects)
    one = 0.5 * np.log(len(account.fit.residual))
    evidence, pieces = account.evidence, account.fit.guess.pieces
    own = sum(
        s.piece >= 0
        and s.recordings is not None
        and not (pieces[s.piece].nuisance or mistaken(account.fit, s))
        for s in account.fit.slots
    )
    return np.array(
        [
            evidence.beside if hypothesis.other else evidence.alone,
            evidence.beside,
            evidence.numbers * one,
            float(count > 0),
            max(count - 1, 0),
            own * one,
            hypothesis.other,
        ],
        float,
    )


def _evidence(table: Array, constants: Constants) -> tuple[Array, Array]:
    """Of hypotheses, and how much of it is of something else beside their effects."""
    alone, some = table[:, 0], table[:, 3] > 0
    beside = np.where(some, table[:, 1] - constants.both, -np.inf)
    both = np.logaddexp(alone, beside)
    return both, np.exp(beside - both)


def probabilities(table: Array, constants: Constants = CONSTANTS) -> Array:
    """Of hypotheses with these `features` (hypotheses, 7), the first of nothing."""
    k = constants
    gain = _evidence(table, k)[0] - k.number * table[:, 2]
    own = np.where(table[:, 3] > 0, np.maximum(gain - gain[0], 0.0), 0.0)
    behind = (gain.max() - gain) / (1 + k.error + k.share * np.sqrt(own))
    tail = np.where(np.arange(len(gain)) == 0, k.noise, k.tail)
    far = tail * (1 + np.log(np.maximum(behind, tail) / tail))
    costs = np.array([k.first, k.more, k.own, k.other])
    log = -np.where(behind < tail, behind, far) - table[:, 3:] @ costs
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


@dataclass(frozen=True)
class Posterior:
    """Probabilities of the hypotheses tried, the first of them that of nothing."""

    hypotheses: tuple[Hypothesis, ...]
    probability: Array
    beside: Array  # of something else beside the effects of each, if they are there

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
        return self.nothing_named + float(self.probability @ self.beside)

    @property
    def nothing_named(self) -> float:
        """Probability that what is missing is on no list."""
        them = [h.other for h in self.hypotheses]
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

    def readings(self) -> list[Account]:
        """The accounts of these sets."""
        shared = [s for s, _ in self.ways()]
        return [h.account for h in self.hypotheses if h.effects in shared]

    def instead(self, name: str) -> list[str]:
        """Effects that stand in the place of one of the selected in other readings."""
        rest = self.selected - {name}
        return [
            next(iter(s - rest))
            for s, _ in self.ways()
            if name not in s and rest < s and len(s) == len(self.selected)
        ]


def table(
    accounts: Sequence[Account], constants: Constants = CONSTANTS
) -> list[tuple[Hypothesis, Array]]:
    """Hypotheses with their features: of each set of effects the best form."""
    every = [Hypothesis(a) for a in accounts]
    every += [Hypothesis(a, True) for a in accounts if not a.effects]
    rows = np.array([features(one) for one in every])
    worth = _evidence(rows, constants)[0] - rows[:, 2]
    best: dict[tuple[frozenset[str], bool], int] = {}
    for i, one in enumerate(every):
        key = one.effects, one.other
        if key not in best or worth[i] > worth[best[key]]:
            best[key] = i
    return [(every[i], rows[i]) for i in best.values()]


def posterior(
    accounts: Sequence[Account], constants: Constants = CONSTANTS
) -> Posterior:
    """The posterior over the accounts tried, the first of them the base alone."""
    found = table(accounts, constants)
    rows = np.array([row for _, row in found])
    p, beside = probabilities(rows, constants), _evidence(rows, constants)[1]
    return Posterior(tuple(h for h, _ in found), p, beside)
