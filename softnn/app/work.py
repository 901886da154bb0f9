"""What other processes do for the pages: read, diagnose, train, export.

Each function calls what a command calls. `python -m softnn.app.work WHAT FOLDER` is one
long run; how far it is stands in the project's folder, so that whoever looks may go and
come back.
"""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import threading
import time
import traceback
import zipfile
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from softnn import readers
from softnn.app.project import Project
from softnn.contracts import Array, InputError
from softnn.plausible import check_plausible, understood
from softnn.readers import ReadOptions
from softnn.readers.source import open_source
from softnn.readers.table import find_tables
from softnn.readers.units import known
from softnn.readers.vocabulary import DIMENSION
from softnn.recording import Recording
from softnn.report.picture import kept

DRAWN = 400  # points of a small curve
WIDTH, HEIGHT = 320.0, 180.0  # of it
UNITS = {role: known(d).split(", ") for role, d in DIMENSION.items()}


# -- reading ---------------------------------------------------------------------------


def understand(file: Path, options: dict[str, Any], as_is: bool) -> dict[str, Any]:
    """What is understood of a file, in plain values, or why nothing is.

    `error`: it cannot be read so; `doubt`: it can, but hardly is what it seems.
    """
    told: dict[str, Any] = {
        "columns": [],
        "recordings": [],
        "notes": [],
        "error": "",
        "doubt": "",
    }
    try:
        told["columns"] = _columns(file)
        found = readers.read(file, ReadOptions(**options))
    except InputError as error:
        return told | {"error": _said(error, file)}
    except Exception as error:  # a fault of softnn: the other files are worth reading
        what = f"{type(error).__name__}: {error}".splitlines()[0]
        return told | {"error": f"softnn failed on this file ({what}); please report it"}
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
        "curve": curve(r.strain, r.stress_MPa),
        "axes": [r.axes.strain.label, r.axes.stress.label],
        "strain": [float(strain.min()), float(strain.max())] if strain.size else [],
        "stress": [float(stress.min()), float(stress.max())] if stress.size else [],
    }


def _sign(strain: Array) -> str:
    low, high = (strain.min(), strain.max()) if strain.size else (0.0, 0.0)
    if -low > 10 * high:
        return "compression (negative)"
    return "tension (positive)" if high > 10 * -low else "tension and compression"


def curve(x: Array, y: Array) -> str:
    """Points of an SVG line of y over x, `WIDTH` by `HEIGHT`.

    >>> curve(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 0.0]))
    '0.0,180.0 160.0,0.0 320.0,180.0'
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if not len(x):
        return ""
    keep = kept(y, DRAWN)
    across = WIDTH * (x - x.min()) / max(float(np.ptp(x)), 1e-300)
    down = HEIGHT * (y.max() - y) / max(float(np.ptp(y)), 1e-300)
    return " ".join(
        f"{a:.1f},{b:.1f}" for a, b in zip(across[keep], down[keep], strict=True)
    )


def read_all(project: Project) -> list[Recording]:
    """The recordings of a project as its visitor wants them read."""
    return [
        r
        for file in project.files
        for r in readers.read(file, ReadOptions(**_reading(project, file)))
    ]


def _reading(project: Project, file: Path) -> dict[str, Any]:
    return {k: v for k, v in project.options(file.name).items() if k != "as_is"}


# -- diagnosing ------------------------------------------------------------------------


def diagnose(project: Project) -> str:
    """Write `found`; the answer in a sentence or two."""
    from softnn import __version__
    from softnn.mismatch import diagnosis
    from softnn.mismatch.api import plausible
    from softnn.mismatch.batch import base
    from softnn.mismatch.case import Case

    digest, choices = project.digest, project.choices
    began = time.time()
    project.tell("diagnose", stage="reading", began=began)
    recordings = read_all(project)
    case = Case(
        project.title,
        tuple(recordings),
        history=choices["history"],
        specimen={r.name: r.specimen for r in recordings if r.specimen},
    )
    case = plausible(case, all(o.get("as_is") for o in choices["files"].values()))
    project.tell("diagnose", stage="diagnosing", began=began)
    model = base(_model_of(project)) if choices["base"] else None
    found = diagnosis.diagnose(case, model)
    found.result["provenance"] = {"softnn": __version__, "seed": 0, "command": "app"}
    project.tell("diagnose", stage="writing", began=began)
    _replaced(project, "found", found.save)
    (project.folder / "found" / "asked").write_text(digest)
    return found.summary


def _model_of(project: Project) -> str:
    """The base by name, or the path of the model.json that was dropped."""
    name = str(project.choices["base"])
    return str(project.folder / name) if name.endswith(".json") else name


def _replaced(project: Project, name: str, save: Any) -> None:
    """Write a folder aside, then in place of the one before: never half of it."""
    import shutil

    aside, place = project.folder / f".{name}", project.folder / name
    shutil.rmtree(aside, ignore_errors=True)
    save(aside)
    shutil.rmtree(place, ignore_errors=True)
    aside.rename(place)


# -- exporting -------------------------------------------------------------------------


def exported(
    model: Path, to: str, name: str, leave_out: Sequence[str] = ()
) -> tuple[str, bytes]:
    """The name and content of one file: what an export makes, zipped if several."""
    from softnn.export.files import Options, export
    from softnn.model_file import read_model

    made = export(read_model(model), to, name, Options(leave_out=tuple(leave_out)))
    if len(made) == 1:
        return next(iter(made.items()))
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in made.items():
            archive.writestr(file, content)
    return f"{name}-{to}.zip", packed.getvalue()


# -- a run of its own ------------------------------------------------------------------


def main(argv: Sequence[str] | None = None) -> int:
    what, folder, *_ = sys.argv[1:] if argv is None else argv
    threading.Thread(target=_with_parent, daemon=True).start()
    project = Project(Path(folder))
    try:
        line = {"diagnose": diagnose}[what](project)
        project.tell(what, ended="done", line=line)
    except InputError as error:
        line = str(error).replace(f"{project.folder / 'files'}{os.sep}", "")
        project.tell(what, ended="failed", line=line)
        return 2
    except Exception as error:  # a fault of softnn
        traceback.print_exc()
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        project.tell(
            what, ended="failed", line=f"softnn failed ({said}); please report it"
        )
        return 1
    return 0


def _with_parent() -> None:
    """End when the server, which holds the other end of standard input, is gone."""
    sys.stdin.buffer.read()
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
