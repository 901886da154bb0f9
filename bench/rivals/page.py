"""The page docs/rivals.md, and its short form in the proof."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.recordings.sets import DEVELOPMENT
from bench.rivals import learners
from bench.rivals.table import (
    ABOUT,
    ANY,
    BASE,
    BEST_LAW,
    SOFTNN,
    as_markdown,
    capped,
    key_of,
    plain,
    verdict,
)
from softnn.mismatch.base import SEARCH
from softnn.study.common import made_with, markdown, percent

if TYPE_CHECKING:
    from bench.proof.page import Page

Result = Mapping[str, Any]
HOW = (
    "Every method gets the recordings that softnn fits, the same samples of them "
    "(about {search} a recording at most), and no others. If specimens differ in "
    "scale, the scales are removed for every method, and a predicted specimen gets the "
    "best scale, as for softnn. Segments, relaxation times, features and sizes are "
    "chosen by leaving out fitted recordings: one at a time, or one rate or amplitude "
    "at a time. The error is the NRMSE on the predicted recordings, as `python -m "
    "studies.recordings` computes it."
)
DRAWN = (
    "To save time some learners draw from these samples: the Gaussian process predicts "
    "from {process}, the network learns from {network}, and PySINDy from {regressed}. "
    "All learners see the strain, its fading memories of seven lengths, the largest "
    "strain so far, its direction, rate, reversals and length of way, and the "
    "temperature where it was measured. Each may also learn the residual of a "
    "piecewise-linear fit, where the inner folds prefer that."
)
SHORT = "[All predictions, and how each method was fitted](rivals.md)."


def short(page: Page, found: Result) -> None:
    """The summary, for the proof."""
    page.say(
        "Unseen recordings of real materials, predicted by softnn and by the methods "
        f"that a user would pick instead. {page_count(found)}",
        as_markdown(found["summary"], found["methods"]),
        ABOUT,
        verdict(found["summary"], found["methods"]),
        SHORT,
    )


def page_count(found: Result) -> str:
    sets = {r["set"] for r in found["predictions"]}
    own = made_with(found["recordings_study"])
    return (
        f"{len(found['predictions'])} predictions from {len(sets)} sets of recordings. "
        f"Base and softnn: {own}"
    )


def whole(page: Page, found: Result) -> None:
    """The summary, who wins where, and every error."""
    rows, what = found["predictions"], found["methods"]
    page.say(
        "This page is for readers who ask whether a simpler fit, a published law or a "
        "learner predicts recordings as well as softnn does.",
        HOW.format(search=SEARCH),
        DRAWN.format(
            process=learners.PROCESS_ROWS[1],
            network=learners.NETWORK_ROWS,
            regressed=learners.REGRESSED,
        ),
        page_count(found),
        as_markdown(found["summary"], what),
        ABOUT,
        verdict(found["summary"], what),
        "## By kind of prediction",
        "The rules of softnn were made with the sets of development in sight. The sets "
        "held back were opened when the rules stood.",
        by_kind(rows, what),
        "## Every prediction",
        "In each line the best single method is marked by a star. The law and the "
        "rival are those that the inner folds pick.",
        every(rows, what),
        "## Every error",
        all_errors(rows),
        "## The methods",
        *(f"- `{n}`: {w}" for n, w in what.items()),
    )


def by_kind(rows: list[Result], what: Mapping[str, str]) -> str:
    """Geometric mean of each method's error over softnn's, for parts of the rows."""
    kinds: dict[str, list[Result]] = {}
    for r in rows:
        name = f"beyond the {r['split']}s fitted" if r["outside"] else r["split"]
        kinds.setdefault(name, []).append(r)
    for name, known in (("sets of development", True), ("sets held back", False)):
        some = [r for r in rows if (r["set"] in DEVELOPMENT) == known]
        kinds |= {name: some} if some else {}
    lines = []
    for name in (n for n in rows[0]["errors"] if n != SOFTNN):
        cells = [f"{ratio(some, name):.2f}" for some in kinds.values()]
        lines.append([what.get(name, name), *cells])
    heads = [f"{n} ({len(some)})" for n, some in kinds.items()]
    return markdown(["error over softnn's", *heads], lines)


def ratio(rows: list[Result], name: str) -> float:
    """Geometric mean of a method's error over softnn's."""
    errors = [(capped(r["errors"][name]), capped(r["errors"][SOFTNN])) for r in rows]
    return float(np.exp(np.mean([np.log(e / own) for e, own in errors])))


def every(rows: list[Result], what: Mapping[str, str]) -> str:
    """A prediction a line: base, softnn, the picks, and the best of all."""
    lines = []
    for r in rows:
        errors = r["errors"]
        single = {k: plain(v) for k, v in errors.items() if k not in (BEST_LAW, ANY)}
        best = min(single, key=lambda k: single[k])
        cells = [
            (percent(errors[k], 1) or "-") + " *" * (k == best)
            for k in (BASE, SOFTNN, BEST_LAW, ANY)
        ]
        won = f"{what.get(best, best)}, {percent(errors[best], 1)}"
        label = key_of(r) + " (beyond)" * r["outside"]
        lines.append([label, *cells, won])
    heads = ["predicted", "base", "softnn", "law picked", "rival picked", "best"]
    return markdown(heads, lines)


def all_errors(rows: list[Result]) -> str:
    """A prediction a line, a method a column, in per cent."""
    names = [n for n in rows[0]["errors"] if n not in (BEST_LAW, ANY)]
    lines = [
        [key_of(r), *(None if (e := r["errors"][n]) is None else f"{100 * e:.1f}"
                      for n in names)]
        for r in rows
    ]  # fmt: skip
    return markdown(["NRMSE, %", *names], lines)
