"""Several processes on one search, in a real PostgreSQL."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from softnn.contracts import InputError
from softnn.search import Range, Search

ROOT = Path(__file__).parents[1]
SPACE = {"x": Range(-1.0, 1.0), "kind": ["even", "odd"]}
FIRST = [{"x": 0.5, "kind": "even"}, {"x": -0.5, "kind": "odd"}]
TRIALS = 12
PROGRAM = """
import os, sys, time
from concurrent.futures import Future
from pathlib import Path
from softnn.search import Range, Search

def submit(parameters, known):
    done = Future()
    stuck = Path(sys.argv[3])
    if stuck.name == "stuck":
        stuck.touch()
        time.sleep(600)
    time.sleep(0.05)
    values = parameters["x"] ** 2, abs(parameters["x"] - 0.3)
    done.set_result((values, {"by": os.getpid()}))
    return done

space = {"x": Range(-1.0, 1.0), "kind": ["even", "odd"]}
first = [{"x": 0.5, "kind": "even"}, {"x": -0.5, "kind": "odd"}]
about = {"objectives": 2, "worker": True, "heartbeat_s": 1}
with Search(sys.argv[1], sys.argv[2], space, **about) as search:
    for _ in search.explore(submit, 12, first=first):
        pass
"""


@pytest.fixture(scope="module")
def server(database_server):
    return database_server("together")


def worker(address: str, name: str, flag: str = "") -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, address, name, flag],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


def kept(address: str, name: str):
    with Search(address, name, SPACE, objectives=2, worker=True) as search:
        return search.finished, search.study.get_trials(deepcopy=False)


def test_every_trial_is_done_once_and_by_both(server):
    both = [worker(server, "both") for _ in range(2)]
    assert [one.wait(120) for one in both] == [0, 0]
    done, _ = kept(server, "both")
    assert sorted(t.slot for t in done) == list(range(TRIALS))
    assert {t.result["by"] for t in done} == {one.pid for one in both}
    given = {t.slot: t.parameters for t in done}
    assert [given[0], given[1]] == FIRST


def test_the_trial_of_a_killed_worker_is_done_by_another(server, tmp_path):
    stuck = tmp_path / "stuck"
    lost = worker(server, "lost", str(stuck))
    deadline = time.monotonic() + 60
    while not stuck.exists():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    lost.send_signal(signal.SIGKILL)
    lost.wait()
    other = worker(server, "lost")
    assert other.wait(120) == 0
    done, every = kept(server, "lost")
    assert sorted(t.slot for t in done) == list(range(TRIALS))
    assert {t.result["by"] for t in done} == {other.pid}
    again = [t.user_attrs["slot"] for t in every if t.state.name == "FAIL"]
    assert again == [0]  # the first, which the killed one was at


def test_one_process_leads(server):
    with Search(server, "led", SPACE):
        with pytest.raises(InputError, match="help it with --worker"):
            Search(server, "led", SPACE)
        with Search(server, "led", SPACE, worker=True):
            pass
    Search(server, "led", SPACE).__exit__(None, None, None)


def test_a_grid_on_a_server_goes_on(server):
    for _ in range(2):
        with Search(server, "grid", {"x": [1, 2, 3]}) as search:
            done = list(search.grid(lambda p: (float(p["x"]), {})))
        assert [t.parameters["x"] for t in done] == [1, 2, 3]
    assert all(t.stored for t in done)


def test_a_trial_that_kills_is_not_tried_for_ever(server):
    from softnn.search.together import DEATHS

    def submit(parameters, known):
        raise RuntimeError("boom")

    for _ in range(DEATHS):
        with Search(server, "boom", SPACE, worker=True) as search:
            with pytest.raises(RuntimeError, match="boom"):
                list(search.explore(submit, 1))
    with Search(server, "boom", SPACE, worker=True) as search:
        with pytest.raises(InputError, match=f"not finished {DEATHS} times"):
            list(search.explore(submit, 1))


def test_a_file_has_no_workers(tmp_path):
    with pytest.raises(InputError, match="workers share a database server"):
        Search(f"sqlite:///{tmp_path}/a.db", "a", SPACE, worker=True)


def test_no_server_is_said_in_one_line_without_the_password():
    with pytest.raises(InputError) as said:
        Search("postgresql+psycopg://me:secret@127.0.0.1:9/none", "a", SPACE)
    assert "cannot be opened" in str(said.value)
    assert "secret" not in str(said.value)
    assert "\n" not in str(said.value)
