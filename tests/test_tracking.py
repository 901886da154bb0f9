"""The MLflow store is read back with a client of its own."""

import json
import signal
import warnings
from datetime import datetime, timedelta

import pytest
from sqlalchemy import event
from sqlalchemy.engine import Engine

from softnn.contracts import InputError
from softnn.tracking import COLUMNS, PARENT, VIEW, Tracker, tables

NOW = datetime(2026, 1, 2, 3, 4, 5)
LATER = NOW + timedelta(seconds=7)
ABOUT = {
    "study": "neurons-abc",
    "name": "a study",
    "parameters": {"seed": 3},
    "data": ("virtual", "f" * 64),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A database is made once (seconds); experiments keep tests apart."""
    return f"sqlite:///{tmp_path_factory.mktemp('mlflow') / 'new' / 'mlflow.db'}"


def read(uri: str, experiment: str):
    from mlflow.tracking import MlflowClient

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        client = MlflowClient(uri)
        found = client.get_experiment_by_name(experiment)
        runs = client.search_runs([found.experiment_id])
    parents = [r for r in runs if PARENT not in r.data.tags]
    return client, parents, [r for r in runs if PARENT in r.data.tags]


def log(tracker, name="5 neurons"):
    return tracker.trial(
        name,
        {"neurons": 5},
        {"nrmse": [0.1, 0.2, 0.3], "nrmse_mean": 0.2},
        started=NOW,
        ended=LATER,
    )


def test_nested_run_holds_its_trial(made):
    with Tracker(made, "nested", identity="1", **ABOUT) as tracker:
        run_id = log(tracker)
    client, parents, nested = read(made, "nested")
    assert [r.info.run_id for r in nested] == [run_id]
    run = nested[0]
    assert run.data.tags[PARENT] == parents[0].info.run_id
    assert run.info.status == "FINISHED"
    assert run.info.end_time - run.info.start_time == 7000
    assert run.data.params == {
        "neurons": "5",
        "seed": "3",
        "data": "virtual",
        "data_sha256": "f" * 64,
    }
    assert run.data.metrics["nrmse_mean"] == 0.2
    history = client.get_metric_history(run_id, "nrmse")
    assert [(m.step, m.value) for m in history] == [(0, 0.1), (1, 0.2), (2, 0.3)]


def test_parent_holds_figure_table_and_numbers(made, tmp_path):
    picture = tmp_path / "figure.png"
    picture.write_bytes(b"png")
    with Tracker(made, "parent", identity="1", **ABOUT) as tracker:
        tracker.curve({"r2": [(1, 0.9), (2, 0.99)]}, LATER)
        tracker.result(
            {"best": 2.0}, note="| a |", files=[picture], texts={"t.csv": "a,b\n"}
        )
    client, (parent,), _ = read(made, "parent")
    assert parent.info.status == "FINISHED"
    assert parent.data.metrics["best"] == 2
    assert parent.data.tags["mlflow.note.content"] == "| a |"
    names = {f.path for f in client.list_artifacts(parent.info.run_id)}
    assert names == {"figure.png", "t.csv"}
    history = client.get_metric_history(parent.info.run_id, "r2")
    assert {(m.step, m.value) for m in history} == {(1, 0.9), (2, 0.99)}
    assert parent.inputs.dataset_inputs[0].dataset.digest == "f" * 36


def test_a_note_too_long_for_a_tag_is_kept_whole_in_a_file(made, tmp_path):
    note = "\n\n".join(f"paragraph {i} " + 90 * "x" for i in range(200))
    with Tracker(made, "long", identity="1", **ABOUT) as tracker:
        tracker.result({}, note=note)
    client, (parent,), _ = read(made, "long")
    seen = parent.data.tags["mlflow.note.content"]
    assert len(seen) <= 8000
    kept, pointer = seen.rsplit("\n\n", 1)
    assert note.startswith(kept + "\n\n")
    assert "note.md" in pointer
    client.download_artifacts(parent.info.run_id, "note.md", str(tmp_path))
    assert (tmp_path / "note.md").read_text() == note


def test_same_identity_goes_on_and_logs_nothing_twice(made):
    with pytest.raises(KeyboardInterrupt):
        stop_after_one_trial(made, "again")
    assert read(made, "again")[1][0].info.status == "KILLED"
    with Tracker(made, "again", identity="1", **ABOUT) as tracker:
        log(tracker)
        log(tracker, "6 neurons")
    client, parents, nested = read(made, "again")
    assert [r.info.status for r in parents] == ["FINISHED"]
    assert sorted(r.info.run_name for r in nested) == ["5 neurons", "6 neurons"]
    assert len(client.get_metric_history(nested[-1].info.run_id, "nrmse")) == 3


def stop_after_one_trial(uri, experiment):
    with Tracker(uri, experiment, identity="1", **ABOUT) as tracker:
        log(tracker)
        raise KeyboardInterrupt


def test_half_written_nested_run_is_completed(made):
    """As a kill leaves it: run and some metrics written, still running."""
    with Tracker(made, "half", identity="1", **ABOUT) as tracker:
        run_id = log(tracker)
        tracker._client.update_run(run_id, status="RUNNING")
    with Tracker(made, "half", identity="1", **ABOUT) as tracker:
        assert log(tracker) == run_id
    client, _, nested = read(made, "half")
    assert [r.info.status for r in nested] == ["FINISHED"]
    assert len(client.get_metric_history(run_id, "nrmse")) == 3


def test_orphan_of_the_same_study_is_closed(made):
    Tracker(made, "orphan", identity="1", **ABOUT)  # killed: its exit never runs
    Tracker(made, "orphan", identity="1", **{**ABOUT, "study": "other"})
    with Tracker(made, "orphan", identity="2", **ABOUT):
        pass
    statuses = {
        (r.data.tags["softnn.study"], r.data.tags["softnn.identity"]): r.info.status
        for r in read(made, "orphan")[1]
    }
    assert statuses == {
        ("neurons-abc", "1"): "KILLED",
        ("neurons-abc", "2"): "FINISHED",
        ("other", "1"): "RUNNING",  # somebody else's, perhaps at work
    }


def test_error_marks_the_parent_failed(made):
    with (
        pytest.raises(ZeroDivisionError),
        Tracker(made, "failed", identity="1", **ABOUT),
    ):
        _ = 1 / 0
    assert read(made, "failed")[1][0].info.status == "FAILED"


@pytest.mark.parametrize("statement", ["INSERT INTO metrics", "UPDATE", "SELECT"])
def test_ctrl_c_within_a_statement_marks_the_parent_killed(made, statement):
    sent = []

    def interrupt(connection, cursor, text, *_):
        if text.startswith(statement) and not sent:
            sent.append(text)
            signal.raise_signal(signal.SIGINT)

    experiment = f"interrupted {statement}"

    def study():
        with Tracker(made, experiment, identity="1", **ABOUT) as tracker:
            event.listen(Engine, "after_cursor_execute", interrupt)
            try:
                log(tracker)
            finally:
                event.remove(Engine, "after_cursor_execute", interrupt)

    with pytest.raises(KeyboardInterrupt):
        study()
    assert sent
    _, parents, nested = read(made, experiment)
    assert [run.info.status for run in parents] == ["KILLED"]
    assert [run.info.status for run in nested] == ["FINISHED"]


def test_a_link_opens_the_table_with_nrmse_and_r2(made):
    with Tracker(made, "linked", identity="1", **ABOUT):
        pass
    client, _, _ = read(made, "linked")
    one = client.get_experiment_by_name("linked")
    client.delete_experiment_tag(one.experiment_id, f"mlflow.sharedViewState.{VIEW}")
    assert "linked" not in tables(made, "http://here")
    with Tracker(made, "linked", identity="1", **ABOUT):  # a store of before has none
        pass
    link = tables(made, "http://here")["linked"]
    assert link == (
        f"http://here/#/experiments/{one.experiment_id}/runs?viewStateShareKey={VIEW}"
    )
    tags = client.get_experiment(one.experiment_id).tags
    shown = json.loads(tags[f"mlflow.sharedViewState.{VIEW}"])["selectedColumns"]
    assert shown == [f"metrics.`{name}`" for name in COLUMNS]


def test_a_store_that_is_not_there_has_no_tables(tmp_path):
    assert tables(f"sqlite:///{tmp_path}/none.db", "http://here") == {}
    assert not list(tmp_path.iterdir())


def test_deleted_experiment_is_said(made):
    with Tracker(made, "deleted", identity="1", **ABOUT) as tracker:
        pass
    tracker._client.delete_experiment(tracker.experiment_id)
    with pytest.raises(InputError, match="has been deleted in MLflow"):
        Tracker(made, "deleted", identity="2", **ABOUT)


def test_address_that_cannot_be_opened():
    with pytest.raises(InputError, match="tracking 'nonsense://x' cannot be opened"):
        Tracker("nonsense://x", "e", identity="1", **ABOUT)
