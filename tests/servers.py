"""A real PostgreSQL for tests, on loopback; without one they skip, saying so."""

import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

BESIDE = sorted(Path("/usr/lib/postgresql").glob("*/bin"))  # Debian's, not in PATH


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def program(name: str) -> str:
    found = shutil.which(name) or next(
        (str(f / name) for f in reversed(BESIDE) if (f / name).exists()), None
    )
    if found is None:
        pytest.skip(f"no PostgreSQL here: {name} is not installed (Debian: postgresql)")
    return str(Path(found).resolve())


@contextmanager
def postgresql() -> Iterator[str]:
    """The SQLAlchemy address of an empty database of a server of its own."""
    pytest.importorskip("psycopg", reason="no psycopg: pip install 'softnn[servers]'")
    initdb, server = program("initdb"), program("postgres")
    user, port = None, free_port()
    with tempfile.TemporaryDirectory(prefix="softnn-pg-") as data:
        if os.geteuid() == 0:  # PostgreSQL refuses to run as root
            user = "postgres"
            shutil.chown(data, user)
        quiet = {
            "stdout": subprocess.DEVNULL,
            "stderr": subprocess.DEVNULL,
            "cwd": data,
        }
        how = ["-D", data, "-U", "softnn", "--auth=trust", "--no-sync"]
        subprocess.run([initdb, *how], check=True, user=user, **quiet)
        where = ["-D", data, "-p", str(port), "-k", data, "-F"]
        child = subprocess.Popen([server, *where], user=user, **quiet)
        try:
            yield _ready(
                f"postgresql+psycopg://softnn@127.0.0.1:{port}/postgres", child
            )
        finally:
            child.send_signal(signal.SIGINT)  # at once, whoever is connected
            child.wait(30)


def new_database(address: str, name: str) -> str:
    """An empty database on the server of this one; its address.

    The name gets a number: tests of a module may come in two parts, each with its own.
    """
    import sqlalchemy

    name = f"{name}_{uuid.uuid4().hex[:8]}"
    engine = sqlalchemy.create_engine(address, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(sqlalchemy.text(f"CREATE DATABASE {name}"))
    engine.dispose()
    return address.rpartition("/")[0] + f"/{name}"


def _ready(address: str, child: subprocess.Popen) -> str:
    import sqlalchemy

    engine = sqlalchemy.create_engine(address, poolclass=sqlalchemy.pool.NullPool)
    for _ in range(300):
        assert child.poll() is None, "PostgreSQL did not start"
        try:
            engine.connect().close()
            return address
        except sqlalchemy.exc.OperationalError:
            time.sleep(0.1)
    raise AssertionError("PostgreSQL did not answer in 30 s")
