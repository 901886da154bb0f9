r"""One posterior over all candidates: effects, nothing missing, or an unlisted cause.

A hypothesis is a set of effects, a cause outside softnn's list (*unlisted*), or that
nothing is missing. An unlisted cause may also act beside effects: the evidence of a set
sums both cases, and the second is `both` nats less likely.

The value v of a hypothesis is its log evidence less two prices. The first is `number`
log n / 2 for each of its parameters. The second is c times the root of D, the
discrepancy gain (`beside` less `bare`): laws that leave a large discrepancy are wrong,
and some of their gain belongs to other effects. Every law is only nearly right, so a
value has an error with heavy tails:

.. math:: h_k(z) = z \text{ up to } k, \quad k\,(1 + \log(z / k)) \text{ beyond}

Small differences count as a likelihood or a power of it (Miller and Dunson 2019,
doi:10.1080/01621459.2018.1469995). Large differences count as a power of themselves, as
odds do under an error with Student's distribution.

The number of effects is judged first, then which ones. Some absent effect always fits
part of the model error, so each further effect must gain f nats more. With w the value
of the best set of n effects less this price,

.. math:: P(n) \propto e^{-\pi(n) - h_{k'}(z)}, \quad
          z = \frac{w_{max} - w_n}{1 + r \log(1 + g_n)}, \quad
          P(S \mid n) \propto e^{-\pi(S) - h_{k'}(z_S)}

g is the gain of a set over no effect; z_S compares sets of equal size. If a model fits
down to the noise, its evidence counts in full. If it leaves a discrepancy, its evidence
counts less: k' falls from `exact` to k as D / (1 + t g) of the leading set grows. The k
of an unlisted cause falls likewise. The hypothesis that nothing is missing has its own
k, because there only the noise model can be wrong.

The constants are fitted to the names of development cases (`bench.calibrate`), some of
them with form errors. `decision` takes names and verdict from these probabilities and
from the error on recordings left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from softnn.contracts import Array
from softnn.fit import Fit
from softnn.mismatch.accounts import Account
from softnn.mismatch.compare import LIKELY, NAMED


@dataclass(frozen=True)
class Constants:
    """Constants of the posterior, fitted on development families: `docs/method.md`."""

    tail: float = 0.439  # k of effects and unlisted causes at a large D
    exact: float = 1.357  # k of effects that leave no discrepancy
    strange: float = 0.683  # k of an unlisted cause, if no discrepancy is left
    noise: float = 7.275  # k of nothing missing
    number: float = 1.096  # of (log n) / 2, the price of a parameter
    left: float = 1.173  # c, of the root of the discrepancy gain
    share: float = 0.538  # r, of the logarithm of the gain of effects
    both: float = 5.359  # nats, price of an unlisted cause beside effects
    further: float = 6.268  # f, nats that a further effect has to gain
    loose: float = 0.65  # the D at which k is halfway
    bent: float = 0.009  # t, usual discrepancy gain over the gain of effects
    first: float = 2.196  # nats, cost of the first effect
    more: float = 1.932  # nats, cost of each further effect
    own: float = 0.037  # of (log n) / 2, price of a parameter of single recordings
    other: float = 2.287  # nats, cost of an unlisted cause


CONSTANTS = Constants()


class Tried(Protocol):
    """A set of effects that was tried: its best fit, and its score."""

    @property
    def fit(self) -> Fit: ...

    @property
    def effects(self) -> frozenset[str]:
        """Ids of the effects."""

    @property
    def seconds(self) -> float:
        """Duration of the fit, s."""

    @property
    def log_odds(self) -> float:
        """Log odds by the recordings, nats, but for a constant and the prior."""


@dataclass(frozen=True)
class Hypothesis:
    """A set of effects; or none, with nothing missing or an unlisted cause."""

    account: Tried
    other: bool = False

    @property
    def effects(self) -> frozenset[str]:
        return self.account.effects


def _evidence(table: Array, constants: Constants) -> tuple[Array, Array]:
    """Return evidences, and the share with an unlisted cause beside the effects."""
    alone, some = table[..., 1], table[..., 5] > 0
    beside = np.where(some, table[..., 2] - constants.both, -np.inf)
    both = np.logaddexp(alone, beside)
    return both, np.exp(beside - np.where(np.isfinite(both), both, 0.0))


def _value(table: Array, constants: Constants) -> tuple[Array, Array]:
    """Return v and D of hypotheses."""
    bare, _, beside, price, _, count, _ = np.moveaxis(table, -1, 0)
    left = np.where(count > 0, np.maximum(beside - bare, 0.0), 0.0)
    paid = constants.number * price + constants.left * np.sqrt(left)
    return _evidence(table, constants)[0] - paid, left


def _lost(behind: Array, tail: Array | float) -> Array:
    """Return h of the difference to the best value."""
    far = tail * (1 + np.log(np.maximum(behind, tail) / tail))
    return np.asarray(np.where(behind < tail, behind, far))


def _normal(log: Array) -> Array:
    """Return weights that sum to one over the last axis; zero if none is finite."""
    most = log.max(axis=-1, keepdims=True)
    weight = np.exp(log - np.where(np.isfinite(most), most, 0.0))
    return np.asarray(weight / np.maximum(weight.sum(axis=-1, keepdims=True), 1e-300))


def probabilities(table: Array, constants: Constants = CONSTANTS) -> Array:
    """Return the probability of each hypothesis; the first is that nothing is missing.

    `table` is (..., hypotheses, 7). A row holds the five numbers of `Account.figures`,
    the number of effects, and 1 for an unlisted cause, else 0. A row whose evidence is
    -inf has probability zero.
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
    """Probabilities of all hypotheses; the first is that nothing is missing.

    `apart` has the probabilities of faults that are judged without any model: a
    hypothesis may hold them or not.
    """

    hypotheses: tuple[Hypothesis, ...]
    probability: Array
    beside: Array  # probability of an unlisted cause, given the effects of each
    apart: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def effects(self) -> dict[str, float]:
        """Probability of each effect, the likeliest first."""
        out: dict[str, float] = {}
        for one, p in zip(self.hypotheses, self.probability, strict=True):
            for name in one.effects:
                out[name] = out.get(name, 0.0) + float(p)
        out = {
            n: max(p, self.apart.get(n, 0.0)) for n, p in {**self.apart, **out}.items()
        }
        return dict(sorted(out.items(), key=lambda item: -item[1]))

    @property
    def nothing(self) -> float:
        return float(self.probability[0])

    @cached_property
    def other(self) -> float:
        """Probability of an unlisted cause, alone or beside effects."""
        return self.nothing_named + float(self.probability @ self.beside)

    @property
    def nothing_named(self) -> float:
        """Probability that the missing effect is not on softnn's list."""
        them = [h.other for h in self.hypotheses]
        return float(self.probability[them].sum())

    @cached_property
    def selected(self) -> frozenset[str]:
        return frozenset(e for e, p in self.effects.items() if p >= NAMED)

    @cached_property
    def best(self) -> Tried:
        """The likeliest candidate with the selected effects, else the nearest set."""
        order = np.argsort(-self.probability, kind="stable")
        ranked = [self.hypotheses[i] for i in order]
        near = [h for h in ranked if h.effects == self.selected]
        near += sorted(ranked, key=lambda h: len(h.effects ^ self.selected))
        return near[0].account

    def ways(self) -> list[tuple[frozenset[str], float]]:
        """Return the sets of effects that share the probability, likeliest first."""
        total: dict[frozenset[str], float] = {}
        for one, p in zip(self.hypotheses, self.probability, strict=True):
            total[one.effects] = total.get(one.effects, 0.0) + float(p)
        ranked = sorted(total.items(), key=lambda item: -item[1])
        return [(s, p) for s, p in ranked if p >= LIKELY * ranked[0][1]]

    def readings(self) -> list[Tried]:
        """Return the candidates of these sets."""
        shared = [s for s, _ in self.ways()]
        return [h.account for h in self.hypotheses if h.effects in shared]

    def instead(self, name: str) -> list[str]:
        """Return the effects that replace a selected effect in alternative sets."""
        rest = self.selected - {name}
        return [
            next(iter(s - rest))
            for s, _ in self.ways()
            if name not in s and rest < s and len(s) == len(self.selected)
        ]


def table(
    sets: Sequence[frozenset[str]], figures: Array, constants: Constants = CONSTANTS
) -> tuple[list[tuple[int, bool]], Array]:
    """Return hypotheses and their rows (hypotheses, 7): the best form of each set.

    `figures` (candidates, 5) are as `Account.figures`. A hypothesis is the index of its
    candidate, and whether it stands for an unlisted cause.
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
    """Return the posterior over candidates, the first of which is the base alone."""
    figures = np.array([a.figures for a in accounts])
    found, rows = table([a.effects for a in accounts], figures, constants)
    p, beside = probabilities(rows, constants), _evidence(rows, constants)[1]
    return Posterior(tuple(Hypothesis(accounts[i], o) for i, o in found), p, beside)
