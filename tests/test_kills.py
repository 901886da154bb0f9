"""A search killed at random moments and started again: nothing lost, nothing twice."""

import json
import random
import signal
import sqlite3
import time
from pathlib import Path

import pytest

from bench.scaling import started

TRIALS = 24
EARLY, LATER = 5, 10  # kills in the first 5 s, and after some more trials
COMMAND = ["-m", "studies.architectures", "--material", "NatPolR", "--out", "out"]
COMMAND += ["--samples", "25", "--folds", "3", "--neurons", "1:3"]
COMMAND += ["--trials", str(TRIALS)]


def rows(folder: Path, query: str) -> list[tuple]:
    file = folder / "mlruns" / "optuna.db"
    if not file.exists():  # a database has its name when it is whole
        return []
    connection = sqlite3.connect(file, timeout=30)
    try:
        return connection.execute(query).fetchall()
    finally:
        connection.close()


def finished(folder: Path) -> list[tuple]:
    return rows(
        folder,
        "SELECT trial_id, datetime_complete FROM trials WHERE state = 'COMPLETE'",
    )


def killed(folder: Path, more: int, delay: float) -> bool:
    """Kill -9 after `more` finished trials and a delay; False if it ended before."""
    before = len(finished(folder))
    child = started(COMMAND, folder)
    deadline = time.monotonic() + 300
    while len(finished(folder)) < before + more and child.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    time.sleep(delay)
    child.send_signal(signal.SIGKILL)
    said, _ = child.communicate(timeout=60)
    assert child.returncode in (-signal.SIGKILL, 0), said
    return child.returncode != 0


def ended(folder: Path) -> dict:
    child = started(COMMAND, folder)
    said, _ = child.communicate(timeout=600)
    assert child.returncode == 0, said
    return json.loads((folder / "out" / "architectures.json").read_text())


@pytest.mark.slow
def test_killed_at_random_moments_it_ends_as_if_it_had_not_been(tmp_path):
    moments = random.Random(26)
    stopped, whole = tmp_path / "stopped", tmp_path / "whole"
    for folder in (stopped, whole):
        folder.mkdir()
    kept: list[tuple] = []
    kills = [(0, moments.uniform(0, 5)) for _ in range(EARLY)]
    kills += [(moments.randint(1, 3), moments.uniform(0, 1)) for _ in range(LATER)]
    count = 0
    for more, delay in kills:
        if not killed(stopped, more, delay):
            break
        count += 1
        now = finished(stopped)
        assert set(kept) <= set(now)  # none lost, none run again
        kept = now
    assert count > EARLY
    one, other = ended(stopped), ended(whole)
    assert set(kept) <= set(finished(stopped))
    assert len(finished(stopped)) == len(finished(whole))
    (material,), (straight,) = one["materials"], other["materials"]
    assert len(material["trials"]) == TRIALS
    for key in ("trials", "front", "choices", "baselines", "take"):
        assert material[key] == straight[key]
    left = rows(stopped, "SELECT count(*) FROM trials WHERE state = 'RUNNING'")
    assert left == [(0,)]
