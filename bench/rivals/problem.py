"""A case as every rival gets it: recordings, base at its best, noise, residual."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from bench.rivals import columns, folds
from softnn.contracts import Array, Effect
from softnn.fit import Data, Engine, Fit, fit
from softnn.mismatch.base import Baseline, beyond, start
from softnn.mismatch.candidates import candidates
from softnn.mismatch.case import read_case
from softnn.mismatch.screen import Screen

T = TypeVar("T")


@dataclass
class Problem:
    """What a rival may know of a case; parts are made when first asked for.

    `seconds` holds what each part took, so that a method is charged for what it uses.
    """

    name: str
    data: Data
    base: Baseline
    seconds: dict[str, float] = field(default_factory=dict)

    def timed(self, part: str, make: Callable[[], T]) -> T:
        begun = time.perf_counter()
        made = make()
        self.seconds[part] = time.perf_counter() - begun
        return made

    @property
    def engine(self) -> Engine:
        return self.base.engine

    @property
    def residual(self) -> Array:
        """Measured minus simulated (valid,), MPa."""
        return self.engine.target - self.base.fit.stress

    @cached_property
    def noise_power(self) -> float:
        """Sum of the noise variances of all samples, MPa^2."""
        return float(np.sum(self.engine.sigma**2))

    @cached_property
    def pool(self) -> list[Effect]:
        return candidates(self.engine, self.base.name, self.base.fixed)

    @cached_property
    def features(self) -> columns.Features:
        return self.timed(
            "features", lambda: columns.features(self.engine, self.base.fit.stress)
        )

    @cached_property
    def dictionary(self) -> columns.Dictionary:
        return self.timed(
            "dictionary",
            lambda: columns.dictionary(self.engine, self.base.fit, self.pool),
        )

    @cached_property
    def screen(self) -> Screen:
        """What the base may still absorb, with samples whitened by the noise."""
        return Screen(self.engine, self.base.fit)

    @cached_property
    def plain(self) -> tuple[Engine, Fit]:
        """The same fit with all samples alike: white noise of one level."""
        return self.timed("plain", self._plain)

    def _plain(self) -> tuple[Engine, Fit]:
        engine = Engine(self.data)
        if self.base.fixed and self.data.simulated_MPa is not None:
            engine = beyond(self.data, self.data.simulated_MPa, self.base.fit.guess)
        found = alike(engine, self.base.fit)
        return engine, alike(engine, found)

    @cached_property
    def plain_screen(self) -> Screen:
        return Screen(*self.plain)

    @cached_property
    def folds(self) -> list[folds.Fold]:
        """The base refitted without each recording."""
        return self.timed("folds", lambda: folds.of(self.engine, self.base.fit))


def alike(engine: Engine, found: Fit) -> Fit:
    """The fit again, every sample weighed by the root mean square of what is left."""
    left = engine.target - engine.run(found.guess, False)[0]
    level = max(float(np.sqrt(np.mean(left**2))), 1e-12 * engine.level)
    engine.set_noise([np.full(len(s), level) for s in engine.data.stress_MPa], None)
    return fit(engine, found.guess, fixed_base=found.fixed_base, iterations=4)


def read(folder: str | Path) -> Problem:
    """The case in `folder`, prepared as the diagnosis prepares it."""
    begun = time.perf_counter()
    case = read_case(folder)
    base = start(case)
    return Problem(
        case.name, base.engine.data, base, {"base": time.perf_counter() - begun}
    )
