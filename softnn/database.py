"""SQLite files, complete or absent; finished rows; locks that end with the process.

Locks of a database server (PostgreSQL's advisory ones) hold over all its machines.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import signal
import sqlite3
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

from filelock import FileLock, Timeout

from softnn.contracts import InputError
from softnn.json_file import plain

ALIVE_S = 2.0  # wait for a lock of a living process
DYING_S = 60.0  # or of a dying one: it frees memory before locks
EXITING = 0x4  # Linux: PF_EXITING in the flags of /proc/PID/stat


def sqlite_file(address: str) -> Path | None:
    """The file of an SQLAlchemy address; None for another server, or for memory."""
    path = address.removeprefix("sqlite:///")
    return Path(path) if path != address and path and path != ":memory:" else None


def made_aside(file: Path, make: Callable[[Path], None]) -> None:
    """Let `make` write a database beside `file` and give it that name when whole.

    Nothing is done where the file is there. Of two processes that make it the first
    one wins; what a killed one left is removed by the next.
    """
    if file.exists():
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(file.with_name(f".{file.name}.making.lock")):
        if file.exists():
            return
        for left in file.parent.glob(f".{file.name}.making-*"):
            left.unlink(missing_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{file.name}.making-", dir=file.parent)
        os.close(handle)
        try:
            make(Path(name))
            Path(name).replace(file)
        finally:
            Path(name).unlink(missing_ok=True)


_waiting: list[bool] = []  # whether this process is within `undisturbed` already


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Let ctrl-C, and a `kill` that means the same, wait for the end of the block.

    Cut off within a statement, SQLAlchemy may keep a connection with an open
    transaction, and whoever writes next finds the file locked. A second ctrl-C does
    not wait: a server may never answer. Off the main thread no signal arrives.
    """
    if threading.current_thread() is not threading.main_thread() or _waiting:
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    handlers: dict[int, Callable[[int, FrameType | None], Any]] = {
        number: handler
        for number in (signal.SIGINT, signal.SIGTERM)
        if callable(handler := signal.getsignal(number))
    }

    def wait(number: int, frame: FrameType | None) -> None:
        came.append((number, frame))
        if len(came) > 1:
            handlers[number](number, frame)

    _waiting.append(True)
    for number in handlers:
        signal.signal(number, wait)
    try:
        yield
    finally:
        _waiting.clear()
        for number in reversed(handlers):  # ctrl-C last: it may raise at once
            signal.signal(number, handlers[number])
        if came:
            handlers[came[0][0]](*came[0])


class Store:
    """Finished rows by name, on disk at once, so that a stopped study can go on.

    Use it as a context. Rows made by other `code` are ignored. Raises `InputError` for
    a file that is something else.
    """

    def __init__(self, path: Path, code: str = "", fresh: bool = False) -> None:
        self.path, self.code = path, code
        path.parent.mkdir(parents=True, exist_ok=True)
        if fresh:
            path.unlink(missing_ok=True)
        try:
            self._base = sqlite3.connect(path, timeout=60)
            self._base.execute(
                "CREATE TABLE IF NOT EXISTS outcomes"
                " (name TEXT, code TEXT, row TEXT, PRIMARY KEY (name, code))"
            )
        except sqlite3.DatabaseError as error:
            raise InputError(f"{path} is no store of outcomes: {error}") from None

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *error: object) -> None:
        self._base.close()

    def add(self, name: str, row: Mapping[str, Any]) -> None:
        with self._base:
            self._base.execute(
                "INSERT OR REPLACE INTO outcomes VALUES (?, ?, ?)",
                (name, self.code, json.dumps(plain(row))),
            )

    def rows(self) -> dict[str, dict[str, Any]]:
        """All rows, by name."""
        found = self._base.execute(
            "SELECT name, row FROM outcomes WHERE code = ?", (self.code,)
        )
        return {name: json.loads(row) for name, row in found}


class Lock:
    """A lock for one process; the system drops it however the process ends.

    `what` is said to whoever comes second, by `InputError`.
    """

    def __init__(self, file: Path, what: str) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        self._lock = FileLock(file)
        owner = file.with_suffix(".owner")
        began = time.monotonic()
        while True:
            try:
                self._lock.acquire(timeout=0.1)
                break
            except Timeout:
                waited = time.monotonic() - began
                if waited > (ALIVE_S if _lives(owner) else DYING_S):
                    raise InputError(
                        f"{what} is being run by another process; wait for it to end "
                        "or stop it"
                    ) from None
        owner.write_text(str(os.getpid()), encoding="ascii")

    def release(self) -> None:
        """Let others in; a second time does nothing."""
        self._lock.release()


def _lives(owner: Path) -> bool:
    """Whether the process named in a file is alive and not on its way out."""
    try:
        pid = int(owner.read_text(encoding="ascii"))
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (OSError, ValueError):
        return False
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return not Path("/proc/self").exists()  # gone just now, or no Linux
    return fields[0] not in "ZX" and not int(fields[6]) & EXITING


class ServerLock:
    """A lock for all users of a PostgreSQL server, which drops it with the process.

    `waits`: for as long as another has it.
    """

    def __init__(self, address: str, what: str, waits: bool = False) -> None:
        import sqlalchemy

        self._engine = sqlalchemy.create_engine(
            address, poolclass=sqlalchemy.pool.NullPool, isolation_level="AUTOCOMMIT"
        )
        number = int.from_bytes(hashlib.sha256(what.encode()).digest()[:8], signed=True)
        call = "pg_advisory_lock" if waits else "pg_try_advisory_lock"
        try:
            self._held = self._engine.connect()
            got = self._held.scalar(sqlalchemy.text(f"SELECT {call}({number})"))
        except sqlalchemy.exc.SQLAlchemyError as error:
            raise InputError(
                f"storage {shown(address)} cannot be opened "
                f"({str(error).splitlines()[0]})"
            ) from None
        if got is False:
            self.release()
            raise InputError(
                f"{what} is being run by another process; wait for it to end, stop it, "
                "or help it with --worker"
            )

    def release(self) -> None:
        """Let others in; a second time does nothing."""
        self._held.close()
        self._engine.dispose()


@contextlib.contextmanager
def server_lock(address: str, what: str) -> Iterator[None]:
    """One after another, where the address is a PostgreSQL server's."""
    if not address.startswith("postgresql"):
        yield
        return
    lock = ServerLock(address, what, waits=True)
    try:
        yield
    finally:
        lock.release()


def shown(address: str) -> str:
    """An address without its password."""
    import sqlalchemy

    try:
        return repr(sqlalchemy.make_url(address).render_as_string())
    except sqlalchemy.exc.ArgumentError:
        return repr(address)
