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
    "2,4,8": "2, 4 and 8: two minutes",
    "1:10": "1 to 10: some minutes",
    "1:20": "1 to 20, as published: several minutes",
}
FOLDS = {"3": "3", "5": "5", "10": "10, as published"}
SPLITS = {  # of what a fold leaves out
    "random": "random folds",
    "specimen": "specimens not seen in training",
    "unseen": "a {} not seen in training",
}
USES = {
    "network.json": ("For recordings like those you have:", "Network"),
    "unseen.json": ("For strain rates or recordings never seen:", "Network for unseen"),
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
        made = result and (result["made"], result["materials"][0]["study_key"])
        if self.shown != made:
            self.shown = made
            self.place.clear()
            with self.place:
                if result:
                    tag("h2", "What it reaches")
                    tag(
                        "img",
                        src=f"/project/{self.project.id}/network.png?{result['made']}",
                        alt="Error of networks by random folds, and on unseen data",
                    )
                    for one in result["materials"]:
                        self.material(one)
                    tag("h2", "Take it with you")
                    for file, (use, button) in USES.items():
                        tag("p", use)
                        path = self.project.folder / "network" / file
                        Downloads(self.runs, self.project, path, MADE, {file: button})

    def material(self, one: dict[str, Any]) -> None:
        for sentence in one["take"]:
            tag("p", sentence)
        split_names = {s: text.format(one["unseen"]) for s, text in SPLITS.items()}
        rows = [
            (row["model"], *(_mean(row.get(split)) for split in SPLITS))
            for row in one["rows"]
        ]
        tag("p", "Error (NRMSE), the mean of the folds.")
        table(("model", *split_names.values()), rows, "errors")
        tag("h2", "Fold by fold")
        head = one["headline"]
        taken = [one["rows"][0]]
        taken += [r for r in one["rows"][1:] if r["model"] == head["take_unseen"]]
        names = {"unseen": list(one["front"][0]["folds_unseen"])}
        for split, text in split_names.items():
            tag("h3", text[:1].upper() + text[1:])
            folds = [row.get(split) for row in taken]
            if not all(isinstance(f, list) for f in folds):
                tag("p", "Not possible with these recordings.", "soft")
                continue
            labels = names.get(split, range(1, len(folds[0]) + 1))
            table(
                ("left out", *(row["model"] for row in taken)),
                [
                    (label, *map(percent, errors))
                    for label, *errors in zip(labels, *folds, strict=True)
                ],
                text,
            )


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


def _mean(folds: Any) -> str:
    """The mean error of folds in percent; "-" where there is none."""
    return percent(sum(folds) / len(folds)) if isinstance(folds, list) else "-"
