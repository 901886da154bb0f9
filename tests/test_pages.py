"""The pages: what stands on them is run, and they open with no network."""

import re
import shlex
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from softnn.cli import main
from softnn.effects import EFFECTS, effect
from softnn.materials import table
from softnn.report import page as report
from softnn.report import phrases

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```$", re.M | re.S)
RUN = ("own.md", "adding.md")
WIDTHS = (400, 1200)
LOOKED_AT = (
    "index.html", "own.html", "first_look.html", "gallery/index.html",
    "gallery/mullins_softening.html", "thesis/chapter-4.html", "method.html",
)  # fmt: skip


# -- what stands on them is run --------------------------------------------------------


@pytest.mark.parametrize("name", RUN)
def test_examples_of_a_page_run_as_they_stand(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scope, commands = {}, 0
    for kind, text in BLOCK.findall((ROOT / "docs" / name).read_text()):
        if kind == "python":
            exec(compile(text, name, "exec"), scope)
            continue
        for line in text.splitlines():
            words = shlex.split(line, comments=True)
            if words[:1] == ["softnn"]:
                assert main(words[1:]) == 0, line
                commands += 1
    assert commands >= (name == "own.md") * 4
    if name == "own.md":
        assert (tmp_path / "found/my_recordings/report.html").is_file()
        said = capsys.readouterr().out
        assert re.search(r"Mullins softening \(\d+ %\) was left out", said)


def test_the_page_lists_what_softnn_can_name():
    page = (ROOT / "docs" / "own.md").read_text()
    for law in EFFECTS:
        said = report.meaning(law.id).rstrip(".")
        assert f"| {phrases.opened(phrases.plain(law.id))} | {said} |" in page


@pytest.mark.slow
def test_commands_of_the_readme_run(tmp_path, monkeypatch):
    """As they stand, but for the folder, and a server that would not end."""
    monkeypatch.chdir(tmp_path)
    lines = (ROOT / "README.md").read_text().splitlines()
    told = [line for line in lines if line.startswith("softnn ")]
    asked = [shlex.split(line, comments=True)[1:] for line in told]
    assert [a[0] for a in asked] == ["demo", "diagnose", "app"]
    for one in asked[:2]:
        assert main(["demo/case" if w == "FOLDER" else w for w in one]) == 0
    assert (tmp_path / "found" / "case" / "report.html").is_file()


def test_the_notebook_runs_and_finds_what_it_made(tmp_path, monkeypatch):
    from studies.site.notebook import cells

    monkeypatch.chdir(tmp_path)
    scope = {}
    for kind, text in cells(ROOT / "docs" / "first_look.ipynb"):
        if kind == "code":
            exec(compile(text, "notebook", "exec"), scope)
    assert scope["found"].selected == ["slack"]
    assert (tmp_path / "found" / "report.html").is_file()


def test_case_toml_of_the_page_is_one(tmp_path):
    from softnn.mismatch.case import KEYS, read_case

    page = (ROOT / "docs" / "own.md").read_text()
    (text,) = re.findall(r"^```toml\n(.*?)^```$", page, re.M | re.S)
    for i, name in enumerate(("slow", "fast", "cycles"), start=1):
        rows = f"time_s,strain,stress_MPa\n0,0,0\n{i},1,1"
        (tmp_path / f"{name}.csv").write_text(rows)
    (tmp_path / "case.toml").write_text(text)
    case = read_case(tmp_path)
    assert len(case.groups()) == 2
    for key in KEYS:
        assert f"`{key}`" in page or f"`[{key}]`" in page


# -- what is generated -----------------------------------------------------------------


def test_how_alike_two_effects_are_is_the_fit_of_one_to_the_other():
    """By a second route: the share of squares that a least-squares scale takes."""
    from studies.site.gallery import alike, changed, clean

    law, other = effect("slack"), effect("permanent_set")
    own = changed("slack", "slack") - clean("slack")
    its = changed("permanent_set", "slack") - clean("slack")
    scale, left, *_ = np.linalg.lstsq(its[:, None], own, rcond=None)
    assert scale[0] > 0
    assert alike(law, other) == pytest.approx(1 - left[0] / (own @ own))
    assert alike(law, law) == pytest.approx(1.0)


def test_a_chapter_has_every_figure_that_was_published():
    from studies.site.thesis import pages

    made = pages()
    for id, chapter in (("3.1", 3), ("4.1", 4), ("4.2", 4), ("5.1", 5), ("7.2", 7)):
        text = made[f"thesis/chapter-{chapter}.md"]
        for row in table(id).rows[:7]:
            for key, value in row.items():
                if key in ("nrmse", "generalisation_error"):
                    assert f"{value:.2f} %" in text
                elif isinstance(value, float):
                    assert f"{value:g}" in text, (id, key)


# -- built -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    pytest.importorskip("material")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", folder],
        cwd=ROOT, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return folder


@pytest.mark.slow
def test_every_effect_has_its_page_with_its_formulas_drawn(site):
    for law in EFFECTS:
        text = (site / "gallery" / f"{law.id}.html").read_text()
        assert text.count("<polyline") >= 4
        assert r"\varepsilon" not in text
        assert ".. math::" not in text
        assert ("<math" in text) == (".. math::" in type(law).__doc__)


@pytest.mark.slow
def test_nothing_on_a_page_is_fetched(site):
    for page in site.rglob("*.html"):
        for tag in re.findall(r"<(?:script|link|img|iframe)\b[^>]*>", page.read_text()):
            address = re.search(r'(?:src|href)="?([^" >]*)', tag)
            assert not (address and "//" in address[1]), (page.name, tag)


def opened(chromium, width, scheme):
    """A page with no network, and all it complains of or asks for elsewhere."""
    page = chromium.new_context(
        viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True
    ).new_page()
    said = []
    page.on("console", lambda m: said.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on(
        "request", lambda r: said.append(r.url) if r.url.startswith("http") else None
    )
    return page, said


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS)
def test_pages_open_from_disk_at_any_width(site, chromium, width, scheme):
    page, said = opened(chromium, width, scheme)
    for name in LOOKED_AT:
        page.goto((site / name).as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width, name
    assert said == []
    page.context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_serious_fault(site, chromium, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page, _ = opened(chromium, 1200, scheme)
    for name in LOOKED_AT:
        page.goto((site / name).as_uri())
        page.wait_for_timeout(300)  # tables are wrapped by a script
        found = axe.Axe().run(page).response["violations"]
        grave = [v["id"] for v in found if v["impact"] in ("serious", "critical")]
        assert grave == [], name
    page.context.close()


def test_the_search_works_from_disk(site, chromium):
    page, said = opened(chromium, 1200, "light")
    page.goto((site / "gallery/slack.html").as_uri())
    from playwright.sync_api import TimeoutError as Late

    # The page reads the box when its index is ready, and from then on at every key.
    box, hit = "input.md-search__input", page.locator(".md-search-result__link").first
    for word in 20 * ("Mullins", "softening", "slack"):
        page.fill(box, word, force=True)
        page.press(box, "End")
        with suppress(Late):
            hit.wait_for(state="attached", timeout=1_000)
            break
    assert hit.count() == 1
    assert said == []
    page.context.close()
