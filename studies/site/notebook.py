"""The notebook as a page: its texts, and its cells as they are run by the tests."""

from __future__ import annotations

import json
from pathlib import Path


def cells(path: Path) -> list[tuple[str, str]]:
    """Kind (markdown or code) and text of each cell."""
    held = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [(c["cell_type"], "".join(c["source"])) for c in held]


def page(path: Path) -> str:
    """Markdown of the notebook."""
    parts = [
        text if kind == "markdown" else f"```python\n{text}\n```"
        for kind, text in cells(path)
    ]
    return "\n\n".join(parts) + "\n"
