"""Networks in MLflow's registry: loaded by MLflow, by softnn, and by hand."""

import json
import shutil
import warnings

import numpy as np
import pandas as pd
import pytest

import softnn
from softnn import InputError, Recording
from softnn.cli import main
from softnn.neural import StressNetwork
from softnn.study.settings import Places, Settings
from softnn.tracking import Tracker, fetched
from studies.neurons import run

ABOUT = {
    "study": "s",
    "identity": "1",
    "name": "n",
    "parameters": {},
    "data": ("d", "f" * 64),
}
TIME = np.linspace(0, 10, 60)
PULL = Recording(
    TIME, 0.1 * TIME, np.tanh(0.2 * TIME), test="tensile", rate_per_s=0.1, name="pull"
)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """An address, and the model registered there under two aliases."""
    folder = tmp_path_factory.mktemp("registry")
    uri = f"sqlite:///{folder / 'mlflow.db'}"
    model = StressNetwork(neurons=2).fit([PULL])
    table = {"time_s": PULL.time_s, "strain": PULL.strain, "rate_per_s": 60 * [0.1]}
    with Tracker(uri, "e", **ABOUT) as tracker:
        for aliases in (["best-random"], ["best-unseen-rate"]):
            version = tracker.register(
                "a/b",
                aliases,
                model.stored_.source,
                table,
                model.predict(PULL),
                "take it.",
            )
            assert version == "1"  # the same network is the same version
    return uri, model, pd.DataFrame(table)


def test_mlflow_loads_it_and_says_the_same(made, monkeypatch):
    import mlflow

    uri, model, table = made
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loaded = mlflow.pyfunc.load_model("models:/a-b@best-random")
        said = loaded.predict(table)
    np.testing.assert_array_equal(said, model.predict(PULL))
    assert loaded.metadata.signature.inputs.input_names() == list(table)
    assert loaded.input_example is not None


def test_softnn_loads_it(made, monkeypatch):
    uri, model, _ = made
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    loaded = softnn.load_model("models:/a-b@best-unseen-rate")
    assert loaded.source == model.stored_.source
    with pytest.raises(InputError, match="cannot be loaded from"):
        softnn.load_model("models:/nobody@best-random")


def test_the_command_exports_it(made, monkeypatch, tmp_path, capsys):
    from softnn.cli import main

    monkeypatch.setenv("MLFLOW_TRACKING_URI", made[0])
    asked = ["--to", "c", "--name", "net", "--out", str(tmp_path / "c")]
    assert main(["export", "models:/a-b@best-random", *asked]) == 0
    assert "net_step" in (tmp_path / "c/net.h").read_text()
    assert main(["export", "models:/nobody@best-random", *asked]) == 2
    assert "cannot be loaded from" in capsys.readouterr().err


def test_the_model_is_logged_linked_and_described(made):
    from mlflow.tracking import MlflowClient

    client = MlflowClient(made[0])
    model = client.get_registered_model("a-b")
    assert set(model.aliases) == {"best-random", "best-unseen-rate"}
    assert "stress [MPa] of a strain history" in model.description
    assert "`best-unseen-rate`: take it." in model.description
    version = client.get_model_version_by_alias("a-b", "best-random")
    run = client.get_run(version.run_id)
    (logged,) = run.outputs.model_outputs
    kept = client.get_logged_model(logged.model_id)
    assert (kept.source_run_id, kept.status.value) == (version.run_id, "READY")
    assert version.source == kept.artifact_location


@pytest.mark.parametrize("stays", [True, False])
def test_a_renamed_or_copied_folder_loads_its_models(tmp_path, stays, monkeypatch):
    before, after = tmp_path / "before", tmp_path / "after it was moved"
    model = StressNetwork(neurons=1).fit([PULL])
    table = {"time_s": PULL.time_s, "strain": PULL.strain, "rate_per_s": 60 * [0.1]}
    with Tracker(f"sqlite:///{before / 'mlflow.db'}", "e", **ABOUT) as tracker:
        tracker.register("m", ["x"], model.stored_.source, table, [0.0])
        tracker.result({}, texts={"t.txt": "here"})
    (shutil.copytree if stays else shutil.move)(before, after)
    if stays:  # what is loaded is what lies beside the copy
        shutil.rmtree(before / "artifacts")
    uri = f"sqlite:///{after / 'mlflow.db'}"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    assert softnn.load_model("models:/m@x").source == model.stored_.source

    from mlflow.tracking import MlflowClient

    client = MlflowClient(uri)
    run = client.get_run(client.get_model_version_by_alias("m", "x").run_id)
    assert "before" not in run.info.artifact_uri
    (place,) = client.list_artifacts(run.info.run_id)
    assert place.path == "t.txt"


def test_files_are_text(made):
    for file in fetched("models:/a-b@best-random", made[0]).parents[1].rglob("*"):
        if file.is_file():
            file.read_text(encoding="utf-8")  # raises for what is not
            assert file.suffix not in (".pkl", ".pickle")


def test_no_store_is_one_line(tmp_path):
    with pytest.raises(InputError, match="no MLflow database"):
        fetched("models:/a@b", f"sqlite:///{tmp_path / 'none.db'}")


@pytest.mark.slow
def test_a_run_done_again_gives_its_figures(tmp_path, capsys):
    places = Places(
        f"sqlite:///{tmp_path / 'o.db'}",
        f"sqlite:///{tmp_path / 'm.db'}",
        tmp_path / "out",
        False,
    )
    run(Settings(neurons=(2,), folds=3, samples=25), places)
    from mlflow.tracking import MlflowClient

    client = MlflowClient(places.tracking)
    (experiment,) = client.search_experiments(
        filter_string="name = 'neurons-as-in-thesis'"
    )
    runs = client.search_runs([experiment.experiment_id])
    trials = [r for r in runs if "softnn.again" in r.data.tags]
    assert trials
    for one in trials:
        about = json.loads(one.data.tags["softnn.again"])
        assert main(["rerun", one.info.run_id, "--tracking", places.tracking]) == 0
        assert "the same" in capsys.readouterr().out
        # With another seed the figures are others, and that is said.
        about["settings"]["seed"] = 5
        about["parameters"]["folds_seed"] = 6
        client.set_tag(one.info.run_id, "softnn.again", json.dumps(about))
        code = main(["rerun", one.info.run_id, "--tracking", places.tracking])
        assert code in (1, 2)  # other figures, or recordings of another hash
    (model,) = client.search_registered_models()
    assert model.name == "NatPolR"
    assert set(model.aliases) == {"best-random"}
    assert main(["rerun", "nobody", "--tracking", places.tracking]) == 2
