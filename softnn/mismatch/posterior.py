r"""One posterior over all that was tried: which effects, if any, and what else.

A hypothesis is a set of effects, or something on no list, or that nothing is missing.
Beside effects there may be something on no list, too: their evidence is that of both
cases together, the second `both` nats less likely. The value v of a hypothesis is its
log evidence less `number` log n / 2 for each number of its own, and less c for the root
of D, what its laws leave to be bent or added (`beside` less `bare`): laws that leave
much get something wrong, and some of what they gain is what others would. Every law is
only nearly right, so that a value is wrong by an error with heavy tails:

.. math:: h_k(z) = z \text{ up to } k, \quad k\,(1 + \log(z / k)) \text{ beyond}

Small differences count as a likelihood, or a power of it (Miller and Dunson 2019,
doi:10.1080/01621459.2018.1469995), large ones as a power of themselves only, as odds do
under an error of Student's kind.

The number of effects is judged first, then which ones. Some absent effect always fits
part of the model error, so each further effect must gain f nats more. With w the value
of the best set of n effects less this price,

.. math:: P(n) \propto e^{-\pi(n) - h_{k'}(z)}, \quad
          z = \frac{w_{max} - w_n}{1 + r \log(1 + g_n)}, \quad
          P(S \mid n) \propto e^{-\pi(S) - h_{k'}(z_S)}

g is the gain of a set over no effect; z_S compares sets of equal size. If a model fits
down to the noise, its evidence counts in full. If it leaves a discrepancy, its evidence
counts less: k' falls from `exact` to k as D / (1 + t g) of the leading set grows. The k
of a cause outside softnn's list falls likewise. The hypothesis that nothing is missing
has its own k, because there only the noise model can be wrong.

The constants are fitted to the names of development cases (`bench.calibrate`), some of
them with laws that are bent. Names, verdict and equivalents are all read off these
probabilities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from softnn.contracts import Array
from softnn.fit import Fit
from softnn.mismatch.accounts import Account

NAMED, SURE = 0.5, 0.9  # probabilities from which an effect is named, and said so
LIKELY = 0.1  # of the probability of the best, from which another is as good a reading


@dataclass(frozen=True)
class Constants:
    """Of the posterior; fitted on development families, see `docs/method.md`."""

    tail: float = 0.439  # k of effects, and of all else where laws leave much
    exact: float = 1.357  # k of effects where laws leave nothing
    strange: float = 0.683  # k of something on no list, likewise
    noise: float = 7.275  # k of nothing
    number: float = 1.096  # of (log n) / 2, the price of a number
    left: float = 1.173  # c, of the root of what laws leave
    share: float = 0.538  # r, of the logarithm of what effects gain
    both: float = 5.359  # of something else beside effects, in their evidence
    further: float = 6.268  # f, nats a further effect has to gain
    loose: float = 0.65  # of D, at which k is halfway
    bent: float = 0.009  # t, of what is gained, that laws leave usually
    first: float = 2.196  # cost of any effect, nats
    more: float = 1.932  # of each further one
    own: float = 0.037  # of (log n) / 2, of a number that is of single recordings
    other: float = 2.287  # of something on no list


CONSTANTS = Constants()


class Tried(Protocol):
    """A set of effects that was tried: its best fit, and how well that does."""

    @property
    def fit(self) -> Fit: ...

    @property
    def effects(self) -> frozenset[str]:
        """Ids of the effects."""

    @property
    def seconds(self) -> float:
        """How long the fit took."""

    @property
    def log_odds(self) -> float:
        """What the recordings say for it, nats, but for a constant and its prior."""


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects; or none, and either nothing or something on no list."""

    account: Tried
    other: bool = False

    @property
    def effects(self) -> frozenset[str]:
        return self.account.effects


def _evidence(table: Array, constants: Constants) -> tuple[Array, Array]:
    """Of hypotheses, and how much of it is of something else beside their effects."""
    alone, some = table[..., 1], table[..., 5] > 0
    beside = np.where(some, table[..., 2] - constants.both, -np.inf)
    both = np.logaddexp(alone, beside)
    return both, np.exp(beside - np.where(np.isfinite(both), both, 0.0))


def _value(table: Array, constants: Constants) -> tuple[Array, Array]:
    """v of hypotheses, and D."""
    bare, _, beside, price, _, count, _ = np.moveaxis(table, -1, 0)
    left = np.where(count > 0, np.maximum(beside - bare, 0.0), 0.0)
    paid = constants.number * price + constants.left * np.sqrt(left)
    return _evidence(table, constants)[0] - paid, left


def _lost(behind: Array, tail: Array | float) -> Array:
    """h of what a value is behind."""
    far = tail * (1 + np.log(np.maximum(behind, tail) / tail))
    return np.asarray(np.where(behind < tail, behind, far))


def _normal(log: Array) -> Array:
    """Weights that sum to one over the last axis; all zero where none is finite."""
    most = log.max(axis=-1, keepdims=True)
    weight = np.exp(log - np.where(np.isfinite(most), most, 0.0))
    return np.asarray(weight / np.maximum(weight.sum(axis=-1, keepdims=True), 1e-300))


def probabilities(table: Array, constants: Constants = CONSTANTS) -> Array:
    """Of hypotheses (..., hypotheses, 7), the first that of nothing.

    A row: the three evidences and two prices of `Account.figures`, effects, and whether
    it is something on no list. Rows of no evidence (-inf), alone or beside, are none.
    """
    k = constants
    _, _, _, _, own, count, other = np.moveaxis(table, -1, 0)
    value, left = _value(table, k)
    gain = np.where(count > 0, np.maximum(value - value[..., :1], 0.0), 0.0)

    sizes = np.arange(1.0, max(count.max(), 1.0) + 1)[:, None]
    mine = (count[..., None, :] == sizes) & np.isfinite(value[..., None, :])
    at = np.where(mine, value[..., None, :], -np.inf)  # (..., sizes, hypotheses)
    best_at = at.argmax(axis=-1)
    best = at.max(axis=-1)
    some = np.isfinite(best)
    best = np.where(some, best, 0.0)
    gained = np.where(some, np.take_along_axis(gain, best_at, axis=-1), 0.0)
    spare = np.where(some, np.take_along_axis(left, best_at, axis=-1), 0.0)
    net = np.where(some, best - k.further * (sizes[:, 0] - 1), -np.inf)
    none = np.where(count == 0, value, -np.inf)
    top = np.maximum(net.max(axis=-1), none.max(axis=-1))[..., None]

    def tail(full: float, over: Array) -> Array:
        return k.tail + (full - k.tail) / (1 + over / k.loose)

    over = spare / (1 + k.bent * gained)
    lead = np.take_along_axis(over, net.argmax(axis=-1)[..., None], axis=-1)
    scale = 1 + k.share * np.log1p(gained)
    many = -_lost(np.where(some, top - net, np.inf) / scale, tail(k.exact, lead))
    many = many - k.first - k.more * (sizes[:, 0] - 1)
    behind = np.where(mine, best[..., None] - at, np.inf) / scale[..., None]
    which = -_lost(behind, tail(k.exact, over)[..., None]) - k.own * own[..., None, :]
    each = np.exp(many)[..., None] * _normal(np.where(mine, which, -np.inf))
    strange = np.exp(-_lost(top - none, tail(k.strange, lead)) - k.other)
    nothing = np.exp(-_lost(top - none, k.noise))
    weight = each.sum(axis=-2)
    weight += np.where(count > 0, 0.0, np.where(other > 0, strange, nothing))
    weight = np.where(np.isfinite(value), weight, 0.0)
    return np.asarray(weight / weight.sum(axis=-1, keepdims=True))


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
    def best(self) -> Tried:
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

    def readings(self) -> list[Tried]:
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
    sets: Sequence[frozenset[str]], figures: Array, constants: Constants = CONSTANTS
) -> tuple[list[tuple[int, bool]], Array]:
    """Hypotheses and their rows (hypotheses, 7): of each set of effects the best form.

    `figures` (accounts, 5) as `Account.figures`; each hypothesis is the place of its
    account, and whether it is something on no list.
    """
    every = [(i, False) for i in range(len(sets))]
    every += [(i, True) for i, effects in enumerate(sets) if not effects]
    rows = np.array([[*figures[i], len(sets[i]), other] for i, other in every], float)
    rows[:, 1] = np.where(rows[:, 6] > 0, rows[:, 2], rows[:, 1])
    worth = _value(rows, constants)[0]
    best: dict[tuple[frozenset[str], bool], int] = {}
    for k, (i, other) in enumerate(every):
        key = sets[i], other
        if key not in best or worth[k] > worth[best[key]]:
            best[key] = k
    return [every[k] for k in best.values()], rows[list(best.values())]


def posterior(
    accounts: Sequence[Account], constants: Constants = CONSTANTS
) -> Posterior:
    """The posterior over the accounts tried, the first of them the base alone."""
    figures = np.array([a.figures for a in accounts])
    found, rows = table([a.effects for a in accounts], figures, constants)
    p, beside = probabilities(rows, constants), _evidence(rows, constants)[1]
    return Posterior(tuple(Hypothesis(accounts[i], o) for i, o in found), p, beside)
