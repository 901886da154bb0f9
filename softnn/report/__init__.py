"""A diagnosis as one HTML page that opens with no server and no network.

`page` makes its content from diagnosis.json alone. `where` puts regions into words,
`phrases` numbers and names, and `picture` packs the curves. `report.html`,
`index.html`, `style.css` and `picture.js` are its looks.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from softnn.json_file import plain as in_json
from softnn.json_file import write_text
from softnn.report.page import Found, contents, verdict

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["Found", "write_index", "write_report"]


def write_report(found: Found, folder: str | Path) -> list[Path]:
    """Write report.html of a diagnosis into `folder`; return the files written."""
    from softnn.report.picture import library, pack, recordings

    text = (
        _templates()
        .get_template("report.html")
        .render(
            contents(found.result, found.axes),
            stored=in_json(found.result),
            pictures=pack(recordings(found)),
            library=library(),
        )
    )
    return [_write(Path(folder) / "report.html", text)]


def write_index(rows: Sequence[Mapping[str, Any]], folder: str | Path) -> Path:
    """Write index.html with a row for each case; return its path.

    A row has `case`, and `result` or `error`; `page` is the address of its report,
    relative to `folder`.
    """
    entries = [
        {
            "result": None,
            "error": "",
            **row,
            "link": quote(str(row["page"])) if row.get("page") else "",
            "verdict": verdict(row["result"]) if row.get("result") else "",
        }
        for row in rows
    ]
    text = _templates().get_template("index.html").render(rows=entries)
    return _write(Path(folder) / "index.html", text)


def _write(path: Path, text: str) -> Path:
    write_text(path, text)
    return path


def _unbroken(value: object) -> object:
    """Return a text whose numbers do not part from their per cent signs."""
    if type(value) is not str:  # numbers, and markup that is ready
        return value
    return re.sub(r"(?<=\d) %", "\N{NO-BREAK SPACE}%", value)


@cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    from softnn.report.phrases import number, opened, percent, plain, promise, sure

    # Names come from files of anybody: nothing is printed that is not escaped.
    made = Environment(
        loader=PackageLoader("softnn.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_unbroken,
    )
    for said in (number, opened, percent, plain, promise, sure):
        made.filters[said.__name__] = said
    return made
