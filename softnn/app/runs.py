"""The processes that compute: one a project and kind, ended with their server.

A diagnosis is minutes of arithmetic, so it never runs in the server: each run is a
process group of its own. Its standard input is held open by the server; when that is
gone, however it went, the process reads the end of it and stops.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from softnn.app.project import Project
from softnn.contracts import InputError
from softnn.workers import attached

PATIENCE_S = 3.0  # for a process to end by itself
ASKED_S = 120.0  # for a file to be read, or a model to be written

Run = subprocess.Popen[bytes]


class Runs:
    """Every process of this server, by project and kind of work."""

    def __init__(self, most: int | None = None) -> None:
        self.most = most or 4 * (os.cpu_count() or 1)
        self._runs: dict[tuple[str, str], Run] = {}
        self._all: list[Run] = []
        self._mlflow: tuple[Run, int] | None = None
        self._pool: ProcessPoolExecutor | None = None

    # -- long work ---------------------------------------------------------------------

    def start(self, project: Project, what: str) -> None:
        """Begin a run. Raises `InputError` when it is on, or too many are."""
        if self.running(project, what):
            raise InputError("it is running already; cancel it first")
        going = sum(run.poll() is None for run in self._all)
        if going >= self.most:
            raise InputError(f"{going} runs are going on; wait until one has ended")
        project.tell(what, stage="starting", began=time.time())
        self._runs[project.id, what] = self._begin(
            project.folder / f"{what}.log", what, str(project.folder)
        )

    def _begin(self, log: Path, *arguments: str) -> Run:
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        with log.open("wb") as told:
            run = subprocess.Popen(
                [sys.executable, "-m", "softnn.app.work", *arguments],
                stdin=subprocess.PIPE,
                stdout=told,
                stderr=subprocess.STDOUT,
                env=os.environ | threads,
                start_new_session=True,
            )
        for gone in [r for r in self._all if r.poll() is not None]:
            _let_go(gone)
            self._all.remove(gone)
        self._all.append(run)
        return run

    def mlflow(self, out: Path) -> int:
        """The port at which MLflow's own pages are, or soon will be."""
        if self._mlflow is None or self._mlflow[0].poll() is not None:
            with socket.socket() as free:
                free.bind(("127.0.0.1", 0))
                port = int(free.getsockname()[1])
            run = self._begin(out / "mlflow.log", "mlflow", str(out), str(port))
            self._mlflow = run, port
        return self._mlflow[1]

    def running(self, project: Project, what: str) -> bool:
        """Whether a run has not ended; what it still logs to MLflow does not count."""
        run = self._runs.get((project.id, what))
        gone = run is None or run.poll() is not None
        return not gone and "ended" not in project.state(what)

    def state(self, project: Project, what: str) -> dict[str, Any]:
        """As `Project.state`; a run that is gone without a word has "failed"."""
        told = project.state(what)
        if told and "ended" not in told and not self.running(project, what):
            told = project.state(what)  # it may have ended in between
            if "ended" not in told:
                why = _last_line(project.folder / f"{what}.log")
                project.tell(
                    what,
                    ended="failed",
                    line=f"The run stopped before its end. {why}"[:500],
                )
                told = project.state(what)
        return told

    def cancel(self, project: Project, what: str) -> None:
        """End a run and all that it started; what it had written aside goes."""
        run = self._runs.get((project.id, what))
        if run is not None:
            _end(run)
            if "ended" not in project.state(what):
                project.tell(what, ended="cancelled", line="Cancelled.")

    # -- short work --------------------------------------------------------------------

    async def ask(self, do: Callable[..., Any], *arguments: Any) -> Any:
        """What a function of `work.py` answers, from a process kept for such work."""
        import asyncio

        for again in (True, False):
            if self._pool is None:
                self._pool = ProcessPoolExecutor(
                    2, get_context("spawn"), initializer=attached
                )
            pool = self._pool
            answer = asyncio.get_running_loop().run_in_executor(pool, do, *arguments)
            try:
                return await asyncio.wait_for(answer, ASKED_S)
            except (BrokenProcessPool, TimeoutError) as error:
                if self._pool is pool:
                    self._pool = None
                for process in list((pool._processes or {}).values()):
                    process.kill()
                pool.shutdown(wait=False, cancel_futures=True)
                if isinstance(error, TimeoutError) or not again:
                    raise InputError(
                        "it took too long or too much memory; use a smaller file"
                    ) from None
        raise AssertionError

    def close(self) -> None:
        for run in self._all:
            _end(run, 0.5)
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)


def _last_line(log: Path) -> str:
    lines = log.read_text("utf-8", "replace").split("\n") if log.is_file() else []
    return next((line for line in reversed(lines) if line.strip()), "")


def _end(run: Run, patience_s: float = PATIENCE_S) -> None:
    for sign in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(run.pid, sign)  # also what it started
        try:
            run.wait(patience_s)
        except subprocess.TimeoutExpired:
            continue
        # The leader is gone; whoever of its group ignored the first sign goes too.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(run.pid, signal.SIGKILL)
        break
    _let_go(run)


def _let_go(run: Run) -> None:
    if run.stdin is not None:
        run.stdin.close()
