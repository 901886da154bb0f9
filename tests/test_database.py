"""Databases and locks under real kills: killed at any moment, started again at once."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from softnn.contracts import InputError
from softnn.database import Lock, made_aside, undisturbed
from softnn.search import Search
from softnn.tracking import Tracker

ROOT = Path(__file__).parents[1]
ABOUT = {
    "study": "s",
    "identity": "1",
    "name": "n",
    "parameters": {},
    "data": ("d", "f" * 64),
}
SEARCH = """
from softnn.search import Search
with Search("sqlite:///x.db", "s", {"n": [1]}) as search:
    print("open", flush=True)
    import time; time.sleep(60)
"""
TRACKER = f"""
from softnn.tracking import Tracker
with Tracker("sqlite:///x.db", "e", **{ABOUT!r}):
    print("open", flush=True)
"""


def child(code: str, folder: Path) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )


def killed_while_making(code: str, folder: Path, tables: int) -> None:
    """Kill -9 as soon as the database being made holds so many tables."""
    made = child(code, folder)
    deadline = time.monotonic() + 120
    while not any(count(f) >= tables for f in making(folder)):
        assert made.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.001)
    made.send_signal(signal.SIGKILL)
    made.communicate()
    assert not (folder / "x.db").exists()
    assert making(folder)


def making(folder: Path) -> list[Path]:
    found = folder.glob(".x.db.making-*")
    return [f for f in found if not f.name.endswith("-journal")]


def count(file: Path) -> int:
    try:
        with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as connection:
            rows = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError:
        return 0
    finally:
        if "connection" in locals():
            connection.close()
    return int(rows[0])


@pytest.mark.slow
def test_killed_while_optuna_makes_its_database(tmp_path):
    killed_while_making(SEARCH, tmp_path, 1)
    with Search(f"sqlite:///{tmp_path / 'x.db'}", "s", {"n": [1]}) as search:
        assert search.run({"n": 1}, lambda _: (2.0, {})).value == 2.0
    assert not list(tmp_path.glob(".x.db.making-*"))


@pytest.mark.slow
@pytest.mark.parametrize("tables", [1, 12, 30])
def test_killed_while_mlflow_makes_its_database(tables, tmp_path):
    killed_while_making(TRACKER, tmp_path, tables)
    with Tracker(f"sqlite:///{tmp_path / 'x.db'}", "e", **ABOUT) as tracker:
        assert tracker.run_id
    assert not list(tmp_path.glob(".x.db.making-*"))


@pytest.mark.slow
def test_killed_at_work_and_opened_at_once(tmp_path):
    for _ in range(3):
        running = child(SEARCH, tmp_path)
        assert running.stdout
        assert running.stdout.readline() == "open\n"
        with pytest.raises(InputError, match="is being run by another process"):
            Search(f"sqlite:///{tmp_path / 'x.db'}", "s", {"n": [1]})
        running.send_signal(signal.SIGKILL)  # not waited for: it may still be dying
        with Search(f"sqlite:///{tmp_path / 'x.db'}", "s", {"n": [1]}):
            pass
        running.communicate()


def test_of_two_that_make_a_file_one_does(tmp_path):
    made = []
    for text in ("first", "second"):
        made_aside(
            tmp_path / "x.db", lambda f, t=text: made.append(t) or f.write_text(t)
        )
    assert made == ["first"]
    assert (tmp_path / "x.db").read_text() == "first"


def test_a_file_that_cannot_be_made_is_not_there(tmp_path):
    with pytest.raises(ZeroDivisionError):
        made_aside(tmp_path / "x.db", lambda f: f.write_text(str(1 / 0)))
    assert not (tmp_path / "x.db").exists()
    assert not list(tmp_path.glob(".x.db.making-*"))


def test_a_lock_let_go_is_free(tmp_path):
    lock = Lock(tmp_path / "a.lock", "it")
    lock.release()
    lock.release()
    Lock(tmp_path / "a.lock", "it").release()


def test_ctrl_c_waits_for_the_end_of_what_is_written():
    done = []

    def write():
        with undisturbed():
            with undisturbed():
                signal.raise_signal(signal.SIGINT)
                done.append("inner")
            done.append("outer")
        done.append("after")

    with pytest.raises(KeyboardInterrupt):
        write()
    assert done == ["inner", "outer"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("levels", [1, 2])
def test_a_second_ctrl_c_does_not_wait(levels):
    done = []

    def write():
        signal.raise_signal(signal.SIGINT)
        done.append("first")
        signal.raise_signal(signal.SIGINT)
        done.append("second")

    for _ in range(levels):
        write = undisturbed()(write)
    with pytest.raises(KeyboardInterrupt):
        write()
    assert done == ["first"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
