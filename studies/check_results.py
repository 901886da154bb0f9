"""Recompute a seeded sample of the published figures; say which of them moved.

Each file of studies/results has the same share of the time (--minutes), one row at
least. How rows are computed again is in `studies/again.py`; how far a figure may move,
and why, is in `bench/checking.py`. With --publish the findings go into
studies/results/checked.json, which the pages read. Files that are not asked for keep
the findings of their last check. `--stale` computes nothing: it lists results whose
code was changed after they were made.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from bench import checking
from softnn.contracts import InputError
from softnn.study.common import (
    RESULTS,
    guarded,
    markdown,
    parser,
    results_folder,
    write_result,
)
from studies.again import CHECKERS

SMOKE = "gait"


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.check_results`; returns the exit code."""
    made = parser("check_results", __doc__)
    made.add_argument("--minutes", type=float, default=10.0, help="in all (10)")
    made.add_argument("--only", default="", help="files with this in their name")
    made.add_argument("--jobs", type=int, default=2, help="processes (2)")
    made.add_argument("--stale", action="store_true", help="list what to make again")
    a = made.parse_args(argv)
    return guarded(lambda: run(a))


def run(a: Any) -> None:
    if not a.minutes > 0 or a.jobs < 1:
        raise InputError("--minutes must be above 0, --jobs 1 or more")
    files = checking.files_of(RESULTS, SMOKE if a.smoke else a.only)
    if not files:
        raise InputError(f"no result has {a.only!r} in its name")

    if a.stale:
        rows = checking.stale(files, CHECKERS, RESULTS.parents[1])
        print(markdown(["result", "made at", "code changed at"], rows))
        print(f"\n{len(rows)} of {len(files)} results are older than their code")
        return

    def say(name: str, one: checking.Result) -> None:
        print(checking.line(name, one), flush=True)

    jobs = 1 if a.smoke else min(a.jobs, len(files))
    now = checking.check(files, CHECKERS, a.minutes, a.seed, jobs, say)
    folder = results_folder(a.smoke, a.publish)
    names = {f.stem for f in checking.files_of(RESULTS)}
    before = {k: v for k, v in checking.read(folder).items() if k in names}
    found = dict(sorted({**before, **now}.items()))
    path = write_result(
        checking.FILE,
        checking.headline_of(found),
        {"files": found},
        seed=a.seed,
        folder=folder,
    )
    print(f"\n{checking.table(now)}\n\nresult: {path}")


if __name__ == "__main__":
    sys.exit(main())
