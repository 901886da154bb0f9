"""Processes for independent work: one BLAS thread each, gone when their parent is.

Or those of a Dask cluster, on any number of machines.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process

from softnn.contracts import InputError

RETRIES = 3  # of work whose Dask worker died
ANSWER_S = 15  # a scheduler is waited for


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
    before = set(active_children())
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=attached)
    try:
        yield pool
    except KeyboardInterrupt:  # do not wait for work that takes minutes
        for process in set(active_children()) - before:
            process.terminate()
        raise
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
