"""What `softnn diagnose` and `softnn simulate` do, as functions."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softnn.contracts import InputError
from softnn.mismatch import diagnosis
from softnn.mismatch.case import HISTORIES, Case, read_case
from softnn.mismatch.diagnosis import Diagnosis
from softnn.mismatch.model_file import Stored, read_model
from softnn.recording import Recording

if TYPE_CHECKING:
    from softnn.neural import StoredNetwork

FILES = (".csv", ".txt", ".dat", ".tra", ".xls", ".xlsx", ".gz")


def read(path: str | Path, **given: Any) -> list[Recording]:
    """Recordings of a file, of a folder of files, or of a case.

    A file is a tidy CSV or what a testing machine exported; `given` are fields of
    `softnn.readers.ReadOptions` (`length_mm=33, area_mm2=18 ...`) for what it does not
    say. A folder may hold an `index.csv`, or be a case. Raises `InputError`.
    """
    from softnn import readers
    from softnn.readers.tidy import read_folder

    path = Path(path)
    if not path.is_dir():
        return readers.read(path, **given)
    if _is_case(path):
        return list(read_case(path).recordings)
    if (path / "index.csv").is_file():
        return read_folder(path)
    files = sorted(
        f for f in path.iterdir() if f.is_file() and f.suffix.lower() in FILES
    )
    if not files:
        raise InputError(
            f"no recordings; files of these kinds are read: {', '.join(FILES)}",
            file=path,
        )
    return [r for f in files for r in readers.read(f, **given)]


def _is_case(folder: Path) -> bool:
    return (folder / "recordings").is_dir() or (folder / "case.toml").is_file()


def diagnose(
    recordings: Sequence[Recording] | Case | str | Path,
    model: str | Path | Stored | StoredNetwork | None = None,
    *,
    history: str = "fresh",
    specimen: Mapping[str, str] | None = None,
    seed: int = 0,
) -> Diagnosis:
    """What a simulation of these recordings leaves out, and how sure that is.

    `recordings`: a list, a case, or a folder of either. `model`: a base by name, a
    model.json or what `load_model` gave; None is what a case says, else pl-wiechert.
    `history`: "fresh" where each recording begins at rest, "continued" where it goes on
    from the one before. `specimen`: of each recording by name, where there are several.
    Raises `InputError`.

    >>> import numpy as np
    >>> time = np.linspace(0, 20, 201)
    >>> strain = 0.4 * (1 - np.abs(time / 10 - 1))
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(201)
    >>> found = diagnose([Recording(time, strain, strain + noise, name="a")], "hooke")
    >>> found.verdict
    'nothing_missing'
    >>> found.selected
    []
    >>> found.model.simulate(found.case.recordings[0])[100].round(2)
    np.float64(0.4)
    """
    if isinstance(recordings, str | Path):
        folder = Path(recordings)
        if not folder.is_dir() or _is_case(folder):
            recordings = read_case(folder)
        else:
            recordings = _case(read(folder), folder.resolve().name)
    elif not isinstance(recordings, Case):
        recordings = _case(recordings, "recordings")
    case = recordings
    if history not in HISTORIES:
        raise InputError(f"history is {history!r}; allowed: {list(HISTORIES)}")
    if history != "fresh":
        case = replace(case, history=history)
    if specimen is not None:
        unknown = set(specimen) - {r.name for r in case.recordings}
        if unknown:
            raise InputError(
                f"specimen names {sorted(unknown)[0]!r}, which is no recording here"
            )
        case = replace(case, specimen=dict(specimen))
    if isinstance(model, Path) or (isinstance(model, str) and model.endswith(".json")):
        model = load_model(model)
    return diagnosis.diagnose(case, model, seed)


def _case(recordings: Sequence[Recording], name: str) -> Case:
    """A case of recordings; those without a name are counted."""
    for one in recordings:
        if not isinstance(one, Recording):
            raise InputError(
                f"recordings hold a {type(one).__name__}; Recording.from_frame makes a "
                "recording of a table"
            )
    named = (
        one if one.name else replace(one, name=f"r{i}")
        for i, one in enumerate(recordings)
    )
    return Case(name, tuple(named))


def load_model(path: str | Path) -> Stored | StoredNetwork:
    """A model.json of a diagnosis, or the file of a trained network.

    `models:/NAME@ALIAS` is one that a study has registered in MLflow: in
    mlruns/mlflow.db below this folder, or where MLFLOW_TRACKING_URI says.
    """
    if isinstance(path, str) and path.startswith(("models:/", "runs:/")):
        from softnn.tracking import fetched

        tracking = os.environ.get("MLFLOW_TRACKING_URI", "sqlite:///mlruns/mlflow.db")
        path = fetched(path, tracking)
    return read_model(path)
