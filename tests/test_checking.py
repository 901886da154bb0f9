"""The check of published results: what it compares, and what it says."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from bench import checking
from bench.checking import EXACT, TIMED, Checker, Tolerance, check, compare, moved
from softnn.contracts import InputError
from softnn.study.common import RESULTS
from studies.again import CHECKERS

ONE_PERCENT = Tolerance("a test", 0.01)


@pytest.mark.parametrize("file", checking.files_of(RESULTS), ids=lambda f: f.stem)
def test_each_result_has_a_checker_or_a_reason(file):
    one = CHECKERS[checking.kind_of(file.stem, CHECKERS)]
    assert bool(one.again) != bool(one.not_checked)
    assert one.tolerance.why


def test_a_result_without_a_checker_is_refused():
    with pytest.raises(InputError, match=r"walnuts-oak\.json: no checker"):
        checking.kind_of("walnuts-oak", CHECKERS)


def test_few_kinds_are_not_checked():
    assert {k for k, c in CHECKERS.items() if not c.again} == {"concealed", "scaling"}


@pytest.mark.parametrize(
    ("was", "now", "moves"),
    [
        (1.0, 1.009, False),
        (1.0, 1.011, True),
        (-1.0, 1.0, True),
        (0.0, 1e-12, False),  # rounding
        (0.0, 1e-3, True),
        (5, 6, True),
        (None, 0.1, True),
        (0.1, None, True),
        (True, True, False),
        (True, False, True),
        ("explained", "undetermined", True),
        (["slack", "inertia"], ["inertia", "slack"], False),
        (["slack"], [], True),
        ([], [], False),
    ],
)
def test_figures_move_by_more_than_their_tolerance(was, now, moves):
    found = compare({"a": was}, {"a": now}, ONE_PERCENT)
    assert found.figures == 1
    told = [{"where": "a", "was": was, "now": now}]
    assert found.moved == (told if moves else [])


def test_rows_are_compared_figure_by_figure():
    was = {"fit": {"nrmse": [0.1, 0.2], "seconds": 5.0}, "name": "NR", "gone": 1.0}
    now = {"fit": {"nrmse": [0.1, 0.3], "seconds": 50.0}, "name": "NR", "new": 2.0}
    found = compare(was, now, ONE_PERCENT, "row 1")
    # Two errors, a name, and one that is gone; no time, and nothing that is new.
    assert found.figures == 4
    assert [m["where"] for m in found.moved] == ["row 1, fit, nrmse[1]", "row 1, gone"]
    # A list of another length has moved as a whole.
    assert len(compare([1.0, 2.0], [1.0], ONE_PERCENT).moved) == 2


def test_times_are_compared_within_a_factor():
    assert not compare(1.0, 1.9, TIMED).moved
    assert not compare(1.0, 0.6, TIMED).moved
    assert compare(1.0, 2.1, TIMED).moved
    assert compare(1.0, 0.4, TIMED).moved


def rows(result, rng):
    """Three rows of numbers, one of which is another now."""
    for i in rng.permutation(3):
        yield f"row {i}", {"a": result["a"][i]}, {"a": 1.0}


def fails(result, rng):
    yield "row", 1.0, 1.0
    raise ZeroDivisionError("oh")


def absent(result, rng):
    raise InputError("no recordings here")
    yield


@pytest.fixture
def results(tmp_path):
    for name in ("good-one", "bad", "not_here", "never"):
        content = {"study": name, "a": [1.0, 1.0, 2.0], "made": "2026-01-02"}
        content |= {"commit": "0123abc", "versions": {"softnn": "0.1.0"}}
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    (tmp_path / "ledger.json").write_text("{}")
    return tmp_path


KINDS = {
    "good": Checker(rows),
    "bad": Checker(fails),
    "not_here": Checker(absent),
    "never": Checker(not_checked="it takes a year"),
}


def checked(results: Path, minutes: float = 1.0) -> dict:
    files = checking.files_of(results)
    said: list[str] = []

    def done(name, one):
        said.append(checking.line(name, one))

    found = check(files, KINDS, minutes, 0, 1, done)
    assert len(said) == len(found) == 4
    return found


def test_every_file_is_checked_and_one_that_fails_stops_no_other(results):
    found = checked(results)
    good = found["good-one"]
    assert (good["rows"], good["figures"]) == (3, 3)
    assert good["moved"] == [{"where": "row 2, a", "was": 2.0, "now": 1.0}]
    assert "not_checked" not in good
    assert found["bad"]["not_checked"] == "failed with ZeroDivisionError: oh"
    assert found["not_here"]["not_checked"] == "no recordings here"
    assert found["never"]["not_checked"] == "it takes a year"
    assert checking.headline_of(found) == {
        "files": 4,
        "files_checked": 1,
        "rows": 4,
        "figures": 4,
        "figures_moved": 1,
    }
    table = checking.table(found)
    assert "row 2, a" in table
    assert "it takes a year" in table


def test_without_time_one_row_is_checked_all_the_same_and_the_seed_says_which(results):
    found = [
        checking.check_file(results / "good-one.json", KINDS["good"], 0.0, seed)
        for seed in (0, 0, 1, 2, 3, 4)
    ]
    assert {one["rows"] for one in found} == {1}
    assert found[0]["moved"] == found[1]["moved"]
    assert len({str(one["moved"]) for one in found}) == 2


def test_a_page_says_which_figures_moved_until_the_result_is_made_anew(results):
    assert moved(results, "good-one") == ""  # never checked
    (results / "checked.json").write_text(json.dumps({"files": checked(results)}))
    said = moved(results, "good-one", "bad", "never")
    assert said.startswith("**1 of 3 figures of `good-one.json` that were computed")
    assert f"by more than {EXACT} " in said
    assert moved(results, "bad") == ""
    file = results / "good-one.json"
    new = json.loads(file.read_text()) | {"commit": "fedc987"}
    file.write_text(json.dumps(new))
    assert moved(results, "good-one") == ""


def test_misses_of_a_trial_are_listed_and_other_cases_were_right():
    from studies.again import named

    miss = {"case": "a", "selected": ["slack"], "verdict": "explained", "cls": "null"}
    trial = {"misses": [miss]}
    wrong = {"selected": ["slack"], "verdict": "explained"}
    assert named(trial, "a", "null", ()) == wrong
    right = {"selected": [], "verdict": "nothing_missing"}
    assert named(trial, "b", "null", ()) == right
    assert named(trial, "b", "single", ["inertia"]) == {"selected": ["inertia"]}


def test_a_sweep_over_neurons_is_checked_on_folds_never_seen_too():
    from studies.again import rows_of

    judged = {"random": {"split": "random"}, "rate": {"split": "rate"}}
    judged["specimen"] = {"not_possible": "one specimen"}
    swept = {"grid": [{"split": "random"}], "networks": {"few": judged}}
    assert [r["split"] for r in rows_of(swept)] == ["random", "random", "rate"]
    assert rows_of({"trials": [1, 2], "front": [3]}) == [1, 2]


def test_cases_of_other_hands_are_those_that_were_forged(tmp_path):
    from bench.hands import forging

    counts = {"nulls": 1, "singles": 1, "pairs": 0, "aliens": 0}
    forging.forge(tmp_path / "all", seed=3, side="development", **counts)
    place = tmp_path / "one"
    jobs = forging.ordered(place, 3, "development", (1, 1, 0, 0, 0, 0))
    name = forging.make(jobs[1])
    for file in sorted((place / "cases" / name).rglob("*.csv")):
        same = tmp_path / "all" / file.relative_to(place)
        assert file.read_bytes() == same.read_bytes()


def test_rows_of_a_published_result_come_out():
    """The cheapest of the real checkers: constants of the code, a study of seconds."""
    for name in ("calibration", "virtual_specimens"):
        result = json.loads((RESULTS / f"{name}.json").read_text())
        checker = CHECKERS[name]
        where, was, now = next(checker.again(result, np.random.default_rng(0)))
        found = compare(was, now, checker.tolerance, where)
        assert found.figures > 10
        assert not found.moved
        # It can fail: a figure of another value is found.
        spoilt = json.loads(json.dumps(was).replace("0.4", "0.5"))
        assert spoilt != was
        assert compare(spoilt, now, checker.tolerance, where).moved


def test_a_result_is_stale_when_its_code_changed_since(tmp_path):
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]

    def git(*words):
        done = subprocess.run(
            ["git", "-C", str(tmp_path), *who, *words],
            check=True, capture_output=True, text=True,
        )  # fmt: skip
        return done.stdout.strip()

    def commit(name):
        file = tmp_path / "softnn" / name / "a.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"{name} = {len(git('log', '--format=%h', '--all'))}\n")
        git("add", ".")
        git("commit", "-qm", name)
        return git("rev-parse", "--short", "HEAD")

    git("init", "-q")
    first = commit("neural")
    checkers = {
        "inputs": Checker(tolerance=checking.TRAINED),
        "rates": Checker(),
        "lost": Checker(),
    }
    files = []
    for name, made in (
        ("inputs", first),
        ("rates", f"{first}-dirty"),
        ("lost", "0bad"),
    ):
        files.append(tmp_path / f"{name}.json")
        files[-1].write_text(json.dumps({"commit": made}))
    assert checking.stale(files, checkers, tmp_path) == [("lost", "0bad", "unknown")]
    second = commit("neural")
    assert checking.stale(files[:2], checkers, tmp_path) == [("inputs", first, second)]
    third = commit("virtual.py")
    found = checking.stale(files[:2], checkers, tmp_path)
    assert found[1] == ("rates", first, third)
    assert not checking.stale(
        files, dict.fromkeys(checkers, Checker(tolerance=TIMED)), tmp_path
    )
