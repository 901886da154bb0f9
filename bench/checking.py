"""Do published results still come out? A sample of their rows is computed again.

A `Checker` computes rows of one kind of result with the present code, one after the
other in a random but seeded order, until its share of the time is spent. Each row is
compared with the published one, figure by figure.
"""

from __future__ import annotations

import json
import math
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import nullcontext, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.json_file import plain
from softnn.study.common import markdown, provenance, provenance_of
from softnn.workers import workers

Result = Mapping[str, Any]
Row = tuple[str, Any, Any]
"""Which row, as it was published, and as it is now."""
Again = Callable[[Result, np.random.Generator], Iterator[Row]]

FILE = "checked"
NO_FIGURES = ("ledger", FILE)  # a list of openings, and what this module writes
ASIDE = ("seconds", "machine", "text", "summary", "note", "study_key")
"""Names that no comparison looks at: times taken and what is said of figures."""
LEAST = 1e-9  # smaller numbers are rounding


@dataclass(frozen=True)
class Tolerance:
    """How far a figure may move, and why so far.

    `relative` is a share of the larger of two numbers; `factor` is what a time may
    grow or shrink by.
    """

    why: str
    relative: float = 0.0
    factor: float = 1.0

    def holds(self, was: float, now: float) -> bool:
        if max(abs(was), abs(now)) <= LEAST:
            return True
        if self.factor > 1:
            return was > 0 and 1 / self.factor <= now / was <= self.factor
        return math.isclose(was, now, rel_tol=self.relative, abs_tol=0)

    def __str__(self) -> str:
        if self.factor > 1:
            return f"a factor of {self.factor:g}"
        return f"{100 * self.relative:g} %"


EXACT = Tolerance("fits without chance; other processors round otherwise", 1e-4)
TRAINED = Tolerance(
    "training amplifies rounding; 1 % is less than the error between folds", 0.01
)
DIAGNOSED = Tolerance(
    "names must stay; the search for parameters stops within the noise", 0.05
)
COPIED = Tolerance("constants are copied into the code in two or three digits", 0.02)
TIMED = Tolerance("other work on the machine slows a timing down", factor=2.0)


CODE = {
    EXACT: (
        *(
            f"softnn/models/{name}.py"
            for name in ("fit_piecewise", "relaxation", "segments", "skeleton")
        ),
        "softnn/prepare",
        "softnn/virtual.py",
    ),
    TRAINED: ("softnn/neural", "softnn/crossval.py"),
    DIAGNOSED: ("softnn/mismatch", "softnn/fit", "softnn/effects"),
}


@dataclass(frozen=True)
class Checker:
    """How rows of one kind of result are computed again, or why they are not."""

    again: Again | None = None
    tolerance: Tolerance = EXACT
    not_checked: str = ""

    @property
    def code(self) -> tuple[str, ...]:
        """Where in softnn its figures come from; nowhere for times and copies."""
        return CODE.get(self.tolerance, ())


@dataclass
class Compared:
    """Number of figures that were compared, and those that moved."""

    figures: int = 0
    moved: list[dict[str, Any]] = field(default_factory=list)


def compare(was: Any, now: Any, tolerance: Tolerance, where: str = "") -> Compared:
    """Compare every figure of `was` with the one in the same place of `now`.

    Numbers may differ by the tolerance; words, and lists of words in any order, may
    not differ. A figure that is gone has moved; one that is new does not count.
    """
    found = Compared()
    _compare(was, now, tolerance, where, found)
    return found


def _compare(was: Any, now: Any, tolerance: Tolerance, at: str, out: Compared) -> None:
    if isinstance(was, Mapping):
        values = now if isinstance(now, Mapping) else {}
        for key, value in was.items():
            if key not in ASIDE:
                below = f"{at}, {key}" if at else str(key)
                _compare(value, values.get(key), tolerance, below, out)
        return
    if isinstance(was, list) and not _words(was):
        alike = isinstance(now, list) and len(now) == len(was)
        for i, value in enumerate(was):
            other = now[i] if alike else None
            _compare(value, other, tolerance, f"{at}[{i}]", out)
        return
    out.figures += 1
    if not _same(was, now, tolerance):
        out.moved.append({"where": at, "was": was, "now": now})


def _words(values: list[Any]) -> bool:
    return all(isinstance(v, str) for v in values)


def _same(was: Any, now: Any, tolerance: Tolerance) -> bool:
    if isinstance(was, list):
        return isinstance(now, list) and sorted(was) == sorted(map(str, now))
    numbers = [
        isinstance(v, int | float) and not isinstance(v, bool) for v in (was, now)
    ]
    return tolerance.holds(was, now) if all(numbers) else bool(was == now)


# --- one file, and all of them --------------------------------------------------------


def kind_of(name: str, checkers: Mapping[str, Checker]) -> str:
    """The kind of a result file: `rates` of `rates-vhb4910-zhao`."""
    kind = name.split("-")[0]
    if kind not in checkers:
        raise InputError(f"{name}.json: no checker for results of {kind!r}")
    return kind


def check_file(file: Path, checker: Checker, seconds: float, seed: int) -> Result:
    """What a check of one result file found, of one row at least."""
    found: dict[str, Any] = {"rows": 0, "figures": 0, "moved": [], **provenance()}
    if checker.again is None:
        return {**found, "not_checked": checker.not_checked}
    result = json.loads(file.read_text(encoding="utf-8"))
    found["of"] = provenance_of(result)
    found["tolerance"] = str(checker.tolerance)
    rng = np.random.default_rng([seed, *file.stem.encode()])
    began = time.monotonic()
    try:
        # What a study prints of its own is no part of this report.
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            for where, was, now in checker.again(result, rng):
                one = compare(plain(was), plain(now), checker.tolerance, where)
                found["rows"] += 1
                found["figures"] += one.figures
                found["moved"] += one.moved
                if time.monotonic() - began >= seconds:
                    break
    except InputError as error:  # such as recordings that are not here
        found["not_checked"] = str(error)
    except Exception as error:  # the other files are checked all the same
        found["not_checked"] = f"failed with {type(error).__name__}: {error}"
    if not found["rows"]:
        found.setdefault("not_checked", "no row that can be computed again")
    return {**found, "seconds": time.monotonic() - began}


def files_of(results: Path, only: str = "") -> list[Path]:
    """Result files with figures, those with `only` in their names."""
    found = [f for f in sorted(results.glob("*.json")) if f.stem not in NO_FIGURES]
    return [f for f in found if only in f.stem]


def check(
    files: Sequence[Path],
    checkers: Mapping[str, Checker],
    minutes: float,
    seed: int,
    jobs: int,
    done: Callable[[str, Result], None],
) -> dict[str, Result]:
    """What checks of all files found; each file has the same share of the time."""
    seconds = 60 * minutes * jobs / max(1, len(files))
    asked = [(f, checkers[kind_of(f.stem, checkers)], seconds, seed) for f in files]
    found: dict[str, Result] = {}

    def add(name: str, one: Result) -> None:
        found[name] = one
        done(name, one)

    with workers(jobs) if jobs > 1 else nullcontext() as pool:
        if pool is None:
            for one in asked:
                add(one[0].stem, check_file(*one))
        else:
            futures = {pool.submit(check_file, *a): a[0].stem for a in asked}
            for future in as_completed(futures):
                add(futures[future], future.result())
    return dict(sorted(found.items()))


def stale(
    files: Sequence[Path], checkers: Mapping[str, Checker], root: Path
) -> list[tuple[str, str, str]]:
    """Results whose code was changed since: name, their commit, the latest change.

    A change need not move a figure: a check says whether it did. `root` is the git
    checkout. A commit that it does not know counts as changed.
    """
    found = []
    for file in files:
        about = provenance_of(json.loads(file.read_text(encoding="utf-8")))
        made = about.get("commit", "unknown").removesuffix("-dirty")
        code = checkers[kind_of(file.stem, checkers)].code
        if not code:
            continue
        since = ["git", "-C", str(root), "log", "-1", "--format=%h", f"{made}..HEAD"]
        done = subprocess.run(
            [*since, "--", *code], capture_output=True, text=True, check=False
        )
        if done.returncode or done.stdout.strip():
            found.append((file.stem, made, done.stdout.strip() or "unknown"))
    return found


# --- what is said of it ---------------------------------------------------------------


def line(name: str, one: Result) -> str:
    """One file in a line."""
    if one.get("not_checked"):
        return f"{name}: not checked: {one['not_checked']}"
    return (
        f"{name}: {len(one['moved'])} of {one['figures']} figures moved "
        f"({one['rows']} rows, {one['seconds']:.0f} s)"
    )


def table(found: Mapping[str, Result]) -> str:
    """All files, and every figure that moved, as Markdown."""
    rows = [
        [
            name,
            one["rows"],
            one["figures"],
            len(one["moved"]),
            one.get("tolerance"),
            one.get("not_checked"),
        ]
        for name, one in found.items()
    ]
    heads = ["result", "rows", "figures", "moved", "tolerance", "not checked"]
    moved = [
        [name, m["where"], short(m["was"]), short(m["now"])]
        for name, one in found.items()
        for m in one["moved"]
    ]
    parts = [markdown(["moved in", "figure", "was", "now"], moved)] if moved else []
    return "\n\n".join([*parts, markdown(heads, rows)])


def short(value: Any) -> str:
    """A value of a result in a few characters.

    >>> short(0.123456), short(["slack", "inertia"]), short([])
    ('0.12346', 'slack, inertia', 'nothing')
    """
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "nothing"
    return str(value)


def headline_of(found: Mapping[str, Result]) -> dict[str, int]:
    return {
        "files": len(found),
        "files_checked": sum(not one.get("not_checked") for one in found.values()),
        "rows": sum(one["rows"] for one in found.values()),
        "figures": sum(one["figures"] for one in found.values()),
        "figures_moved": sum(len(one["moved"]) for one in found.values()),
    }


def read(results: Path) -> dict[str, Result]:
    """What the last check of these results found, by file; nothing without one."""
    file = results / f"{FILE}.json"
    if not file.exists():
        return {}
    return dict(json.loads(file.read_text(encoding="utf-8"))["files"])


def moved(results: Path, *names: str) -> str:
    """A sentence on figures of these files that moved; "" if none did.

    A check of an earlier version of a file says nothing of the present one.
    """
    found = read(results)
    parts = []
    for name in names:
        one, file = found.get(name), results / f"{name}.json"
        if not one or not one["moved"] or not file.exists():
            continue
        if one["of"] != provenance_of(json.loads(file.read_text(encoding="utf-8"))):
            continue
        parts.append(
            f"{len(one['moved'])} of {one['figures']} figures of `{name}.json` that "
            f"were computed again moved by more than {one['tolerance']} "
            f"(commit {one.get('commit', 'unknown')}, {one['made']})"
        )
    return f"**{'; '.join(parts)}.**" if parts else ""
