"""A project: the folder of dropped files, of the visitor's choices and of the results.

    OUT/20261128-143205-1f3a90c2/
        files/         dropped recordings, under harmless names
        base.json      a dropped model
        specimens.json sizes of each file, of a dropped table
        choices.json   options of each file, the base
        found/         the files of `softnn diagnose`
        network/       the files of the study of networks
        *.state.json   how far a run is, or how it ended

Pages show nothing but this folder, so a closed page loses nothing.
"""

from __future__ import annotations

import hashlib
import json
import re
import secrets
import time
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from softnn.contracts import InputError
from softnn.json_file import write
from softnn.readers.sizes import row_of

NAMED = re.compile(r"\d{8}-\d{6}-[0-9a-f]{8}")
MODEL = "base.json"  # a model that was dropped, to simulate with
LONGEST = 120  # characters of a file's name
EMPTY: dict[str, Any] = {
    "title": "",
    "base": "",
    "history": "fresh",
    "files": {},
    "network": {},
}


@dataclass(frozen=True)
class Project:
    """One folder of `OUT`. Nothing is kept in memory."""

    folder: Path

    @property
    def id(self) -> str:
        return self.folder.name

    @property
    def day(self) -> str:
        """When it was begun."""
        day, clock, _ = self.id.split("-")
        return f"{day[:4]}-{day[4:6]}-{day[6:]} {clock[:2]}:{clock[2:4]}"

    @property
    def files(self) -> list[Path]:
        """The dropped files, by name."""
        place = self.folder / "files"
        return sorted(f for f in place.iterdir()) if place.is_dir() else []

    @property
    def choices(self) -> dict[str, Any]:
        """What the visitor chose; "files" holds fields of `ReadOptions` by file."""
        return EMPTY | (_json(self.folder / "choices.json") or {})

    def choose(self, **changed: Any) -> None:
        write(self.folder / "choices.json", self.choices | changed)

    def options(self, file: str) -> dict[str, Any]:
        return dict(self.choices["files"].get(file, {}))

    def set_options(self, file: str, options: dict[str, Any]) -> None:
        self.choose(files=self.choices["files"] | {file: options})

    @property
    def title(self) -> str:
        """What the visitor called it, else its first file."""
        files = self.files
        if self.choices["title"]:
            return str(self.choices["title"])
        if not files:
            return "empty"
        more = f" and {len(files) - 1} more" if len(files) > 1 else ""
        return f"{files[0].name}{more}"

    @property
    def digest(self) -> str:
        """Return the SHA-256 (hex) of the list of files, and of all choices for them.

        A file is never written twice, so its date stands for its content.
        """
        beside = ("title", "network")  # what no diagnosis depends on
        asked = {k: v for k, v in self.choices.items() if k not in beside}
        files = [*self.files, self.folder / MODEL]
        dates = [(f.name, f.stat().st_mtime_ns) for f in files if f.is_file()]
        return hashlib.sha256(json.dumps([dates, asked]).encode()).hexdigest()

    def place_of(self, name: str) -> Path:
        """Where a file dropped as `name` goes: into `files`, under a free name."""
        place = self.folder / "files"
        place.mkdir(exist_ok=True)
        taken = {f.name.casefold() for f in self.files}
        wanted = safe(name)
        stem, dot, ends = wanted.partition(".")
        number = 1
        while wanted.casefold() in taken:
            number += 1
            wanted = f"{stem}-{number}{dot}{ends}"
        return place / wanted

    @property
    def sizes(self) -> dict[str, Any]:
        """The dropped table of sizes: a row by file."""
        return _json(self.folder / "specimens.json") or {}

    def keep_sizes(self, table: dict[str, Any]) -> None:
        """Keep a table of sizes, and give each file that it names its own."""
        write(self.folder / "specimens.json", table)
        for file in self.files:
            self.sized(file.name)

    def sized(self, name: str) -> None:
        """Give a file what the table says of it; a correction after it counts more."""
        if row := row_of(self.sizes, name):
            given = self.options(name) | row
            self.set_options(name, {k: v for k, v in given.items() if v is not None})

    def remove(self, name: str) -> None:
        for file in self.files:
            if file.name == name:
                file.unlink()
        rest = {k: v for k, v in self.choices["files"].items() if k != name}
        self.choose(files=rest)

    def state(self, what: str) -> dict[str, Any]:
        """How far a run of a kind is: what `work.py` wrote last, {} before it."""
        return _json(self.folder / f"{what}.state.json") or {}

    def tell(self, what: str, **state: Any) -> None:
        write(self.folder / f"{what}.state.json", state)

    @property
    def result(self) -> dict[str, Any] | None:
        """diagnosis.json, once there is one."""
        return _json(self.folder / "found" / "diagnosis.json")

    @property
    def network(self) -> dict[str, Any] | None:
        """The result file of the study of networks, once there is one."""
        return trained(self.folder / "network")


def trained(place: Path) -> dict[str, Any] | None:
    """The result file of the study of networks in a folder, once there is one."""
    found = sorted(place.glob("joint*.json"))
    return _json(found[0]) if found else None


def new(out: Path) -> Project:
    """An empty project under a name nobody can guess."""
    name = f"{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(4)}"
    folder = out / name
    (folder / "files").mkdir(parents=True)
    return Project(folder)


def opened(out: Path, name: str) -> Project:
    """The project of a name that came from outside. Raises `InputError`."""
    if not NAMED.fullmatch(name) or not (out / name).is_dir():
        raise InputError("there is no project of that name; begin a new one")
    return Project(out / name)


def listed(out: Path) -> Iterator[Project]:
    """Projects that hold a file, the newest first."""
    named = (f for f in out.iterdir() if NAMED.fullmatch(f.name))
    for folder in sorted(named, reverse=True):
        if (found := Project(folder)).files:
            yield found


def safe(name: str) -> str:
    """A file's name without anything that could lead out of a folder.

    >>> safe("../../etc/passwd"), safe(r"C:\\\\data\\.hidden"), safe("a\\nb<c>.csv")
    ('passwd', 'hidden', 'a_b_c_.csv')
    """
    name = unicodedata.normalize("NFC", name).replace("\\", "/").rpartition("/")[2]
    name = re.sub(r"[^\w .,()+=@&'-]", "_", name).strip(" .")
    if len(name) > LONGEST:
        stem, dot, ends = name.rpartition(".")
        name = (stem or ends)[: LONGEST - 12] + (dot + ends[:10] if stem else "")
    return name or "file"


def _json(file: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None
