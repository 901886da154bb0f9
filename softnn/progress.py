"""How far a long run is: computations say so, and whoever started them may listen.

A computation calls `stage` where a part of it begins and `step` wherever it has come on
a little. Without a listener both cost nothing.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

EVERY_S = 0.1  # between two calls of a listener
SURE = 0.03  # of a stage, before which nothing is said of the time left


@dataclass(frozen=True)
class Progress:
    """Where a run is: its stage, steps made in that stage, seconds since it began.

    `share` of the stage, or of its present `part`, is done, from 0 to 1; 0 where nobody
    knows. `left_s` seconds are left of it, or None. `item` is what it is at: a file.
    """

    stage: str  # "reading", "diagnosing" or "writing"
    steps: int
    seconds: float
    share: float = 0.0
    left_s: float | None = None
    item: str = ""
    part: str = ""
    so_far: str = ""


Listener = Callable[[Progress], None]


class _Told:
    """What a listener was told last."""

    def __init__(self, listener: Listener) -> None:
        self.listener = listener
        self.began = self.last = time.monotonic()
        self.changed = self.began
        self.stage, self.steps, self.item = "", 0, ""
        self.part, self.pieces, self.count = "", 0.0, 0
        self.so_far = ""

    def tell(self, now: float) -> None:
        self.last = now
        share, left = 0.0, None
        if self.count:
            share = min(self.pieces / self.count, 1.0)
            if share > SURE:
                left = (now - self.changed) * (1 - share) / share
        seconds = now - self.began
        where = self.stage, self.steps, seconds, share, left
        self.listener(Progress(*where, self.item, self.part, self.so_far))


_TOLD: ContextVar[_Told | None] = ContextVar("told", default=None)


@contextmanager
def heard(listener: Listener | None) -> Iterator[None]:
    """Tell `listener` of computations inside; None listens to nothing.

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


def stage(name: str, count: int = 0) -> None:
    """A stage of the run begins, of so many pieces; 0 if nobody knows."""
    told = _TOLD.get()
    if told is not None:
        told.stage, told.steps, told.item = name, 0, ""
        part("", count)


def part(name: str, count: int) -> None:
    """A part of the stage begins, of so many pieces about as long as each other.

    The time left is that of the part: how many parts follow depends on their results.
    """
    told = _TOLD.get()
    if told is not None:
        told.part, told.pieces, told.count = name, 0.0, count
        told.changed = time.monotonic()
        told.tell(told.changed)


def so_far(answer: str) -> None:
    """The answer would be this one, if the run ended now."""
    told = _TOLD.get()
    if told is not None and answer != told.so_far:
        told.so_far = answer
        told.tell(time.monotonic())


def step(item: str = "") -> None:
    """The stage has come on a little, and is at an item now."""
    told = _TOLD.get()
    if told is not None:
        told.steps += 1
        told.item = item
        _tell(told)


def piece(done: float = 1.0) -> None:
    """A piece is done, or the share `done` of the piece under way.

    >>> with heard(lambda p: print(p.part, p.share)):
    ...     part("one effect", 4)
    ...     piece(), piece(0.5)
    ...     stage("writing")
    one effect 0.0
    (None, None)
     0.0
    """
    told = _TOLD.get()
    if told is not None:
        whole = int(told.pieces)
        told.pieces = whole + 1 if done >= 1 else whole + max(done, told.pieces - whole)
        _tell(told)


def _tell(told: _Told) -> None:
    now = time.monotonic()
    if now - told.last > EVERY_S:
        told.tell(now)


def watched() -> bool:
    """Whether somebody watches, on a terminal or in a notebook; nothing else tells."""
    return _TOLD.get() is None and (sys.stderr.isatty() or _notebook())


def _notebook() -> bool:
    shell = sys.modules.get("IPython")
    name = "" if shell is None else type(shell.get_ipython()).__name__
    return name == "ZMQInteractiveShell"


class Shown:
    """A line on the terminal that says what runs, for how long, and how far it is.

    A thread writes it anew twice a second: it moves even where a step takes long.
    Without a terminal it is a line of its own every ten seconds. Nothing is written
    where `quiet`.
    """

    def __init__(self, label: str, quiet: bool = False) -> None:
        self.label, self.quiet = label, quiet
        self.live = not quiet and (sys.stderr.isatty() or _notebook())
        self.now = Progress("", 0, 0.0)
        self.began = self.heard = time.monotonic()
        self.over = threading.Event()
        self.lock = threading.Lock()

    def __enter__(self) -> Shown:
        if not self.quiet:
            self.thread = threading.Thread(target=self._beat, daemon=True)
            self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        if not self.quiet:
            self.thread.join()
            self.clear()

    def __call__(self, now: Progress) -> None:
        before, self.now, self.heard = self.now, now, time.monotonic()
        if now.so_far != before.so_far and not self.quiet:
            self.say(f"{self.label}, so far: {now.so_far}")

    def say(self, line: str) -> None:
        """A line of its own, above the one that moves."""
        with self.lock:
            self._clear()
            print(line, file=sys.stderr, flush=True)

    def clear(self) -> None:
        with self.lock:
            self._clear()

    def _clear(self) -> None:
        if self.live:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def _beat(self) -> None:
        while not self.over.wait(BEAT_S if self.live else SIGN_S):
            with self.lock, contextlib.suppress(OSError, ValueError):
                if self.live:
                    width = shutil.get_terminal_size().columns - 1
                    print(f"\r\x1b[K{self.line()[:width]}", end="", file=sys.stderr,
                          flush=True)  # fmt: skip
                else:
                    print(self.line(), file=sys.stderr, flush=True)

    def line(self) -> str:
        """What runs, how far it is, since when, and about how long it will take."""
        now, seconds = self.now, time.monotonic() - self.began
        told = f"{self.label}: {_SAID.get(now.stage, 'starting')}"
        told += f" {now.item}" if now.item else ""
        told += f", {now.part}" if now.part else ""
        if not now.share:
            return f"{told}, {spelt(seconds)}"
        full = round(20 * now.share)
        bar = "#" * full + "-" * (20 - full)
        left = ""
        if now.left_s is not None:
            rest = now.left_s - (time.monotonic() - self.heard)
            of = " of this part" if now.part else ""
            left = f", about {spelt(rest)} left{of}" if rest > 1 else ""
        return f"{told} [{bar}] {spelt(seconds)}{left}"


_SAID = {"reading": "reading", "diagnosing": "comparing models", "writing": "writing"}
BEAT_S, SIGN_S = 0.5, 10.0  # between two signs of life, on a terminal and elsewhere


def spelt(seconds: float) -> str:
    """A time as one would say it.

    >>> spelt(42.3), spelt(125), spelt(7300)
    ('42 s', '2 min 5 s', '2 h 1 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"
