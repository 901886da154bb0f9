"""How far a long run is: computations say so, and whoever started them may listen.

A computation calls `stage` where a part of it begins and `step` wherever it has come on
a little. Without a listener both cost nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

EVERY_S = 0.1  # between two calls of a listener


@dataclass(frozen=True)
class Progress:
    """Where a run is: its stage, steps made in that stage, seconds since it began."""

    stage: str  # "reading", "diagnosing" or "writing"
    steps: int
    seconds: float


Listener = Callable[[Progress], None]


class _Told:
    """What a listener was told last."""

    def __init__(self, listener: Listener) -> None:
        self.listener = listener
        self.began = self.last = time.monotonic()
        self.stage, self.steps = "", 0

    def tell(self, now: float) -> None:
        self.last = now
        self.listener(Progress(self.stage, self.steps, now - self.began))


_TOLD: ContextVar[_Told | None] = ContextVar("told", default=None)


@contextmanager
def heard(listener: Listener | None) -> Iterator[None]:
    """Tell `listener` of what is computed inside; nothing changes where it is None.

    The listener is called in the same thread, at most every 0.1 s and at each new
    stage. An exception that it raises ends the run: so a run is cancelled.

    >>> with heard(lambda p: print(p.stage, p.steps)):
    ...     stage("reading")
    reading 0
    """
    if listener is None:
        yield
        return
    token = _TOLD.set(_Told(listener))
    try:
        yield
    finally:
        _TOLD.reset(token)


def stage(name: str) -> None:
    """A part of the run begins."""
    told = _TOLD.get()
    if told is not None:
        told.stage, told.steps = name, 0
        told.tell(time.monotonic())


def step() -> None:
    """The stage has come on by a step."""
    told = _TOLD.get()
    if told is not None:
        told.steps += 1
        now = time.monotonic()
        if now - told.last > EVERY_S:
            told.tell(now)
