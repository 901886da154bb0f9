"""The pages of the proof, from the JSON files in studies/results alone.

`python -m studies.proof` writes docs/proof.md, docs/proof-hands.md (cases made by other
people), docs/rivals.md (other methods) and their figures. A section without a result
says which command makes it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from bench.proof import hands as proof_hands
from bench.proof.concealed import concealed
from bench.proof.limits import limits
from bench.proof.loop import loop
from bench.proof.others import cost, recordings
from bench.proof.page import MADE, OTHER, Page
from bench.proof.readme import into_readme
from bench.rivals import page as rivals
from softnn.study.common import RESULTS, RUNS, guarded, parser

ABOUT = (
    "This page is for readers who ask how often softnn is right. It has four parts: "
    "predictions of real recordings, beside other methods; effects concealed in "
    "made-up recordings; the smallest effect that softnn finds; and the time it takes. "
    "*Base* is the simulation without any effect. *NRMSE* is the root mean square "
    "error over the root mean square of the stress."
)
HANDS = (
    "This page is for readers who want to test softnn on cases that its authors did "
    "not make. [Cases by other hands](hands.md) says how they are made."
)
DOCS = Path(__file__).resolve().parents[2] / "docs"


def make(results: Path, folder: Path) -> Path:
    """Write the pages from the results; the path of the first."""
    other = Page(results, folder)
    other.say("# The proof by other hands", HANDS, MADE)
    other.section("Cases by other hands", "hands", proof_hands.hands)
    other.section("Small changes of the recordings", "stability", proof_hands.stability)
    other.section("The recording that softnn asks for", "loop", loop)
    other.section("All trials so far", "ledger", proof_hands.openings)
    other.write("proof-hands.md")
    beside = Page(results, folder)
    beside.say("# What a user would pick instead", MADE)
    beside.section("Real recordings, other methods", "rivals", rivals.whole)
    beside.write("rivals.md")
    page = Page(results, folder)
    page.say("# The proof", ABOUT, MADE)
    page.say("Cases made by other people, and a list of all trials: " + OTHER)
    page.section("What a user would pick instead", "rivals", rivals.short)
    page.section("Real recordings", "recordings", recordings)
    page.section("Concealed effects", "concealed", concealed)
    page.section("How small an effect may be", "limits", limits)
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
