"""The page of a project: recordings, simulation, diagnosis, report, downloads."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from softnn.app import work
from softnn.app.parts import (
    SANDBOX,
    Watched,
    button,
    choice,
    drop,
    entry,
    figure,
    says,
    tag,
    tick,
)
from softnn.app.project import Project
from softnn.app.runs import Runs
from softnn.contracts import InputError
from softnn.readers import ReadOptions
from softnn.report.page import BASES

SIZES = {
    "length_mm": "Length [mm]",
    "area_mm2": "Section [mm2]",
    "width_mm": "Width [mm]",
    "thickness_mm": "Thickness [mm]",
    "diameter_mm": "Diameter [mm]",
}
CLOCK = {
    "interval_s": "Seconds between samples",
    "rate_per_s": "Strain rate [1/s]",
}
ROLES = ("time", "force", "displacement", "strain", "stress", "temperature")
DECIMAL = {"": "as found", ".": "point: 1.5", ",": "comma: 1,5"}
# What is true of one specimen alone, and not copied to other files.
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
        self.list = tag("div")
        drop(project.id, self.most, "Add recordings: drop them, or choose files")
        ui.on("dropped", self.read, args=[])
        tag("h2", "2. Simulation")
        with tag("div", classes="form wide"):
            choice("Simulate with", self.bases(), project.choices["base"], self.base)
            choice(
                "Each recording begins",
                HISTORIES,
                project.choices["history"],
                lambda key: self.chosen(history=key),
            )
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
        self.watch()
        for name in files:
            if name not in self.seen and name in self.cards:
                await self.cards[name].read()

    def chosen(self, **changed: Any) -> None:
        self.project.choose(**changed)
        self.watch()

    async def for_all(self, name: str) -> None:
        """What was set for one file becomes so for all of them."""
        given = self.project.options(name)
        for other in self.project.files:
            theirs = self.project.options(other.name)
            own = {k: v for k, v in theirs.items() if k in OWN}
            shared = {k: v for k, v in given.items() if k not in OWN}
            if other.name != name:
                self.project.set_options(other.name, shared | own)
        for other_name, card in self.cards.items():
            if other_name != name:
                card.form()
                await card.read()

    # -- simulation --------------------------------------------------------------------

    def bases(self) -> dict[str, str]:
        usual = "as usual: simulated_MPa of the files, else PL-Wiechert"
        return {"": usual} | BASES

    def base(self, key: str) -> None:
        self.chosen(base=key)

    # -- diagnosis ---------------------------------------------------------------------

    def watch(self) -> None:
        """Bring what is shown of the run and of its report up to date."""
        names = [f.name for f in self.project.files]
        read = [self.seen.get(n) for n in names]
        wrong = sum(bool(r and (r["error"] or r["doubt"])) for r in read)
        lacking = ""
        if not names:
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
        # Reading every file twice a second would be too much: their dates will do.
        dates = [(f.name, f.stat().st_mtime_ns) for f in self.project.files]
        now = made_of, dates, str(self.project.choices)
        if self.shown == now:
            return
        self.shown = now
        self.report.clear()
        if result is None:
            return
        with self.report:
            tag("h2", "4. Report")
            if made_of != self.project.digest:
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
            tag("h2", "5. Take it with you")
            self.told = tag("p", "", "say", role="alert")
            says(self.told, "")
            with tag("div", classes="row"):
                for file, text in (
                    ("report.html", "Report"),
                    ("model.json", "Model"),
                    ("diagnosis.json", "All figures"),
                ):
                    button(text, partial(self.file, file))
                for form, text in MADE.items():
                    button(text, partial(self.export, form))

    def file(self, name: str) -> None:
        place = self.project.folder / "found" / name
        ui.download.file(place, f"{self.stem}-{name}")

    async def export(self, form: str) -> None:
        model = self.project.folder / "found" / "model.json"
        try:
            name, content = await self.runs.ask(work.exported, model, form, self.stem)
        except InputError as error:
            says(self.told, f"{MADE[form]}: {error}")
            return
        says(self.told, "")
        ui.download.content(content, name)

    @property
    def stem(self) -> str:
        return Path(self.project.title).stem.replace(" ", "_") or "model"


class Card:
    """One file: what was understood of it, and where that is corrected."""

    def __init__(self, sheet: Sheet, file: Path) -> None:
        self.sheet, self.name, self.file_ = sheet, file.name, file
        self.place = tag("article", classes="file", aria_label=file.name)
        with self.place:
            with tag("div", classes="head"):
                tag("h3", file.name)
                self.state = tag("span", "reading", "state", role="status")
                button(
                    "Remove",
                    self.remove,
                    "plain",
                    aria_label=f"Remove {file.name}",
                )
            self.facts = tag("div")
            self.details = tag("details")
            with self.details:
                tag("summary", "Correct")
                self.inside = tag("div")

    @property
    def options(self) -> dict[str, Any]:
        return self.sheet.project.options(self.name)

    async def remove(self) -> None:
        self.sheet.project.remove(self.name)
        await self.sheet.read()

    async def read(self) -> None:
        """Read the file as chosen, and show what came of it."""
        given = self.options
        as_is = bool(given.pop("as_is", False))
        first = self.name not in self.sheet.seen
        try:
            told = await self.sheet.runs.ask(work.understand, self.file_, given, as_is)
        except InputError as error:
            told = {"columns": [], "recordings": [], "notes": [], "doubt": ""}
            told["error"] = str(error)
        if self.name not in self.sheet.cards:
            return  # taken away in the meantime
        self.sheet.seen[self.name] = told
        self.tell(told)
        if first:
            self.form()
            if told["error"] or told["doubt"]:
                self.details._props["open"] = True
                self.details.update()
        self.sheet.watch()

    def tell(self, told: dict[str, Any]) -> None:
        wrong = told["error"] or told["doubt"]
        self.state.classes(remove="good bad", add="bad" if wrong else "good")
        word = "not read" if told["error"] else "in doubt" if wrong else "understood"
        says(self.state, word)
        self.facts.clear()
        with self.facts:
            if wrong:
                tag("p", wrong, "say")
            for r in told["recordings"]:
                self.recording(r, len(told["recordings"]) > 1)
            notes = list(told["notes"])
            notes += [n for r in told["recordings"] for n in r["notes"]]
            if notes:
                with tag("ul", classes="notes"):
                    for note in dict.fromkeys(notes):
                        tag("li", note)

    def recording(self, r: dict[str, Any], several: bool) -> None:
        across, up = r["axes"]
        ranges = "; ".join(
            f"{axis.partition(' [')[0]} {low:.3g} to {high:.3g} {unit}".strip()
            for axis, unit, (low, high) in r["ranges"]
        )
        with tag("div", classes="seen"):
            figure(
                r["curve"],
                work.WIDTH,
                work.HEIGHT,
                ranges,
                f"Curve of {up} over {across}",
            )
            columns = [f"{k} from {v}" for k, v in r["columns"].items()]
            sizes = ", ".join(
                f"{SIZES.get(k, k).partition(' [')[0].lower()} {v:.6g} {_unit(k)}"
                for k, v in r["geometry"].items()
            )
            facts = {
                "Recording": r["name"] if several else "",
                "Specimen": r["specimen"],
                "Seen": f"{r['samples']} samples, {r['understood']}",
                "Columns": columns,
                "Sign": r["sign"],
                "Geometry": sizes or "not given",
                "File kind": r["dialect"],
            }
            with tag("dl", classes="facts"):
                for key, value in facts.items():
                    if not value:
                        continue
                    tag("dt", key)
                    for line in [value] if isinstance(value, str) else value:
                        tag("dd", line)

    # -- corrections -------------------------------------------------------------------

    def form(self) -> None:
        """What can be corrected, as it is set now."""
        told = self.sheet.seen.get(self.name, {})
        now = self.options
        self.inside.clear()
        with self.inside:
            with tag("fieldset"):
                tag("legend", "Specimen")
                with tag("div", classes="form"):
                    for key, label in SIZES.items():
                        entry(label, now.get(key), partial(self.number, key))
                    entry(
                        "Specimen's name",
                        now.get("specimen"),
                        partial(self.set, "specimen"),
                        number=False,
                    )
            with tag("fieldset"):
                tag("legend", "Columns")
                names = {"": "as found"} | {c: c for c in told.get("columns", [])}
                with tag("div", classes="form"):
                    for role in ROLES:
                        choice(
                            role.capitalize(),
                            names,
                            now.get(role, ""),
                            partial(self.set, role),
                        )
            with tag("fieldset"):
                tag("legend", "Units of these columns")
                units = now.get("units", {})
                with tag("div", classes="form"):
                    for role in ROLES:
                        known = {"": "as the file says"}
                        known |= {u: u for u in work.UNITS[role]}
                        choice(
                            f"Unit of {role}",
                            known,
                            units.get(role, ""),
                            partial(self.unit, role),
                        )
            with tag("fieldset"):
                tag("legend", "How it was written")
                with tag("div", classes="form"):
                    choice(
                        "Decimal mark",
                        DECIMAL,
                        now.get("decimal", ""),
                        partial(self.set, "decimal"),
                    )
                    for key, label in CLOCK.items():
                        entry(label, now.get(key), partial(self.number, key))
                for key, label in (
                    ("compression", "The file counts compression as positive"),
                    ("skip_bad_cells", "Cells that are no numbers are missing values"),
                    ("as_is", "The numbers are right, however odd they look"),
                ):
                    tick(label, bool(now.get(key)), partial(self.set, key))
            with tag("div", classes="row"):
                button("Use these for all files", self.for_all)
                button("Undo all corrections", self.undo)

    async def number(self, key: str, text: str) -> None:
        """A number typed, with a point or a comma. Raises `InputError`."""
        try:
            value = float(text.replace(",", ".")) if text else None
            if value is not None:
                replace(ReadOptions(), **{key: value})
        except InputError:
            raise InputError("a number above 0") from None
        except ValueError:
            raise InputError(f"{text!r} is no number") from None
        await self.set(key, value)

    async def unit(self, role: str, unit: str) -> None:
        units = dict(self.options.get("units", {}))
        units.pop(role, None)
        await self.set("units", units | ({role: unit} if unit else {}))

    async def set(self, key: str, value: Any) -> None:
        now = {k: v for k, v in self.options.items() if k != key}
        if value not in (None, "", False, {}):
            now[key] = value
        self.sheet.project.set_options(self.name, now)
        await self.read()

    async def for_all(self) -> None:
        await self.sheet.for_all(self.name)

    async def undo(self) -> None:
        self.sheet.project.set_options(self.name, {})
        self.form()
        await self.read()


def _unit(key: str) -> str:
    return key.rpartition("_")[2]
