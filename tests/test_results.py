"""What a result file says of how it was made, and the picture drawn from it."""

import json
import subprocess

import pytest

import softnn
from softnn.study import common
from softnn.study.common import RESULTS, code_of, write_result
from studies import pictures

FILES = sorted(RESULTS.glob("*.json"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_a_result_says_how_it_was_made(file):
    if file.stem == "ledger":
        return  # a list of openings, each with its own commit
    found = json.loads(file.read_text(encoding="utf-8"))
    assert {"made", "commit", "versions", "seed", "data"} <= set(found)
    assert "unknown" not in common.made_with(found)
    assert "made_by_code" not in found


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A git checkout of one file, in the place of softnn."""
    (tmp_path / "softnn").mkdir()
    file = tmp_path / "softnn" / "__init__.py"
    file.write_text("a = 1\n")
    monkeypatch.setattr(softnn, "__file__", str(file))
    monkeypatch.setattr(common, "commit", common.commit.__wrapped__)
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    for words in (["init", "-q"], ["add", "."], [*who, "commit", "-qm", "first"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    return tmp_path


def test_a_result_has_the_commit_and_says_where_code_differs(checkout):
    def written():
        path = write_result("n", {}, {}, folder=checkout / "out")
        return json.loads(path.read_text())["commit"]

    words = ["git", "rev-parse", "--short", "HEAD"]
    head = subprocess.run(words, cwd=checkout, capture_output=True, text=True)
    assert written() == head.stdout.strip()  # a new file is no change of the code
    (checkout / "softnn" / "__init__.py").write_text("a = 2\n")
    assert written() == head.stdout.strip() + "-dirty"


def test_results_and_pages_that_a_study_writes_do_not_make_the_code_dirty(checkout):
    for name in ("studies/results", "docs"):
        (checkout / name).mkdir(parents=True)
        (checkout / name / "a").write_text("1")
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    for words in (["add", "."], [*who, "commit", "-qm", "second"]):
        subprocess.run(["git", *words], cwd=checkout, check=True)
    (checkout / "studies" / "results" / "a").write_text("2")
    (checkout / "docs" / "a").write_text("2")
    assert "dirty" not in str(common.commit())


def test_without_a_checkout_there_is_no_commit_and_no_error(tmp_path, monkeypatch):
    monkeypatch.setattr(softnn, "__file__", str(tmp_path / "softnn" / "__init__.py"))
    monkeypatch.setattr(common, "commit", common.commit.__wrapped__)
    path = write_result("n", {}, {}, folder=tmp_path / "out")
    assert "commit" not in json.loads(path.read_text())
    monkeypatch.setenv("PATH", "")  # nor git
    assert common.commit() is None


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ('"""Other words."""\n\n# a remark\ndef f():\n    return  1\n', True),
        ('"""Words."""\n\ndef f():\n    "What."\n    return 1\n', True),
        ('"""Words."""\n\ndef f():\n    return 2\n', False),
    ],
)
def test_a_store_goes_on_after_other_words_but_not_after_other_numbers(
    tmp_path, text, same
):
    one, two = tmp_path / "a.py", tmp_path / "b.py"
    one.write_text('"""Words."""\n\ndef f():\n    return 1\n')
    two.write_text(text)
    assert (code_of([two]) == code_of([one])) is same


@pytest.mark.parametrize("panel", pictures.PANELS)
def test_the_picture_of_the_readme_has_a_mark_of_every_model(panel):
    drawn = {m: pictures.errors(panel, m) for m in pictures.MARKS}
    del drawn["network, fewest needed"]  # where fewer do as well
    assert all(drawn.values())
