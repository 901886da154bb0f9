"""Faults of single recordings, judged where no law of the material matters.

What is read before anything moves, readings that stay at a limit, and differences
between replicates say the same whatever the material is. So these faults are judged by
themselves, once for all candidate models.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Piece, fit
from softnn.mismatch.accounts import REFITTED
from softnn.mismatch.candidates import refine, shown
from softnn.mismatch.posterior import NAMED, Hypothesis, Posterior

LEAST = 0.01  # of probability, that is worth a candidate of its own
CLIPPED = 0.99  # probability of a limit, where the highest readings are all the same


@dataclass(frozen=True)
class Fault:
    """An effect that is on in some recordings, and how likely that is."""

    piece: Piece
    chance: float

    @property
    def effect(self) -> str:
        """Id of the effect."""
        return self.piece.effect.id

    @property
    def likely(self) -> bool:
        """Whether it is named."""
        return self.chance >= NAMED

    def said(self, found: Fit) -> frozenset[str]:
        """The id of the fault, if it is likely and a fit has it in its recordings."""
        if not self.likely:
            return frozenset()
        mine = (p for p in found.guess.pieces if p.effect.id == self.effect)
        has = any(on(self.piece) <= on(p) for p in mine)
        return frozenset({self.effect} if has else ())


def on(piece: Piece) -> set[int]:
    """The recordings that a piece is on in."""
    return {r for group in piece.groups for r in group}


def at_limit(engine: Engine) -> list[Fault]:
    """A limit of the load cell, where the highest readings are all the same."""
    laws = [law for law in EFFECTS if law.id == "load_cell_saturation"]
    return [Fault(piece, CLIPPED) for piece in shown(engine, laws)]


def asked(probable: Posterior, fault: Fault, engine: Engine) -> Posterior:
    """The posterior, each hypothesis shared: with the fault, or without it."""

    def ask(found: Fit) -> tuple[float, Fit] | None:
        if any(p.effect.id == fault.effect for p in found.guess.pieces):
            return None
        return fault.chance, refine(engine, found, fault.piece, REFITTED)

    return shared(probable, ask)


def spared(probable: Posterior, fault: Fault, engine: Engine) -> Posterior:
    """The posterior of candidates that all have the fault, shared in the same way."""

    def ask(found: Fit) -> tuple[float, Fit] | None:
        rest = [p for p in found.guess.pieces if p.effect.id != fault.effect]
        guess, fixed = replace(found.guess, pieces=tuple(rest)), found.fixed_base
        less = fit(engine, guess, fixed_base=fixed, iterations=REFITTED)
        return 1 - fault.chance, less

    return shared(probable, ask)


def shared(
    probable: Posterior, ask: Callable[[Fit], tuple[float, Fit] | None]
) -> Posterior:
    """The posterior with each hypothesis shared between itself and another fit.

    `ask` has of a fit how likely the other one is, and the other; or None. Something
    that is not on the list stays, alone or beside the effects of the other.
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
    """Ids of the likely faults that a fit has."""
    return frozenset[str]().union(*(fault.said(found) for fault in faults))
