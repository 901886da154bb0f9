"""Elements that the pages are made of: plain HTML, which browsers make accessible.

Texts are set as text, never as HTML, so a name may hold anything.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import run, ui
from nicegui.element import Element

from softnn.app import work
from softnn.app.project import Project
from softnn.app.runs import Runs
from softnn.contracts import InputError

FILES = {  # beside a model, as they are
    "report.html": "Report",
    "model.json": "Model",
    "diagnosis.json": "All figures",
    "next_recording.csv": "Next recording",
}
HERE = Path(__file__).parent
SANDBOX = "allow-scripts allow-popups allow-downloads"


def tag(name: str, text: str = "", classes: str = "", **props: Any) -> Element:
    """An element with a text; `for_` and `aria_label` stand for `for`, `aria-label`."""
    made = Element(name)
    if text:
        made._text = text
    if classes:
        made.classes(classes)
    for key, value in props.items():
        made._props[key.strip("_").replace("_", "-")] = value
    return made


@contextmanager
def page(title: str, here: str, project: str = "") -> Iterator[None]:
    """What every page has around its content; `here` is its entry in the menu.

    Of a project the first two entries lead to its own pages.
    """
    of = f"/project/{project}" if project else ""
    ui.page_title(f"{title} - softnn" if title else "softnn")
    ui.add_css(HERE / "style.css")
    ui.add_head_html(f"<script>{(HERE / 'app.js').read_text('utf-8')}</script>")
    with tag("div", classes="page"):
        with tag("header", classes="top"):
            tag("a", "softnn", "brand", href="/", aria_label="softnn: begin anew")
            with tag("nav", aria_label="Pages"):
                for text, address in (
                    ("Diagnose", of or "/"),
                    ("Train a network", f"{of}/network"),
                    ("Earlier results", "/results"),
                ):
                    made = tag("a", text, href=address)
                    if text == here:
                        made._props["aria-current"] = "page"
        yield


def button(
    text: str, do: Callable[..., Any], classes: str = "act", **props: Any
) -> Element:
    return tag("button", text, classes, type="button", **props).on("click", do, args=[])


def able(made: Element, on: bool) -> None:
    """Let a button be pressed, or not."""
    if on:
        made._props.pop("disabled", None)
    else:
        made._props["disabled"] = True
    made.update()


def says(made: Element, text: str) -> None:
    """Change the text of an element, and let it be seen only when it has one."""
    if made._text != text:
        made._text = text
        made.update()
    made.set_visibility(bool(text))


def choice(
    label: str,
    options: Mapping[str, str],
    value: str,
    do: Callable[[str], Any],
) -> Element:
    """A list to choose one of; `do` gets a key of `options` and nothing else."""
    with tag("div", classes="field"):
        named = tag("label", label)
        with tag("select") as made:
            named._props["for"] = made.html_id
            for key, text in options.items():
                option = tag("option", text, value=key)
                if key == value:
                    option._props["selected"] = True

    def changed(event: Any) -> Any:
        return do(str(event.args)) if str(event.args) in options else None

    return made.on("change", changed, js_handler="(e) => emit(e.target.value)")


def entry(
    label: str, value: Any, do: Callable[[str], Any], number: bool = True
) -> Element:
    """A line to type into; what `do` refuses by `InputError` is marked as invalid."""
    with tag("div", classes="field"):
        named = tag("label", label)
        made = tag(
            "input",
            type="text",
            # Not `value`: answers to other fields would take away what is typed here.
            defaultValue=f"{value:g}" if isinstance(value, float) else value or "",
            autocomplete="off",
            maxlength=100,
            inputmode="decimal" if number else "text",
        )
        named._props["for"] = made.html_id
        told = tag("span", "", "bad", role="alert")
        told.set_visibility(False)

    async def changed(event: Any) -> None:
        made._props["defaultValue"] = str(event.args)[:100]
        try:
            answer = do(str(event.args)[:100].strip())
            if answer is not None:
                await answer
        except InputError as error:
            made._props["aria-invalid"] = "true"
            says(told, str(error))
        else:
            made._props.pop("aria-invalid", None)
            says(told, "")
        made.update()

    return made.on("change", changed, js_handler="(e) => emit(e.target.value)")


def tick(label: str, value: bool, do: Callable[[bool], Any]) -> Element:
    """A box to tick."""
    with tag("div", classes="tick"):
        made = tag("input", type="checkbox")
        if value:
            made._props["checked"] = True
        tag("label", label, for_=made.html_id)
    return made.on(
        "change", lambda e: do(bool(e.args)), js_handler="(e) => emit(e.target.checked)"
    )


def drop(project: str, most: int, text: str, then: str = "") -> None:
    """Where files are dropped or chosen; `app.js` sends them.

    Without a `project` a new one is begun, and its page `then` opened.
    """
    with tag(
        "label",
        classes="drop less" if project else "drop",
        id="drop",
        data_project=project,
        data_most=most,
        data_then=then,
    ):
        tag("strong", text)
        tag("span", "CSV, text, Excel, as the testing machine wrote them", "soft small")
        tag("input", type="file", multiple=True, aria_label="Choose recordings").on(
            "change",
            js_handler="(e) => softnn.chosen(e.target)",
        )
    tag("p", "", "soft small", id="sending", role="status")
    tag("ul", "", id="refused", role="alert", hidden=True)
    ui.run_javascript("softnn.begin()")


class Watched:
    """A button that starts a run, one that cancels it, and how far it is."""

    def __init__(self, runs: Runs, project: Project, what: str, word: str) -> None:
        self.runs, self.project, self.what = runs, project, what
        with tag("div", classes="row"):
            self.go = button(word, self.start, "act main")
            self.stop = button("Cancel", self.cancel)
        self.bar = tag("progress", aria_label=f"{word}: under way")
        self.line = tag("p", role="status")

    def start(self) -> None:
        try:
            self.runs.start(self.project, self.what)
        except InputError as error:
            ui.notify(str(error))
        self.show("")

    async def cancel(self) -> None:
        await run.io_bound(self.runs.cancel, self.project, self.what)
        self.show("")

    def show(self, lacking: str) -> bool:
        """Bring it up to date; `lacking`: why it cannot start. Whether it is on."""
        state = self.runs.state(self.project, self.what)
        going = bool(state) and "ended" not in state
        able(self.go, not going and not lacking)
        self.stop.set_visibility(going)
        self.bar.set_visibility(going)
        if going:
            for key, of in (("value", state.get("part")), ("max", state.get("of"))):
                if of is None:
                    self.bar._props.pop(key, None)
                else:
                    self.bar._props[key] = of
            self.bar.update()
            seconds = time.time() - state.get("began", time.time())
            text = f"{state.get('stage', '')}, {seconds:.0f} s"
            says(self.line, text[:1].upper() + text[1:])
        elif lacking:
            says(self.line, lacking)
        else:
            ended_well = state.get("ended") in (None, "done")
            says(self.line, "" if ended_well else state.get("line", ""))
        return going


class Downloads:
    """Buttons that take a model away, as it is or in another form."""

    def __init__(
        self,
        runs: Runs,
        project: Project,
        model: Path,
        forms: Mapping[str, str],
        files: Mapping[str, str] = FILES,
    ) -> None:
        self.runs, self.project, self.model, self.forms = runs, project, model, forms
        self.stem = Path(project.title).stem.replace(" ", "_") or "model"
        with tag("div", classes="row"):
            for file, text in files.items():
                if (place := model.parent / file).is_file():
                    button(
                        text, partial(ui.download.file, place, f"{self.stem}-{file}")
                    )
            for form, text in forms.items():
                button(text, partial(self.export, form, False))
        self.told = tag("div", role="status")

    async def export(self, form: str, anyway: bool) -> None:
        ask = self.project, self.model, form, self.stem, anyway
        self.told.clear()
        with self.told:
            waiting = tag("p", f"Writing the {self.forms[form]}.", "soft")
        try:
            name, content, lines = await self.runs.ask(work.exported, *ask)
        except InputError as error:
            if not self.told.is_deleted:
                waiting.delete()
                self.refused(form, str(error))
            return
        if self.told.is_deleted:
            return  # the page was closed in the meantime
        waiting.delete()
        ui.download.content(content, name)
        if lines:
            with self.told, tag("ul", classes="notes"):
                for line in lines:
                    tag("li", line)

    def refused(self, form: str, why: str) -> None:
        wanted = re.sub(r"; --(anyway|leave-out \w+) .*", "", why)
        with self.told:
            tag("p", f"{self.forms[form]}: {wanted}.", "say")
            if wanted != why:
                again = partial(self.export, form, True)
                button(f"Write the {self.forms[form]} anyway", again)


def figure(svg: str, caption: str, says_: str) -> None:
    """A small curve, as `softnn.glance` draws it: numbers alone, so it is safe."""
    with tag("figure", role="img", aria_label=says_):
        ui.html(svg, sanitize=False)
        tag("figcaption", caption)
