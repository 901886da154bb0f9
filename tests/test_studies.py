"""Every study runs; the network studies resume, report and refuse as they should."""

import json
import os
import pkgutil
import re
import signal
import sqlite3
import subprocess
import sys
import time
import warnings
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
import torch
from smoke import FOLDER, smoked

from softnn import Recording
from softnn.contracts import InputError
from softnn.neural import device_of
from softnn.search import Finished
from softnn.study.choice import fewest, pick
from softnn.study.common import write_result
from softnn.study.material_data import Data, first_loading, prepared
from softnn.study.settings import Settings, parse_neurons
from softnn.study.trainer import Trainer
from studies import neurons
from studies.shown.neurons import published

ROOT = Path(__file__).parents[1]
NAMES = sorted(
    module.name
    for module in pkgutil.iter_modules([str(FOLDER)])
    if not module.ispkg
    and re.search(r"def main\(|import main", (FOLDER / f"{module.name}.py").read_text())
)


# These have a test of their own that runs the smoke and asks more of it.
ELSEWHERE = {
    name
    for file in Path(__file__).parent.glob("test_*.py")
    for name in re.findall(r'smoked\("(\w+)"\)', file.read_text())
}


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in NAMES if n not in ELSEWHERE])
def test_every_study_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    smoked(name)


def test_smokes_that_run_elsewhere_are_of_studies():
    assert set(NAMES) >= ELSEWHERE


# --- what a study is made of ----------------------------------------------------------


def test_virtual_training_set_has_the_published_size():
    (data,) = prepared(Settings())
    assert sum(map(len, data.tensile)) == 7229  # Table 6.2
    assert len(Trainer(data, Settings()).samples("FFRD4").target) == 7229


NOISE = 0.01  # MPa


def line(rate: float, slope: float, name: str) -> Recording:
    strain = np.linspace(0, 1, 60)
    rng = np.random.default_rng([int(10 * rate), int(name[-1])])
    return Recording(
        strain / rate,
        strain,
        slope * strain + NOISE * rng.standard_normal(60),
        name=name,
        specimen=name,
        test="tensile",
        rate_per_s=rate,
    )


LINES = Data(
    "lines",
    "line",
    [line(r, s, f"{r}-{i}") for r, s in ((0.1, 1.0), (0.5, 2.0)) for i in range(2)],
    [],
)


def test_trial_of_a_known_law():
    """Two lines, told apart by their rate: learnt from specimens, not across rates."""
    settings = Settings(neurons=(3,), folds=4)
    error, found = Trainer(LINES, settings)({"neurons": 3, "split": "specimen"})
    # What cannot be foretold is the noise, over the RMS of lines of slope 1 and 2.
    assert error == pytest.approx(NOISE * np.mean([1, 1 / 2]) / np.sqrt(1 / 3), rel=0.2)
    assert error == pytest.approx(np.mean(found["nrmse"]), rel=1e-12)
    assert set(found["nrmse_by_rate"]) == {"0.1", "0.5"}
    assert found["parameters"] == 3 * (2 + 1) + 3 + 1
    assert sum(found["test_samples"]) == found["samples"] == 240
    # With one rate only to learn from, the other is taken for it: a slope of 1 in
    # place of 2 or 2 in place of 1, so errors of 1/2 and 1.
    _, by_rate = Trainer(LINES, settings)({"neurons": 3, "split": "rate"})
    assert sorted(by_rate["nrmse"]) == pytest.approx([0.5, 1.0], abs=0.02)


def test_networks_are_trained_on_the_device_asked_for():
    with pytest.raises(InputError, match="device is 'tpu'"):
        Trainer(LINES, Settings(neurons=(1,), device="tpu"))({"neurons": 1})
    assert device_of("auto") == ("cuda" if torch.cuda.is_available() else "cpu")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU here")
@pytest.mark.parametrize("inputs", ["FFRI3", "FFRD4", "FFRD4S", "FFH4", "FFH7"])
@pytest.mark.parametrize("regularisation", ["bayesian", "early-stopping", "l2=1e-4"])
def test_a_gpu_trains_what_the_cpu_does(inputs, regularisation):
    error = {}
    for device in ("cpu", "cuda"):
        settings = Settings(neurons=(3,), folds=4, device=device)
        asked = {"neurons": 3, "inputs": inputs, "regularisation": regularisation}
        error[device], _ = Trainer(LINES, settings)(asked)
    # They part by rounding, which may end at a neighbouring optimum of noisy lines.
    assert error["cuda"] == pytest.approx(error["cpu"], rel=0.02)


def test_fraction_is_drawn_once_and_folds_do_not_depend_on_neurons():
    settings = Settings(fraction=0.25, folds=5)
    trainer = Trainer(LINES, settings)
    assert len(trainer.samples("FFRI1").target) == 60
    a, b = (
        Trainer(LINES, settings)({"neurons": n, "split": "random"})[1] for n in (1, 2)
    )
    assert a["test_samples"] == b["test_samples"] == [12] * 5
    known = Trainer(LINES, settings).samples("FFRI1")
    np.testing.assert_array_equal(known.inputs, trainer.samples("FFRI1").inputs)


def test_first_loading_of_a_triangle_ends_at_its_peak():
    strain = np.concatenate([np.linspace(0, 2, 201), np.linspace(2, 0, 201)])
    time = np.arange(402.0)
    part = first_loading(Recording(time, strain, 3 * strain, test="cyclic"), 50)
    assert len(part) == 50
    assert part.strain[-1] == pytest.approx(0.995 * 2, abs=0.01)
    np.testing.assert_allclose(part.stress_MPa, 3 * part.strain, rtol=1e-12)
    assert [s.name for s in part.log] == ["first_loading", "resample"]


def trial(count: int, r2: float) -> Finished:
    now = datetime(2026, 1, 1)
    result = {"r2_mean": r2}
    return Finished(0, {"neurons": count}, 0.0, result, now, now, False)


@pytest.mark.parametrize(
    ("r2", "chosen"),
    [
        ([0.9, 0.9991, 0.9999], 2),  # fewest above 99.9 %
        ([0.9, 0.998, 0.997], 2),  # none above: the largest
        ([0.9, 0.999, 0.999], 2),  # 99.9 % is not above 99.9 %; ties to the fewest
    ],
)
def test_rule_of_the_thesis(r2, chosen):
    grid = [trial(i + 1, value) for i, value in enumerate(r2)]
    assert pick(grid).parameters["neurons"] == chosen


def test_fewest_neurons_within_one_standard_error():
    r2 = {1: [0.90, 0.92], 2: [0.94, 0.95], 3: [0.94, 0.96], 4: [0.95, 0.97]}
    now = datetime(2026, 1, 1)
    grid = [
        Finished(
            0, {"neurons": n}, 0.0, {"r2": v, "r2_mean": np.mean(v)}, now, now, False
        )
        for n, v in r2.items()
    ]
    # The largest mean is 0.96, its standard error 0.0141 / sqrt(2) = 0.01.
    assert fewest(grid).parameters["neurons"] == 3


def test_published_rows_are_fractions():
    rows = published("NR")
    assert [(r["model"], r["nrmse"], r["r2"]) for r in rows] == [
        ("thesis: network", pytest.approx(0.0122), pytest.approx(0.999)),
        ("thesis: PL-SLS", pytest.approx(0.0136), None),
        ("thesis: PL-Wiechert", pytest.approx(0.0236), None),
    ]


def test_result_file(tmp_path):
    path = write_result(
        "n", {"a": 1.5, "b": np.nan}, {"c": np.arange(2)}, seed=3, folder=tmp_path
    )
    content = json.loads(path.read_text())
    assert content["headline"] == {"a": 1.5, "b": None}
    assert content["c"] == [0, 1]
    assert content["seed"] == 3
    assert content["versions"]["numpy"] == np.__version__
    with pytest.raises(InputError, match="headline of n is not flat: a"):
        write_result("n", {"a": {"b": 1}}, {}, folder=tmp_path)  # type: ignore[dict-item]


# --- input that cannot be used --------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["20:1", "0:3", "", "a", "1:2:3", "-1", "1.5", "99999"]
)
def test_bad_neurons(text):
    with pytest.raises(InputError, match="allowed is a range from low to high"):
        parse_neurons(text)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--material", "Wood"], "no material 'Wood'"),
        (["--data", "nowhere"], "SOFTNN_DATA"),
        (["--neurons", "20:1"], "neurons are '20:1'"),
        (["--inputs", "FFRD9"], "inputs is 'FFRD9'"),
        (["--split", "colour"], "split is 'colour'"),
        (["--regularisation", "l2=-1"], "regularisation is 'l2=-1'"),
        (["--device", "tpu"], "device is 'tpu'; here is cpu"),
        (["--folds", "1"], "folds is 1"),
        (["--folds", "99999", "--neurons", "1"], "use fewer folds"),
        (["--folds", "ten"], "invalid int value: 'ten'"),
        (["--fraction", "0"], "fraction is 0.0"),
        (["--samples", "1"], "samples is 1"),
        (["--colour", "red"], "unrecognized arguments: --colour"),
        (["--storage", "nonsense://x"], "storage 'nonsense://x' cannot be opened"),
        (["--tracking", "nonsense://x"], "tracking 'nonsense://x' cannot be opened"),
    ],
)
def test_refusals_are_one_line(options, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SOFTNN_DATA", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    try:
        code = neurons.main(["--as-in-thesis", *options])
    except SystemExit as exit:  # argparse's way out
        code = exit.code
    assert code == 2
    message = capsys.readouterr().err
    assert said in message
    assert len(message.strip().splitlines()) == 1


# --- stopping and going on ------------------------------------------------------------

COMPLETE = 6 + 2 + 2  # counts, and two more splits of the best and the fewest


def run(folder: Path, *more: str, **options) -> subprocess.Popen:
    command = [sys.executable, "-m", "studies.neurons", "--as-in-thesis"]
    command += ["--neurons", "1:6"]
    command += ["--samples", "25", "--folds", "3", "--out", str(folder / "out"), *more]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def trials(folder: Path) -> dict[int, tuple[str, str]]:
    """State and end of each trial in Optuna's database."""
    file = folder / "mlruns" / "optuna.db"
    if not file.exists():
        return {}
    try:
        with sqlite3.connect(file, timeout=5) as connection:
            rows = connection.execute(
                "SELECT trial_id, state, datetime_complete FROM trials"
            ).fetchall()
    except sqlite3.OperationalError:  # tables are being made
        return {}
    finally:
        connection.close()
    return {number: (state, end) for number, state, end in rows}


def finished(folder: Path) -> dict[int, tuple[str, str]]:
    return {n: t for n, t in trials(folder).items() if t[0] == "COMPLETE"}


def wait_for(child: subprocess.Popen, folder: Path, count: int) -> None:
    deadline = time.monotonic() + 120
    while len(finished(folder)) < count:
        assert child.poll() is None, child.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.005)


def runs(folder: Path):
    from mlflow.tracking import MlflowClient

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        client = MlflowClient(f"sqlite:///{folder / 'mlruns' / 'mlflow.db'}")
        experiment = client.get_experiment_by_name("neurons-as-in-thesis")
        found = client.search_runs([experiment.experiment_id])
    nested = [r for r in found if "mlflow.parentRunId" in r.data.tags]
    return [r for r in found if r not in nested], nested, client


@pytest.mark.slow
@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
def test_stopped_and_started_again_goes_on(stop, tmp_path):
    child = run(tmp_path)
    wait_for(child, tmp_path, 2)
    child.send_signal(stop)
    child.communicate(timeout=60)
    assert child.returncode == (-9 if stop == signal.SIGKILL else 130)
    kept = finished(tmp_path)
    assert 2 <= len(kept) < COMPLETE
    if stop == signal.SIGINT:
        assert [r.info.status for r in runs(tmp_path)[0]] == ["KILLED"]

    child = run(tmp_path)
    out, err = child.communicate(timeout=120)
    assert child.returncode == 0, err
    assert f"{len(kept)} of {COMPLETE} trials were finished before" in out
    after = finished(tmp_path)
    assert len(after) == COMPLETE
    assert kept.items() <= after.items()  # none lost, none run again
    assert all(state in ("COMPLETE", "FAIL") for state, _ in trials(tmp_path).values())
    parents, nested, client = runs(tmp_path)
    assert [r.info.status for r in parents] == ["FINISHED"]
    assert {r.info.status for r in nested} == {"FINISHED"}
    assert len(nested) == len({r.info.run_name for r in nested}) == COMPLETE
    for one in nested:
        for name in ("nrmse", "r2", "gamma"):
            history = client.get_metric_history(one.info.run_id, f"fold_{name}")
            assert [m.step for m in history] == list(range(3))
            mean = np.mean([m.value for m in history])
            assert one.data.metrics[name] == pytest.approx(mean, rel=1e-12)
        assert {"seed", "data_sha256", "neurons", "split"} <= set(one.data.params)
    artifacts = {f.path for f in client.list_artifacts(parents[0].info.run_id)}
    assert {"comparison.csv", "neurons.csv", "best.json"} <= artifacts
    assert any(name.endswith(".png") for name in artifacts)

    # As if it had never been stopped: the same figures, to the last digit.
    whole = tmp_path / "whole"
    whole.mkdir()
    child = run(whole)
    child.communicate(timeout=120)
    assert child.returncode == 0
    resumed, straight = (
        json.loads((f / "out" / "neurons.json").read_text())["headline"]
        for f in (tmp_path, whole)
    )
    assert resumed.pop("study_s") is None  # no run did all the work
    assert straight.pop("study_s") > 0
    assert resumed == straight


@pytest.mark.slow
def test_finished_study_reports_from_the_store_unless_fresh(tmp_path):
    for options, told, number in (
        ([], "", COMPLETE),
        ([], f"{COMPLETE} of {COMPLETE} trials were finished before", COMPLETE),
        (["--fresh"], "", COMPLETE),
        (["--seed", "1"], "", 2 * COMPLETE),  # another study
    ):
        child = run(tmp_path, *options)
        out, err = child.communicate(timeout=120)
        assert child.returncode == 0, err
        assert told in out
        assert ("from the store" in out) == bool(told)
        assert len(finished(tmp_path)) == number
    assert len(runs(tmp_path)[0]) == 3  # the fresh one stands beside the first
