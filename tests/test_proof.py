"""The page of the proof says what the result files say, and nothing else."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from bench import cost, ledger, scoring
from bench.limits import reporting as limits_report
from bench.proof import concealed, limits, make, others, page
from bench.reporting import publish
from bench.rivals import table as rivals_table
from bench.scoring import Rate, Truth
from bench.trials import reporting
from softnn.json_file import plain
from softnn.study import common


def write(folder: Path, name: str, content: dict) -> None:
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(plain(content)))


MADE = {"made": "2026-11-23", "softnn": "0.1.0", "commit": "0123abc"}
SAID = "Made with softnn 0.1.0 at commit 0123abc, 2026-11-23."


def trial(strength: float, right: int) -> dict:
    one, none = Rate(right, 40).entry(), Rate(0, 0).entry()
    hidden = {"accepted": Rate(31, 40).entry(), "named": Rate(29, 31).entry()}
    return {
        "record": {
            "strength": strength,
            "seed": 10007,
            "cases": 61,
            "key_sha256": "abcdef0123456789" * 4,
            **MADE,
        },
        "all": {
            "naming": {"single": one, "null": Rate(20, 21).entry()},
            "effects": {"slack": one},
        },
        "bars": [
            {"key": "a", "what": "one effect", "bar": 0.95, "met": False, **one},
            {"key": "b", "what": "two", "bar": 0.85, "met": None, **none},
            {"key": "c", "what": "F1", "bar": 0.8, "met": True, "rate": 0.87654},
        ],
        "concealment": {
            "accepted_below_nrmse": 0.05,
            "groups": {"single": {**hidden, "right": Rate(28, 31).entry()}},
        },
        "misses": [
            {"effects": ["slack"], "cls": "single", "cause": "nothing named"},
            {"effects": [], "cls": "null", "cause": "something named"},
            {"effects": ["slack", "inertia"], "cls": "pair", "cause": "one found"},
        ],
    }


def limits_found() -> dict:
    rows = [
        {
            "effect": effect,
            "strength": strength,
            "level": 0.005,
            "colour": "white",
            "number": number,
            "verdict": "explained" if named else "nothing_missing",
            "selected": [effect] if named else [],
            "named": named,
            "right": named or effect == "null",
            "oracle": None if effect == "null" else 0.95,
            "energy": None if effect == "null" else 1000 * strength**2,
            "samples": 1000,
            "seconds": 1.0,
            "error": None,
        }
        for effect in ("slack", "null")
        for strength in (0.1, 1.0)
        for number in range(4)
        for named in [effect != "null" and strength > number * 0.3]
    ]
    found = limits_report.summarise(rows)
    grid = {"effects": ["slack"], "strengths": [0.1, 1.0], "levels": [0.005]}
    record = {"grid": grid | {"colours": ["white"], "cases": 4}, "cases": 16}
    return {"headline": limits_report.headline_of(found), "record": record, **found}


def cost_found() -> dict:
    rows = [
        {"curve": c, "planted": "", "count": n, "seconds": 0.004 * n, "read_s": 0.1}
        for c in ("samples", "unthinned", "effects")
        for n in (500, 1000)
    ]
    curves = {c: cost.curve_of(rows, c) for c in ("samples", "unthinned", "effects")}
    headline = {
        "seconds_of_7_by_1000": 4.0,
        "slope_samples": 0.43,
        "slope_samples_unthinned": 0.98,
        "slope_effects": None,
        "search_samples": 1000,
        "report_samples": 6000,
    }
    return {"headline": headline, "machine": "x, 2 cores", "curves": curves}


def rivals_found() -> dict:
    errors = {"base": 0.2, "softnn": 0.1, "trees": 0.4}
    row = {"set": "foam", "group": "a", "split": "rate", "label": "1 /s"}
    row |= {"outside": False, "errors": errors | {"best_law": 0.3, "best_rival": 0.4}}
    return {
        "predictions": [row],
        "summary": rivals_table.summary([row]),
        "methods": {"trees": "boosted trees", "softnn": "softnn"},
        "recordings_study": MADE,
        **MADE,
    }


def copy_of(name: str, fault: str, found: bool = False, there: bool = False) -> dict:
    told = {"set": name, "group": "a", "fault": fault, "found": found}
    told |= {"there_before": there, "said": [f"not {fault}"]}
    return told | {"left": {"film": 0.0121, "tape": 0.0888}[name]}


def recordings_found() -> dict:
    row = {
        "set": "foam",
        "group": "a",
        "kind": "split",
        "base": "pl-wiechert",
        "split": "specimen",
        "label": "4, 5",
        "selected": ["mullins_softening"],
        "verdict": "explained",
        "missed": ["permanent_set"],
        "named_though_absent": [],
        "agrees": False,
        "unseen": {"before": 0.21, "after": 0.0371},
        "bars_met": True,
        "outside": False,
    }
    beyond = {"group": "b", "bars_met": False, "outside": True}
    material = [{"set": "foam", "group": "a", "bars": {"nrmse": 0.04, "ratio": 0.25}}]
    material += [{"set": "foam", "group": "b", "bars": {"nrmse": 0.035}}]
    head = {"groups": 12, "groups_judged": 9, "groups_in_agreement": 7}
    head |= {"bars": 6, "bars_met": 5, "sure_names": 4, "sure_names_excluded": 1}
    head |= {"cycles_from_first_loading_nrmse_before_median": 0.3}
    head |= {"cycles_from_first_loading_nrmse_after_median": None}
    faults = {
        "by_fault": {"slack": Rate(9, 10).entry()},
        "by_fault_seen": {"slack": Rate(8, 9).entry()},
        "by_fault_found_of_seen": {"slack": Rate(7, 8).entry()},
        "found": Rate(9, 10).entry(),
        "seen_by_oracle": Rate(8, 9).entry(),
        "found_of_seen": Rate(7, 8).entry(),
        "with_a_false_name": Rate(0, 10).entry(),
        "new_without_a_fault": Rate(1, 4).entry(),
        **MADE,
        "close": 0.05,
        "found_where_close": Rate(8, 8).entry(),
        "copies": [copy_of("film", "lag", True), copy_of("tape", "slip", True)],
    }
    faults["copies"] += [copy_of("film", "lag"), copy_of("tape", "lag")]
    faults["copies"] += [copy_of("tape", "slip"), copy_of("tape", "clip", there=True)]
    rows = [row, {**row, "base": "hooke"}, {**row, "kind": "all", "unseen": {}}]
    rows.append({**row, **beyond})
    return {"headline": head, "rows": rows, "faults": faults, "literature": material}


def test_nothing_has_been_run(tmp_path):
    text = make.make(tmp_path / "results", tmp_path / "docs").read_text()
    text += (tmp_path / "docs" / "proof-hands.md").read_text()
    for command in page.COMMANDS.values():
        assert f"Not run: `{command}`." in text
    assert "![" not in text


def test_the_page_quotes_the_results(tmp_path):
    results, docs = tmp_path / "results", tmp_path / "docs"
    write(results, "concealed", {"trials": {"x": trial(0.3, 34), "y": trial(1.0, 37)}})
    write(results, "limits", limits_found())
    write(results, "cost", cost_found())
    write(results, "rivals", rivals_found())
    write(results, "recordings", recordings_found())
    text = make.make(results, docs).read_text()
    assert "Not run" not in text
    cells = [re.sub(r" +", " ", line) for line in text.splitlines()]
    # 37 and 34 of 40, the stronger first.
    found = ("one effect", "92 % (80 to 97)", "85 % (71 to 93)")
    assert "| {} | {} | 0.95, missed | {} | 0.95, missed |".format(*found) in cells
    assert "| F1 | 0.877 | 0.8, met | 0.877 | 0.8, met |" in cells
    assert "| two | - | - | - | - |" in cells
    assert "in 31 of 40 cases with one effect" in text
    assert "named the effect in 94 % (79 to 98)" in text
    assert "`abcdef0123456789...`" in text
    assert "| two effects | one found | 1 |" in cells
    # All four at strength 1, one at 0.1: 5 of 8, over a power of 0.95.
    assert any(c.startswith("| slack | 0.66 (") for c in cells)
    assert "| strength 0.1 | 25 % | 95 % | 0.26 |" in cells
    assert "| noise of 0.5 % | 62 % | 95 % | 0.66 |" in cells
    assert "names 0.66 of what the oracle sees; 0 of 1 effects" in text
    assert "takes 4.0 s (x, 2 cores)" in text
    assert "0.98 when every sample is used, and - with the effects" in text
    # Twice the error of softnn's base, four times that of softnn itself.
    assert "| boosted trees | 40.0 % | 4.00 | 4.00 to 4.00 | 0 of 1 | 0 of 1 |" in cells
    assert "No rival is ahead of softnn by the geometric mean." in text
    assert text.index("boosted trees") < text.index("| foam a ")  # the first table
    assert "| foam a rate 1 /s | 20.0 % |" in (docs / "rivals.md").read_text()
    named, lost = "mullins_softening | 21.00 % | 3.71 %", "no: no permanent_set"
    assert [c for c in cells if c.startswith("| foam")] == [
        f"| foam a | specimen 4, 5 | {named} | 4.0 % and 25 % of the base's, met | "
        f"{lost} |",
        f"| foam b | specimen 4, 5 * | {named} | 3.5 %, missed | {lost} |",
    ]
    assert (
        "| slack | 9 of 10 (60 to 98 %) | 8 of 9 (57 to 98 %) | 7 of 8 (53 to 98 %) |"
        in (cells)
    )
    assert "| a new name, one recording less | 1 of 4 (5 to 70 %) | - | - |" in cells
    assert f"beside the effects of the material. {SAID}" in text
    assert "Strength 0.3, seed 10007: 61 cases" in text
    assert text.count(SAID) == 5  # two trials, the rivals twice, the made faults
    assert "range. There 100 % (68 to 100) of 8 faults were found." in text
    lost = [c for c in cells if c.startswith(("| film a", "| tape a"))]
    assert lost == [  # what is least explained first
        "| tape a | 8.88 % | lag: not lag; slip: not slip |",
        "| film a | 1.21 % | lag: not lag |",
    ]
    assert "in 7 of them. Of 6 predictions with a bar (the largest error" in text
    assert "with an error of 30.00 %; with the named effects it is - (" in text
    shown = re.findall(r"!\[.+?\]\((.+?)\)", text)
    assert len(shown) == 3
    assert all((docs / s).stat().st_size > 3000 for s in shown)
    again = tmp_path / "again"
    assert make.make(results, again).read_text() == text
    for s in shown:  # the same results are the same files
        assert (again / s).read_bytes() == (docs / s).read_bytes()


def test_the_page_of_other_hands_quotes_the_results(tmp_path):
    results, docs = tmp_path / "results", tmp_path / "docs"
    told = {"verdict": "explained", "selected": ["slack"]}
    told["explanations"] = [{"effect": "slack", "probability": 0.95}]
    truths = [Truth(str(i), "single", ("slack",), 900, noise="pink") for i in range(3)]
    truths += [Truth("n", "null"), Truth("f", "single", ("slack",), 9)]
    scores = scoring.summary([scoring.row(t, told) for t in truths])
    record = {"generator": "hands", "label": "held-out", "seed": 7, "cases": 5}
    record |= {"key_sha256": "abcdef0123456789" * 4, **MADE}
    record["opened_before"] = ["2026-01-01, held-out"]
    bars = reporting.bars(scores, record)
    one = {"record": record, "bars": bars, **scores}
    write(results, "hands", {"trials": {"held-out": one}})
    opening = {
        "trial": "x",
        "opened": "2026-01-02",
        "what": "held-out",
        "commit": "0123abc",
    }
    opening |= {"generator": "hands", "side": "held-out", "seed": 7}
    opening |= {"counts": {"single": 4, "null": 1}, "right": {"single": "4 of 4"}}
    ledger.enter(opening, results)
    ledger.enter(opening | {"trial": "y"}, results)  # the same draw again is not fresh
    other = opening | {"trial": "z", "seed": 8, "right": {"single": "2 of 6"}}
    ledger.enter(other, results)
    ledger.enter(other | {"trial": "dead", "seed": 9, "undiagnosed": 5}, results)
    ledger.enter(other | {"trial": "dev", "side": "development"}, results)
    make.make(results, docs)
    text = re.sub(r" +", " ", (docs / "proof-hands.md").read_text())
    assert "5 cases, seed 7 (1 null, 4 single)" in text
    assert SAID in text
    assert "**Opened before** (2026-01-01, held-out)" in text
    # Three that can be seen, one that cannot; the null got a name.
    alone = "| one effect: it and nothing else | 3 of 3 (44 to 100 %) | 0.92 | yes |"
    assert alone in text
    assert "| nothing: nothing_missing | 0 of 1 (0 to 79 %) | 0.98 | no |" in text
    assert "| others | single | 1 of 1 (21 to 100 %) | 0 of 1 (0 to 79 %) |" in text
    assert "| pink | single | 3 of 3 (44 to 100 %) |" in text
    assert "| 0.9 | 0.95 | 4 of 5 (38 to 96 %) |" in text
    assert (
        "| 2026-01-02 | hands | held-out | 7 | held-out | 5 | single 4 of 4 | 0123abc |"
        in text
    )
    fresh = "| 7 | 0123abc | 4 of 4 |\n| 8 | 0123abc | 2 of 6 |\n"
    fresh += "| together | | 60 % (31 to 83) |"
    assert fresh in text
    for name in ("naming", "reliability"):
        assert (docs / f"figures/proof-hands-{name}.png").stat().st_size > 3000
    assert "(proof-hands.md)" in (docs / "proof.md").read_text()


@pytest.mark.parametrize("missing", ["concealment", "effects"])
def test_older_results_are_read_too(missing, tmp_path):
    one = trial(1.0, 37)
    if missing == "concealment":
        del one["concealment"]
    else:
        one["all"]["effects"] = {}
    write(tmp_path / "results", "concealed", {"trials": {"y": one}})
    text = make.make(tmp_path / "results", tmp_path).read_text()
    assert ("looks good by eye" in text) == (missing != "concealment")


def test_kinds_that_a_law_was_written_for_are_counted_apart():
    kinds = {
        "thixotropy": (3, 4),
        "one_way_flow": (4, 4),
        "hum": (5, 5),
        "tack": (4, 5),
    }
    found = trial(0.3, 30) | {"aliens": {k: Rate(*v).entry() for k, v in kinds.items()}}
    said = concealed.strangers_sentence(found)
    assert share_in(said) == ["88 % (53 to 98) of 8", "90 % (60 to 98) of 10"]
    only = {"hum": Rate(5, 5).entry()}
    assert concealed.strangers_sentence(found | {"aliens": only}) == ""


def share_in(text: str) -> list[str]:
    return re.findall(r"\d+ % \([^)]*\) of \d+", text)


def test_bases_stand_in_one_order_whichever_ran_last():
    one = {"groups_in_agreement": 1, "groups_judged": 2, "bars_met": 0, "bars": 0}
    one |= {f"unseen_nrmse_{k}_median": None for k in ("before", "after")}
    one |= {"commit": "0123abc"}
    said = others.bases({name: one for name in ("sls", "pl-wiechert", "hooke")})
    assert re.findall(r"^\| ([a-z-]+) +\|", said, re.M)[1:] == [
        "hooke",
        "sls",
        "pl-wiechert",
    ]


def test_the_closed_loop_is_told_with_what_was_promised(tmp_path):
    def arm(right, of):
        rates = {"settled": right, "right": right, "wrong": of - right}
        return {k: Rate(n, of).entry() for k, n in rates.items()}

    rows = [{"of": "held_out", "left_out": "the verdict is good_enough"}] * 3
    told = {
        "cases": 7,
        "open": 4,
        "arms": {"asked": arm(3, 4), "random": arm(1, 4)},
        "promised": [{"promised": 0.8, "came": Rate(3, 4).entry()}],
    }
    write(tmp_path / "results", "loop", {"told": told, "rows": rows})
    make.make(tmp_path / "results", tmp_path / "docs")
    text = (tmp_path / "docs" / "proof-hands.md").read_text()
    assert "7 cases" in text
    assert "the verdict is good enough (3)" in text
    (asked,) = (row for row in text.splitlines() if "| the recording asked for" in row)
    assert re.findall(r"(\d+) % \(", asked) == ["75", "75", "25"]
    assert "80 % promised, 75 %" in text
    assert (tmp_path / "docs/figures/proof-loop.png").stat().st_size > 3000


def test_lists_of_equivalents_are_told_where_something_is_named():
    some = {"rate": 0.25, "of": 8}
    told = limits.lists_sentence({"with_a_list": some, "mean_length": 0.5})
    assert "empty in 75 % of 8 cases and has 0.5 effects" in told
    none = {"rate": None, "of": 0}
    assert limits.lists_sentence({"with_a_list": none, "mean_length": None}) == ""


def test_a_section_says_which_commit_made_its_result(tmp_path):
    told = {"made": "2026-01-02", "commit": "fedc987", "versions": {"softnn": "0.2"}}
    write(tmp_path / "results", "cost", told)
    made = page.Page(tmp_path / "results", tmp_path)
    made.section("What it costs", "cost", lambda page, result: None)
    said = "Made with softnn 0.2 at commit fedc987, 2026-01-02."
    assert made.parts[-1] == said
    # Without a checkout there is no commit, and the page does not fail.
    write(tmp_path / "results", "cost", {"made": "2026-01-02"})
    made.section("What it costs", "cost", lambda page, result: None)
    assert "at commit unknown, 2026-01-02" in made.parts[-1]


def test_each_trial_of_a_file_says_its_own_commit(tmp_path, monkeypatch):
    monkeypatch.setattr(common, "RESULTS", tmp_path)
    head = {"weak/single": 0.9, "strong/single": 0.1}
    before = {"weak": trial(0.3, 34), "strong": trial(1.0, 3)}
    write(tmp_path, "concealed", {"headline": head, "trials": before})
    now = trial(1.0, 37)
    now["record"] |= {"commit": "fedc987", "made": "2026-11-28"}
    record = {"label": "strong", "published": True, "seed": 10007, "key_sha256": "ab"}
    publish("concealed", record, {"strong/single": 0.95}, now, tmp_path / "elsewhere")
    written = json.loads((tmp_path / "concealed.json").read_text())
    assert written["headline"] == {"weak/single": 0.9, "strong/single": 0.95}
    make.make(tmp_path, tmp_path / "docs")
    text = (tmp_path / "docs" / "proof.md").read_text()
    weak, strong = (
        next(line for line in text.splitlines() if line.startswith(f"Strength {s},"))
        for s in ("0.3", "1")
    )
    assert SAID in weak
    assert "at commit fedc987, 2026-11-28." in strong


def test_what_is_not_published_leaves_the_results_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(common, "RESULTS", tmp_path / "project")
    record = {"label": "a", "published": False, "seed": 1, "key_sha256": "ab"}
    publish("concealed", record, {}, trial(1.0, 3), tmp_path / "run")
    assert (tmp_path / "run" / "concealed.json").exists()
    assert not (tmp_path / "project").exists()


def test_an_opening_of_a_run_that_is_not_published_counts(tmp_path):
    opening = {"opened": "2026-01-02", "what": "held-out", "right": {}, "counts": {}}
    opening |= {"generator": "hands", "side": "held-out", "seed": 7}
    mine, project = tmp_path / "mlruns", tmp_path / "project"
    assert not ledger.enter(opening | {"trial": "x"}, mine, [project])["opened_before"]
    # The same opening, published later, is no second one; another trial is.
    both = [mine, project]
    assert not ledger.enter(opening | {"trial": "x"}, project, both)["opened_before"]
    again = ledger.enter(opening | {"trial": "y"}, project, both)["opened_before"]
    assert again == ["2026-01-02, held-out"]
