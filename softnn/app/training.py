"""The page that trains a network on the recordings of a project."""

from __future__ import annotations

from functools import partial
from typing import Any

from nicegui import ui

from softnn.app import work
from softnn.app.parts import Downloads, Watched, choice, tag, tick
from softnn.app.project import Project
from softnn.app.runs import Runs
from softnn.report.phrases import percent

NEURONS = {
    "2,4,8": "2, 4 and 8: half a minute",
    "1:10": "1 to 10: a few minutes",
    "1:20": "1 to 20, as published",
}
FOLDS = {"3": "3", "5": "5", "10": "10, as published"}
SPLITS = {
    "random": "random folds",
    "specimen": "specimens not seen in training",
    "rate": "strain rates not seen in training",
}
MADE = {"c": "C code", "onnx": "ONNX", "fmu": "FMU"}
EVERY_S = 0.5


class Training:
    """One visitor's view of the networks of a project."""

    def __init__(self, project: Project, runs: Runs) -> None:
        self.project, self.runs = project, runs
        self.shown: Any = None

    def build(self) -> None:
        project = self.project
        asked = work.NETWORK | project.choices["network"]
        tag("h1", f"A network of {project.title}")
        tag(
            "p",
            "Small networks learn stress from strain, and are judged on what they have "
            "not seen: random samples, whole specimens, whole strain rates.",
        )
        count = len(project.files)
        with tag("p"):
            tag("span", f"{count} file{'' if count == 1 else 's'}, read as set on ")
            tag("a", "the first page", href=f"/project/{project.id}")
            tag("span", ". Strain rates that a file does not say are set there too.")
        with tag("div", classes="form wide"):
            choice("Neurons", NEURONS, asked["neurons"], partial(self.set, "neurons"))
            choice("Folds", FOLDS, asked["folds"], partial(self.set, "folds"))
        tick(
            "Learn whole cycles, not first loadings alone",
            asked["cycles"],
            partial(self.set, "cycles"),
        )
        self.run = Watched(self.runs, project, "network", "Train")
        self.place = tag("section", aria_label="Result")
        self.watch()
        ui.timer(EVERY_S, self.watch)

    def set(self, key: str, value: Any) -> None:
        self.project.choose(network=self.project.choices["network"] | {key: value})

    def watch(self) -> None:
        self.run.show("" if self.project.files else "Add a recording first.")
        result = self.project.network
        made = result and (result["made"], result["materials"][0].get("study_key"))
        if self.shown != made:
            self.shown = made
            self.place.clear()
            with self.place:
                if result:
                    tag("h2", "What it reaches")
                    tag(
                        "img",
                        src=f"/project/{self.project.id}/network.png?{result['made']}",
                        alt="Error and R2 of the folds over the number of neurons",
                    )
                    for one in result["materials"]:
                        self.material(one)
                    network = self.project.folder / "network" / "network.json"
                    Downloads(self.runs, self.project, network, MADE)

    def material(self, one: dict[str, Any]) -> None:
        head = one["headline"]
        tag(
            "p",
            f"{head['neurons']} neurons, {head['parameters']} parameters, "
            f"{head['samples']} samples.",
        )
        rows = [
            (r["judged_on"], r["model"], percent(r["nrmse"]), _r2(r["r2"]), r["size"])
            for r in one["comparison"]
        ]
        table(("judged on", "model", "error (NRMSE)", "R2", "size"), rows, "errors")
        tag("h2", "Fold by fold")
        for split, text in SPLITS.items():
            found = one["networks"].get("network", {}).get(split, {})
            tag("h3", text[:1].upper() + text[1:])
            if "nrmse" not in found:
                tag("p", found.get("not_possible", "not possible here"), "soft")
                continue
            table(
                ("left out", "error (NRMSE)", "R2"),
                [
                    (fold, percent(e), _r2(r))
                    for fold, e, r in zip(
                        found["folds"], found["nrmse"], found["r2"], strict=True
                    )
                ],
                text,
            )
        tag("p", one["note"], "soft small")


def table(names: tuple[str, ...], rows: list[tuple[Any, ...]], label: str) -> None:
    """A table that scrolls by itself where the window is narrow."""
    with tag(
        "div", classes="scroll", tabindex=0, role="group", aria_label=f"Table: {label}"
    ):
        with tag("table"):
            with tag("thead"), tag("tr"):
                for name in names:
                    tag("th", name, scope="col")
            with tag("tbody"):
                for row in rows:
                    with tag("tr"):
                        for cell in row:
                            tag("td", "-" if cell is None else str(cell))


def _r2(value: float | None) -> str | None:
    return None if value is None else f"{value:.4f}"
