"""The small table of README.md: how often softnn is right, and how often it is not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from bench.proof.others import BASE
from bench.recordings.history import WORSE
from bench.reporting import between
from softnn.study.common import made_with, markdown, percent

MARK = "<!-- made by python -m studies.proof -->"
OTHERS = {  # classes of cases made by somebody else, in the words of a reader
    "single": "one effect concealed: it is named, and nothing else",
    "pair": "two effects concealed: both are named, and nothing else",
    "null": 'nothing concealed: "nothing is missing"',
    "alien": "an effect that softnn does not know: no name",
}


def table(results: Path) -> str:
    """Rows on real recordings, then on cases in which others concealed effects."""
    real, rivals, hands = (
        json.loads((results / f"{name}.json").read_text(encoding="utf-8"))
        for name in ("recordings", "rivals", "hands")
    )
    trial = hands["trials"]["by-others"]
    rows = [*on_real(real), *beside(rivals), *on_concealed(trial)]
    made = (
        f"Recordings: {made_with(real)} Other methods: {made_with(rivals)} "
        f"Concealed: {made_with(trial['record'])}"
    )
    return f"{markdown(['', 'result'], rows)}\n\n{made}"


def on_real(real: dict[str, Any]) -> list[list[str]]:
    """Errors on recordings that no fit used, names against the literature, faults."""
    unseen = [
        (r["unseen"]["before"], r["unseen"]["after"])
        for r in real["rows"]
        if r["kind"] == "split" and r["base"] == BASE and r["unseen"]
    ]
    before, after = np.transpose(unseen)
    head = real["headline"]
    worse = int(np.sum(after > WORSE * before))
    rows = [
        [
            f"real recordings: median error of {len(unseen)} predictions",
            f"{percent(float(np.median(after)), 1)} corrected, "
            f"{percent(float(np.median(before)), 1)} before",
        ],
        [
            "... predictions that the correction makes worse by more than a tenth",
            f"{worse} of {len(unseen)}",
        ],
        [
            "... groups in which the names agree with the literature",
            f"{head['groups_in_agreement']} of {head['groups_judged']}",
        ],
        [
            "... names given at 90 % or more; excluded by the literature",
            f"{head['sure_names']}; {head['sure_names_excluded']}",
        ],
    ]
    faults = real.get("faults")
    if (
        faults and faults["commit"] == real["commit"]
    ):  # those of an older engine are not
        found, false = faults["found"], faults["with_a_false_name"]
        words = "... faults put into copies: found; copies with a false name"
        if "found_of_seen" in faults:
            found = faults["found_of_seen"]
            words = "... faults that can be found: found; copies with a false name"
        told = f"{found['right']} of {found['of']}; {false['right']} of {false['of']}"
        rows.append([words, told])
    return rows


def beside(rivals: dict[str, Any]) -> list[list[str]]:
    """The rival that is nearest, of those that a user would pick."""
    head = rivals["headline"]
    ids = [k.removesuffix("/ratio") for k in head if k.endswith("/ratio")]
    near = min(
        set(ids) - {"softnn", "best_law", "best_rival"},
        key=lambda k: head[f"{k}/ratio"],
    )
    name = rivals["methods"][near] if isinstance(rivals["methods"], dict) else near
    low, high = head[f"{near}/ratio_low"], head[f"{near}/ratio_high"]
    return [
        [
            f"... the best other method ({name}): times softnn's error",
            f"{head[f'{near}/ratio']:.2f} ({low:.2f} to {high:.2f})",
        ]
    ]


def on_concealed(trial: dict[str, Any]) -> list[list[str]]:
    """Names, class by class, and names that are said to be sure."""
    naming = trial["all"]["naming"]
    rows = [
        [what, f"{naming[key]['right']} of {naming[key]['of']}"]
        for key, what in OTHERS.items()
    ]
    sure = next(b for b in trial["bars"] if b["key"] == "sure_right")
    rows.append(
        [
            "names given at 90 % or more that are right",
            f"{sure['right']} of {sure['of']}",
        ]
    )
    return rows


def into_readme(results: Path, file: Path) -> None:
    """Write the table between the marks of the file."""
    text = file.read_text(encoding="utf-8")
    file.write_text(between(MARK, text, table(results)), encoding="utf-8")
