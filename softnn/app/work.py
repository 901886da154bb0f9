"""What other processes do for the pages: read, diagnose, train, export.

Each function calls what a command calls. `python -m softnn.app.work WHAT FOLDER` is one
long run; how far it is stands in the project's folder, so that whoever looks may go and
come back.
"""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import traceback
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from softnn import glance, readers
from softnn.app.project import MODEL, Project, safe, trained
from softnn.contracts import Array, InputError
from softnn.plausible import check_plausible, understood
from softnn.progress import Progress, heard, stage
from softnn.readers import ReadOptions
from softnn.readers.lacking import NoRecording
from softnn.readers.sizes import read_sizes
from softnn.readers.source import open_source
from softnn.readers.table import find_tables
from softnn.readers.units import known
from softnn.readers.vocabulary import DIMENSION
from softnn.recording import Recording

TOLD_S = 0.3  # between two words of a run
NETWORK = {"neurons": "2,4,8", "folds": "5", "cycles": False}  # small: two minutes
KEPT = {"network.json": "best-random", "unseen.json": "best-unseen-rate"}
UNITS = {role: known(d).split(", ") for role, d in DIMENSION.items()}


# -- reading ---------------------------------------------------------------------------


def understand(file: Path, options: dict[str, Any], as_is: bool) -> dict[str, Any]:
    """Facts of a file as softnn reads it, in plain values, or why it does not.

    `error`: it cannot be read so; `doubt`: it can, but hardly is what it seems;
    `no_test`: it holds no test, and is passed over.
    """
    told: dict[str, Any] = {
        "columns": [],
        "recordings": [],
        "notes": [],
        "error": "",
        "doubt": "",
        "no_test": "",
    }
    with suppress(InputError):  # then `read` says why
        told["columns"] = _columns(file)
    try:
        found = readers.read(file, ReadOptions(**options))
    except NoRecording as error:
        return told | {"no_test": _said(error, file)}
    except InputError as error:
        return told | {"error": _said(error, file)}
    except Exception as error:  # a fault of softnn: the other files are worth reading
        what = f"{type(error).__name__}: {error}".splitlines()[0]
        told["error"] = f"softnn failed on this file ({what}); please report it"
        return told
    for recording in found:
        told["recordings"].append(_facts(recording))
        try:
            told["notes"] += check_plausible(recording, as_is=as_is)
        except InputError as error:
            told["doubt"] = _said(error, recording.name)
    return told


def _columns(file: Path) -> list[str]:
    """Names of the columns of a file, for the visitor to choose from."""
    names: dict[str, None] = {}
    for sheet in open_source(file).sheets:
        for table in find_tables(sheet.grid, file, sheet.name):
            names.update(dict.fromkeys(c.name for c in table.columns if c.name))
    return list(names)


def _said(error: InputError, file: str | Path) -> str:
    """The message without the place, which the page shows beside it."""
    return re.sub(rf"^{re.escape(str(file))}(, |: )?", "", str(error)).strip()


def _facts(r: Recording) -> dict[str, Any]:
    read = next((s.arguments for s in r.log if s.name == "read"), {})
    strain, stress = r.strain[np.isfinite(r.strain)], r.stress_MPa
    stress = stress[np.isfinite(stress)]
    return {
        "name": r.name,
        "specimen": r.specimen,
        "dialect": read.get("dialect", "tidy CSV"),
        "samples": len(r),
        "understood": understood(r),
        "columns": dict(read.get("columns", {})),
        "notes": list(read.get("notes", [])),
        "geometry": {
            f.name: getattr(r.geometry, f.name)
            for f in fields(r.geometry)
            if getattr(r.geometry, f.name) is not None
        },
        "sign": _sign(strain),
        "curve": glance.svg([(r.strain, r.stress_MPa)]),
        "simulated": r.simulated_MPa is not None,
        "axes": [r.axes.strain.label, r.axes.stress.label],
        "ranges": [
            (axis.name, axis.unit.strip("-"), (float(v.min()), float(v.max())))
            for axis, v in ((r.axes.strain, strain), (r.axes.stress, stress))
            if v.size
        ],
    }


def _sign(strain: Array) -> str:
    low, high = (strain.min(), strain.max()) if strain.size else (0.0, 0.0)
    if -low > 10 * high:
        return "compression (negative)"
    return "tension (positive)" if high > 10 * -low else "tension and compression"


def read_all(project: Project) -> list[Recording]:
    """The recordings of a project as its visitor wants them read."""
    found = []
    for file in project.files:
        with suppress(NoRecording):
            found += readers.read(file, ReadOptions(**_reading(project, file)))
    return found


def _reading(project: Project, file: Path) -> dict[str, Any]:
    return {k: v for k, v in project.options(file.name).items() if k != "as_is"}


def example(folder: Path) -> None:
    """Fill a project with the recordings of `softnn demo`."""
    from softnn.mismatch.demo import conceal

    project = Project(folder)
    conceal(folder / "demo", "mullins_softening")
    for file in sorted((folder / "demo" / "recordings").iterdir()):
        file.rename(project.place_of(file.name))
    shutil.rmtree(folder / "demo")
    project.choose(title="Example: an effect concealed in made-up recordings")


# -- diagnosing ------------------------------------------------------------------------


def diagnose(project: Project) -> None:
    """Write `found`, by what `softnn diagnose` calls."""
    from softnn import __version__
    from softnn.mismatch.api import diagnose as api_diagnose
    from softnn.mismatch.api import plausible
    from softnn.mismatch.case import case_of

    digest, choices = project.digest, project.choices
    began = time.time()
    told = 0.0

    def tell(progress: Progress) -> None:
        nonlocal told
        if time.time() - told > TOLD_S or progress.steps == 0:
            told = time.time()
            part = f", {progress.part}" if progress.part else ""
            steps = f", step {progress.steps}" if progress.steps else ""
            answer = f"; so far: {progress.so_far}" if progress.so_far else ""
            now = (progress.stage or "diagnosing") + part + steps + answer
            project.tell("diagnose", stage=now, began=began)

    with heard(tell):
        stage("reading")
        recordings = read_all(project)
        case = case_of(recordings, project.title, history=choices["history"])
        as_is = all(o.get("as_is") for o in choices["files"].values())
        case = plausible(case, bool(choices["files"]) and as_is)
    base = choices["base"]
    model = str(project.folder / base) if base == MODEL else base or None
    found = api_diagnose(case, model, progress=tell)
    found.result["provenance"] = {"softnn": __version__, "seed": 0, "command": "app"}
    project.tell("diagnose", stage="writing", began=began)
    _replaced(project, "found", found.save)
    (project.folder / "found" / "asked").write_text(digest)
    project.tell("diagnose", ended="done", line=found.summary)
    _log(project)


def sizes_of(file: Path) -> dict[str, dict[str, Any]]:
    """What a dropped table of sizes says. Raises `InputError`."""
    try:
        return read_sizes(file)
    except InputError as error:
        raise InputError(_said(error, file)) from None


def check_model(file: Path) -> None:
    """Raises `InputError` where a file is no model."""
    from softnn.mismatch.api import load_model

    try:
        load_model(file)
    except InputError as error:
        raise InputError(_said(error, file)) from None


def _log(project: Project) -> None:
    """Log the diagnosis to MLflow, as `--tracking` does; for the page of results."""
    from softnn.mismatch.record import log

    log(tracking(project), [project.folder / "found"], 0)


def tracking(project: Project) -> str:
    """MLflow's address, the same for all projects."""
    return f"sqlite:///{project.folder.parent / 'mlflow.db'}"


def _replaced(project: Project, name: str, save: Any) -> None:
    """Write a folder aside, then in place of the one before: never half of it."""
    aside, place = project.folder / f".{name}", project.folder / name
    shutil.rmtree(aside, ignore_errors=True)
    save(aside)
    shutil.rmtree(place, ignore_errors=True)
    aside.rename(place)


# -- training --------------------------------------------------------------------------


def network(project: Project) -> None:
    """Write `network`, by `python -m studies.neurons` on the recordings as tidy CSV."""
    from softnn.readers.tidy import write_index
    from softnn.tracking import fetched

    began = time.time()
    project.tell("network", stage="reading", began=began)
    asked = NETWORK | project.choices["network"]
    stem = re.sub(r"[^\w-]+", "_", Path(project.title).stem)
    source = project.folder / f"{stem}-{project.id[-8:]}"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir()
    written = {f"{i}-{safe(r.name)}.csv": r for i, r in enumerate(read_all(project), 1)}
    for file, recording in written.items():
        recording.to_frame().to_csv(source / file, index=False)
    write_index(source, written)
    where = tracking(project)

    def save(place: Path) -> None:
        command = [sys.executable, "-m", "studies.neurons", "--data", str(source)]
        command += ["--neurons", asked["neurons"], "--folds", asked["folds"]]
        command += ["--cycles"] if asked["cycles"] else []
        command += ["--storage", f"sqlite:///{project.folder / 'optuna.db'}"]
        command += ["--tracking", where, "--out", str(place)]
        _watched(project, command, began)
        found = trained(place)
        assert found is not None
        registered = found["materials"][0]["registered"]
        for file, alias in KEPT.items():
            name = f"models:/{registered}@{alias}"
            shutil.copy(fetched(name, where), place / file)

    _replaced(project, "network", save)
    shutil.rmtree(source, ignore_errors=True)
    project.tell("network", ended="done", line="")


def _watched(project: Project, command: Sequence[str], began: float) -> None:
    """Run a study, and tell how many trials are done. Raises `InputError`."""
    last = ""
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as study:
        assert study.stderr is not None
        for line in study.stderr:  # a bar writes over itself: universal newlines
            last = line.strip() or last
            print(line, end="", flush=True)
            if found := re.search(r"\b(\d+)/(\d+) \[", line):
                part, of = map(int, found.groups())
                stage = f"training: {part} of {of} configurations"
                project.tell("network", stage=stage, began=began, part=part, of=of)
    if study.returncode:
        raise InputError(re.sub(r"^[\w.]+: ", "", last) or "the study ended early")


# -- exporting -------------------------------------------------------------------------


def exported(
    project: Project, model: Path, to: str, name: str, anyway: bool
) -> tuple[str, bytes, list[str]]:
    """The name and content of one file, zipped if several, and what it lacks.

    Raises `InputError` for a model that has no such form, or loses much in it; unless
    it is wanted `anyway`.
    """
    from softnn.export.command import CARDS, compared
    from softnn.export.files import Options, export
    from softnn.export.parts import UNSTEPPED
    from softnn.model_file import read_model

    stored = read_model(model)
    options = Options(leave_out=tuple(UNSTEPPED) if anyway else ())
    made = export(stored, to, name, options)
    lines = compared(stored, read_all(project), anyway) if to in CARDS else []
    if len(made) == 1:
        return (*next(iter(made.items())), lines)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in made.items():
            archive.writestr(file, content)
    return f"{name}-{to}.zip", packed.getvalue(), lines


# -- a run of its own ------------------------------------------------------------------


def main(argv: Sequence[str] | None = None) -> int:
    what, folder, *more = sys.argv[1:] if argv is None else argv
    threading.Thread(target=_with_parent, daemon=True).start()
    if what == "mlflow":
        return mlflow(Path(folder), *more)
    project = Project(Path(folder))
    try:
        {"diagnose": diagnose, "network": network}[what](project)
    except InputError as error:
        line = str(error).replace(f"{project.folder / 'files'}{os.sep}", "")
        _failed(project, what, line)
        return 2
    except Exception as error:  # a fault of softnn
        traceback.print_exc()
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        _failed(project, what, f"softnn failed ({said}); please report it")
        return 1
    return 0


def _failed(project: Project, what: str, line: str) -> None:
    if "ended" not in project.state(what):  # else the result itself is there
        project.tell(what, ended="failed", line=line)


def mlflow(out: Path, port: str) -> int:
    """MLflow's own pages, as `make ui` serves them."""
    command = [sys.executable, "-m", "mlflow", "ui", "--workers", "1"]
    command += ["--backend-store-uri", f"sqlite:///{out / 'mlflow.db'}"]
    command += ["--host", "127.0.0.1", "--port", port]
    quiet = {
        "MLFLOW_DISABLE_TELEMETRY": "true",
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
    }
    return subprocess.run(command, env=os.environ | quiet, check=False).returncode


def _with_parent() -> None:
    """End when the server, which holds the other end of standard input, is gone."""
    while os.read(0, 4096):  # not sys.stdin: its lock would outlive the interpreter
        pass
    os.killpg(0, signal.SIGKILL)  # a group of its own, with all that it started


if __name__ == "__main__":
    sys.exit(main())
