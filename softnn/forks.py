"""Independent steps of one piece of work, shared out to forks of this process.

A fork starts with all that is in memory, in some hundredths of a second: it pays for
steps of tenths. `softnn.workers` are for pieces of work that share nothing.
"""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterable
from multiprocessing import Pipe, parent_process
from multiprocessing.connection import Connection
from signal import SIGKILL
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

FORKS = os.name == "posix" and sys.platform != "darwin"  # Accelerate cannot be forked
_free: tuple[int, int] | None = None  # a pipe, with a byte for each idle processor


def each(work: Callable[[T], R], items: Iterable[T]) -> list[R]:
    """`[work(item) for item in items]`, on all processors where that is safe.

    It is not beside other threads (of a notebook, a progress bar), as a fork has none
    of them; and in a worker of a pool processors are taken: then all is done here.
    Steps may share out steps of their own: who has none left is free for any. What a
    step changes in memory may be lost, what it returns is pickled. A fork that fails
    or is killed leaves its steps to this process, which raises what they raise.
    """
    global _free
    todo = list(items)
    alone = threading.active_count() == 1 and parent_process() is None
    if len(todo) < 2 or not FORKS or not alone:
        return [work(item) for item in todo]
    if _free is not None:
        return _shared(work, todo)
    _free = os.pipe()
    try:
        os.set_blocking(_free[0], False)
        os.write(_free[1], bytes(len(os.sched_getaffinity(0)) - 1))
        return _shared(work, todo)
    finally:
        for end in _free:
            os.close(end)
        _free = None


def _shared(work: Callable[[T], R], todo: list[T]) -> list[R]:
    queue, tickets = os.pipe()  # whoever is free reads the number of the next step
    os.write(tickets, b"".join(i.to_bytes(2, "big") for i in range(len(todo))))
    os.close(tickets)

    def share(forks: list[tuple[int, Connection]] | None = None) -> dict[int, R]:
        done = {}
        while ticket := os.read(queue, 2):
            i = int.from_bytes(ticket, "big")
            while forks is not None and i + 1 + len(forks) < len(todo) and _taken():
                forks.append(_forked(share))
            done[i] = work(todo[i])
        return done

    forks: list[tuple[int, Connection]] = []
    try:
        done = share(forks)
        if forks:
            _give()  # while it waits
        for _, answer in forks:
            try:
                done |= answer.recv()
            except (EOFError, OSError):
                continue
        if forks:
            _taken()
    finally:
        os.close(queue)
        for pid, answer in forks:
            answer.close()
            os.kill(pid, SIGKILL)
            os.waitpid(pid, 0)
    return [done[i] if i in done else work(item) for i, item in enumerate(todo)]


def _give() -> None:
    """This processor is idle."""
    assert _free is not None
    os.write(_free[1], b"\0")


def _taken() -> bool:
    """Whether a processor was idle; it is taken."""
    assert _free is not None
    try:
        return bool(os.read(_free[0], 1))
    except BlockingIOError:
        return False


def _forked(share: Callable[[], dict[int, R]]) -> tuple[int, Connection]:
    """A fork that works at its share: its id, and where its answer can be read."""
    answer, end = Pipe(duplex=False)
    with warnings.catch_warnings():
        # Threads of BLAS are no hazard: it minds forks.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if pid:
        end.close()
        return pid, answer
    try:
        done = share()
        _give()
        end.send(done)
    finally:
        os._exit(0)
