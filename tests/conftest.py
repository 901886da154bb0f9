import os
import shutil
from pathlib import Path

import pytest


@pytest.fixture
def data_folder() -> Path:
    """The folder of real recordings; without it the test is skipped, saying so."""
    folder = os.environ.get("SOFTNN_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("no real recordings: SOFTNN_DATA names no folder")
    return Path(folder)


@pytest.fixture(scope="module")
def chromium():
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no chromium to look at the page with")
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()
