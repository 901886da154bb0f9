"""Do the names hold when recordings are hardly changed, or have half the noise?

Cases of a folder (`cases/`, `truth/`), and real recordings of SOFTNN_DATA with --real,
are diagnosed as they are and changed: a row less in each recording, a NaN, a row twice,
stress in other units (smaller numbers, where larger ones are refused), the recordings
in another order, another seed. Where the truth folder has the noise-free stress
(`clean/`), half the noise too: no true name may go, no false one come. What is finished
is kept, so a run that was stopped goes on. The result is stability.json.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.recordings.groups import discover
from bench.reporting import carried_out, share
from bench.scoring import Rate
from softnn.contracts import InputError
from softnn.mismatch.case import Case, LARGEST_STRESS_MPa, read_case
from softnn.mismatch.diagnosis import diagnose
from softnn.readers.tidy import data_folder
from softnn.recording import Recording, data_hash
from softnn.study.common import (
    guarded,
    markdown,
    parser,
    results_folder,
    runs_folder,
    write_result,
)

HALF, SEED, AS_IT_IS = "half the noise", "another seed", "as it is"
Change = Callable[[Case, np.random.Generator], Case]


def each(do: Callable[[Recording, int], Recording]) -> Change:
    """The change of every recording at a row somewhere in the middle of it."""

    def changed(case: Case, rng: np.random.Generator) -> Case:
        rows = [int(rng.integers(1, len(r.time_s) - 1)) for r in case.recordings]
        pairs = zip(case.recordings, rows, strict=True)
        return replace(case, recordings=tuple(do(r, row) for r, row in pairs))

    return changed


def without(recording: Recording, row: int) -> Recording:
    return recording.take(np.delete(np.arange(len(recording.time_s)), row))


def unknown(recording: Recording, row: int) -> Recording:
    stress = recording.stress_MPa.copy()
    stress[row] = np.nan
    return replace(recording, stress_MPa=stress)


def twice(recording: Recording, row: int) -> Recording:
    return recording.take(np.insert(np.arange(len(recording.time_s)), row, row))


def by(factor: float) -> Change:
    """Stress times a factor; over it, where so much stress is refused."""

    def changed(case: Case, rng: np.random.Generator) -> Case:
        most = max(float(np.nanmax(np.abs(r.stress_MPa))) for r in case.recordings)
        own = factor if factor * most < LARGEST_STRESS_MPa else 1 / factor
        return each(lambda r, _: replace(r, stress_MPa=own * r.stress_MPa))(case, rng)

    return changed


CHANGES: dict[str, Change] = {
    "a row less": each(without),
    "a NaN": each(unknown),
    "a row twice": each(twice),
    "stress x 10": by(10.0),
    "stress x 1000": by(1000.0),
    "other order": lambda case, _: replace(case, recordings=case.recordings[::-1]),
    SEED: lambda case, _: case,
}


def quieter(case: Case, clean: Path) -> Case:
    """The case with half its noise; `clean` has the stress without any."""

    def half(r: Recording) -> Recording:
        table = pd.read_csv(clean / f"{r.name}.csv")
        known = np.interp(r.time_s, table["time_s"], table["stress_MPa"])
        return replace(r, stress_MPa=known + 0.5 * (r.stress_MPa - known))

    return replace(case, recordings=tuple(map(half, case.recordings)))


def ways_of(case: Case) -> dict[str, Case]:
    """A case as it is, and hardly changed in every way."""
    rng = np.random.default_rng(0)
    ways = {AS_IT_IS: case}
    for name, change in CHANGES.items():
        if name != "other order" or case.history == "fresh":
            ways[name] = change(case, rng)
    return ways


def seed_of(way: str) -> int:
    """The seed of the diagnosis of a changed case."""
    return int(way == SEED)


def trial(
    of: str, case: Case, true: Sequence[str] | None, clean: Path | None
) -> dict[str, Any]:
    """Names of a case as it is and changed; `true` where its truth is known."""
    ways = ways_of(case)
    if clean is not None and clean.is_dir():
        ways[HALF] = quieter(case, clean)
    told = {n: diagnose(one, seed=seed_of(n)) for n, one in ways.items()}
    return {
        "of": of,
        "case": case.name,
        "data": data_hash(case.recordings),
        "true": true,
        "named": {n: sorted(one.selected) for n, one in told.items()},
        "verdict": {n: one.verdict for n, one in told.items()},
    }


def told(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Shares of cases with the same names, and what half the noise does to them.

    *Uncertain* are names that differ where the verdict is undetermined both times.
    """
    out: dict[str, Any] = {}
    every: list[bool] = []
    unsure = 0
    for name in CHANGES:
        mine = [r for r in rows if name in r["named"]]
        same = [r["named"][name] == r["named"]["as it is"] for r in mine]
        out[name] = Rate(sum(same), len(same)).entry()
        every += same
        unsure += sum(
            r["verdict"][name] == r["verdict"]["as it is"] == "undetermined"
            for r, ok in zip(mine, same, strict=True)
            if not ok
        )
    out["hardly changed"] = Rate(sum(every), len(every)).entry()
    out["the same, or uncertain"] = Rate(sum(every) + unsure, len(every)).entry()
    halved = [r for r in rows if HALF in r["named"] and r["true"] is not None]
    fewer = more = 0
    for r in halved:
        was, now, true = map(set, (r["named"]["as it is"], r["named"][HALF], r["true"]))
        fewer += len(now & true) < len(was & true)
        more += len(now - true) > len(was - true)
    out["fewer true names"] = Rate(fewer, len(halved)).entry()
    out["more false names"] = Rate(more, len(halved)).entry()
    return out


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.stability`; returns the exit code."""
    p = parser("stability", __doc__)
    p.add_argument("folders", nargs="*", type=Path, metavar="FOLDER")
    p.add_argument("--real", nargs="*", metavar="SET", help="sets of SOFTNN_DATA (all)")
    p.add_argument("--cases", type=int, default=20, help="of each folder (20)")
    p.add_argument("--jobs", type=int, default=2)
    p.add_argument("--fresh", action="store_true", help="forget what is finished")
    p.add_argument("--finished", action="store_true", help="no more than is finished")
    return guarded(lambda: run(p.parse_args(argv)))


def run(a: Any) -> None:
    tasks: dict[str, tuple[str, Case, Sequence[str] | None, Path | None]] = {}
    for folder in a.folders:
        for path in sorted((folder / "cases").iterdir())[: a.cases]:
            truth = folder / "truth" / path.name
            true = json.loads((truth / "truth.json").read_text("utf-8"))["effects"]
            task = folder.name, read_case(path), true, truth / "clean"
            tasks[str(path.resolve())] = task
    if a.real is not None:
        groups, _ = discover(data_folder(), a.real)
        tasks |= {g.label: ("recordings", g.case(), None, None) for g in groups}
    if a.smoke:
        from bench.recordings.virtual import made_up

        tasks = {"smoke": ("made up", made_up(a.seed)[0].case(), None, None)}
    if not tasks:
        raise InputError("no cases; give a FOLDER with cases/ and truth/, or --real")
    file = runs_folder(a.smoke) / "stability.sqlite"
    every = carried_out(file, {k: (trial, *t) for k, t in tasks.items()}, a)
    rows = list(every.values())
    result = told(rows)
    print(markdown(["change", "cases"], [[k, share(v)] for k, v in result.items()]))
    write_result(
        "stability",
        {k: v["rate"] for k, v in result.items()},
        {"rates": result, "rows": sorted(rows, key=lambda r: (r["of"], r["case"]))},
        seed=a.seed,
        data={f"{r['of']}/{r['case']}": r["data"] for r in rows},
        folder=results_folder(a.smoke, a.publish),
    )
