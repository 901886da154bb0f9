"""`softnn diagnose` and `softnn simulate` as Python functions."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from softnn import readers
from softnn.axes import Axes, common
from softnn.cards.given import Given
from softnn.cards.read import is_card, read_card
from softnn.contracts import Array, Chunk, InputError, nearest
from softnn.mismatch import base as bases
from softnn.mismatch import diagnosis
from softnn.mismatch.case import (
    HISTORIES,
    Case,
    case_of,
    check_sizes,
    mask_failure,
    mask_gaps,
    read_case,
    read_notes,
)
from softnn.mismatch.diagnosis import Diagnosis
from softnn.model_file import Stored, read_model
from softnn.plausible import (
    accidents,
    check_plausible,
    check_together,
    going_on,
    one_size,
    scattered,
    understood,
)
from softnn.progress import Listener, Shown, heard, stage, watched
from softnn.readers import ReadOptions
from softnn.readers.arguments import as_arguments
from softnn.readers.folder import read_files, without_copies
from softnn.readers.options import name_of
from softnn.recording import Recording, bridged

if TYPE_CHECKING:
    from softnn.neural import StoredNetwork

Paths = str | Path | Sequence[str | Path]
Function = TypeVar("Function", bound=Callable[..., Any])


def _of_arguments(function: Function) -> Function:
    """Make errors of a function name keyword arguments, not command options."""

    @wraps(function)
    def inner(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except InputError as error:
            told = InputError(as_arguments(str(error)))
            told.file, told.row, told.column = error.file, error.row, error.column
            raise told from None

    return cast(Function, inner)


def options_of(given: Mapping[str, Any]) -> ReadOptions:
    """Return reading options from keyword arguments. Raises `InputError` on others."""
    allowed = [f.name for f in fields(ReadOptions)]
    for name in given:
        if name not in allowed:
            raise InputError(
                f"no argument {name!r}{nearest(name, allowed)}; allowed: "
                f"{', '.join(allowed)}"
            )
    return ReadOptions(**given)


@_of_arguments
def read(path: Paths, *, skip: Iterable[str] = (), **given: Any) -> list[Recording]:
    """Return the recordings of a file, of several files, or of a folder (recursive).

    A file is a tidy CSV or the export of a testing machine. `given` supplies what the
    file does not say, by the names of `softnn.readers.ReadOptions`: `length_mm=33,
    area_mm2=18` (or `width_mm`, `thickness_mm`, `diameter_mm`), `units={"Load": "N"}`,
    columns by name as `strain="Video"`, `compression=True` and others. Files that hold
    no test are passed over, and so are files that match a pattern of `skip`. Raises
    `InputError` naming file, row and column.
    """
    return list(_read_case(path, options_of(given), tuple(skip)).recordings)


def to_case(
    path: Paths,
    as_is: bool = False,
    *,
    options: ReadOptions | None = None,
    skip: Sequence[str] = (),
    **given: Any,
) -> Case:
    """Return the case in a folder, or of the files in a list; `given` as for `read`.

    `notes` of the case name the files that were passed over and the oddities of the
    recordings. Implausible numbers raise `InputError` unless `as_is` is set.
    """
    return plausible(_read_case(path, options or options_of(given), skip), as_is)


def plausible(case: Case, as_is: bool = False) -> Case:
    """Return the case with notes on oddities. Raises `InputError` on implausible ones.

    Copies of a recording are dropped, and so is the stress after a specimen has torn.
    """
    # before anything is noted
    _each(case, lambda r, alone: check_sizes(r, r.source or r.name or None, alone))
    if as_is:
        return case
    case = _once(case)
    notes = _each(
        case, lambda r, alone: check_plausible(r, history=case.history, alone=alone)
    )
    if case.history == "fresh":
        check_together(case.recordings)
    kept = []
    for r in case.recordings:
        r, told = accidents(r)
        kept.append(r)
        notes += told
    materials = sorted({r.material for r in case.recordings if r.material})
    if len(materials) > 1:
        notes.append(
            f"recordings of {len(materials)} materials ({', '.join(materials[:4])}) in "
            "one case: one model has to fit them all; name the files of one material, "
            f"as softnn diagnose {shlex.quote(Path(case.recordings[0].source).name)} .."
        )
    notes += going_on(case.recordings, case.history)
    if not case.groups():
        notes += one_size(case.recordings) or scattered(case.recordings)
    case = replace(case, recordings=tuple(kept))
    return replace(case, notes=(*case.notes, *notes, *_failed(case)))


def _failed(case: Case) -> list[str]:
    """Return a note on each recording that is used up to a failure only."""
    out, whole = [], mask_gaps(case)
    for one, cut in zip(whole.recordings, mask_failure(whole).recordings, strict=True):
        gone = np.isfinite(one.stress_MPa) & ~np.isfinite(cut.stress_MPa)
        if gone.any():
            at, stress = one.time_s[gone.argmax()], one.axes.stress.name
            out.append(
                f"{one.name}: {stress} falls by more than two thirds at {at:.4g} s and "
                "does not come back: taken as a failure; what follows is not used"
            )
    return out


def _each(case: Case, check: Callable[[Recording, bool], Any]) -> list[str]:
    """Return the notes of a check of each recording.

    Raises its `InputError`, with advice for one file alone unless all files need it.
    """
    notes, wrong = list[str](), list[tuple[Recording, InputError]]()
    for one in case.recordings:
        try:
            notes += check(one, False) or ()
        except InputError as error:
            wrong.append((one, error))
    if not wrong:
        return notes
    first, told = wrong[0]
    if len({r.source for r, _ in wrong}) < len({r.source for r in case.recordings}):
        check(first, True)
    raise told


def _once(case: Case) -> Case:
    kept, notes = without_copies(case.recordings)
    if not notes:
        return case
    at = [i for i, r in enumerate(case.recordings) if any(r is k for k in kept)]
    simulated = case.simulated_MPa
    return replace(
        case,
        recordings=tuple(kept),
        simulated_MPa=simulated and tuple(simulated[i] for i in at),
        notes=(*case.notes, *notes),
    )


def _read_case(path: Paths, options: ReadOptions, skip: Sequence[str] = ()) -> Case:
    stage("reading")
    paths = [Path(path)] if isinstance(path, str | Path) else [Path(p) for p in path]
    if not paths:
        raise InputError("no files named; at least one is needed")
    if len(paths) == 1 and not paths[0].is_file():
        return read_case(paths[0], options, skip)
    found = read_files(None, paths, options, readers.read)
    found.notes += read_notes(found.recordings)
    if skip:
        found.notes.append("--skip is for folders: files that are named are all read")
    one = paths[0]
    name = name_of(one) if len(paths) == 1 else one.resolve().parent.name
    return case_of(found.recordings, name, notes=tuple(found.notes))


@dataclass(frozen=True)
class History:
    """A strain programme to simulate: its name, the recording, and any known stress.

    `simulated` and `measured` are stress (n,) in the unit of the recording, or None.
    """

    name: str
    chunk: Chunk
    simulated: Array | None
    measured: Array | None


def histories(
    paths: Sequence[str | Path],
    axes: Axes,
    options: ReadOptions | None = None,
    skip: Sequence[str] = (),
) -> tuple[list[History], list[str]]:
    """Return the strain histories in files and folders, and notes on skipped files.

    Takes every file that `diagnose` takes; a tidy CSV may lack the stress. Raises
    `InputError`.
    """
    from softnn.mismatch.histories import read_history

    options = options or ReadOptions()
    bare, files, notes = list[History](), list[Path](), list[str]()
    recordings: list[Recording] = []
    for path in map(Path, paths):
        if path.is_dir():
            case = read_case(path, options, skip)
            recordings += case.recordings
            notes += case.notes
        elif options == ReadOptions() and _is_tidy(path):
            frame = read_history(path, axes)
            time = frame["time_s"].to_numpy(float)
            strain = bridged(frame[axes.strain.column].to_numpy(float), time)
            more = {
                key: frame[column].to_numpy(float) if column in frame else None
                for key, column in (
                    ("warm", "temperature_C"),
                    ("simulated", axes.simulated),
                    ("measured", axes.stress.column),
                )
            }
            chunk = Chunk(time, strain, more.pop("warm"))
            bare.append(History(name_of(path), chunk, **more))
        else:
            files.append(path)
    if files:
        found = read_files(None, files, options, readers.read)
        recordings += found.recordings
        notes += found.notes + read_notes(found.recordings)
    common({"the model": axes} | {r.name: r.axes for r in recordings})
    every = bare + [
        History(r.name, r.history, r.simulated_MPa, r.stress_MPa) for r in recordings
    ]
    names = [h.name for h in every]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise InputError(f"two recordings are called {name!r}; rename one")
    return every, notes


def _is_tidy(path: Path) -> bool:
    try:
        with path.open("rb") as stream:
            head = stream.read(4096)
    except (OSError, ValueError):
        return False  # the reader says why
    first = head.removeprefix(b"\xef\xbb\xbf").split(b"\n", 1)[0]
    return b"time_s" in [name.strip(b' "\r') for name in first.split(b",")]


def inferred(case: Case, model: str | None = None) -> list[str]:
    """Return inferred settings: a line for each recording, and one for the case."""
    lines = []
    for r in case.recordings:
        read_ = next((s.arguments for s in r.log if s.name == "read"), {})
        dialect = read_.get("dialect", "tidy CSV")
        lines.append(f"{r.name}: {dialect}, {len(r)} samples, {understood(r)}")
    count, named = len(case.recordings), len(set(case.specimen.values()))
    specimens = f"{named} specimen{'s'[: named != 1]}" if named else "unnamed specimens"
    base = model or case.model
    if base is None:
        base = "the column simulated_MPa" if case.simulated_MPa else bases.DEFAULT
    elif case.simulated_MPa:
        base += " (the column simulated_MPa is not used)"
    begins = "at rest" if case.history == "fresh" else "where the one before ended"
    lines.append(
        f"{case.name}: {count} recording{'s'[: count != 1]} of {specimens}, "
        f"each begins {begins}; base: {base}"
    )
    return lines


@_of_arguments
def diagnose(
    recordings: Recording | Sequence[Recording | str | Path] | Case | str | Path,
    model: str | Path | Stored | StoredNetwork | Given | None = None,
    *,
    history: str | None = None,
    specimen: Mapping[str, str] | None = None,
    seed: int = 0,
    tolerance: float = 0.02,
    as_is: bool = False,
    refit: bool = False,
    card_unit: str | None = None,
    progress: Listener | None = None,
    **given: Any,
) -> Diagnosis:
    """Diagnose recordings: which effects a simulation left out, and how sure that is.

    `recordings`: a recording, a list of them, a file, a list of files, a folder or a
    case. `model`: the name of a base, a model.json, the result of `load_model`, or a
    material card (.inp, .mac, .feb); None
    takes the model that the case names, else the simulation stored with the recordings,
    else pl-wiechert. `history`: "fresh" if each recording begins at rest, "continued"
    if it goes on from the one before; None takes the case's own, else "fresh".
    `specimen`: maps names of recordings to names of specimens. `tolerance`: the error
    of prediction, a fraction, that is good enough. `as_is`: accept implausible numbers.
    `refit`: fit the moduli of a material card too. `card_unit`: the unit of its
    stresses. `progress`: called with a `softnn.progress.Progress` from time to time;
    None shows a bar on a terminal and in a notebook. `given`: as for `read`, if files
    are read. Returns a `Diagnosis`. Raises `InputError`.

    >>> import numpy as np
    >>> time = np.linspace(0, 20, 201)
    >>> strain = 0.4 * (1 - np.abs(time / 10 - 1))
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(201)
    >>> found = diagnose(Recording(time, strain, strain + noise, name="a"), "hooke")
    >>> found.verdict
    'nothing_missing'
    >>> found.selected
    []
    >>> found.model.simulate(found.case.recordings[0])[100].round(2)
    np.float64(0.4)
    """
    shown = Shown("softnn", quiet=progress is not None or not watched())
    with shown, heard(progress if shown.quiet else shown):
        case = _given_case(recordings, given)
        if history is not None and history not in HISTORIES:
            raise InputError(
                f"history is {history!r}{nearest(history, HISTORIES)}; allowed: "
                f"{list(HISTORIES)}"
            )
        if history is not None:
            case = replace(case, history=history)
        if specimen is not None:
            unknown = set(specimen) - {r.name for r in case.recordings}
            if unknown:
                raise InputError(
                    f"specimen names {sorted(unknown)[0]!r}, which is no recording here"
                )
            case = replace(case, specimen=dict(specimen))
        if not isinstance(recordings, Case):
            case = plausible(case, as_is)
        if isinstance(model, str | Path) and is_card(str(model)):
            model = replace(read_card(str(model), card_unit), refit=refit)
        elif refit or card_unit is not None:
            raise InputError("refit and card_unit are for material cards")
        named = isinstance(model, Path) or (
            isinstance(model, str) and model.endswith(".json")
        )
        return diagnosis.diagnose(
            case,
            load_model(cast(Path, model)) if named else cast(Any, model),
            seed,
            tolerance,
        )


def _given_case(recordings: Any, given: Mapping[str, Any]) -> Case:
    """Return the case made of whatever kind of input `diagnose` was given."""
    if isinstance(recordings, str | Path):
        return _read_case(recordings, options_of(given))
    if isinstance(recordings, Recording):
        recordings = [recordings]
    elif not isinstance(recordings, Case):
        recordings = list(recordings)
    if isinstance(recordings, list) and recordings:
        if all(isinstance(r, str | Path) for r in recordings):
            return _read_case(recordings, options_of(given))
    if given:
        options_of(given)  # report a misspelt option before a file is read
        raise InputError(
            f"{next(iter(given))} is for files; these recordings are read already: "
            "give it to softnn.read"
        )
    if isinstance(recordings, Case):
        return recordings
    return case_of(recordings, "recordings")


@_of_arguments
def load_model(path: str | Path) -> Stored | StoredNetwork:
    """Load a model.json of a diagnosis, or the file of a trained network.

    `models:/NAME@ALIAS` names a model that a study has registered in MLflow. The store
    is mlruns/mlflow.db below this folder, or the one in MLFLOW_TRACKING_URI.
    """
    if isinstance(path, str) and path.startswith(("models:/", "runs:/")):
        from softnn.tracking import fetched

        tracking = os.environ.get("MLFLOW_TRACKING_URI", "sqlite:///mlruns/mlflow.db")
        path = fetched(path, tracking)
    return read_model(path)
