"""The report as a reader meets it: in a browser, with no network, on any screen."""

import base64
import gzip
import json
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from softnn.axes import SPECIMEN, Axes
from softnn.mismatch.case import Case
from softnn.mismatch.words import summary
from softnn.recording import Recording
from softnn.report import write_index, write_report
from softnn.report.picture import kept, recordings
from softnn.report.where import sentences

HOSTILE = "</script><script>document.title='taken'</script><img src=x onerror=alert(1)>"
READY_S = 3.0  # on a slow machine, with others; the aim is 2 on one alone
STIFF, SOFT = 1.0, 0.8  # MPa, measured and simulated


@dataclass
class Told:
    """A diagnosis by hand: a spring of 1 MPa simulated with 0.8 on the way back."""

    case: Case
    result: dict
    time_s: list
    strain: list
    measured: list
    before: list
    after: list
    axes: Axes = SPECIMEN


def told(names=("first", "second"), samples=400):
    time = np.linspace(5, 25, samples)
    strain = 0.4 * (1 - np.abs(time / 10 - 1.5))
    measured = STIFF * strain
    before = np.where(time > 15, SOFT, STIFF) * strain
    n = len(names)
    region = {
        "start_s": 15.0, "end_s": 24.0, "branch": "unloading", "cycle": 1,
        "strain": [0.04, 0.4], "rate_per_s": [-0.04, -0.04],
        "sign": "simulation too soft", "share": 1 / n,
    }  # fmt: skip
    error = {"nrmse": 0.1, "heldout_nrmse": 0.12}
    row = {"evidence": 0.0, "seconds": 0.1}
    depth = {"value": 0.2, "low": 0.1, "high": None, "unit": "-"}
    result = {
        "case": names[0], "data_sha256": "ab", "model": "hooke", "version": 1,
        "verdict": "explained", "summary": "Slack was left out (95 %). And more.",
        "selected": ["mullins_softening"], "corrected_by": ["mullins_softening"],
        "mismatch": [region | {"recording": name} for name in names],
        "explanations": [{
            "effect": "mullins_softening", "stage": "material", "probability": 0.95,
            "form": "MullinsSoftening", "parameters": {"depth": depth},
            "where": "on the way back", "equivalent": ["permanent_set"],
            "recordings": list(names), "nrmse_without": 0.1,
        }],
        "probabilities": {"nothing": 0.01, "on_no_list": 0.04},
        "ways": [{"effects": ["mullins_softening"], "probability": 0.95},
                 {"effects": [], "probability": 0.05}],
        "fit": {"before": error, "after": {"nrmse": 0.01, "heldout_nrmse": 0.02},
                "noise_nrmse": float("nan")},
        "next_recording": {"strain_programme": "cycles", "why": "they part there",
                           "separates": ["mullins_softening", "permanent_set"]},
        "candidates": [
            row | {"effect": None, "probability": 0.01, "heldout_nrmse": 0.12},
            row | {"effect": "mullins_softening", "probability": 0.95,
                   "heldout_nrmse": 0.02, "evidence": 50.0},
            row | {"effect": "permanent_set", "probability": 0.02,
                   "heldout_nrmse": 0.05, "evidence": 20.0},
            row | {"effect": "slack", "probability": 0.0, "heldout_nrmse": 0.13},
        ],
        "seconds": 1.0,
    }  # fmt: skip
    case = Case(
        names[0],
        tuple(Recording(time, strain, measured, name=name) for name in names),
        notes=("strain was in per cent",),
    )
    return Told(
        case, result, *([x] * n for x in (time, strain, measured, before, measured))
    )


# -- what is written -------------------------------------------------------------------


def test_no_name_from_a_file_is_markup_anywhere_on_the_page(tmp_path):
    (page,) = write_report(told((HOSTILE, "b")), tmp_path)
    text = page.read_text()
    assert HOSTILE not in text
    assert "<img" not in text
    index = write_index(
        [{"case": HOSTILE, "page": f"{HOSTILE}/report.html", "error": HOSTILE}],
        tmp_path,
    ).read_text()
    assert "<script>" not in index
    assert "<img" not in index


def test_a_page_asks_nothing_of_a_network(tmp_path):
    (page,) = write_report(told(), tmp_path)
    for sign in ('src="', "url(", "@import", "<link", "href="):
        assert sign not in page.read_text()


def test_what_is_drawn_is_what_was_measured():
    found = told(samples=401)
    first = recordings(found)[0]
    np.testing.assert_allclose(first["time"], found.time_s[0] - 5, atol=1e-4)
    np.testing.assert_allclose(first["measured"], found.measured[0], rtol=1e-5)
    assert first["regions"] == [[10.0, 19.0]]
    found.result["corrected_by"] = []
    assert recordings(found)[0]["after"] is None


def test_a_correction_that_has_no_name_is_told_by_what_is_in_it(tmp_path):
    found = told()
    text = write_report(found, tmp_path)[0].read_text()
    assert "simulation after" in text
    assert 'data-shaded="where the correction acts"' in text
    found.result["selected"] = []
    text = write_report(found, tmp_path)[0].read_text()
    assert "simulation after" not in text
    assert "with mullins softening" in text
    assert 'data-shaded="beyond the noise"' in text


def test_a_spike_is_drawn_however_long_the_recording():
    values = np.zeros(100_000)
    values[54_321] = 1.0
    index = kept(values, 1000)
    assert 54_321 in index
    assert len(index) <= 1002
    assert (np.diff(index) > 0).all()


def test_shares_in_words_add_up_to_those_of_the_regions():
    regions = [
        {"recording": name, "branch": branch, "cycle": cycle, "strain": [0.1, top],
         "sign": "simulation too stiff", "share": 0.25}
        for name, branch, cycle, top in (
            ("a", "unloading", 2, 0.5), ("a", "unloading", 3, 0.4),
            ("b", "unloading", 4, 0.3), ("a", "hold", 1, 0.2),
        )
    ]  # fmt: skip
    first, second = sentences(regions, 3, SPECIMEN.strain)
    assert first == (
        "Unloading of cycles 2-4 in a, b, strain 0.1 to 0.5: 75 % "
        "(simulation too stiff)."
    )
    assert second.startswith("Hold of cycle 1 in a, strain 0.1 to 0.2: 25 %")


def test_the_page_says_why_each_effect_lost(tmp_path):
    (page,) = write_report(told(), tmp_path)
    text = page.read_text()
    assert "cannot be told from mullins softening here" in text  # permanent set
    assert "foretells recordings left out no better than the base alone" in text
    assert "not determined by these recordings" in text  # an interval without an end
    assert "strain was in per cent" in text


def test_of_one_recording_nothing_is_said_of_others(tmp_path):
    (page,) = write_report(told(("only",)), tmp_path)
    text = page.read_text()
    assert "foretells what was left out no better than the base alone" in text
    assert "recordings left out no better" not in text
    assert "One recording: nothing can be checked on another" in text
    assert "% at 4 % a second" in text  # as it was understood


@pytest.mark.parametrize(
    ("nothing_named", "said"),
    [(0.09, "that no effect known here explains (97 %)"),
     (0.80, "that is on no list (80 %)")],
)  # fmt: skip
def test_what_is_unexplained_is_as_sure_as_that_something_is_missing(
    nothing_named, said
):
    probable = SimpleNamespace(nothing_named=nothing_named, nothing=0.03, effects={})
    engine = SimpleNamespace(chunks=[None])
    one = SimpleNamespace(
        posterior=probable,
        engine=engine,
        names=[],
        verdict="unexplained",
        judged_by="likelihood",
        decision=SimpleNamespace(account=SimpleNamespace(effects=frozenset())),
    )
    fit = {"noise_nrmse": 0.01, "before": {"heldout_nrmse": 0.5}}
    result = {
        "fit": fit | {"after": {"heldout_nrmse": 0.2}},
        "structure": {"depends_on": {"travel": 0.9}, "period": None},
    }
    sentence = summary(result, one)
    assert said in sentence
    assert "on parts left out of it is 50 %" in sentence
    assert "It depends on travel most" in sentence
    # Where a reading corrects it all the same, what that leaves is what depends.
    one.decision.account.effects = frozenset(["slack"])
    sentence = summary(result, one)
    assert "The corrected model has slack" in sentence
    assert "(20 %)" in sentence
    assert "What that leaves depends on travel most" in sentence


def test_seven_recordings_of_5000_samples_stay_under_6_megabytes(tmp_path):
    found = told([f"r{i}" for i in range(7)], 5000)
    noise = np.random.default_rng(0).standard_normal(5000)
    found.measured = [m + 1e-3 * noise for m in found.measured]
    (page,) = write_report(found, tmp_path)
    assert page.stat().st_size < 6e6
    packed = page.read_text().split('id="series">')[1].split("<")[0]
    drawn = json.loads(gzip.decompress(base64.b64decode(packed)))
    assert [len(r["time"]) for r in drawn] == [5000] * 7


# -- in a browser ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    found = told((HOSTILE, "second"))
    after = [np.array(m) for m in found.measured]
    after[1] = 0.5 * after[1]
    (page,) = write_report(replace(found, after=after), folder)
    return page


@pytest.fixture
def opened(chromium, written):
    """The page opened from disk, no network, and the complaints of the browser."""
    context = chromium.new_context(
        viewport={"width": 1000, "height": 900}, color_scheme="light", offline=True
    )
    page, said = context.new_page(), []
    page.on("console", lambda m: said.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(written.as_uri())
    page.wait_for_selector("#picture[data-ready]")
    yield page, said
    context.close()


def drawn(page, name, axis="y"):
    return page.evaluate(
        "([n, a]) => document.getElementById('picture').data"
        ".find((t) => t.name === n)[a]",
        [name, axis],
    )


def test_seven_recordings_of_5000_samples_are_ready_at_once(chromium, tmp_path):
    """In time of the processor, which others on the machine do not lengthen much."""
    (page,) = write_report(told([f"r{i}" for i in range(7)], 5000), tmp_path)
    context = chromium.new_context(offline=True)
    one = context.new_page()
    tools = context.new_cdp_session(one)
    tools.send("Performance.enable")
    one.goto(page.as_uri())
    one.wait_for_selector("#picture[data-ready]", timeout=120_000)
    measured = tools.send("Performance.getMetrics")["metrics"]
    taken = next(m["value"] for m in measured if m["name"] == "ThreadTime")
    assert taken < READY_S
    context.close()


def test_it_opens_and_another_recording_and_axis_can_be_picked(opened):
    page, said = opened
    assert page.title().startswith("</script>")  # the name, as text
    np.testing.assert_allclose(max(drawn(page, "simulated after")), 0.4, atol=2e-3)
    page.select_option("#recording", "1")
    np.testing.assert_allclose(max(drawn(page, "simulated after")), 0.2, atol=2e-3)
    page.check("input[value=strain]")
    np.testing.assert_allclose(max(drawn(page, "measured", "x")), 0.4, atol=2e-3)
    page.click("#next")  # and round again
    assert page.input_value("#recording") == "0"
    assert said == []


def test_hover_tells_the_stress_and_a_drag_zooms(opened):
    page, said = opened
    box = page.locator("#picture .nsewdrag").first.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.wait_for_selector("#picture .hoverlayer text")
    assert "MPa" in page.locator("#picture .hoverlayer").text_content()
    reach = "document.getElementById('picture').layout.xaxis.range"
    low, high = page.evaluate(reach)
    page.mouse.down()
    page.mouse.move(middle[0] + box["width"] / 4, middle[1], steps=4)
    page.mouse.up()
    page.wait_for_function(f"{reach}[1] - {reach}[0] < {0.5 * (high - low)}")
    assert said == []


def test_it_is_dark_where_the_reader_is_and_black_on_white_on_paper(opened):
    page, _ = opened
    look = (
        "[getComputedStyle(document.body).backgroundColor,"
        " getComputedStyle(document.querySelector('#picture .xtick text')).fill]"
    )

    def lightness(colour):
        return np.mean([float(v) for v in colour[4:-1].split(",")])

    paper, ink = map(lightness, page.evaluate(look))
    assert paper > 200 > 100 > ink
    page.emulate_media(color_scheme="dark")
    paper, ink = map(lightness, page.evaluate(look))
    assert ink > 200 > 100 > paper
    page.emulate_media(color_scheme="dark", media="print")
    paper, ink = map(lightness, page.evaluate(look))
    assert paper > 200 > 100 > ink


@pytest.mark.parametrize("width", [400, 2000])
def test_it_fits_narrow_and_wide_screens(opened, width):
    page, _ = opened
    page.set_viewport_size({"width": width, "height": 900})
    # Pictures follow the window when the browser has time for them.
    page.wait_for_function(
        "width => document.documentElement.scrollWidth <= width", arg=width
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_fault(opened, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page, _ = opened
    page.emulate_media(color_scheme=scheme)
    found = axe.Axe().run(page)
    assert [v["id"] for v in found.response["violations"]] == []
