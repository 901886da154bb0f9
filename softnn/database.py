"""SQLite files that are whole or not there, and a lock that dies with its owner."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from filelock import FileLock, Timeout

from softnn.contracts import InputError

ALIVE_S = 2.0  # how long a lock is waited for that a living process holds
DYING_S = 60.0  # or a dying one: memory is given back before locks are
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


class Lock:
    """One process at a time; the system drops it with the process, however it dies.

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
