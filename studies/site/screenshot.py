"""`python -m studies.site.screenshot`: the demo's report as docs/figures/report.png.

Needs Chromium beside what the tests need.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from softnn.cli import main as softnn
from softnn.contracts import InputError
from softnn.study.common import guarded

TARGET = Path(__file__).parents[2] / "docs" / "figures" / "report.png"


def main() -> int:
    """Make the picture; returns the exit code."""
    return guarded(lambda: take(TARGET))


def take(target: Path) -> None:
    """Write the picture of a new demo's report to `target`."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        raise InputError("no chromium to look at the report with; install it")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        softnn(["demo", "--out", folder])
        browser = play.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(
            viewport={"width": 1100, "height": 1000}, color_scheme="light"
        )
        page.goto((Path(folder) / "found/case/report.html").as_uri())
        page.wait_for_selector("#picture[data-ready]")
        page.select_option("#recording", index=2)  # cycles: there it shows
        page.wait_for_timeout(500)
        box = page.locator("#picture").bounding_box()
        assert box is not None
        height = box["y"] + box["height"] + 10
        page.screenshot(
            path=target,
            full_page=True,
            clip={"x": 0, "y": 0, "width": 1100, "height": height},
        )
        browser.close()
    print(target)


if __name__ == "__main__":
    sys.exit(main())
