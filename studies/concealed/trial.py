"""Forge concealed cases, diagnose them, open the key, score."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from studies.concealed import forge


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="python -m studies.concealed", description=__doc__)
    p.add_argument("--cases", type=int, default=20, help="of each effect")
    p.add_argument("--nulls", type=int, help="default: ten times --cases")
    p.add_argument("--pairs", type=int, help="default: three times --cases")
    p.add_argument("--unlisted", type=int, help="default: three times --cases")
    p.add_argument("--only", nargs="+", default=[], choices=forge.NAMES)
    p.add_argument("--strength", type=float, default=1.0)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--dirty", type=float, default=0.15, help="share of the cases")
    p.add_argument("--simulated", type=float, default=0.1, help="share of the cases")
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    p.add_argument("--forge-only", type=Path, metavar="DIR")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    a = parser().parse_args(argv)
    orders = forge.plan(
        a.seed,
        a.strength,
        each=a.cases,
        nulls=10 * a.cases if a.nulls is None else a.nulls,
        pairs=3 * a.cases if a.pairs is None else a.pairs,
        unlisted=3 * a.cases if a.unlisted is None else a.unlisted,
        only=a.only,
        dirty=a.dirty,
        simulated=a.simulated,
    )
    digest = forge.forge(orders, a.forge_only, a.jobs)
    print(f"{len(orders)} cases in {a.forge_only / 'cases'}; key SHA-256 {digest}")
    return 0
