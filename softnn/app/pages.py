"""The pages and their addresses: diagnose, train a network, earlier results."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi import Request
from fastapi.responses import FileResponse, PlainTextResponse, Response
from nicegui import app, ui

from softnn.app import project as projects
from softnn.app import work
from softnn.app.parts import SANDBOX, able, button, drop, page, says, tag
from softnn.app.project import MODEL, Project
from softnn.app.runs import Runs
from softnn.app.sheet import Sheet
from softnn.app.training import Training
from softnn.contracts import InputError
from softnn.readers.sizes import NAMES

ICON = (
    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 32 32'>"
    "<path d='M3 28C14 27 20 20 29 4' fill='none' stroke='#17657f' stroke-width='4'/>"
    "</svg>"
)


@dataclass(frozen=True)
class Limits:
    """The largest file [bytes], and the most files of a project."""

    bytes_: int
    files: int


def register(out: Path, runs: Runs, limits: Limits, local: bool) -> None:
    """Give every page and file its address; `local`: only this machine is served."""

    @ui.page("/")
    def start() -> None:
        with page("", "Diagnose"):
            tag("h1", "What does your simulation leave out?")
            tag(
                "p",
                "Drop the recordings of one material: softnn shows what it understood "
                "of them, simulates them, and says which physics the simulation lacks. "
                "The files stay on the machine that runs softnn app.",
            )
            drop("", limits.bytes_, "Drop recordings here, or choose files")
            with tag("p", classes="small"):
                tag("span", "No recordings at hand? ", "soft")
                button("Look at an example", example, "plain")

    async def example() -> None:
        project = projects.new(out)
        await runs.ask(work.example, project.folder)
        ui.navigate.to(f"/project/{project.id}")

    @ui.page("/project/{name}")
    def sheet(name: str) -> None:
        with guarded("Diagnose"):
            project = projects.opened(out, name)
            with page(project.title, "Diagnose", name):
                Sheet(project, runs, limits.bytes_).build()

    @ui.page("/network")
    def any_network() -> None:
        with page("Train a network", "Train a network"):
            tag("h1", "Train a network on recordings")
            tag(
                "p",
                "Drop recordings of one material, or open an earlier project below.",
            )
            then = "/network"
            drop("", limits.bytes_, "Drop recordings here, or choose files", then)
            earlier(out, runs, then)

    @ui.page("/project/{name}/network")
    def network(name: str) -> None:
        with guarded("Train a network"):
            project = projects.opened(out, name)
            with page(f"Network of {project.title}", "Train a network", name):
                Training(project, runs).build()

    @ui.page("/results")
    def results() -> None:
        with page("Earlier results", "Earlier results"):
            tag("h1", "Earlier results")
            earlier(out, runs)
            tag("h2", "MLflow")
            tag(
                "p",
                "MLflow lists the same diagnoses and every network that was trained, "
                "side by side, with their errors and files.",
            )
            if local:
                Mlflow(out, runs).build()
            else:
                tag("p", "Its pages are for the machine itself, where they are opened.")

    @app.post("/project")
    def begin() -> Response:
        return PlainTextResponse(projects.new(out).id)

    @app.post("/project/{name}/files")
    async def take(name: str, request: Request) -> Response:
        try:
            project = projects.opened(out, name)
            given = request.query_params.get("name", "")
            place = await received(project, given, request.stream(), limits)
            if place.suffix.lower() == ".json":
                await simulating(project, place, runs)
            elif given.casefold() in NAMES:
                await sizing(project, place, runs)
            else:
                project.sized(place.name)
        except InputError as error:
            return PlainTextResponse(str(error), 400)
        return PlainTextResponse("taken")

    def shown(name: str, pattern: str, kind: str) -> Response:
        try:
            files = sorted(projects.opened(out, name).folder.glob(pattern))
        except InputError as error:
            return PlainTextResponse(str(error), 404)
        if not files:
            return PlainTextResponse("It is not there yet.", 404)
        # Whatever it shows, it can reach nothing of these pages.
        policy = {"Content-Security-Policy": f"sandbox {SANDBOX}"}
        return FileResponse(files[0], media_type=kind, headers=policy)

    @app.get("/project/{name}/report.html")
    def report(name: str) -> Response:
        return shown(name, "found/report.html", "text/html")

    @app.get("/project/{name}/network.png")
    def drawn(name: str) -> Response:
        return shown(name, "network/*.png", "image/png")


async def simulating(project: Project, file: Path, runs: Runs) -> None:
    """Let a model.json simulate, unless it is none. Raises `InputError`."""
    place = file.rename(project.folder / MODEL)
    try:
        await runs.ask(work.check_model, place)
    except InputError as error:
        place.unlink()
        if project.choices["base"] == MODEL:
            project.choose(base="")
        raise InputError(f"no model: {error}") from None
    project.choose(base=MODEL)


async def sizing(project: Project, file: Path, runs: Runs) -> None:
    """Take a table of sizes, as `softnn diagnose` does of a folder."""
    try:
        project.keep_sizes(await runs.ask(work.sizes_of, file))
    finally:
        file.unlink()


def earlier(out: Path, runs: Runs, then: str = "") -> None:
    """The projects that are there, each with what came of it."""
    rows = list(projects.listed(out))
    if not rows:
        tag("p", "There are none yet.", "soft")
        return
    with tag("ul", classes="earlier"):
        for project in rows:
            with tag("li"):
                tag("a", project.title, href=f"/project/{project.id}{then}")
                tag("span", project.day, "soft small")
                for text in told_of(project, runs):
                    tag("p", text, "small")


def told_of(project: Project, runs: Runs) -> list[str]:
    """What there is of a project, in a sentence each."""
    out = []
    for what, word in (("diagnose", "diagnosis"), ("network", "training")):
        if runs.running(project, what):
            out.append(f"The {word} is running.")
    if result := project.result:
        out.append(result["summary"])
    if found := project.network:
        out += found["materials"][0]["take"]
    return out or ["Not diagnosed yet."]


class Mlflow:
    """Starts MLflow's own server when asked, and says where it is."""

    def __init__(self, out: Path, runs: Runs) -> None:
        self.out, self.runs = out, runs

    def build(self) -> None:
        with tag("div", classes="row"):
            self.go = button("Start MLflow", self.start)
            self.line = tag("span", role="status")
            self.link = tag("a", "Open MLflow", "act", target="_blank")
        self.link.set_visibility(False)
        if not (self.out / "mlflow.db").is_file():
            able(self.go, False)
            says(self.line, "There is nothing in it yet.")

    async def start(self) -> None:
        able(self.go, False)
        says(self.line, "starting")
        port = self.runs.mlflow(self.out)
        for _ in range(120):
            try:
                _, writer = await asyncio.open_connection("127.0.0.1", port)
            except OSError:
                await asyncio.sleep(0.5)
                continue
            writer.close()
            self.link._props["href"] = f"http://127.0.0.1:{port}/#/experiments"
            self.link.update()
            self.link.set_visibility(True)
            says(self.line, "")
            return
        says(self.line, f"It does not answer; see {self.out / 'mlflow.log'}.")
        able(self.go, True)


class guarded:
    """An `InputError` while a page is made becomes the page."""

    def __init__(self, here: str) -> None:
        self.here = here

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: Any, error: Any, _: Any) -> bool:
        if not isinstance(error, InputError):
            return False
        with page("Not found", self.here):
            tag("h1", "Not found")
            tag("p", str(error))
            tag("a", "Begin a new project", href="/")
        return True


async def received(
    project: Project, name: str, content: AsyncIterator[bytes], limits: Limits
) -> Path:
    """Write a dropped file into the project, no more than allowed; its path."""
    if len(project.files) >= limits.files:
        raise InputError(f"not taken: a project holds {limits.files} files at most")
    place = project.place_of(name)
    size = 0
    try:
        with place.open("xb") as file:
            async for chunk in content:
                size += len(chunk)
                if size > limits.bytes_:
                    raise InputError(f"over {limits.bytes_ // 10**6} MB; split it")
                file.write(chunk)
    except BaseException as error:
        place.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"cannot be kept: {error.strerror}") from None
        raise
    return place
