"""Faults of single recordings, judged without any model of the material.

Stress before the first strain, readings that stay at a limit, and differences between
replicates mean the same for every material. So these faults are judged by themselves.
By prediction every candidate has the likely ones; by likelihood each candidate is split
between with and without.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Piece
from softnn.mismatch.accounts import REFITTED
from softnn.mismatch.candidates import refine, shown
from softnn.mismatch.posterior import NAMED, Hypothesis, Posterior

LEAST = 0.01  # probability from which a fault gets a candidate model of its own
CLIPPED = 0.99  # probability of a limit, if the highest readings are all equal


@dataclass(frozen=True)
class Fault:
    """An effect that is present in some recordings, and its probability."""

    piece: Piece
    chance: float

    @property
    def effect(self) -> str:
        """Id of the effect."""
        return self.piece.effect.id

    @property
    def likely(self) -> bool:
        """Whether the fault is named."""
        return self.chance >= NAMED

    def said(self, found: Fit) -> frozenset[str]:
        """Return the id of the fault if it is likely and a fit has it there too."""
        if not self.likely:
            return frozenset()
        mine = (p for p in found.guess.pieces if p.effect.id == self.effect)
        has = any(on(self.piece) <= on(p) for p in mine)
        return frozenset({self.effect} if has else ())


def on(piece: Piece) -> set[int]:
    """Return the indices of the recordings in which an effect is present."""
    return {r for group in piece.groups for r in group}


def at_limit(engine: Engine) -> list[Fault]:
    """Return a load-cell limit, if the highest readings are all equal."""
    laws = [law for law in EFFECTS if law.id == "load_cell_saturation"]
    return [Fault(piece, CLIPPED) for piece in shown(engine, laws)]


def asked(probable: Posterior, fault: Fault, engine: Engine) -> Posterior:
    """Return the posterior with each hypothesis split: with and without the fault."""

    def ask(found: Fit) -> tuple[float, Fit] | None:
        if any(p.effect.id == fault.effect for p in found.guess.pieces):
            return None
        return fault.chance, refine(engine, found, fault.piece, REFITTED)

    return shared(probable, ask)


def shared(
    probable: Posterior, ask: Callable[[Fit], tuple[float, Fit] | None]
) -> Posterior:
    """Return the posterior with each hypothesis split between itself and another fit.

    `ask` takes a fit and returns the probability of the other fit, and that fit; or
    None. The probability of a cause outside softnn's list stays, alone or beside
    effects.
    """
    hypotheses, probability = list(probable.hypotheses), list(probable.probability)
    beside = list(probable.beside)
    for i, one in enumerate(probable.hypotheses):
        told = ask(one.account.fit) if probability[i] >= LEAST else None
        if told is None or probability[i] * told[0] < LEAST:
            continue
        share = probability[i] * told[0]
        other: Any = replace(cast(Any, one.account), fit=told[1])
        unlisted = 1.0 if one.other else float(probable.beside[i])
        alone = not other.effects and unlisted == 1.0
        hypotheses.append(Hypothesis(other, alone))
        probability[i] -= share
        probability.append(share)
        beside.append(0.0 if alone else unlisted)
    return Posterior(tuple(hypotheses), np.array(probability), np.array(beside))


def named(faults: Sequence[Fault], found: Fit) -> frozenset[str]:
    """Return the ids of the likely faults that a fit has."""
    return frozenset[str]().union(*(fault.said(found) for fault in faults))
