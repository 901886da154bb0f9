"""Processes for independent work: one BLAS thread each, gone when their parent is.

Or those of a Dask cluster, on any number of machines.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from typing import NoReturn, TypeVar

from softnn.contracts import InputError

RETRIES = 3  # of work whose Dask worker died
ANSWER_S = 15  # a scheduler is waited for
X = TypeVar("X")
Y = TypeVar("Y")


@contextmanager
def workers(jobs: int, scheduler: str | None = None) -> Iterator[Executor]:
    """A pool of `jobs` processes, or the workers of the Dask `scheduler` (tcp://...).

    What has not begun is dropped on the way out. Raises `InputError` where no
    scheduler answers.
    """
    if scheduler is not None:
        with _cluster(scheduler) as executor:
            yield executor
        return
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    # Spawned, not forked: the parent may hold threads of BLAS or torch.
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=attached)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _cluster(scheduler: str) -> Iterator[Executor]:
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler needs Dask, which is not installed: pip install "
            "'softnn[servers]'"
        ) from None
    try:
        client = Client(scheduler, timeout=ANSWER_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {scheduler!r} ({error}); start one with "
            "`dask scheduler`, workers with `dask worker`"
        ) from None
    with client, client.get_executor(pure=False, retries=RETRIES) as executor:
        yield executor


def attached() -> None:
    """A worker leaves ctrl-C to its parent, and ends when that is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def side_by_side(work: Callable[[X], Y], items: Iterable[X], jobs: int) -> list[Y]:
    """[work(x) for x in items], shared among this process and `jobs` - 1 forks of it.

    Forks see what it has in memory, so that results alone are sent. Where a process
    cannot safely be forked it does all of the work itself.
    """
    every = list(items)
    jobs = max(min(jobs, len(every)), 1) if sys.platform == "linux" else 1
    shares = [every[k::jobs] for k in range(jobs)]
    forks: dict[int, int] = {}  # pid: where to read from
    done: list[list[Y]] = []
    try:
        for share in shares[1:]:
            read, write = os.pipe()
            with warnings.catch_warnings():  # BLAS has threads, but idle ones
                warnings.simplefilter("ignore", DeprecationWarning)
                pid = os.fork()
            if not pid:
                _answer(work, share, write)
            os.close(write)
            forks[pid] = read
        done.append([work(x) for x in shares[0]])
        for pid, read in list(forks.items()):
            with os.fdopen(read, "rb") as pipe:
                answer = pipe.read()
            del forks[pid]
            os.waitpid(pid, 0)
            if not answer:
                raise RuntimeError("a fork of this process was killed")
            part = pickle.loads(answer)  # our own child's
            if isinstance(part, BaseException):
                raise part
            done.append(part)
    finally:
        for pid in forks:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
    return [done[i % len(done)][i // len(done)] for i in range(len(every))]


def _answer(work: Callable, share: list, write: int) -> NoReturn:
    """In a fork: do its share, write what comes of it, and be gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        try:
            out: object = [work(x) for x in share]
        except BaseException as error:
            out = error
        with os.fdopen(write, "wb") as pipe:
            pickle.dump(out, pipe, protocol=5)
    finally:
        os._exit(0)
