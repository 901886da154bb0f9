"""Work on a real Dask cluster, on loopback."""

import json
import os

import numpy as np
import pytest

from softnn.cli import main
from softnn.contracts import InputError
from softnn.workers import workers

distributed = pytest.importorskip(
    "distributed", reason="no Dask: pip install 'softnn[servers]'"
)


@pytest.fixture(scope="module")
def scheduler():
    quiet = {"dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", **quiet
    ) as cluster:
        yield cluster.scheduler_address


def whose(number: int) -> tuple[int, int]:
    return number, os.getpid()


@pytest.mark.slow
def test_workers_of_a_cluster_do_the_work(scheduler):
    with workers(1, scheduler) as pool:
        done = [f.result(60) for f in [pool.submit(whose, i) for i in range(20)]]
    assert [number for number, _ in done] == list(range(20))
    assert os.getpid() not in {process for _, process in done}
    assert len({process for _, process in done}) == 2


def test_no_scheduler_is_said_in_one_line(monkeypatch):
    monkeypatch.setattr("softnn.workers.ANSWER_S", 1)
    with pytest.raises(InputError, match="no Dask scheduler answers at 'tcp"):
        with workers(1, "tcp://127.0.0.1:9"):
            pass


@pytest.mark.slow
def test_diagnoses_on_a_cluster_are_those_made_here(scheduler, tmp_path, capsys):
    case = tmp_path / "case"
    case.mkdir()
    noise = np.random.default_rng(26).normal(0, 1e-3, 40)
    rows = [f"{t},{0.01 * t},{0.02 * t + e}" for t, e in enumerate(noise)]
    text = "\n".join(["time_s,strain,stress_MPa", *rows])
    (case / "pull.csv").write_text(text)
    found = []
    for place, more in (("there", ["--scheduler", scheduler]), ("here", [])):
        out = tmp_path / place
        asked = ["diagnose", str(case), "--out", str(out), "--model", "hooke"]
        assert main([*asked, *more]) == 0
        told = json.loads((out / "case" / "diagnosis.json").read_text("utf-8"))
        found.append({k: told[k] for k in ("verdict", "selected", "summary")})
    assert found[0] == found[1]
