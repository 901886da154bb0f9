"""What single recordings show where laws have no part: asked of every hypothesis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from softnn.fit import Engine, Fit, Piece
from softnn.mismatch.accounts import REFITTED
from softnn.mismatch.candidates import refine
from softnn.mismatch.posterior import NAMED, Hypothesis, Posterior

LEAST = 0.01  # of probability, that is worth an account of its own


@dataclass(frozen=True)
class Apart:
    """A piece that is on in the recordings that stand apart, and how likely that is."""

    engine: Engine
    piece: Piece | None = None
    chance: float = 0.0

    def asked(self, probable: Posterior) -> Posterior:
        """The posterior, each hypothesis shared: nothing is apart, or these are."""

        def ask(found: Fit) -> tuple[float, Fit] | None:
            if self.piece is None or any(map(self._alike, found.guess.pieces)):
                return None
            return self.chance, refine(self.engine, found, self.piece, REFITTED)

        return asked_apart(probable, ask)

    def said(self, found: Fit) -> frozenset[str]:
        """The id of what is apart, where that is likely and a fit has it in those."""
        if self.piece is None or self.chance < NAMED:
            return frozenset()
        those = on(self.piece)
        has = any(self._alike(p) and those <= on(p) for p in found.guess.pieces)
        return frozenset({self.piece.effect.id} if has else ())

    def _alike(self, piece: Piece) -> bool:
        return self.piece is not None and piece.effect.id == self.piece.effect.id


def on(piece: Piece) -> set[int]:
    """The recordings that a piece is on in."""
    return {r for group in piece.groups for r in group}


def asked_apart(
    probable: Posterior, ask: Callable[[Fit], tuple[float, Fit] | None]
) -> Posterior:
    """The posterior with each hypothesis shared between what it is and one effect more.

    `ask` has of a fit how likely that is, and the fit with it; or None. Beside
    something on no list it leaves that there.
    """
    hypotheses, probability = list(probable.hypotheses), list(probable.probability)
    beside = list(probable.beside)
    for i, one in enumerate(probable.hypotheses):
        asked = ask(one.account.fit) if probability[i] >= LEAST else None
        if asked is None or probability[i] * asked[0] < LEAST:
            continue
        share = probability[i] * asked[0]
        with_it: Any = replace(cast(Any, one.account), fit=asked[1])
        hypotheses.append(Hypothesis(with_it))
        probability[i] -= share
        probability.append(share)
        beside.append(1.0 if one.other else probable.beside[i])
    return Posterior(tuple(hypotheses), np.array(probability), np.array(beside))
