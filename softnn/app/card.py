"""One file on the page: its curve and columns as understood, and their correction."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softnn.app import work
from softnn.app.parts import button, choice, entry, figure, says, tag, tick
from softnn.contracts import InputError
from softnn.readers import ReadOptions

if TYPE_CHECKING:
    from softnn.app.sheet import Sheet

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
TICKS = {
    "compression": "The file counts compression as positive",
    "zero": "Strain counts from where the file starts",
    "zero_stress": "Force and stress count from where the file starts",
    "skip_bad_cells": "Cells that are no numbers are missing values",
    "as_is": "The numbers are right, however odd they look",
}
ROLES = ("time", "force", "displacement", "strain", "stress", "temperature")
DECIMAL = {"": "as found", ".": "point: 1.5", ",": "comma: 1,5"}

# Messages speak to those who type; here the same things have names on the page.
FLIP = {"": "neither", "strain": "strain", "stress": "stress"}
SPOKEN = {
    r"--unit '?(?:[^':=\s]+:)?([^'=]+)=([^\s'),;]*[^\s'),;.])'?": (
        r"the unit of \1 (\2)"
    ),
    r"--(length|width|thickness|diameter)( MM)?": r"\1",
    r"--area( MM2)?": "section",
    r"--interval( SECONDS)?": "the seconds between samples",
    r"--rate( STRAIN)?": "the strain rate",
    r"--(time|force|displacement|strain|stress|temperature)": r"the column of \1",
    r"--decimal( \S+)?": "the decimal mark",
    r"--compression": "the tick for compression",
    r"--skip-bad-cells": "the tick for missing values",
    r"--zero-stress": "the tick for force and stress",
    r"--zero": "the tick for strain",
    r"--flip \S*strain or --flip \S*stress": "around by 'Turn the sign of' below",
    r"--as-is": "so by the last tick below",
}


def worded(message: str) -> str:
    """A message of a command, in the words of the page.

    >>> worded("no length of the specimen in it; give --length MM")
    'no length of the specimen in it; give length'
    >>> worded("is strain in per cent? Divide it by 100 (--unit fast.csv:strain=%)")
    'is strain in per cent? Divide it by 100 (the unit of strain (%))'
    >>> worded("take it off with --zero-stress")
    'take it off with the tick for force and stress'
    """
    for option, words in SPOKEN.items():
        message = re.sub(rf"{option}(?![\w-])", words, message)
    return message


async def number(
    key: str, text: str, then: Callable[[str, Any], Awaitable[None]]
) -> None:
    """A number typed, with a point or a comma. Raises `InputError`."""
    value = None
    if text:
        try:
            value = float(text.replace(",", "."))
        except ValueError:
            raise InputError(f"{text!r} is no number") from None
        options: dict[str, Any] = {key: value}
        try:
            replace(ReadOptions(), **options)
        except InputError:
            raise InputError("a number above 0") from None
    await then(key, value)


class Card:
    """One file: its facts as read, and a form that corrects them."""

    def __init__(self, sheet: Sheet, file: Path) -> None:
        self.sheet, self.name, self.file_ = sheet, file.name, file
        self.read_with: dict[str, Any] = {}
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

    @property
    def changed(self) -> bool:
        """Whether other options are wanted than those it was read with."""
        return self.read_with != self.options

    async def remove(self) -> None:
        self.sheet.project.remove(self.name)
        await self.sheet.read()

    async def read(self) -> None:
        """Read the file as chosen, and show what came of it."""
        given = self.read_with = self.options
        as_is = bool(given.get("as_is", False))
        given = {k: v for k, v in given.items() if k != "as_is"}
        first = self.name not in self.sheet.seen
        try:
            told = await self.sheet.runs.ask(work.understand, self.file_, given, as_is)
        except InputError as error:
            told = {"columns": [], "recordings": [], "notes": [], "doubt": ""}
            told |= {"error": str(error), "no_test": ""}
        if self.name not in self.sheet.cards or self.place.is_deleted:
            return  # removed, or the page was closed, in the meantime
        self.sheet.seen[self.name] = told
        self.tell(told)
        if first:
            self.form()
            alone = len(self.sheet.project.files) == 1
            if alone and (told["error"] or told["doubt"]):
                self.details._props["open"] = True
                self.details.update()
        self.sheet.watch()

    def tell(self, told: dict[str, Any]) -> None:
        wrong = told["error"] or told["doubt"]
        kind = "bad" if wrong else "soft" if told["no_test"] else "good"
        self.state.classes(remove="good bad soft", add=kind)
        word = "not read" if told["error"] else "in doubt" if wrong else "understood"
        says(self.state, "no test: passed over" if told["no_test"] else word)
        self.facts.clear()
        with self.facts:
            if wrong:
                tag("p", worded(wrong), "say")
            if told["no_test"]:
                tag("p", worded(told["no_test"]), "soft small")
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
                "Simulation": "its column simulated_MPa" if r["simulated"] else "",
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
                tag("legend", "Columns and their units")
                columns = {c: c for c in told.get("columns", [])}
                used = (
                    told["recordings"][0]["columns"] if told.get("recordings") else {}
                )
                units = now.get("units", {})
                with tag("div", classes="form pairs"):
                    for role in ROLES:
                        known = {"": "as found"}
                        known |= {u: u for u in work.UNITS[role]}
                        with tag("div", classes="pair"):
                            word = role.capitalize()
                            one = now.get(role, "")
                            found = f"{used[role]}, as found" if role in used else ""
                            names = {"": found or "none"} if used else {"": "as found"}
                            names |= columns
                            choice(word, names, one, partial(self.set, role))
                            of = units.get(role, "")
                            choice(f"{word} in", known, of, partial(self.unit, role))
            with tag("fieldset"):
                tag("legend", "How it was written")
                with tag("div", classes="form"):
                    mark = now.get("decimal", "")
                    choice("Decimal mark", DECIMAL, mark, partial(self.set, "decimal"))
                    turned = now.get("flip", "")
                    choice("Turn the sign of", FLIP, turned, partial(self.set, "flip"))
                    for key, label in CLOCK.items():
                        entry(label, now.get(key), partial(self.number, key))
                for key, label in TICKS.items():
                    tick(label, bool(now.get(key)), partial(self.set, key))
            with tag("div", classes="row"):
                if len(self.sheet.project.files) > 1:
                    button("Use these for all files", self.for_all)
                button("Undo all corrections", self.undo)

    async def number(self, key: str, text: str) -> None:
        await number(key, text, self.set)

    async def unit(self, role: str, unit: str) -> None:
        units = dict(self.options.get("units", {}))
        units.pop(role, None)
        await self.set("units", units | ({role: unit} if unit else {}))

    async def set(self, key: str, value: Any) -> None:
        self.put(key, value)
        await self.read()

    def put(self, key: str, value: Any) -> None:
        """Keep one option of the file; nothing, where there is no value."""
        now = {k: v for k, v in self.options.items() if k != key}
        if value not in (None, "", False, {}):
            now[key] = value
        self.sheet.project.set_options(self.name, now)

    async def for_all(self) -> None:
        await self.sheet.like(self.name)

    async def undo(self) -> None:
        self.sheet.project.set_options(self.name, {})
        self.form()
        await self.read()


def _unit(key: str) -> str:
    return key.rpartition("_")[2]
