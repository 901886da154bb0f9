"""What was concealed, what was found, what was not, and why: a page or two.

`python -m studies.proof` writes docs/proof.md, docs/proof-hands.md of the trial by
other hands, docs/rivals.md of other methods, and their figures, from the JSON files in
studies/results alone; what has not been run is said to be so.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from bench.proof import hands as proof_hands
from bench.proof.concealed import concealed
from bench.proof.limits import limits
from bench.proof.others import cost, recordings
from bench.proof.page import MADE, OTHER, Page
from bench.proof.readme import into_readme
from bench.rivals import page as rivals
from softnn.study.common import RESULTS, RUNS, guarded, parser

DOCS = Path(__file__).resolve().parents[2] / "docs"


def make(results: Path, folder: Path) -> Path:
    """Write the pages from the results; the path of the first."""
    other = Page(results, folder)
    other.say("# The proof by other hands", MADE)
    other.section("Cases by other hands", "hands", proof_hands.hands)
    other.section("Hardly changed", "stability", proof_hands.stability)
    other.section("All that was ever opened", "ledger", proof_hands.openings)
    other.write("proof-hands.md")
    beside = Page(results, folder)
    beside.say("# What a user would pick instead", MADE)
    beside.section("Real recordings, other methods", "rivals", rivals.whole)
    beside.write("rivals.md")
    page = Page(results, folder)
    page.say("# The proof", MADE)
    page.say("Cases made by other hands, and all that was ever opened: " + OTHER)
    page.section("What a user would pick instead", "rivals", rivals.short)
    page.section("Real recordings", "recordings", recordings)
    page.section("What was concealed", "concealed", concealed)
    page.section("How small it may be", "limits", limits)
    page.section("What it costs", "cost", cost)
    return page.write()


def make_parser() -> argparse.ArgumentParser:
    p = parser("proof", __doc__)
    p.add_argument("--results", type=Path, default=RESULTS, help="where the JSON lies")
    p.add_argument("--out", type=Path, help="folder of the page (docs)")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.proof`; returns the exit code."""
    a = make_parser().parse_args(argv)
    folder = a.out or (RUNS / "smoke" / "docs" if a.smoke else DOCS)

    def work() -> None:
        print(f"written to {make(a.results, folder)}")
        if folder == DOCS:
            into_readme(a.results, DOCS.parent / "README.md")

    return guarded(work)
