"""A study in MLflow: a parent run, and a nested run for each of its trials.

MLflow mirrors what the search has stored, so it can be written again at any time: a
run is found by what it stands for and completed, never made twice.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import re
import sqlite3
import tempfile
import warnings
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any

# Read when mlflow is imported: no study reports its use to anybody.
os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
os.environ.setdefault("DO_NOT_TRACK", "true")

import numpy as np
from mlflow.entities import (
    Dataset,
    DatasetInput,
    Experiment,
    LoggedModel,
    LoggedModelOutput,
    LoggedModelStatus,
    Metric,
    Param,
    Run,
)
from mlflow.exceptions import MlflowException
from mlflow.store.db.utils import (
    _initialize_tables,
    create_sqlalchemy_engine_with_retry,
)
from mlflow.tracking import MlflowClient

from softnn.contracts import InputError, nearest
from softnn.database import made_aside, sqlite_file, undisturbed

for _library in ("mlflow", "alembic"):
    logging.getLogger(_library).setLevel(logging.WARNING)

PARENT = "mlflow.parentRunId"  # MLflow's own tags: its UI nests, names and describes
NAME = "mlflow.runName"  # runs by them
NOTE = "mlflow.note.content"
SOURCE = {"mlflow.source.type": "LOCAL", "mlflow.source.name": "softnn"}
# Without it the UI takes an experiment for one with language models.
KIND = {"mlflow.experimentKind": "custom_model_development"}
# MLflow has no default columns, each browser keeps its own. A link can name a view,
# which is a tag of the experiment, as the Share button of MLflow's UI writes it.
VIEW = "softnn"
COLUMNS = ("nrmse", "r2", "nrmse_unseen", "r2_unseen")
SHOWN = {
    f"mlflow.sharedViewState.{VIEW}": json.dumps(
        {"selectedColumns": [f"metrics.`{name}`" for name in COLUMNS]}
    )
}
STUDY, IDENTITY, TRIAL = "softnn.study", "softnn.identity", "softnn.trial"
AGAIN = "softnn.again"  # what `softnn rerun` needs, as JSON; set by softnn.study.sweep
DIGEST = "softnn.sha256"
BATCH = 1000  # metrics that MLflow takes in one call
LONGEST = 8000  # characters that MLflow keeps of a tag
ARTIFACTS = "artifacts"  # beside an SQLite store
LOCATIONS = (  # where MLflow keeps addresses of artifacts
    ("experiments", "artifact_location"),
    ("runs", "artifact_uri"),
    ("logged_models", "artifact_location"),
    ("model_versions", "source"),
    ("model_versions", "storage_location"),
)
WHOLE = "note.md"  # where a note longer than that is kept


class Tracker:
    """The parent run of a study in MLflow, running while the context is open.

    `study` names the settings and the data. `identity` names this run of the study: the
    same identity continues the same parent run. Other parent runs of the study that
    were left running are marked KILLED. `data` maps recordings to their hash. `uri` is
    an MLflow address; for an SQLite file the artifacts lie in `artifacts/` beside it.

    On an error or ctrl-C the parent run is marked FAILED or KILLED.
    """

    @undisturbed()
    def __init__(
        self,
        uri: str,
        experiment: str,
        *,
        study: str,
        identity: str,
        name: str,
        parameters: Mapping[str, Any],
        data: tuple[str, str],
    ) -> None:
        self._client = _client(uri)
        self.experiment_id = _experiment(self._client, uri, experiment).experiment_id
        parent = None
        for run in self._runs(f"tags.`{STUDY}` = '{study}'"):
            if run.data.tags.get(IDENTITY) == identity:
                parent = run
            elif run.info.status == "RUNNING":
                self._client.set_terminated(run.info.run_id, "KILLED")
        if parent is None:
            tags = {NAME: name, STUDY: study, IDENTITY: identity, **SOURCE}
            parent = self._client.create_run(self.experiment_id, tags=tags)
        self.run_id: str = parent.info.run_id
        self._client.update_run(self.run_id, status="RUNNING")
        self._common = {k: str(v) for k, v in parameters.items()}
        self._common |= {"data": data[0], "data_sha256": data[1]}
        self._log(self.run_id, self._common)
        self._client.log_inputs(self.run_id, [_dataset(*data)])
        self._nested = {
            run.data.tags[TRIAL]: run
            for run in self._runs(f"tags.`{PARENT}` = '{self.run_id}'")
            if TRIAL in run.data.tags
        }

    def __enter__(self) -> Tracker:
        return self

    @undisturbed()
    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        status = "FINISHED"
        if kind is not None:
            status = "KILLED" if issubclass(kind, KeyboardInterrupt) else "FAILED"
        self._client.set_terminated(self.run_id, status)

    @undisturbed()
    def trial(
        self,
        name: str,
        parameters: Mapping[str, Any],
        metrics: Mapping[str, float | Sequence[float]],
        *,
        started: datetime,
        ended: datetime,
        tags: Mapping[str, str] | None = None,
    ) -> str:
        """Log one finished trial as a nested run, unless it is there; its run id.

        A sequence is logged step by step: one value a fold. `name` stands for the
        trial: it must be its own within the study.
        """
        run = self._nested.get(name)
        if run is not None and run.info.status == "FINISHED":
            return run.info.run_id
        if run is None:
            about = {NAME: name, TRIAL: name, PARENT: self.run_id, **SOURCE}
            about |= tags or {}
            run = self._client.create_run(
                self.experiment_id, start_time=_milliseconds(started), tags=about
            )
        run_id: str = run.info.run_id
        values = {**self._common, **{k: str(v) for k, v in parameters.items()}}
        self._log(run_id, values, metrics, _milliseconds(ended))
        self._client.set_terminated(run_id, "FINISHED", end_time=_milliseconds(ended))
        self._nested[name] = self._client.get_run(run_id)
        return run_id

    @undisturbed()
    def curve(
        self, metrics: Mapping[str, Iterable[tuple[int, float]]], ended: datetime
    ) -> None:
        """Log metrics of the study against a count, as (count, value) pairs."""
        time = _milliseconds(ended)
        points = [
            Metric(name, float(value), time, step)
            for name, pairs in metrics.items()
            for step, value in pairs
        ]
        self._write(self.run_id, points)

    @undisturbed()
    def result(
        self,
        metrics: Mapping[str, float],
        *,
        note: str = "",
        files: Iterable[Path] = (),
        texts: Mapping[str, str] | None = None,
        tags: Mapping[str, str] | None = None,
    ) -> None:
        """Log the results on the parent run: figures, tables, and named numbers.

        Tables are Markdown (`note`, file name -> text). A second call replaces the
        first.
        """
        self._log(self.run_id, {}, metrics)
        if len(note) > LONGEST:
            self._client.log_text(self.run_id, note, WHOLE)
            note = beginning(note)
        for key, value in {NOTE: note, **(tags or {})}.items():
            self._client.set_tag(self.run_id, key, value)
        for file in files:
            self._client.log_artifact(self.run_id, str(file))
        for name, text in (texts or {}).items():
            self._client.log_text(self.run_id, text, name)

    @undisturbed()
    def register(
        self,
        name: str,
        aliases: Sequence[str],
        network: Mapping[str, Any],
        example: Mapping[str, Sequence[float]],
        output: Sequence[float],
        about: str = "",
    ) -> str:
        """Keep a network with the run and in the registry; its version.

        `network` is its JSON, `example` a table of inputs, `output` what it says to
        them, `about` a sentence on its use. A version that holds the same network is
        used again. A colon or slash in a name becomes a dash, as MLflow allows neither.
        """
        name = self.registered(name)
        text = json.dumps(network, sort_keys=True)
        digest = hashlib.sha256(text.encode()).hexdigest()
        with contextlib.suppress(MlflowException):  # there already
            self._client.create_registered_model(name)
        known = self._client.search_model_versions(f"name = '{_quoted(name)}'")
        version = next((v for v in known if v.tags.get(DIGEST) == digest), None)
        if version is None:
            model = self._logged(f"model-{digest[:12]}", text, example, output)
            version = self._client.create_model_version(
                name,
                model.artifact_location,
                self.run_id,
                tags={DIGEST: digest},
                model_id=model.model_id,
            )
        number = version.version
        if about:
            self._client.update_model_version(name, number, about)
        for alias in aliases:
            self._client.set_registered_model_alias(name, alias, number)
        self._client.update_registered_model(name, self._described(name))
        return str(number)

    @staticmethod
    def registered(name: str) -> str:
        """The name of a model as MLflow keeps it."""
        return re.sub(r"[:/]", "-", name)

    def _logged(
        self,
        name: str,
        text: str,
        example: Mapping[str, Sequence[float]],
        output: Sequence[float],
    ) -> LoggedModel:
        """The network as a model of the run, which MLflow shows beside it."""
        model = self._client.create_logged_model(
            self.experiment_id, name, self.run_id, model_type="softnn"
        )
        with tempfile.TemporaryDirectory() as folder:
            _saved(Path(folder), text, example, output)
            self._client.log_model_artifacts(model.model_id, f"{folder}/model")
        self._client.log_outputs(self.run_id, [LoggedModelOutput(model.model_id, 0)])
        return self._client.finalize_logged_model(
            model.model_id, LoggedModelStatus.READY
        )

    def _described(self, name: str) -> str:
        """Return a description of a registered model: its recordings and aliases."""
        model = self._client.get_registered_model(name)
        lines = [
            f"Networks for {name}: stress [MPa] of a strain history, trained on "
            f"`{self._common['data']}`."
        ]
        for alias, number in sorted(model.aliases.items()):
            said = self._client.get_model_version(name, number).description
            lines.append(f"`{alias}`: " + (said or f"version {number}."))
        load = f"softnn.load_model('models:/{name}@ALIAS')"
        export = f"softnn export 'models:/{name}@ALIAS' --to c --out DIR"
        return "\n\n".join([*lines, f"Load one with `{load}`, or `{export}`."])

    def _log(
        self,
        run_id: str,
        parameters: Mapping[str, str],
        metrics: Mapping[str, float | Sequence[float]] | None = None,
        time: int | None = None,
    ) -> None:
        time = _milliseconds(datetime.now()) if time is None else time
        points = []
        for name, values in (metrics or {}).items():
            steps = values if isinstance(values, Sequence) else [values]
            points += [Metric(name, float(v), time, i) for i, v in enumerate(steps)]
        given = [Param(key, value) for key, value in parameters.items()]
        self._client.log_batch(run_id, params=given)
        self._write(run_id, points)

    def _write(self, run_id: str, points: list[Metric]) -> None:
        for i in range(0, len(points), BATCH):
            self._client.log_batch(run_id, metrics=points[i : i + BATCH])

    def _runs(self, condition: str) -> list[Run]:
        return list(
            self._client.search_runs(
                [self.experiment_id], filter_string=condition, max_results=10_000
            )
        )


def read_run(uri: str, run_id: str) -> tuple[dict[str, list[float]], str | None]:
    """Metrics of a run, step by step, and how to do it again; raises `InputError`."""
    client = _connected(_present(uri))
    try:
        run = client.get_run(run_id)
    except MlflowException:
        raise InputError(
            f"no run {run_id!r} in {uri}; the MLflow UI shows ids"
        ) from None
    metrics = {
        name: [
            m.value
            for m in sorted(
                client.get_metric_history(run_id, name), key=lambda m: m.step
            )
        ]
        for name in run.data.metrics
    }
    return metrics, run.data.tags.get(AGAIN)


def fetched(uri: str, tracking: str) -> Path:
    """The file of a network by MLflow's address, `models:/NAME@ALIAS`.

    `models:/NAME/VERSION` and `runs:/ID/PATH` do as well. Raises `InputError`.
    """
    from mlflow.artifacts import download_artifacts

    client = _connected(_present(tracking))
    kind, _, rest = uri.partition(":/")
    try:
        source: str | None = uri
        if kind == "models" and "@" in rest:
            source = client.get_model_version_by_alias(*rest.rsplit("@", 1)).source
        elif kind == "models":
            name, _, version = rest.rpartition("/")
            source = client.get_model_version(name, version).source
        folder = Path(download_artifacts(source, tracking_uri=tracking))
        return next(folder.rglob("network.json"))
    except StopIteration:
        raise InputError(f"{uri!r} holds no network of softnn") from None
    except (MlflowException, OSError) as error:
        have = [one.name for one in client.search_registered_models()]
        asked = re.split("[@/]", rest)[0]
        told = f"; registered there: {', '.join(have) or 'none'}{nearest(asked, have)}"
        raise InputError(
            f"{uri!r} cannot be loaded from {tracking}: {_line(error)}{told}"
        ) from None


def _present(uri: str) -> str:
    file = sqlite_file(uri)
    if file is not None and not file.is_file():
        raise InputError(
            f"no MLflow database {file}; start in the folder of the study, or give its "
            "address, such as sqlite:///mlruns/mlflow.db"
        )
    mended(uri)
    return uri


def mended(uri: str) -> None:
    """Point an SQLite store to the artifacts beside it, if its folder was moved.

    MLflow keeps absolute addresses, so a store that was renamed or copied would look
    for its models where they were. Another kind of store is left as it is.
    """
    file = sqlite_file(uri)
    if file is None or not file.is_file() or not (file.parent / ARTIFACTS).is_dir():
        return
    here = (file.parent / ARTIFACTS).resolve().as_uri() + "/"
    with contextlib.closing(sqlite3.connect(file)) as store, store:
        rows = store.execute("SELECT artifact_location FROM experiments").fetchall()
        found = {place.rpartition(f"/{ARTIFACTS}/")[0] for (place,) in rows if place}
        old = [f"{one}/{ARTIFACTS}/" for one in found if one.startswith("file:")]
        for there in old:
            if there == here:
                continue
            for table, column in LOCATIONS:
                store.execute(
                    f"UPDATE {table} SET {column} = ? || substr({column}, ?) "
                    f"WHERE substr({column}, 1, ?) = ?",
                    (here, len(there) + 1, len(there), there),
                )


def _saved(
    folder: Path,
    text: str,
    example: Mapping[str, Sequence[float]],
    output: Sequence[float],
) -> None:
    """Write FOLDER/model as MLflow's pyfunc wants it: JSON and YAML, no pickle."""
    import pandas as pd
    from mlflow import pyfunc
    from mlflow.models import infer_signature

    table = pd.DataFrame(example)
    (folder / "network.json").write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of MLflow's about itself
        pyfunc.save_model(
            folder / "model",
            loader_module="softnn.neural.served",
            data_path=folder / "network.json",
            signature=infer_signature(table, np.asarray(output)),
            input_example=table,
            pip_requirements=["softnn"],
        )


def _line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


def _quoted(text: str) -> str:
    return text.replace("'", "''")


def beginning(note: str) -> str:
    """As many whole paragraphs of a note as fit into a tag; the rest is in a file."""
    more = f"\n\nThe rest is in the artifact `{WHOLE}`."
    return note[: LONGEST - len(more)].rpartition("\n\n")[0] + more


def _client(uri: str) -> MlflowClient:
    file = sqlite_file(uri)
    try:
        if file is not None:
            made_aside(file, _make)
            mended(uri)
        return _connected(uri)
    except Exception as error:  # SQLAlchemy's, requests', MLflow's own
        raise InputError(
            f"tracking {uri!r} cannot be opened ({_line(error)}); "
            "give an address such as sqlite:///mlruns/mlflow.db"
        ) from None


def _connected(uri: str) -> MlflowClient:
    with warnings.catch_warnings():
        # MLflow uses what its own dependencies have deprecated.
        warnings.simplefilter("ignore", DeprecationWarning)
        client = MlflowClient(uri)
        client.search_experiments(max_results=1)  # connects
    return client


def _make(file: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        made = create_sqlalchemy_engine_with_retry(f"sqlite:///{file}")
        _initialize_tables(made)
    made.dispose()


def _experiment(client: MlflowClient, uri: str, name: str) -> Experiment:
    found = client.get_experiment_by_name(name)
    if found is None:
        file = sqlite_file(uri)
        place = (file.parent / ARTIFACTS / name).resolve().as_uri() if file else None
        try:
            made = client.create_experiment(name, place, KIND | SHOWN)
            return client.get_experiment(made)
        except MlflowException:  # made by another process in between
            found = client.get_experiment_by_name(name)
            if found is None:
                raise
    if found.lifecycle_stage != "active":
        raise InputError(
            f"experiment {name!r} has been deleted in MLflow; restore it there "
            "or give another --tracking address"
        )
    for tag, value in SHOWN.items():
        if found.tags.get(tag) != value:
            client.set_experiment_tag(found.experiment_id, tag, value)
    return found


def tables(uri: str, address: str) -> dict[str, str]:
    """Where MLflow's UI at `address` shows the runs of each experiment, by its name.

    The link opens the table with NRMSE and R2 as columns, of what was judged by random
    folds and of what was never seen. An SQLite store that is not there has none.
    """
    file = sqlite_file(uri)
    if file is not None and not file.is_file():
        return {}
    return {
        one.name: f"{address}/#/experiments/{one.experiment_id}/runs"
        f"?viewStateShareKey={VIEW}"
        for one in _connected(uri).search_experiments()
        if SHOWN.keys() <= one.tags.keys()
    }


def _dataset(name: str, digest: str) -> DatasetInput:
    # MLflow keeps 36 characters of a digest; the whole of it is a parameter.
    return DatasetInput(
        Dataset(name, digest[:36], source_type="softnn", source=name), tags=[]
    )


def _milliseconds(moment: datetime) -> int:
    return round(moment.timestamp() * 1000)
