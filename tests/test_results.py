"""Figures in studies/results are of today's code, or said to be of older code."""

import json
from pathlib import Path

import pytest

from bench.proof.page import older
from softnn.study.code import files_of
from softnn.study.common import RESULTS, code_of
from studies import pictures

OLDER = Path(__file__).with_name("older_results.txt")  # a name a line
NOT_OURS = {"ledger"}  # a book of what was opened, not a figure


def stale() -> set[str]:
    found = set()
    for file in sorted(RESULTS.glob("*.json")):
        if older(json.loads(file.read_text(encoding="utf-8"))):
            found.add(file.stem)
    return found - NOT_OURS


def test_no_figure_is_of_older_code_unsaid():
    unsaid = stale() - set(OLDER.read_text(encoding="utf-8").split())
    assert not unsaid, (
        f"{sorted(unsaid)} in studies/results are not of today's code: run their "
        f"studies again, or, until that is done, add their names to {OLDER.name}"
    )


def test_no_figure_is_said_to_be_older_that_is_not():
    fresh = set(OLDER.read_text(encoding="utf-8").split()) - stale()
    assert not fresh, f"take {sorted(fresh)} out of {OLDER.name}"


def test_the_files_of_a_study_are_those_that_it_runs():
    names = {"/".join(f.parts[-2:]) for f in files_of("studies.architectures")}
    assert {"neural/levenberg.py", "architectures/trials.py"} <= names
    assert {"models/fit_piecewise.py", "softnn/crossval.py"} <= names
    assert not {"architectures/page.py", "softnn/tracking.py"} & names
    assert not any("mismatch" in name for name in names)


def test_a_package_that_imports_all_it_holds_is_followed():
    names = {f.name for f in files_of("studies.limits")}
    assert {"mullins_softening.py", "engine.py"} <= names


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ('"""Other words."""\n\n# a remark\ndef f():\n    return  1\n', True),
        ('"""Words."""\n\ndef f():\n    "What."\n    return 1\n', True),
        ('"""Words."""\n\ndef f():\n    return 2\n', False),
    ],
)
def test_words_do_not_count_but_numbers_do(tmp_path, text, same):
    one = tmp_path / "a.py"
    one.write_text('"""Words."""\n\ndef f():\n    return 1\n')
    before = code_of([one], words=False)
    two = tmp_path / "b.py"
    two.write_text(text)
    assert (code_of([two], words=False) == before) is same


@pytest.mark.parametrize("panel", pictures.PANELS)
def test_the_picture_of_the_readme_has_a_mark_of_every_model(panel):
    drawn = {m: pictures.errors(panel, m) for m in pictures.MARKS}
    del drawn["network, fewest needed"]  # where fewer do as well
    assert all(drawn.values())
