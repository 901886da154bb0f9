"""Public recordings, fetched from where their authors keep them, checked and read.

`manifest.toml` has address, commit, licence, hashes and what the files do not say. A
fetched set is a folder with `original/` as published, `tidy/` as softnn reads it and
`index.csv`, under `SOFTNN_DATA` or the cache folder, where studies find it by name.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from softnn.contracts import InputError, nearest
from softnn.database import Lock
from softnn.readers import read
from softnn.readers.tidy import data_folder, write_index, write_table

MANIFEST = Path(__file__).with_name("manifest.toml")
MIRROR = "https://raw.githubusercontent.com"
SOURCE = "source.json"  # in the folder of a set: its origin, and every file's hash
TIMEOUT_S = 30.0

__all__ = ["Published", "PublishedSet", "fetch", "published", "published_set", "verify"]


@dataclass(frozen=True)
class Published:
    """One file as its authors published it, and the options its reader needs."""

    path: str  # in the repository
    sha256: str
    reader: str  # the dialect it is read as
    options: dict[str, Any]
    test: str

    @property
    def name(self) -> str:
        return Path(self.path).name


@dataclass(frozen=True)
class PublishedSet:
    """A set of public recordings; without `files` it can only be fetched by hand."""

    name: str
    material: str
    about: str
    repository: str
    commit: str
    licence: str
    reference: str = ""
    notes: str = ""
    files: tuple[Published, ...] = ()

    @property
    def address(self) -> str:
        return f"https://github.com/{self.repository}/tree/{self.commit}"

    @property
    def folder(self) -> Path:
        return data_folder() / self.name


def published() -> dict[str, PublishedSet]:
    """The sets of the manifest, by name."""
    entries = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))
    return {
        name: PublishedSet(
            name,
            **{k: v for k, v in entry.items() if k != "files"},
            files=tuple(Published(**f) for f in entry.get("files", [])),
        )
        for name, entry in entries.items()
    }


def published_set(name: str) -> PublishedSet:
    """The set called `name`. Raises `InputError`."""
    sets = published()
    if name not in sets:
        raise InputError(
            f"no set {name!r}{nearest(name, sets)}; allowed: {', '.join(sets)}"
        )
    return sets[name]


def fetch(name: str, mirror: str = MIRROR) -> Path:
    """Fetch a set, check its hashes, read its files; the folder it is in.

    Whole or not there: it is put together aside and renamed. A set that is there and
    whole is left alone. Raises `InputError`: no hash known, no answer, another hash,
    or a folder of that name that is not this set.
    """
    chosen = published_set(name)
    if not chosen.files:
        raise InputError(
            f"{name} cannot be fetched, no hashes are known; get it by hand from "
            f"{chosen.address}"
        )
    folder = chosen.folder
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        lock = Lock(folder.with_name(f".{name}.lock"), f"a fetch of {name}")
    except OSError as error:
        raise _unwritable(error, folder.parent) from None
    try:
        if folder.exists():
            _check_there(name, folder)
            return folder
        for left in folder.parent.glob(f".{name}.fetching-*"):
            shutil.rmtree(left, ignore_errors=True)
        with tempfile.TemporaryDirectory(
            prefix=f".{name}.fetching-", dir=folder.parent, ignore_cleanup_errors=True
        ) as aside:
            made = Path(aside) / name
            _put_together(chosen, made, mirror)
            made.rename(folder)
    except OSError as error:
        raise _unwritable(error, folder) from None
    finally:
        lock.release()
    return folder


def verify(name: str) -> list[str]:
    """Return the faults of a fetched set, a line each; nothing if it is complete."""
    chosen = published_set(name)
    try:
        told = json.loads((chosen.folder / SOURCE).read_text(encoding="utf-8"))
        hashes = {str(k): str(v) for k, v in told["sha256"].items()}
    except OSError:
        return [f"{name}: not fetched into {chosen.folder}"]
    except (ValueError, TypeError, KeyError, AttributeError):
        return [f"{name}: {SOURCE} is damaged"]
    # The manifest has the say on the originals, whatever the folder tells of itself.
    hashes |= {f"original/{f.name}": f.sha256 for f in chosen.files}
    wrong = []
    for file, expected in hashes.items():
        path = chosen.folder / file
        if not path.resolve().is_relative_to(chosen.folder.resolve()):
            wrong.append(f"{name}: {file!r} lies outside the folder")
        elif not path.is_file():
            wrong.append(f"{name}: {file} is missing")
        elif _sha256(path) != expected:
            wrong.append(f"{name}: {file} is not as it was fetched")
    return wrong


def _check_there(name: str, folder: Path) -> None:
    wrong = verify(name)
    if wrong:
        raise InputError(
            f"is there already, and is not the set as fetched ({wrong[0]}); move it "
            "away, or set SOFTNN_DATA to another folder",
            file=folder,
        )


def _put_together(chosen: PublishedSet, folder: Path, mirror: str) -> None:
    (folder / "tidy").mkdir(parents=True)
    made = {}
    for file in chosen.files:
        url = f"{mirror}/{chosen.repository}/{chosen.commit}/{quote(file.path)}"
        original = _download(url, file.sha256, folder / "original" / file.name)
        for recording in read(original, **file.options):
            dialect = recording.log[0].arguments["dialect"]
            if dialect != file.reader:
                raise InputError(f"read as {dialect}, not as {file.reader}", file=url)
            tidy = f"tidy/{recording.name.replace(' ', '_')}.csv"
            write_table(folder / tidy, recording.columns)
            about: dict[str, Any] = {"material": chosen.material, "test": file.test}
            made[tidy] = replace(recording, **about)
    write_index(folder, made)
    told = {
        "set": chosen.name,
        "address": chosen.address,
        "licence": chosen.licence,
        "sha256": {
            str(p.relative_to(folder)): _sha256(p)
            for p in sorted(folder.rglob("*"))
            if p.is_file()
        },
    }
    (folder / SOURCE).write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")


def _download(url: str, sha256: str, to: Path) -> Path:
    import logging

    import pooch
    import requests

    pooch.get_logger().setLevel(logging.WARNING)
    web = pooch.HTTPDownloader(timeout=TIMEOUT_S)
    try:
        pooch.retrieve(url, f"sha256:{sha256}", to.name, to.parent, downloader=web)
    except requests.RequestException as error:
        status = getattr(error.response, "status_code", None)
        answer = f"answers {status}" if status else "gives no whole answer"
        raise InputError(f"{answer}; nothing was kept, try again", file=url) from None
    except ValueError:
        raise InputError(
            "is not the file of the manifest (another SHA-256); nothing was kept",
            file=url,
        ) from None
    return to


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _unwritable(error: OSError, folder: Path) -> InputError:
    return InputError(
        f"cannot be written ({error.strerror}); set SOFTNN_DATA to another folder",
        file=folder,
    )
