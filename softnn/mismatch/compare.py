"""Which effects do predictions need? Sets of effects compared in pairs, fold by fold.

All sets are wrong by far more than the noise, so likelihoods say nothing. What can be
measured is which set predicts better what a fit has not seen. Folds are few and differ
much in difficulty, which is the same for all sets; so sets are compared in pairs, as in
a paired test (Student 1908, doi:10.1093/biomet/6.1.1). The share of a set is the
probability that the best one is ahead of it by chance.

A cause that is not on the list takes no probability from these. The error that the best
set leaves speaks for a further cause, not against its effects, and the answer gives it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import t as student

from softnn.contracts import Array
from softnn.effects import effect

NAMED, SURE = 0.5, 0.9  # probabilities to name an effect, and to be certain of it
LIKELY = 0.1  # of the probability of the best set, from which a set is an alternative
PRICE = 0.1  # of a logarithm: an effect must take a tenth off the error
SPREAD = 0.1  # of a logarithm: usual deviation of a paired difference of two folds
CLEAR = 2  # usual deviations, beyond which a fold says no more about the scatter
MAD = 1.4826  # of a normal distribution: standard over median absolute deviation
BELIEVED = 2  # folds that this usual deviation is worth
FLOOR = 1e-3  # of the stress; smaller errors count as none
HARM = 0.05  # of an error: a correction may be worse by so much by chance
MOST = 3  # laws of a class; more say little

Sets = Sequence[frozenset[str]]


def shares(errors: Array, sizes: Array, unseen: float) -> Array:
    """Return the share (..., sets) of each set of effects; they sum to 1.

    `errors` (..., sets, folds) are NRMSE, `sizes` (sets,) numbers of effects. The mean
    difference of log errors to the best set, plus `PRICE` for each effect, has a
    standard error; its variance is drawn towards `SPREAD`, since folds are few. The
    fits of all folds share most recordings, so their errors are not independent: the
    ratio of samples left out to samples fitted, `unseen`, adds to 1/folds (Nadeau and
    Bengio 2003, doi:10.1023/A:1024068626366). A fold more than `CLEAR` usual deviations
    from the median counts as so many there: that a law fails wholly in one fold says
    nothing of how the others scatter.
    """
    log = np.log(errors + FLOOR)
    score = log.mean(axis=-1) + PRICE * sizes
    best, folds = score.argmin(axis=-1)[..., None], log.shape[-1]
    behind = log - np.take_along_axis(log, best[..., None], axis=-2)
    usual = np.median(behind, axis=-1, keepdims=True)
    off = MAD * np.median(np.abs(behind - usual), axis=-1, keepdims=True)
    most = CLEAR * np.maximum(off, SPREAD)
    scatter = np.clip(behind, usual - most, usual + most).var(axis=-1)
    apart = (scatter * folds + BELIEVED * SPREAD**2) / (folds + BELIEVED - 1)
    lost = score - np.take_along_axis(score, best, axis=-1)
    weight = student.sf(lost / np.sqrt(apart * (1 / folds + unseen)), folds)
    return np.asarray(weight / weight.sum(axis=-1, keepdims=True))


@dataclass(frozen=True)
class Class:
    """Laws that these recordings cannot tell apart, and that one of them is there."""

    members: tuple[str, ...]
    probability: float

    @property
    def name(self) -> str:
        """What the laws have in common, in the words of the field; "" if nothing."""
        family = {effect(m).family for m in self.members}
        return family.pop() if len(family) == 1 else ""


@dataclass(frozen=True)
class Names:
    """What the shares of sets say of each effect.

    `least` is the least probability of an effect as each fold is left out.
    """

    probability: Mapping[str, float]
    least: Mapping[str, float]
    classes: tuple[Class, ...] = field(default=())


def names(sets: Sets, errors: Array, unseen: float, chance: float = 0.0) -> Names:
    """Return the probability of each effect, and classes of laws that are like it.

    `errors` (sets, folds) are NRMSE, `unseen` is that of `shares`. `chance` is the
    probability that what these recordings need, the next one does not.
    """
    sizes = np.array([len(s) for s in sets])
    every = sorted(set().union(*sets))
    has = np.array([[name in s for s in sets] for name in every]).reshape(-1, len(sets))
    share = shares(errors, sizes, unseen) * (1 - chance)
    likely = has @ share
    fewer = [np.delete(errors, k, axis=1) for k in range(errors.shape[1])]
    parts = [shares(e, sizes, unseen) for e in fewer if e.shape[1] > 1]
    parts = [has @ part * (1 - chance) for part in parts]
    least = np.min([likely, *parts], axis=0)
    return Names(
        dict(zip(every, map(float, likely), strict=True)),
        dict(zip(every, map(float, least), strict=True)),
        classes(sets, share, dict(zip(every, likely, strict=True))),
    )


def classes(sets: Sets, share: Array, likely: Mapping[str, float]) -> tuple[Class, ...]:
    """Return the classes of laws that can take each other's place here.

    Two laws can if two sets that differ in them alone both have a share. A class is
    given if one of its laws is there with a probability of `SURE`, and of none alone is
    it sure.
    """
    top = share.max()
    near = {s for s, p in zip(sets, share, strict=True) if p >= LIKELY * top}
    swapped = {
        frozenset(a ^ b)
        for a in near
        for b in near
        if len(a) == len(b) and len(a ^ b) == 2
    }
    open_ = [n for n in sorted(likely, key=lambda n: -likely[n]) if likely[n] < SURE]
    out, taken = list[Class](), set[str]()
    for first in open_:
        if first in taken or likely[first] < LIKELY:
            continue
        members, found = [first], likely[first]
        while found < SURE and len(members) < MOST:
            more = [
                n
                for n in open_
                if n not in members and n not in taken and likely[n] >= LIKELY
                and any(frozenset((m, n)) in swapped for m in members)
            ]  # fmt: skip
            tried = [(_any(sets, share, [*members, n]), n) for n in more]
            if not tried:
                break
            found, best = max(tried)
            members.append(best)
        if found >= SURE and len(members) > 1:
            out.append(Class(tuple(members), float(found)))
            taken |= set(members)
    return tuple(out)


def _any(sets: Sets, share: Array, members: Sequence[str]) -> float:
    has = np.array([bool(s & set(members)) for s in sets])
    return float(share[has].sum())
