"""mkdocs calls this: generated pages are added to those in docs/, none is kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.utils import get_relative_url

from studies.site import gallery, notebook, thesis

ROOT = Path(__file__).parents[2]


def on_files(files: Files, config: Any) -> Files:
    """Add the gallery, the chapters of the thesis and the notebook."""
    made = gallery.pages() | thesis.pages()
    made["first_look.md"] = notebook.page(ROOT / "docs" / "first_look.ipynb")
    for path, content in (made | thesis.pictures()).items():
        files.append(File.generated(config, path, content=content))
    return files


def on_post_page(output: str, page: Any, config: Any) -> str:
    """Load pages.js before the theme's own script, which starts the search."""
    script = get_relative_url("pages.js", page.url)
    return output.replace("</head>", f'<script src="{script}"></script></head>', 1)


def on_post_build(config: Any) -> None:
    """The index of the search as a script, too: for pages opened from disk."""
    folder = Path(config.site_dir) / "search"
    index = (folder / "search_index.json").read_text(encoding="utf-8")
    (folder / "search_index.js").write_text(f"var __index = {index}", encoding="utf-8")


def on_config(config: Any) -> Any:
    """The pages of effects, below the gallery, in the order in which they act."""
    for section in config.nav:
        for title, entry in section.items():
            if title == gallery.TITLE:
                entry += gallery.nav()
    return config
