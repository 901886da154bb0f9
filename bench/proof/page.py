"""A page of Markdown and its figures, from the JSON files in studies/results."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.checking import moved
from softnn.study.common import made_with

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COMMANDS = {  # of the result files the page is made of
    "concealed": "archived; see git",
    "hands": "python -m studies.concealed --hands held-out",
    "ledger": "python -m studies.concealed",
    "stability": "python -m studies.stability",
    "loop": "python -m studies.loop",
    "limits": "python -m studies.limits",
    "rivals": "python -m studies.rivals",
    "recordings": "python -m studies.recordings",
    "cost": "python -m studies.cost",
}
MADE = (
    "Made by `python -m studies.proof` from `studies/results`; no number here is "
    "typed. In brackets are 95 % intervals (Wilson for shares)."
)
OTHER = "[the proof by other hands](proof-hands.md)."
DPI = 100  # small files: the figures lie in the repository

Result = Mapping[str, Any]


class Page:
    """Text and figures of the page, in their order."""

    def __init__(self, results: Path, folder: Path) -> None:
        self.results, self.folder = results, folder
        self.parts: list[str] = []

    def result(self, name: str) -> Result | None:
        file = self.results / f"{name}.json"
        return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None

    def say(self, *paragraphs: str) -> None:
        self.parts += [p.strip() for p in paragraphs if p]

    def figure(self, name: str, figure: Figure, about: str) -> None:
        place = self.folder / "figures"
        place.mkdir(parents=True, exist_ok=True)
        figure.savefig(place / f"{name}.png", dpi=DPI)
        self.say(f"![{about}](figures/{name}.png)")

    def section(
        self, title: str, name: str, write: Callable[[Page, Result], None]
    ) -> None:
        """A section from one result, or that there is none."""
        self.say(f"## {title}")
        found = self.result(name)
        if found is None:
            self.say(f"Not run: `{COMMANDS[name]}`.")
            return
        # Each trial of several says its own, and a ledger is of many commits.
        if "made" in found and not isinstance(found.get("trials"), Mapping):
            self.say(made_with(found))
        self.say(moved(self.results, name))
        write(self, found)

    def write(self, name: str = "proof.md") -> Path:
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / name
        path.write_text("\n\n".join(self.parts) + "\n", encoding="utf-8")
        return path
