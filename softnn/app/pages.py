"""The pages and their addresses: diagnose, train a network, earlier results."""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi import Request
from fastapi.responses import FileResponse, PlainTextResponse, Response
from nicegui import app, ui

from softnn.app import project as projects
from softnn.app.parts import SANDBOX, drop, page, tag
from softnn.app.project import Project
from softnn.app.runs import Runs
from softnn.app.sheet import Sheet
from softnn.contracts import InputError

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


def register(out: Path, runs: Runs, limits: Limits) -> None:
    """Give every page and file its address."""

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
            drop("", limits.bytes_, "Drop recordings here, or choose files", False)

    @ui.page("/project/{name}")
    def sheet(name: str) -> None:
        with guarded("Diagnose"):
            project = projects.opened(out, name)
            with page(project.title, "Diagnose"):
                Sheet(project, runs, limits.bytes_).build()

    @app.post("/project")
    def begin() -> Response:
        return PlainTextResponse(projects.new(out).id)

    @app.post("/project/{name}/files")
    async def take(name: str, request: Request) -> Response:
        try:
            project = projects.opened(out, name)
            given = request.query_params.get("name", "")
            await received(project, given, request.stream(), limits)
        except InputError as error:
            return PlainTextResponse(str(error), 400)
        return PlainTextResponse("taken")

    @app.get("/project/{name}/report.html")
    def report(name: str) -> Response:
        try:
            found = projects.opened(out, name).folder / "found" / "report.html"
        except InputError as error:
            return PlainTextResponse(str(error), 404)
        if not found.is_file():
            return PlainTextResponse("There is no report yet.", 404)
        # Whatever the report shows, it can reach nothing of these pages.
        policy = {"Content-Security-Policy": f"sandbox {SANDBOX}"}
        return FileResponse(found, media_type="text/html", headers=policy)


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
    """Write what is sent into the project, no more than allowed; its file."""
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
