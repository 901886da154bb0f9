"""Elements that the pages are made of: plain HTML, which browsers make accessible.

Texts are set as text, never as HTML, so a name may hold anything.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import contextmanager
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.element import Element

from softnn.contracts import InputError

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
def page(title: str, here: str) -> Iterator[None]:
    """What every page has around its content; `here` is its entry in the menu."""
    ui.page_title(f"{title} - softnn" if title else "softnn")
    ui.add_css(HERE / "style.css")
    ui.add_head_html(f"<script>{(HERE / 'app.js').read_text('utf-8')}</script>")
    with tag("div", classes="page"):
        with tag("header", classes="top"):
            tag("a", "softnn", "brand", href="/")
            with tag("nav", aria_label="Pages"):
                for text, address in (
                    ("Diagnose", "/"),
                    ("Train a network", "/network"),
                    ("Earlier results", "/results"),
                ):
                    current = {"aria_current": "page"} if text == here else {}
                    tag("a", text, href=address, **current)
        with tag("main"):
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
    with tag("label", classes="field"):
        tag("span", label)
        with tag("select") as made:
            for key, text in options.items():
                chosen = {"selected": True} if key == value else {}
                tag("option", text, value=key, **chosen)

    def changed(event: Any) -> Any:
        return do(str(event.args)) if str(event.args) in options else None

    return made.on("change", changed, js_handler="(e) => emit(e.target.value)")


def entry(
    label: str, value: Any, do: Callable[[str], Any], number: bool = True
) -> Element:
    """A line to type into; what `do` refuses by `InputError` is marked as invalid."""
    with tag("label", classes="field"):
        tag("span", label)
        made = tag(
            "input",
            type="text",
            value="" if value is None else str(value),
            autocomplete="off",
            maxlength=100,
            **({"inputmode": "decimal"} if number else {}),
        )
        told = tag("span", "", "bad", role="alert")
        told.set_visibility(False)

    async def changed(event: Any) -> None:
        made._props["value"] = str(event.args)[:100]
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
    with tag("label", classes="tick"):
        props = {"checked": True} if value else {}
        made = tag("input", type="checkbox", **props)
        tag("span", label)
    return made.on(
        "change", lambda e: do(bool(e.args)), js_handler="(e) => emit(e.target.checked)"
    )


def drop(project: str, most: int, text: str, less: bool) -> None:
    """Where files are dropped or chosen; `app.js` sends them."""
    with tag(
        "label",
        classes="drop less" if less else "drop",
        id="drop",
        data_project=project,
        data_most=most,
    ):
        tag("strong", text)
        tag("span", "CSV, text, Excel, as the testing machine wrote them", "soft small")
        tag("input", type="file", multiple=True, aria_label="Choose recordings").on(
            "change",
            js_handler="(e) => { softnn.send([...e.target.files]); e.target.value = ''; }",
        )
    tag("p", "", "soft small", id="sending", role="status")
    tag("ul", "", id="refused", role="alert", hidden=True)
    ui.run_javascript("softnn.begin()")


def figure(points: str, width: float, height: float, caption: str, says_: str) -> None:
    """A small curve as SVG."""
    with tag("figure"):
        with tag(
            "svg",
            viewBox=f"-2 -2 {width + 4:g} {height + 4:g}",
            role="img",
            aria_label=says_,
            preserveAspectRatio="none",
        ):
            tag("rect", "", "frame", x=-1, y=-1, width=width + 2, height=height + 2)
            tag("polyline", points=points)
        tag("figcaption", caption)
