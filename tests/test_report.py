"""The report as a reader meets it: in a browser, with no network, on any screen."""

import base64
import gzip
import json
import re
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import pytest

from softnn.axes import SPECIMEN, Axes, Axis
from softnn.mismatch import words
from softnn.mismatch.case import Case
from softnn.recording import Recording
from softnn.report import write_index, write_report
from softnn.report.phrases import number, percent, plain, sure
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
    row = {"evidence": 0.0, "seconds": 0.1, "alone": True, "together": None}
    both = {"effects": ["mullins_softening", "permanent_set"], "heldout_nrmse": 0.0195}
    depth = {"value": 0.2, "low": 0.1, "high": None, "unit": "-"}
    result = {
        "case": names[0], "data_sha256": "ab", "model": "hooke", "version": 1,
        "verdict": "explained", "judged_by": "likelihood", "structure": None,
        "shows": {"few": False, "only_loading": False, "noise": False}, "nearest": None,
        "classes": [], "floor": None, "tolerance": 0.02, "action": "record",
        "selected": ["mullins_softening"], "corrected_by": ["mullins_softening"],
        "recordings": [
            {"name": name, "samples": samples, "specimen": "", "source": "",
             "understood": "20 s; strain up to 40 %", "nrmse_before": 0.11,
             "nrmse_after": 0.011} for name in names],
        "notes": ["strain was in per cent"], "software": {"Python": "3.11"},
        "mismatch": [region | {"recording": name} for name in names],
        "where": ["Unloading, strain 0.04 to 0.4: 100 % (simulation too soft)."],
        "explanations": [{
            "effect": "mullins_softening", "stage": "material", "probability": 0.95,
            "form": "MullinsSoftening", "parameters": {"depth": depth},
            "where": "on the way back", "equivalent": ["permanent_set"],
            "recordings": list(names), "nrmse_without": 0.1, "nrmse_own": [0.1, 0.01],
        }],
        "probabilities": {"nothing": 0.01, "on_no_list": 0.04},
        "fit": {"before": {"nrmse": 0.1, "heldout_nrmse": 0.12},
                "after": {"nrmse": 0.01, "heldout_nrmse": 0.02},
                "heldout_by": "recording" if len(names) > 1 else "stretch",
                "noise_nrmse": 0.0099},
        "next_recording": ADVICE,
        "candidates": [
            row | {"effect": None, "probability": 0.01, "heldout_nrmse": 0.12},
            row | {"effect": "mullins_softening", "probability": 0.95,
                   "heldout_nrmse": 0.02, "evidence": 50.0},
            row | {"effect": "permanent_set", "probability": 0.13,
                   "heldout_nrmse": 0.05, "together": both},
            row | {"effect": "cyclic_softening", "probability": 0.02,
                   "heldout_nrmse": 0.0202, "evidence": 20.0},
            row | {"effect": "slack", "probability": 0.0, "heldout_nrmse": 0.13},
        ],
        "seconds": 1.0,
    }  # fmt: skip
    case = Case(
        names[0], tuple(Recording(time, strain, measured, name=name) for name in names)
    )
    said(result)
    return Told(
        case, result, *([x] * n for x in (time, strain, measured, before, measured))
    )


ADVICE = {
    "strain_programme": "load to 40 % and back, twice, at 0.05 /s",
    "separates": ["mullins_softening", "permanent_set"],
    "why": "on reloading it is 0.2 MPa or 0.3 MPa",
    "programme": {"time_s": [0.0, 7.0, 14.0], "strain": [0.0, 0.4, 0.0]},
    "differ": 0.17,
    "specimens": 2,
    "expected": {"sure": 0.72, "gain": 0.5, "error": 0.02},
    "predictions": [
        {"if": f"if {name}", "effects": [], "probability": 0.5, "stress": [0.0, y, 0.0]}
        for name, y in (("softening", 0.2), ("set", 0.3))
    ],
    "cheap": {
        "strain_programme": "repeat first on another specimen",
        "kind": "repeat",
        "expected": {"sure": 0.4, "gain": 0.2, "error": 0.02},
    },
}


def said(result):
    """The result with its sentences made anew."""
    for row in result["candidates"]:
        row["why"] = words.reason(row, result)
    result["answer"] = words.answer(result)
    result["summary"] = words.summary(result["answer"])
    return result


def changed(**parts):
    """The result by hand with other parts, its sentences made anew."""
    result = deepcopy(told().result)
    result["fit"] |= parts.pop("fit", {})
    return said(result | parts)


def visible(page):
    """What a reader sees of a page, without what effects and parameters mean."""
    text = re.sub(
        r"<(script|style|svg|thead).*?</\1>", " ", page.read_text(), flags=re.S
    )
    text = re.sub(r'<(span|td) class="soft".*?</\1>', " ", text, flags=re.S)
    text = re.sub(r"<option.*?</option>", " ", text, flags=re.S)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text))


LABELS = {"95", "256"}  # of an interval, of a hash
FIGURE = re.compile(r"\d+(?:[.,]\d+)*(?:e[+-]?\d+)?")


def figures(value):
    """Every figure in a JSON value, in all ways in which a page prints it."""
    if isinstance(value, dict):
        return set().union(*map(figures, value.values()))
    if isinstance(value, list):
        return set().union(*map(figures, value))
    if isinstance(value, str):
        return set(FIGURE.findall(value))
    if value is None or isinstance(value, bool):
        return set()
    printed = (number(value), percent(value), sure(value), str(value))
    return set(FIGURE.findall(" ".join(printed)))


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
    assert 'data-shaded="where the named effects act' in text
    result = changed(selected=[], explanations=[], verdict="undetermined")
    text = write_report(replace(found, result=result), tmp_path)[0].read_text()
    assert "With Mullins softening, recordings not used in the fit" in text
    assert 'data-shaded="where the simulation misses more than the noise"' in text


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
    text = visible(page)
    assert "the error of the fit to all is 10 % without it, 1 % with it" in text
    # Permanent set, which would explain a little more beside softening; and slack.
    assert "Leaves 5 % alone; added to Mullins softening it leaves 1.9 % inst" in text
    assert "Leaves 13 % alone; Mullins softening leaves 2 %." in text
    # As small an error as that of softening.
    assert "its log evidence is lower by 30." in text
    assert "not determined by these recordings" in text  # an interval without an end
    assert "strain was in per cent" in text


def test_every_figure_of_a_page_is_one_of_diagnosis_json(tmp_path, softened):
    (page,) = write_report(told(), tmp_path)
    assert set(FIGURE.findall(visible(page))) <= figures(told().result) | LABELS
    result = json.loads((softened[1] / "diagnosis.json").read_text())
    shown = set(FIGURE.findall(visible(softened[1] / "report.html")))
    assert len(shown) > 50
    assert shown <= figures(result) | LABELS


def test_an_effect_has_one_probability_wherever_it_is_told(tmp_path, softened):
    for result, folder in (
        (told().result, tmp_path),
        (json.loads((softened[1] / "diagnosis.json").read_text()), softened[1]),
    ):
        if folder is tmp_path:
            write_report(told(), folder)
        text, counted = visible(folder / "report.html"), 0
        for row in result["candidates"][1:]:
            name = re.escape(plain(row["effect"]))
            said = rf"{name}(?: in [^()]*)? \(?((?:over |under )?\d+ %)"
            found = re.findall(said, text, flags=re.IGNORECASE)
            assert set(found) <= {sure(row["probability"])}
            counted += len(found)
        assert counted >= len(result["candidates"])  # the table, and the headline


def test_missing_physics_and_data_not_used_have_words_of_their_own(tmp_path):
    (page,) = write_report(told(), tmp_path)
    text = visible(page)
    for match in re.finditer("left out", text):
        assert re.search(r"(was|were) $", text[: match.start()])


def test_a_single_recording_is_judged_by_its_parts(tmp_path):
    (page,) = write_report(told(("only",)), tmp_path)
    text = visible(page)
    assert "parts not used in the fit are predicted to 2 % instead of 12 %" in text
    assert "recordings not used" not in text


def test_the_next_recording_is_drawn_with_what_each_model_predicts(tmp_path):
    (page,) = write_report(told(), tmp_path)
    assert page.read_text().count("<polyline") == 3  # the programme and two models
    text = visible(page)
    assert "if softening (50 %)" in text
    assert "if set (50 %)" in text
    assert "That settles it with a probability of 72 %" in text
    assert "Cheaper: repeat first on another specimen (40 %)" in text


def test_a_recording_whose_promise_is_unknown_is_asked_for_without_one(tmp_path):
    unknown = {"sure": None, "gain": 0.4, "error": 0.02}
    cheap = ADVICE["cheap"] | {"expected": unknown}
    result = changed(next_recording=ADVICE | {"expected": unknown, "cheap": cheap})
    assert result["answer"]["next"].endswith(
        "There the likely models differ most; whether that settles it is open. "
        "Cheaper: repeat first on another specimen."
    )
    (page,) = write_report(replace(told(), result=result), tmp_path)
    assert "Cheaper: repeat first on another specimen." in visible(page)


def test_models_that_predict_alike_are_said_to_serve_alike(tmp_path):
    alike = {"programme": None, "expected": None, "predictions": [], "cheap": None}
    result = changed(next_recording=ADVICE | alike | {"why": "they are the same"})
    assert "They are the same." in result["answer"]["next"]
    (page,) = write_report(replace(told(), result=result), tmp_path)
    assert "<polyline" not in page.read_text()


# -- the answer ------------------------------------------------------------------------


def test_the_answer_is_a_sentence_a_number_and_a_next_step():
    answer = told().result["answer"]
    assert answer["what"] == "Mullins softening (95 %) was left out."
    assert answer["error"] == (
        "With it, recordings not used in the fit are predicted to 2 % instead of 12 % "
        "(noise 0.99 %)."
    )
    assert answer["open"] == [
        "Permanent set (13 %) would do nearly as well as Mullins softening."
    ]
    assert answer["next"] == (
        "To tell Mullins softening from permanent set, record: load to 40 % and back, "
        "twice, at 0.05 /s, on 2 specimens (next_recording.csv). That settles it with "
        "a probability of 72 %. Cheaper, with 40 %: repeat first on another specimen."
    )


def test_an_effect_that_may_be_there_beside_a_sure_one_is_asked_for():
    advice = ADVICE | {"separates": ["permanent_set"]}
    answer = words.answer(told().result | {"next_recording": advice})
    assert answer["next"].startswith("To see whether permanent set is there as well, ")


@pytest.mark.parametrize(("third", "told_"), [("inertia", True), ("slack", False)])
def test_that_a_search_adds_three_effects_is_said_where_three_are_named(third, told_):
    row = {"evidence": 0.0, "heldout_nrmse": 0.1, "alone": True, "together": None}
    names = ["mullins_softening", "permanent_set", third]
    result = told().result
    (first,) = result["explanations"]
    forms = {"permanent_set": "PermanentSet", "inertia": "Inertia", "slack": "Slack"}
    more = [first | {"effect": n, "form": forms[n]} for n in names[1:]]
    result |= {"selected": names, "corrected_by": names, "judged_by": "prediction"}
    result["verdict"] = "partly_explained"
    result["explanations"] += more
    rows = [row | {"effect": n, "probability": 0.7} for n in names]
    result["candidates"] = [row | {"effect": None, "probability": 0.0}, *rows]
    said_ = " ".join(words.answer(result)["open"])
    assert "Whether a fourth effect is there" in said_
    assert ("looks for 3 such effects at most" in said_) == told_


def test_a_parameter_at_the_end_of_its_range_is_marked(tmp_path):
    found = told()
    parameters = found.result["explanations"][0]["parameters"]
    for name, value, marked in (
        ("power", 4.0, True), ("power", 3.9, False), ("viscous_share", 0.0, False)
    ):  # fmt: skip
        parameters.clear()
        parameters[name] = {"value": value, "low": 0.0, "high": value, "unit": "-"}
        parameters[name]["low"] = value - 0.1
        text = visible(write_report(found, tmp_path)[0])
        assert ("at the limit of its range" in text) == marked


def test_a_number_and_its_per_cent_sign_do_not_part(tmp_path):
    text = write_report(told(), tmp_path)[0].read_text()
    assert "95\N{NO-BREAK SPACE}%) was left out" in text


def test_a_cause_on_no_list_has_a_row(tmp_path):
    found = told()
    for chance, said_ in ((0.001, False), (0.31, True)):
        found.result["probabilities"]["on_no_list"] = chance
        text = visible(write_report(found, tmp_path)[0])
        assert ("A cause that is not on the list 31 %" in text) == said_


def test_two_effects_of_new_specimens_and_whether_there_is_a_third():
    row = {"evidence": 0.0, "heldout_nrmse": 0.1, "alone": True, "together": None}
    result = changed(
        selected=["permanent_set", "mullins_softening"],
        corrected_by=["mullins_softening", "permanent_set"],
        verdict="partly_explained",
        judged_by="prediction",
        fit={"heldout_by": "specimen"},
        candidates=[
            row | {"effect": None, "probability": 0.0},
            row | {"effect": "mullins_softening", "probability": 0.97},
            row | {"effect": "permanent_set", "probability": 0.6},
            row | {"effect": "inertia", "probability": 0.2},
        ],
    )
    assert result["summary"] == (
        "Mullins softening (97 %) was left out, and most likely permanent set (60 %). "
        "With them, new specimens are predicted to 2 % instead of 12 % (2 % is good "
        "enough). 2 % remain (2 % is good enough). Whether a third effect is there "
        "(perhaps inertia (20 %)), these recordings cannot tell."
    )


@pytest.mark.parametrize(
    ("recordings", "said"),
    [(["b"], " in b (95 %) was"), (["a", "b", "c"], " in 3 of 4 recordings (95 %) was"),
     (["a", "b", "c", "d"], "A zero offset (95 %) was")],
)  # fmt: skip
def test_a_fault_is_told_with_the_recordings_that_have_it(recordings, said):
    result = told(tuple("abcd")).result
    (one,) = result["explanations"]
    one |= {"effect": "zero_offset", "form": "ZeroOffset", "recordings": recordings}
    row = result["candidates"][1]
    row["effect"] = "zero_offset"
    result |= {"selected": ["zero_offset"], "corrected_by": ["zero_offset"]}
    assert said in words.answer(result)["what"]


@pytest.mark.parametrize(
    ("unlisted", "sentence"),
    [(0.09, "Something is missing (97 %), and no effect known to softnn explains it."),
     (0.80, "Something is missing that is not on softnn's list of effects (80 %).")],
)  # fmt: skip
def test_what_is_unexplained_is_as_sure_as_that_something_is_missing(
    unlisted, sentence
):
    bare = {
        "verdict": "unexplained", "selected": [], "explanations": [],
        "probabilities": {"nothing": 0.03, "on_no_list": unlisted},
        "structure": {"depends_on": {"travel": 0.9}, "period": None},
        "nearest": {"effect": "slack", "share": 0.4},
    }  # fmt: skip
    alone = changed(**bare, corrected_by=[])["answer"]
    assert alone["what"] == sentence
    assert "predicts recordings not used in the fit to 12 % only" in alone["error"]
    assert "slack, accounts for 40 % of the mismatch" in alone["open"][0]
    assert alone["open"][1] == "The mismatch depends most on travel."
    # Where a set of effects corrects it all the same, what that leaves is what depends.
    with_ = changed(**bare, corrected_by=["slack"])["answer"]
    assert with_["error"].startswith("With slack, recordings not used")
    assert with_["open"][1] == "What the correction leaves depends most on travel."


def test_first_loading_alone_is_not_enough():
    result = changed(
        selected=[], explanations=[], corrected_by=[], verdict="undetermined",
        shows={"few": False, "only_loading": True, "noise": False},
        action="record_unloading",
        next_recording=ADVICE | {"separates": [], "expected": None, "specimens": 1},
    )  # fmt: skip
    assert "First loading alone does not tell" in result["answer"]["what"]
    assert result["answer"]["next"] == (
        "Record: load to 40 % and back, twice, at 0.05 /s (next_recording.csv)."
    )


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
    np.testing.assert_allclose(max(drawn(page, "corrected")), 0.4, atol=2e-3)
    page.select_option("#recording", "1")
    np.testing.assert_allclose(max(drawn(page, "corrected")), 0.2, atol=2e-3)
    np.testing.assert_allclose(max(drawn(page, "measured", "x")), 0.4, atol=2e-3)
    page.check("input[value=time]")
    np.testing.assert_allclose(max(drawn(page, "measured", "x")), 20, atol=2e-3)
    page.click("#next")  # and round again
    assert page.input_value("#recording") == "0"
    assert said == []


def test_hover_tells_the_stress_and_a_drag_zooms(opened):
    page, said = opened
    page.check("input[value=time]")
    page.locator("#picture").scroll_into_view_if_needed()
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


def test_hundreds_of_cycles_that_share_a_mismatch_are_one_sentence():
    one = {"branch": "unloading", "sign": "simulation too stiff", "recording": "a"}
    one |= {"strain": [0.1, 0.5], "share": 0.003}
    assert sentences(
        [one | {"cycle": c} for c in range(300)], 1, Axis("strain", "-")
    ) == ["Unloading of cycles 0-299, strain 0.1 to 0.5: 90 % (simulation too stiff)."]
