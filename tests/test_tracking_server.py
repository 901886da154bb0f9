"""Runs on a real MLflow server, with a real PostgreSQL and a store of artifacts."""

import os
import subprocess
import sys
import time
import urllib.error
import urllib.request
from datetime import datetime, timedelta

import pytest
from servers import free_port

from softnn.tracking import Tracker, fetched, read_run

NOW = datetime(2026, 1, 2, 3, 4, 5)
NETWORK = {"kind": "network", "weights": [1.0, 2.0]}
EXAMPLE = {"time_s": [0.0, 1.0], "strain": [0.0, 0.1]}


@pytest.fixture(scope="module")
def server(tmp_path_factory, database_server):
    folder, port = tmp_path_factory.mktemp("server"), free_port()
    database = database_server("tracked")
    command = [sys.executable, "-W", "ignore", "-m", "mlflow", "server"]
    command += ["--backend-store-uri", database, "--port", str(port)]
    command += ["--artifacts-destination", str(folder / "artifacts")]
    child = subprocess.Popen(
        [*command, "--host", "127.0.0.1", "--workers", "1"],
        cwd=folder,
        env={
            **os.environ,
            "MLFLOW_DISABLE_TELEMETRY": "true",
            "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
        },
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield _answering(f"http://127.0.0.1:{port}", child)
    finally:
        os.killpg(child.pid, 15)
        child.wait(30)


def _answering(address: str, child: subprocess.Popen) -> str:
    for _ in range(600):
        assert child.poll() is None, "the MLflow server did not start"
        try:
            urllib.request.urlopen(f"{address}/health", timeout=5).close()
            return address
        except (urllib.error.URLError, TimeoutError, ConnectionError):
            time.sleep(0.2)
    raise AssertionError("the MLflow server did not answer in 2 minutes")


def test_runs_files_and_networks_come_back_from_a_server(server, tmp_path):
    picture = tmp_path / "front.png"
    picture.write_bytes(b"picture")
    about = {"study": "s", "name": "a study", "parameters": {"seed": 3}}
    with Tracker(
        server, "served", identity="1", data=("virtual", "f" * 64), **about
    ) as tracker:
        run_id = tracker.trial(
            "5 neurons",
            {"neurons": 5},
            {"nrmse": 0.2, "fold_nrmse": [0.1, 0.3]},
            started=NOW,
            ended=NOW + timedelta(seconds=7),
        )
        tracker.result({"nrmse": 0.2}, files=[picture], texts={"front.md": "| a |"})
        tracker.register("rubber", ["best-random"], NETWORK, EXAMPLE, [0.0, 0.2])
    metrics, _ = read_run(server, run_id)
    assert metrics == {"nrmse": [0.2], "fold_nrmse": [0.1, 0.3]}
    kept = fetched("models:/rubber@best-random", server)
    assert '"weights": [1.0, 2.0]' in kept.read_text()

    from mlflow.tracking import MlflowClient

    files = MlflowClient(server).list_artifacts(tracker.run_id)
    assert {"front.png", "front.md"} <= {f.path for f in files}
