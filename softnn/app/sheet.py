"""The page of a project: recordings, simulation, diagnosis, report, downloads."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

from nicegui import ui

from softnn.app.card import SIZES, Card, number
from softnn.app.parts import (
    SANDBOX,
    Downloads,
    Watched,
    choice,
    drop,
    entry,
    says,
    tag,
    tick,
)
from softnn.app.project import MODEL, Project
from softnn.app.runs import Runs
from softnn.readers.sizes import called, row_of
from softnn.report.page import BASES

# Options of one specimen alone: not copied to other files.
OWN = ("specimen",)
HISTORIES = {
    "fresh": "at rest",
    "continued": "where the one before it ended",
}
MADE = {
    "c": "C code",
    "fmu": "FMU",
    "abaqus": "Abaqus card",
    "ansys": "Ansys card",
}
EVERY_S = 0.5  # a run is looked at


class Sheet:
    """One visitor's view of a project. All that lasts is in the project's folder."""

    def __init__(self, project: Project, runs: Runs, most: int) -> None:
        self.project, self.runs, self.most = project, runs, most
        self.seen: dict[str, dict[str, Any]] = {}
        self.cards: dict[str, Card] = {}
        self.shown: Any = None  # of the report: what it was made of

    def build(self) -> None:
        project = self.project
        self.title = tag("h1", project.title)
        tag("h2", "1. Recordings")
        self.common = tag("fieldset", classes="file")
        self.list = tag("div")
        drop(project.id, self.most, "Add recordings: drop them, or choose files")
        ui.on("dropped", self.read, args=[])
        tag("h2", "2. Simulation")
        self.base = tag("div", classes="form wide")
        tag("p", "A model.json of softnn, dropped above, simulates too.", "soft small")
        self.simulation()
        tag("h2", "3. Diagnosis")
        self.run = Watched(self.runs, project, "diagnose", "Diagnose")
        self.report = tag("section", aria_label="Report")
        self.watch()
        ui.timer(EVERY_S, self.watch)
        ui.timer(0.01, self.read, once=True)

    # -- recordings --------------------------------------------------------------------

    async def read(self) -> None:
        """Show the files that are there now; read those not yet seen."""
        files = {f.name: f for f in self.project.files}
        for name in set(self.cards) - set(files):
            self.cards.pop(name).place.delete()
            self.seen.pop(name, None)
        for name in files:
            if name not in self.cards:
                with self.list:
                    self.cards[name] = Card(self, files[name])
        says(self.title, self.project.title)
        self.sizes()
        self.simulation()
        self.watch()
        # A table of sizes, dropped now, changes those seen before.
        new = [n for n in files if n not in self.seen]
        other = [n for n in files if n in self.seen and self.cards[n].changed]
        for name in other:
            self.cards[name].form()
        await self.again([*new, *other])

    def chosen(self, **changed: Any) -> None:
        self.project.choose(**changed)
        self.watch()

    async def like(self, name: str) -> None:
        """All files get the options of one."""
        given = self.project.options(name)
        for other, card in self.cards.items():
            if other != name:
                theirs = self.project.options(other)
                own = {k: v for k, v in theirs.items() if k in OWN}
                shared = {k: v for k, v in given.items() if k not in OWN}
                self.project.set_options(other, shared | own)
                card.form()
        await self.again([n for n in self.cards if n != name])

    async def size(self, key: str, text: str) -> None:
        """A size typed once, for all files."""
        await number(key, text, self.for_all)

    async def for_all(self, key: str, value: Any) -> None:
        for card in self.cards.values():
            card.put(key, value)
            card.form()
        await self.again(list(self.cards))

    async def again(self, names: list[str]) -> None:
        await asyncio.gather(*(self.cards[n].read() for n in names if n in self.cards))

    def sizes(self) -> None:
        """Sizes of all files at once, where there are several."""
        files = [f.name for f in self.project.files]
        self.common.clear()
        self.common.set_visibility(len(files) > 1)
        if len(files) < 2:
            return
        with self.common:
            tag("legend", "Specimens of all files")
            with tag("div", classes="form"):
                for key, label in SIZES.items():
                    given = {self.project.options(f).get(key) for f in files}
                    one = given.pop() if len(given) == 1 else None
                    entry(label, one, partial(self.size, key))
            tick(
                "The files count compression as positive",
                all(self.project.options(f).get("compression") for f in files),
                partial(self.for_all, "compression"),
            )
            self.table(files)

    def table(self, files: list[str]) -> None:
        """What a table of sizes that was dropped is of."""
        rows = self.project.sizes
        if not rows:
            tag("p", "A table specimens.csv, dropped too, gives each its own.", "soft")
            return
        of = [f for f in files if row_of(rows, f)]
        names = {n for f in files for n in called(f)}
        lost = [name for name in rows if name not in names]
        text = f"specimens.csv gives the sizes of {len(of)} of {len(files)} files."
        if lost:
            text += f" It names {', '.join(lost[:3])}, not dropped here"
            text += f", and {len(lost) - 3} more." if len(lost) > 3 else "."
        tag("p", text, "say" if lost else "soft", role="status")

    # -- simulation --------------------------------------------------------------------

    def bases(self) -> dict[str, str]:
        usual = "the simulation in the files, else PL-Wiechert"
        own = "the model.json that was dropped"
        dropped = (self.project.folder / MODEL).is_file()
        return {"": usual} | ({MODEL: own} if dropped else {}) | BASES

    def simulation(self) -> None:
        """What simulates; a model.json that was dropped is on offer too."""
        self.base.clear()
        with self.base:
            choice(
                "Simulate with",
                self.bases(),
                self.project.choices["base"],
                lambda key: self.chosen(base=key),
            )
            choice(
                "Each recording begins",
                HISTORIES,
                self.project.choices["history"],
                lambda key: self.chosen(history=key),
            )

    # -- diagnosis ---------------------------------------------------------------------

    def watch(self) -> None:
        """Show the state of the run and the newest report."""
        names = [f.name for f in self.project.files]
        read = [self.seen.get(n) for n in names]
        wrong = sum(bool(r and (r["error"] or r["doubt"])) for r in read)
        lacking = ""
        if not any(not r or r["recordings"] for r in read) and not wrong:
            lacking = "Add a recording first."
        elif wrong:
            needs = "1 file needs" if wrong == 1 else f"{wrong} files need"
            lacking = f"{needs} a correction above, or to be removed."
        elif not all(read):
            lacking = "Reading the files."
        self.run.show(lacking)
        self.reported()

    def reported(self) -> None:
        """The report of the last run that ended well, and whether it still holds."""
        result = self.project.result
        asked = self.project.folder / "found" / "asked"
        made_of = asked.read_text() if result and asked.is_file() else ""
        now = made_of, self.project.digest
        if self.shown == now:
            return
        self.shown = now
        self.report.clear()
        if result is None:
            return
        with self.report:
            tag("h2", "4. Report")
            if made_of != now[1]:
                tag(
                    "p",
                    "The files or the choices above have changed since this report. "
                    "Diagnose again to bring it up to date.",
                    "say",
                    role="status",
                )
            address = f"/project/{self.project.id}/report.html"
            with tag("div", classes="row"):
                text = "Open the report in a tab"
                tag("a", text, "act", href=address, target="_blank")
            tag(
                "iframe",
                "",
                "report",
                src=f"{address}?{made_of[:8]}",
                title="Report of the diagnosis",
                sandbox=SANDBOX,
            )
            model = self.project.folder / "found" / "model.json"
            tag("h2", "Take it with you")
            Downloads(self.runs, self.project, model, MADE)
