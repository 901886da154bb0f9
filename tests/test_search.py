"""Resuming is tested by killing a process; draws by running the search twice."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import event
from sqlalchemy.engine import Engine

from softnn.contracts import InputError
from softnn.search import Range, Search

GRID = {"kind": ["a", "b"], "count": [1, 2, 3]}


def address(folder: Path) -> str:
    return f"sqlite:///{folder / 'new' / 'search.db'}"


def counted(calls: list):
    def objective(parameters):
        calls.append(parameters)
        return float(parameters["count"]), {"kind": parameters["kind"]}

    return objective


def test_grid_visits_every_combination_once_in_order(tmp_path):
    calls: list = []
    with Search(address(tmp_path), "s", GRID) as search:
        done = list(search.grid(counted(calls)))
    expected = [{"kind": k, "count": c} for k in "ab" for c in (1, 2, 3)]
    assert calls == expected
    assert [t.parameters for t in done] == expected
    assert [t.value for t in done] == [1, 2, 3, 1, 2, 3]
    assert all(t.ended >= t.started and not t.stored for t in done)


def test_ctrl_c_as_a_trial_is_made_leaves_none_running(tmp_path):
    def interrupt(connection, cursor, text, *_):
        if text.startswith("INSERT INTO trials"):
            signal.raise_signal(signal.SIGINT)

    with Search(address(tmp_path), "s", GRID) as search:
        event.listen(Engine, "after_cursor_execute", interrupt)
        try:
            with pytest.raises(KeyboardInterrupt):
                list(search.grid(counted([])))
        finally:
            event.remove(Engine, "after_cursor_execute", interrupt)
        assert [t.state.name for t in search.study.get_trials()] == ["FAIL"]


def test_finished_trials_are_not_run_again(tmp_path):
    calls: list = []
    with Search(address(tmp_path), "s", GRID) as search:
        search.run({"kind": "b", "count": 2}, counted(calls))
    with Search(address(tmp_path), "s", GRID) as search:
        done = list(search.grid(counted(calls)))
    assert len(calls) == 6
    assert [t.stored for t in done] == [t.parameters == calls[0] for t in done]
    with Search(address(tmp_path), "s", GRID, fresh=True) as search:
        assert search.finished == []


def test_grid_can_hold_a_parameter(tmp_path):
    with Search(address(tmp_path), "s", GRID) as search:
        done = list(search.grid(counted([]), kind="b"))
    assert [t.parameters["count"] for t in done] == [1, 2, 3]
    assert {t.parameters["kind"] for t in done} == {"b"}


def test_grid_of_a_range_is_refused():
    with (
        Search("sqlite://", "s", {"x": Range(0, 1)}) as search,
        pytest.raises(InputError, match="a grid needs values for x"),
    ):
        list(search.grid(counted([])))


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_trial_cut_short_is_tried_again(tmp_path, error):
    def objective(parameters):
        raise error

    with pytest.raises(error), Search(address(tmp_path), "s", GRID) as search:
        search.run({"kind": "a", "count": 1}, objective)
    with Search(address(tmp_path), "s", GRID) as search:
        assert search.finished == []
        assert len(list(search.grid(counted([])))) == 6


def valley(parameters):
    weight = parameters["weight"]
    return (np.log10(weight) + 3) ** 2, {"weight": weight}


def stopping_after(trials: int):
    calls = []

    def objective(parameters):
        calls.append(parameters)
        if len(calls) > trials:
            raise KeyboardInterrupt
        return valley(parameters)

    return objective


VALLEY = {"method": ["none", "l2"], "weight": Range(1e-8, 1e2, log=True)}


def test_minimise_finds_the_valley_and_resumes_where_it_was(tmp_path):
    with Search("sqlite://", "s", VALLEY, seed=5) as search:
        search.run({"method": "none"}, lambda p: (9.0, {}))
        whole = list(search.minimise(valley, 20, method="l2"))
    assert all(t.parameters["method"] == "l2" for t in whole)
    assert all(1e-8 <= t.parameters["weight"] <= 1e2 for t in whole)
    # The minimum is at 1e-3; uniform draws over 10 decades come within a quarter of
    # a decade in one of 20 only.
    assert min(t.value for t in whole) < 0.25**2

    storage = address(tmp_path)
    with Search(storage, "s", VALLEY, seed=5) as search:
        search.run({"method": "none"}, lambda p: (9.0, {}))
        stopped = search.minimise(stopping_after(7), 20, method="l2")
        with pytest.raises(KeyboardInterrupt):
            list(stopped)
    with Search(storage, "s", VALLEY, seed=5) as search:
        resumed = list(search.minimise(valley, 20, method="l2"))
    assert [t.parameters for t in resumed] == [t.parameters for t in whole]
    assert [t.stored for t in resumed] == [True] * 7 + [False] * 13


def test_remember_keeps_the_first(tmp_path):
    with Search(address(tmp_path), "s", GRID) as search:
        assert search.remembered("run") is None
        assert search.remember("run", "first") == "first"
    with Search(address(tmp_path), "s", GRID) as search:
        assert search.remember("run", "second") == "first"
        assert search.remembered("run") == "first"


def test_one_process_a_search(tmp_path):
    with (
        Search(address(tmp_path), "s", GRID),
        pytest.raises(InputError, match="another process"),
    ):
        Search(address(tmp_path), "s", GRID)
    with Search(address(tmp_path), "s", GRID), Search(address(tmp_path), "t", GRID):
        pass  # other searches in the same storage are free to run


def test_storage_that_cannot_be_opened():
    with pytest.raises(InputError, match="give an address such as"):
        Search("nonsense://x", "s", GRID)


CHILD = """
import sys, time
from softnn.search import Search
log = open(sys.argv[2], "a", buffering=1)
def objective(p):
    time.sleep(0.15)
    log.write(f"{p['n']}\\n")
    return 1.0, {"pid": 1}
with Search(sys.argv[1], "killed", {"n": list(range(8))}) as search:
    done = [t.parameters["n"] for t in search.grid(objective)]
print(done)
"""


@pytest.mark.slow
def test_kill_9_loses_no_finished_trial_and_repeats_none(tmp_path):
    log = tmp_path / "log"
    command = [sys.executable, "-c", CHILD, address(tmp_path), str(log)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    child = subprocess.Popen(command, env=environment)
    deadline = time.monotonic() + 60
    while not log.exists() or log.read_text().count("\n") < 3:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    time.sleep(0.1)  # the third has been told, the fourth is at work
    child.send_signal(signal.SIGKILL)
    child.wait()
    ran = log.read_text().split()
    again = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=60
    )
    assert again.returncode == 0, again.stderr
    assert again.stdout.strip() == str(list(range(8)))
    assert sorted(map(int, log.read_text().split())) == list(range(8))
    assert ran == ["0", "1", "2"]
