"""Workers end with their parent, however that ends."""

import os
import signal
import subprocess
import sys
import time

import pytest

PARENT = """
import os, time
from softnn.workers import workers

if __name__ == "__main__":
    with workers(1) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        pool.submit(time.sleep, 120).result()
"""


STUDY = """
import subprocess, sys
from softnn.study.common import guarded

CHILD = "import os, time; print(os.getpid(), flush=True); time.sleep(120)"
sys.exit(guarded(lambda: subprocess.run([sys.executable, "-c", CHILD])))
"""


def running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat") as file:
        return file.read().split()[2] != "Z"  # ended, and nobody has asked


@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc"), reason="asks /proc who is running")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_no_worker_outlives_a_parent_that_is_killed(tmp_path, how):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True
    ) as parent:
        worker = int(parent.stdout.readline())
        assert running(worker)
        parent.send_signal(how)
        parent.wait(timeout=20)
        end = time.monotonic() + 20
        while running(worker) and time.monotonic() < end:
            time.sleep(0.05)
        left = running(worker)
    if left:
        os.kill(worker, signal.SIGKILL)
    assert not left


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="asks /proc who is running")
def test_a_command_that_a_study_runs_ends_with_it(tmp_path):
    with subprocess.Popen(
        [sys.executable, "-c", STUDY],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as study:
        command = int(study.stdout.readline())
        assert running(command)
        study.send_signal(signal.SIGTERM)
        said = study.communicate(timeout=20)[1]
        left = running(command)
    if left:
        os.kill(command, signal.SIGKILL)
    assert (study.returncode, left) == (130, False)
    assert said.strip() == "stopped; finished trials are kept"


LOST = """
import gc, os, signal, sys, time, weakref
from softnn.study.common import guarded

class Thing:
    pass

def gone(_):  # as SQLAlchemy's, of connections that are collected
    os.kill(os.getpid(), signal.SIGINT)
    sum(range(1000))

def work():
    thing = Thing()
    thing.itself = thing
    kept = weakref.ref(thing, gone)
    del thing
    gc.collect()
    time.sleep(20)
    print("went on")

sys.exit(guarded(work))
"""


def test_ctrl_c_within_a_collector_s_callback_is_not_lost():
    done = subprocess.run(
        [sys.executable, "-c", LOST], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 130, done
    assert "went on" not in done.stdout
    assert done.stderr.strip() == "stopped; finished trials are kept"
