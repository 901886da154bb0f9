"""A model as a functional mock-up unit: FMI 2.0 and 3.0, co-simulation.

The unit holds the C of `c_source`, its wrapper, and both compiled for this machine.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

import softnn
from softnn.cards.texts import remark
from softnn.contracts import InputError
from softnn.export.parts import Options
from softnn.export.source import c_source, described, meanings
from softnn.export.templates_of import fill, template
from softnn.model_file import Stored
from softnn.neural import StoredNetwork

STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror")
ENDINGS = {"linux": ".so", "darwin": ".dylib", "win32": ".dll"}
# FMI 2.0 names platforms by one word, FMI 3.0 by machine and system.
SHORT = {"linux": "linux64", "darwin": "darwin64", "win32": "win64"}
LONG = {"linux": "linux", "darwin": "darwin", "win32": "windows"}
DATED = (1980, 1, 1, 0, 0, 0)  # the same unit is the same file


def fmu(
    model: Stored | StoredNetwork, name: str, options: Options | None = None
) -> dict[str, bytes]:
    """Units by file name, one a version of FMI; `InputError` without a C compiler."""
    header, source = c_source(model, name, options)
    token = hashlib.sha256((header + source).encode()).hexdigest()[:32]
    places = {
        "name": name,
        "guard": name.upper(),
        "token": token,
        "what": described(model),
        "version": remark(softnn.__version__),
        **meanings(model, name, options),
    }
    common = {
        f"{name}.h": header,
        f"{name}.c": source,
        f"{name}_fmu.h": fill(template("fmu/fmu.h"), places),
    }
    out = {}
    for version in (2, 3):
        files = common | {
            f"{name}_fmi{version}.c": fill(template(f"fmu/fmi{version}.c"), places)
        }
        content = {f"sources/{k}": v.encode() for k, v in files.items()}
        description = fill(template(f"fmu/fmi{version}.xml"), places)
        content["modelDescription.xml"] = description.encode()
        if version == 3:
            build = fill(template("fmu/build.xml"), places)
            content["sources/buildDescription.xml"] = build.encode()
        content[f"binaries/{_folder(version)}/{name}{_ending()}"] = library(files)
        out[f"{name}-fmi{version}.fmu"] = _zipped(content)
    return out


def library(files: Mapping[str, str]) -> bytes:
    """A shared library of C files by name; `InputError` where none can be made."""
    compiler = shutil.which(os.environ.get("CC", "cc")) or shutil.which("gcc")
    if compiler is None:
        raise InputError("no C compiler (cc, gcc or CC) to build an FMU; try --to c")
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for file, text in files.items():
            (place / file).write_text(text, encoding="ascii")
        sources = [file for file in files if file.endswith(".c")]
        made = place / f"model{_ending()}"
        command = [compiler, *STRICT, "-shared", "-fPIC", "-o", made.name, *sources]
        done = subprocess.run(
            [*command, "-lm"], cwd=place, capture_output=True, text=True, check=False
        )
        if done.returncode:
            first = next(iter(done.stderr.splitlines()), "no message")
            raise InputError(f"{Path(compiler).name} cannot compile the model: {first}")
        return made.read_bytes()


def _folder(version: int) -> str:
    system = sys.platform if sys.platform in SHORT else "linux"
    if version == 2:
        return SHORT[system]
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    return f"{machine}-{LONG[system]}"


def _ending() -> str:
    return ENDINGS.get(sys.platform, ".so")


def _zipped(content: Mapping[str, bytes]) -> bytes:
    from io import BytesIO

    whole = BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in content.items():
            archive.writestr(zipfile.ZipInfo(path, DATED), data)
    return whole.getvalue()
