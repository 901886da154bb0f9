"""`softnn app` as a visitor meets it: a server, a browser, real recordings."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from made import mullins, write_case
from servers import free_port

pytest.importorskip("playwright.sync_api", reason="no Playwright")
pytest.importorskip("nicegui", reason="no NiceGUI: pip install 'softnn[app]'")

from playwright.sync_api import TimeoutError

import softnn
from softnn.export.files import export
from softnn.model_file import read_model
from softnn.neural import StoredNetwork

SEEN = "document.querySelectorAll('.state:is(.good, .bad, .soft)').length == {}"
NAME = """(document.activeElement.innerText
    || document.activeElement.getAttribute("aria-label") || "")"""
HOSTILE = "<img src=x onerror=\"document.title='taken'\">.csv"


@contextmanager
def server(out: Path, *options: str) -> Iterator[str]:
    """The address of `softnn app`; it ends by ctrl-C, and well."""
    command = [sys.executable, "-m", "softnn.cli", "app", "--no-browser", *options]
    command += ["--out", str(out), "--port", str(port := free_port())]
    # NiceGUI behaves otherwise where it sees that it is tested.
    env = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST")}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env) as app:
        try:
            address = app.stdout.readline().split()[-1]
            for _ in range(100):
                with suppress(urllib.error.URLError):
                    urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5)
                    break
                time.sleep(0.1)
            yield address
        finally:
            app.send_signal(signal.SIGINT)
            assert app.wait(20) == 0
            app.stdout.close()


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("app")


@pytest.fixture(scope="module")
def address(out):
    with server(out, "--max-mb", "1") as found:
        yield found


@pytest.fixture
def page(chromium, address):
    """A visitor of his own, whose page must raise nothing."""
    context = chromium.new_context(viewport={"width": 1280, "height": 900})
    one = context.new_page()
    wrong = []
    one.on("pageerror", lambda error: wrong.append(str(error)))
    one.goto(address)
    yield one
    context.close()
    assert wrong == []


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two recordings with an effect concealed in them."""
    folder = write_case(tmp_path_factory.mktemp("made") / "case", [mullins()])
    return sorted((folder / "recordings").iterdir())[:2]


def dropped(page, files):
    page.set_input_files("#drop input", [str(f) for f in files])
    page.wait_for_url("**/project/*")
    page.wait_for_function(SEEN.format(len(files)), timeout=60_000)


def folder_of(out: Path, page) -> Path:
    return out / page.url.split("/project/")[1].split("/")[0]


def diagnosed(page):
    page.get_by_role("button", name="Diagnose", exact=True).click()
    page.wait_for_selector("iframe.report", timeout=180_000)


def downloaded(page, button: str, to: Path) -> Path:
    with page.expect_download(timeout=60_000) as found:
        page.get_by_role("button", name=button, exact=True).click()
    place = to / found.value.suggested_filename
    found.value.save_as(place)
    return place


def written(page, button: str, to: Path) -> Path:
    """As `downloaded`; anyway, where the page says what would be lost."""
    try:
        with page.expect_download(timeout=10_000) as found:
            page.get_by_role("button", name=button, exact=True).click()
    except TimeoutError:
        assert page.locator(".say").last.inner_text().startswith(button)
        return downloaded(page, f"Write the {button} anyway", to)
    return to / found.value.suggested_filename


def running_of(out: Path) -> list[int]:
    """Processes that work on projects below a folder."""
    found = []
    for one in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if str(out) in one.read_text() and "softnn.app.work" in one.read_text():
                found.append(int(one.parent.name))
    return found


# -- the whole way ---------------------------------------------------------------------


def test_three_machine_exports_from_drop_to_download(
    page, out, data_folder, tmp_path, capsys
):
    formats = data_folder / "machine-formats"
    began = time.monotonic()
    dropped(
        page,
        [
            formats / "instron_bluehill" / "leap-tension-1_1.csv",
            formats / "cellscale_univert" / "XtraSoft.csv",
        ],
    )
    go = page.get_by_role("button", name="Diagnose", exact=True)
    assert go.is_disabled()
    assert page.get_by_text("2 files need a correction above").is_visible()
    # Sizes of all files, then another section for one of them.
    page.get_by_label("Length [mm]").first.fill("33")
    page.get_by_label("Section [mm2]").first.fill("18,5")
    page.get_by_label("Section [mm2]").first.press("Tab")
    page.wait_for_function("document.querySelectorAll('.state.good').length == 2")
    card = page.get_by_role("article", name="XtraSoft.csv")
    card.get_by_text("Correct", exact=True).click()
    card.get_by_label("Section [mm2]").fill("100")
    card.get_by_label("Section [mm2]").press("Tab")
    page.wait_for_function(
        "[...document.querySelectorAll('dd')].some(x => x.innerText.includes('100 mm'))"
    )
    diagnosed(page)
    taken = time.monotonic() - began
    frame = page.frame_locator("iframe.report")
    assert frame.locator(".answer").inner_text().strip()
    with capsys.disabled():
        print(f"\ndrop to report by softnn app: {taken:.0f} s")

    # The same functions as in Python, on the same recordings.
    found = json.loads(downloaded(page, "All figures", tmp_path).read_text())
    sizes = {"length_mm": 33.0, "area_mm2": 18.5}
    other = sizes | {"area_mm2": 100.0}
    same = [
        *softnn.read(formats / "cellscale_univert" / "XtraSoft.csv", **other),
        *softnn.read(formats / "instron_bluehill" / "leap-tension-1_1.csv", **sizes),
    ]
    again = softnn.diagnose(same).result
    for key in ("verdict", "selected", "candidates"):
        mine = json.loads(json.dumps(again[key], default=str))
        if key == "candidates":
            mine, theirs = (
                [(c["effect"], round(c["probability"], 6)) for c in x]
                for x in (mine, found[key])
            )
            assert mine == theirs
        else:
            assert mine == found[key]

    model = downloaded(page, "Model", tmp_path)
    stored = read_model(model)
    report = downloaded(page, "Report", tmp_path).read_text()
    assert found["summary"].split(".")[0][:40] in report
    stem = model.name.removesuffix("-model.json")
    code = zipfile.ZipFile(downloaded(page, "C code", tmp_path))
    assert {n: code.read(n) for n in code.namelist()} == export(stored, "c", stem)
    code.close()
    assert written(page, "FMU", tmp_path).suffix == ".zip"
    assert written(page, "Abaqus card", tmp_path).suffix == ".inp"


def test_wrong_files_are_named_and_none_of_them_runs(page, out, made, tmp_path):
    wrong = {
        "notes.txt": b"Hello, these are my notes.\n",
        "report.pdf": b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n1 0 obj\n",
        "empty.csv": b"",
        HOSTILE: b"a,b\n1,x\n",
        "model.json": b"{}",
        "large.csv": b"1" * 1_100_000,
        "lock.xlsx": b"PK\x03\x04" + b"\0" * 50,
    }
    files = []
    for name, content in wrong.items():
        files.append({"name": name, "mimeType": "", "buffer": content})
    good = {"name": "good.csv", "mimeType": "", "buffer": made[0].read_bytes()}
    page.set_input_files("#drop input", [*files, good])
    page.wait_for_url("**/project/*")
    page.wait_for_function(SEEN.format(len(wrong) - 1), timeout=60_000)
    refused = page.locator("#refused").inner_text()
    assert "large.csv: over 1 MB" in refused
    assert "model.json: no model" in refused
    assert page.title() != "taken"
    assert page.get_by_role("heading", name="<img src").count() == 0
    assert page.locator(".page img").count() == 0
    bad = page.locator("article", has=page.locator(".state.bad"))
    passed_over = page.locator("article", has=page.locator(".state.soft"))
    assert bad.count() + passed_over.count() == 5
    assert all(s.inner_text().strip() for s in bad.locator(".say").all())
    assert all(s.inner_text().strip() for s in passed_over.locator("p").all())
    go = page.get_by_role("button", name="Diagnose", exact=True)
    assert go.is_disabled() == bool(bad.count())
    while left := bad.count():
        bad.first.get_by_role("button", name="Remove").click()
        page.wait_for_function(
            f"document.querySelectorAll('.state.bad').length < {left}"
        )
    page.wait_for_function("!document.querySelector('button.main').disabled")
    kept = {f.name for f in (folder_of(out, page) / "files").iterdir()}
    assert "good.csv" in kept
    assert not kept & {"model.json", "large.csv"}


def test_another_column_and_unit_are_chosen_with_a_click(page, made):
    import pandas as pd

    table = pd.read_csv(made[0])
    table["second"] = table["stress_MPa"] * 2e3
    table.columns = ["Time (s)", "Strain (%)", "Stress (MPa)", "Second (kPa)"]
    table["Strain (%)"] *= 100
    content = table.to_csv(index=False).encode()
    page.set_input_files(
        "#drop input", {"name": "a.csv", "mimeType": "", "buffer": content}
    )
    page.wait_for_url("**/project/*")
    page.wait_for_function(SEEN.format(1))
    caption = page.locator("figcaption")
    before = float(caption.inner_text().split()[-2])
    page.get_by_text("Correct", exact=True).click()
    page.get_by_label("Stress", exact=True).select_option("Second")
    page.wait_for_function(
        f"!document.querySelector('figcaption').innerText.endsWith('{before:g} MPa')"
    )
    assert float(caption.inner_text().split()[-2]) == pytest.approx(
        2 * before, rel=0.01
    )
    page.get_by_label("Length [mm]").fill("long")
    page.get_by_label("Length [mm]").press("Tab")
    page.get_by_text("'long' is no number").wait_for()
    page.get_by_role("button", name="Undo all corrections").click()
    page.wait_for_function(
        f"document.querySelector('figcaption').innerText.endsWith('{before:.3g} MPa')"
    )


def test_a_table_of_sizes_is_dropped_before_or_after_its_files(page, tmp_path):
    rows = "\n".join(f"{t},{t % 10},{0.5 * (t % 10)}" for t in range(40))
    files = []
    for name in ("a", "b", "c"):
        file = tmp_path / f"{name}.csv"
        file.write_text(f"Time (s),Extension (mm),Load (N)\n{rows}\n")
        files.append(file)
    dropped(page, files[:1])
    page.get_by_text("no cross-section").wait_for()
    sizes = tmp_path / "specimens.csv"
    sizes.write_text("File;Length (mm);Area (mm2)\na;40;10,5\nb;20;10,5\nd;1;1\n")
    page.set_input_files("#drop input", [str(sizes), str(files[1])])
    page.wait_for_function(SEEN.format(2))
    for text in ("length 40 mm, section 10.5 mm2", "length 20 mm, section 10.5 mm2"):
        page.get_by_text(text).wait_for()
    line = page.get_by_text("specimens.csv gives the sizes of 2 of 2 files.")
    assert "It names d, not dropped here." in line.inner_text()
    assert page.get_by_text("not read", exact=True).count() == 0
    # A correction counts for more than the table.
    card = page.get_by_label("a.csv", exact=True)  # open: it lacked its sizes
    card.get_by_label("Length [mm]").fill("80")
    card.get_by_label("Length [mm]").press("Tab")
    card.get_by_text("length 80 mm, section 10.5 mm2").wait_for()


# -- runs ------------------------------------------------------------------------------


def test_a_run_survives_a_reload_a_closed_page_and_ends_when_cancelled(
    page, out, made, chromium
):
    dropped(page, made)
    page.get_by_role("button", name="Diagnose", exact=True).click()
    page.locator("progress").wait_for(state="visible")
    project = folder_of(out, page)
    page.reload()
    page.locator("progress").wait_for(state="visible")
    assert page.get_by_role("button", name="Diagnose", exact=True).is_disabled()
    other = chromium.new_context().new_page()  # the page closed, and opened elsewhere
    other.goto(page.url)
    page.goto("about:blank")
    other.get_by_role("button", name="Cancel").click()
    other.get_by_text("Cancelled.").wait_for()
    other.context.close()
    assert running_of(project) == []
    assert not (project / "found").exists()


def test_two_visitors_do_not_wait_for_one_another_nor_see_each_other(
    page, chromium, address, made, out
):
    dropped(page, made[:1])
    context = chromium.new_context()
    second = context.new_page()
    second.goto(address)
    dropped(second, made[1:])
    assert second.get_by_role("heading", name=made[0].name).count() == 0
    for one in (page, second):
        one.get_by_role("button", name="Diagnose", exact=True).click()
    for one in (page, second):
        one.locator("progress").wait_for(state="visible")
    assert len({p for f in (page, second) for p in running_of(folder_of(out, f))}) == 2
    for one in (page, second):
        one.wait_for_selector("iframe.report", timeout=180_000)
        answer = one.frame_locator("iframe.report").locator("h1").inner_text()
        assert answer == one.locator("h1").inner_text()
    context.close()


def test_a_correction_after_the_report_says_that_it_is_old(page, made):
    dropped(page, made[:1])
    diagnosed(page)
    old = page.get_by_text("have changed since this report")
    assert old.count() == 0
    page.get_by_label("Simulate with").select_option("hooke")
    old.wait_for()
    page.get_by_label("Simulate with").select_option("")
    old.wait_for(state="detached")
    # The report can reach nothing of the page around it.
    page.frame_locator("iframe.report").locator(".answer").wait_for()
    (frame,) = (f for f in page.frames if "report.html" in f.url)
    with pytest.raises(Exception, match=r"(?i)cross-origin|blocked|denied"):
        frame.evaluate("parent.document.title")


# -- networks and earlier results ------------------------------------------------------


def test_a_network_is_trained_shown_and_taken_away(page, data_folder, tmp_path, out):
    page.get_by_role("link", name="Train a network").click()
    folder = data_folder / "rubber-compression-relaxation" / "tidy"
    page.set_input_files(
        "#drop input", [str(folder / f"large_{i}.csv") for i in (1, 2)]
    )
    page.wait_for_url("**/project/*/network")
    page.get_by_label("Folds").select_option("3")
    page.get_by_role("button", name="Train").click()
    page.get_by_role("heading", name="Fold by fold").wait_for(timeout=600_000)
    told = json.loads(
        next(folder_of(out, page).glob("network/joint*.json")).read_text()
    )
    folds = told["materials"][0]["rows"][0]["random"]
    rows = page.get_by_role("group", name="Table: random folds").locator("tbody tr")
    rows.nth(len(folds) - 1).wait_for()  # the page is built from the top
    assert rows.count() == len(folds) == 3
    for button in ("Network", "Network for unseen"):
        network = softnn.load_model(downloaded(page, button, tmp_path))
        assert isinstance(network, StoredNetwork)
    page.get_by_role("link", name="Earlier results").click()
    assert page.get_by_text("For recordings you have").first.is_visible()
    page.get_by_role("button", name="Start MLflow").click()
    link = page.get_by_role("link", name="Open MLflow")
    link.wait_for(timeout=90_000)
    with urllib.request.urlopen(link.get_attribute("href"), timeout=30) as answer:
        assert b"MLflow" in answer.read()


# -- how it looks ----------------------------------------------------------------------


def serious(page) -> list[str]:
    """What axe finds of serious or critical faults."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    found = axe.Axe().run(page).response["violations"]
    return [
        f"{v['id']}: {v['nodes'][0]['html'][:120]}"
        for v in found
        if v["impact"] in ("serious", "critical")
    ]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_page_is_accessible_and_fits_a_narrow_window(page, made, address, scheme):
    page.emulate_media(color_scheme=scheme)
    dropped(page, made[:1])
    page.get_by_text("Correct", exact=True).click()
    here = page.url
    for where in (here, f"{here}/network", address, f"{address}results", f"{here}x"):
        if where != here:
            page.goto(where)
        for width in (1280, 400):
            page.set_viewport_size({"width": width, "height": 800})
            page.wait_for_timeout(200)
            wide = page.evaluate("document.documentElement.scrollWidth")
            assert wide <= width, (where, width)
        assert serious(page) == [], where
    shade = page.evaluate("getComputedStyle(document.body).backgroundColor")
    light = sum(map(int, shade[4:-1].split(",")[:3])) > 380
    assert light == (scheme == "light")


def test_the_keyboard_alone_reaches_files_and_buttons(page, made):
    dropped(page, made[:1])
    page.locator("h1").click()
    reached = set()
    for _ in range(25):
        page.keyboard.press("Tab")
        reached.add(page.evaluate(NAME))
    assert {"Choose recordings", "Diagnose", "Correct", "Remove"} <= reached


# -- who may come in -------------------------------------------------------------------


def test_with_a_token_nobody_else_comes_in(chromium, tmp_path):
    with server(tmp_path, "--token") as address:
        bare, _, token = address.partition("?token=")
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(bare, timeout=10)
        context = chromium.new_context()
        one = context.new_page()
        one.goto(address)
        one.get_by_role("heading", name="What does your simulation").wait_for()
        assert token not in one.url
        one.get_by_role("button", name="Look at an example").click()
        one.wait_for_url("**/project/*")  # by the socket, with the cookie
        context.close()


def test_the_server_takes_its_runs_along(chromium, tmp_path, made):
    with server(tmp_path) as address:
        one = chromium.new_context().new_page()
        one.goto(address)
        dropped(one, made)
        one.get_by_role("button", name="Diagnose", exact=True).click()
        one.locator("progress").wait_for(state="visible")
        assert running_of(tmp_path)
        one.context.close()
    until = time.monotonic() + 10
    while running_of(tmp_path) and time.monotonic() < until:
        time.sleep(0.1)
    assert running_of(tmp_path) == []
    assert os.listdir(tmp_path)  # what was dropped is there for the next time
