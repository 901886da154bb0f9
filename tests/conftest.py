"""What all tests share: a thread of arithmetic, data, a diagnosis, servers."""

import os
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

# The products of a diagnosis are small. With more threads than one they take up to 15
# times longer, and more still where several workers of pytest-xdist share the cores.
# Set before NumPy is imported, and for the processes that tests start.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
# A shell starts what it puts in the background with SIGINT ignored, and so would be the
# processes that tests stop by it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

STARTED = {"chromium", "database_server"}  # what asks for these is slow


@pytest.hookimpl(tryfirst=True)  # before -m selects
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if STARTED & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.slow)


@pytest.fixture
def data_folder() -> Path:
    """The folder of real recordings; without it the test is skipped, saying so."""
    folder = os.environ.get("SOFTNN_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("no real recordings: SOFTNN_DATA names no folder")
    return Path(folder)


@pytest.fixture(scope="session")
def chromium():
    """A browser, started once; tests that ask for it are slow."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no chromium to look at the page with")
    sync = pytest.importorskip("playwright.sync_api")
    with sync.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def database_server() -> Iterator[Callable[[str], str]]:
    """A PostgreSQL, started once: makes an empty database and says its address."""
    from servers import new_database, postgresql

    with postgresql() as address:
        yield lambda name: new_database(address, name)


@pytest.fixture(scope="session")
def softened(tmp_path_factory) -> tuple[Path, Path]:
    """A case with softening, and what `softnn diagnose` writes of it: two folders.

    The one diagnosis that tests share; what they ask of it changes neither folder.
    """
    from made import mullins, write_case

    from softnn.cli import main

    folder = tmp_path_factory.mktemp("cases")
    case = write_case(folder / "soft <b>", [mullins()])
    out = folder / "out"
    assert main(["diagnose", str(case), "--out", str(out), "--jobs", "1"]) == 0
    return case, out / "soft__b_"
