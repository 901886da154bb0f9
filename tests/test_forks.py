"""Steps that are shared out to forks: the same results, whatever becomes of a fork."""

import os
import select
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from made import mullins, write_case

from softnn import forks
from softnn.forks import each
from softnn.mismatch import read_case
from softnn.mismatch.base import start
from softnn.mismatch.candidates import candidates, expand, names

pytestmark = pytest.mark.skipif(not forks.FORKS, reason="no forks on this system")


@pytest.fixture
def two(monkeypatch):
    """As on a machine of two processors, with no thread of who runs the tests."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1})
    monkeypatch.setattr(forks.threading, "active_count", lambda: 1)


def test_results_are_in_order_and_of_two_processes(two):
    beside = os.pipe()
    there = os.pipe()

    def step(i):  # neither goes on until the other has begun
        mine, other = (beside, there) if i else (there, beside)
        os.write(mine[1], b".")
        assert select.select([other[0]], [], [], 30)[0]
        return i, os.getpid()

    (a, here), (b, away) = each(step, range(2))
    assert (a, b) == (0, 1)
    assert here != away
    assert os.getpid() in (here, away)


def test_large_results_come_back_whole(two):
    out = each(lambda i: np.full(300_000, float(i)), range(7))
    for i, x in enumerate(out):
        assert x.shape == (300_000,)
        assert (x == i).all()


def test_steps_of_steps(two):
    out = each(lambda i: sum(each(lambda j: 10 * i + j, range(5))), range(6))
    assert out == [sum(10 * i + j for j in range(5)) for i in range(6)]


def test_what_a_step_raises_is_raised(two):
    def step(i):
        raise ValueError(f"step {i}")

    for _ in range(5):  # whoever meets it first
        with pytest.raises(ValueError, match="step"):
            each(step, range(4))
    assert each(abs, [-1, -2]) == [1, 2]


def test_steps_of_a_fork_that_was_killed_are_done_here(two):
    me = os.getpid()

    def step(i):
        if os.getpid() != me:
            os.kill(os.getpid(), signal.SIGKILL)
        return i

    assert each(step, range(20)) == list(range(20))


def test_no_fork_beside_another_thread():
    stop = threading.Event()
    thread = threading.Thread(target=stop.wait)
    thread.start()
    try:
        assert set(each(lambda i: os.getpid(), range(8))) == {os.getpid()}
    finally:
        stop.set()
        thread.join()


def test_the_command_has_no_thread_beside_a_diagnosis(tmp_path):
    """Else it would never fork."""
    case = write_case(tmp_path / "case")
    code = f"""
import threading
from softnn.cli import main
from softnn.mismatch import batch
def diagnose_one(job):
    print(threading.active_count())
    return batch.Outcome("asked")
batch.diagnose_one = diagnose_one
main(["diagnose", {str(case)!r}, "--out", "out"])
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.stdout.split()[0] == "1"


def test_nothing_is_left_open_or_running(two, monkeypatch):
    pids, fork = [], os.fork

    def forked():
        pids.append(fork())
        return pids[-1]

    monkeypatch.setattr(os, "fork", forked)
    before = set(os.listdir("/proc/self/fd"))
    each(lambda i: i, range(8))
    assert set(os.listdir("/proc/self/fd")) == before
    assert pids
    for pid in pids:
        with pytest.raises(ChildProcessError):
            os.waitpid(pid, os.WNOHANG)


def test_refits_are_the_same_here_and_by_forks(two, tmp_path, monkeypatch):
    base = start(read_case(write_case(tmp_path, [mullins()])))
    pool = candidates(base.engine, base.name, base.fixed)

    def found():
        fits = expand(base.engine, base.fit, pool, 3)
        return [(names(f), f.chi2, f.jacobian.tobytes(), f.slots) for f in fits]

    begun, fork = [], os.fork
    monkeypatch.setattr(os, "fork", lambda: begun.append(0) or fork())
    shared = found()
    assert begun
    assert "mullins_softening" in shared[0][0]
    monkeypatch.setattr(forks, "FORKS", False)
    assert found() == shared
