"""What `softnn diagnose` and `softnn simulate` do, as functions."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softnn import readers
from softnn.contracts import InputError, nearest
from softnn.mismatch import base as bases
from softnn.mismatch import diagnosis
from softnn.mismatch.case import ABOUT, HISTORIES, Case, check_sizes, read_case
from softnn.mismatch.diagnosis import Diagnosis
from softnn.model_file import Stored, read_model
from softnn.plausible import check_plausible, scattered, understood
from softnn.readers.tidy import read_folder
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
    path = Path(path)
    if not path.is_dir():
        return readers.read(path, **given)
    if _is_case(path):
        return list(read_case(path).recordings)
    if (path / "index.csv").is_file():
        return read_folder(path)
    return [r for f in _files(path) for r in readers.read(f, **given)]


def to_case(
    path: str | Path | Sequence[str | Path], as_is: bool = False, **given: Any
) -> Case:
    """The case in a folder, or of the files in a list; `given` as for `read`.

    A folder with `recordings/` or a case.toml is read as a case; of any other folder
    every file of a kind that is read. `notes` of the case say what was not used, and
    what is odd; implausible numbers are refused unless they are right `as_is`.
    """
    return plausible(_read_case(path, given), as_is)


def plausible(case: Case, as_is: bool = False) -> Case:
    """The case with notes on what is odd in its recordings. Raises `InputError`."""
    for recording in case.recordings:
        check_sizes(recording, recording.name or None)  # before anything is noted
    if as_is:
        return case
    notes = [n for r in case.recordings for n in check_plausible(r)]
    notes += [] if case.groups() else scattered(case.recordings)
    return replace(case, notes=(*case.notes, *notes))


def _read_case(
    path: str | Path | Sequence[str | Path], given: Mapping[str, Any]
) -> Case:
    if isinstance(path, str | Path):
        folder = Path(path)
        if not folder.is_dir() or _is_case(folder):
            return read_case(folder)
        case = _case(read(folder, **given), folder.resolve().name)
        return replace(case, folder=folder, notes=tuple(_left_out(folder, case)))
    files = [Path(f) for f in path]
    name = files[0].stem if len(files) == 1 else files[0].resolve().parent.name
    return _case([r for f in files for r in readers.read(f, **given)], name)


def _left_out(folder: Path, case: Case) -> list[str]:
    """Notes on files of a folder that were not read; pictures are not told of."""
    used = {Path(r.source).name for r in case.recordings} | set(ABOUT)
    listed = (folder / "index.csv").is_file()
    notes = []
    for file in sorted(folder.iterdir()):
        if not file.is_file() or file.name in used or file.suffix == ".png":
            continue
        if file.suffix.lower() not in FILES:
            notes.append(f"{file.name}: not a kind of file read")
        elif listed:
            notes.append(f"{file.name}: not listed in index.csv, so not read")
    return notes


def inferred(case: Case, model: str | None = None) -> list[str]:
    """What was understood of a case, in a line a recording and one for all."""
    lines = []
    for r in case.recordings:
        read_ = next((s.arguments for s in r.log if s.name == "read"), {})
        dialect = read_.get("dialect", "tidy CSV")
        lines.append(f"{r.name}: {dialect}, {len(r)} samples, {understood(r)}")
    specimens = len(set(case.specimen.values())) or 1
    base = model or case.model
    if base is None:
        base = "the column simulated_MPa" if case.simulated_MPa else bases.DEFAULT
    begins = "at rest" if case.history == "fresh" else "where the one before ended"
    lines.append(
        f"{case.name}: {len(case.recordings)} recording(s) of {specimens} specimen(s), "
        f"each begins {begins}; base: {base}"
    )
    return lines


def _is_case(folder: Path) -> bool:
    return (folder / "recordings").is_dir() or (folder / "case.toml").is_file()


def _files(folder: Path) -> list[Path]:
    """Files of kinds that are read. Raises `InputError` where there are none."""
    files = sorted(
        f
        for f in folder.iterdir()
        if f.is_file() and f.suffix.lower() in FILES and f.name not in ABOUT
    )
    if not files:
        raise InputError(
            f"no recordings; files of these kinds are read: {', '.join(FILES)}",
            file=folder,
        )
    return files


def diagnose(
    recordings: Sequence[Recording] | Case | str | Path,
    model: str | Path | Stored | StoredNetwork | None = None,
    *,
    history: str = "fresh",
    specimen: Mapping[str, str] | None = None,
    seed: int = 0,
    as_is: bool = False,
) -> Diagnosis:
    """What a simulation of these recordings leaves out, and how sure that is.

    `recordings`: a list, a case, or a folder of either. `model`: a base by name, a
    model.json or what `load_model` gave; None is what a case says, else pl-wiechert.
    `history`: "fresh" where each recording begins at rest, "continued" where it goes on
    from the one before. `specimen`: of each recording by name, where there are several.
    `as_is`: take implausible numbers as they stand. Raises `InputError`.

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
        recordings = to_case(recordings, as_is)
    elif not isinstance(recordings, Case):
        recordings = plausible(_case(recordings, "recordings"), as_is)
    case = recordings
    if history not in HISTORIES:
        raise InputError(
            f"history is {history!r}{nearest(history, HISTORIES)}; allowed: "
            f"{list(HISTORIES)}"
        )
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
    case = Case(name, tuple(named))
    specimens = {r.name: r.specimen for r in case.recordings if r.specimen}
    return replace(case, specimen=specimens)


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
