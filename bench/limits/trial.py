r"""How small may an effect be and still be named? Its strength swept, beside an oracle.

Each of the nineteen effects is planted in cases by other hands (`bench.hands`) over a
grid of strengths, noise levels and noise colours, and diagnosed; nulls of every colour
give the false alarms. Beside each share of cases named stands the power of the oracle:
the likelihood-ratio test that is told the true form, the programme and the noise.

A case keeps its material, programmes and draws over all strengths, so that a curve over
strength is the same specimens with more of the effect. A case is diagnosed once: its
outcome goes into a database at once, and whatever stops the run, the next one goes on.
After a change of softnn or of the forge, cases are diagnosed anew. Seeds below 10000
are for development; those from 10000 on may be published (--publish).

The full grid takes a night on a few cores; --quick takes a fraction of an hour.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench import scoring
from bench.hands import forging, grid
from bench.hands.families import EFFECTS, SIDES
from bench.limits.reporting import report
from bench.limits.summary import CORRELATION_S
from bench.trials.sealing import FIRST_TRIAL_SEED, read_truth
from bench.trials.trial import check_names
from softnn.contracts import InputError
from softnn.database import Store
from softnn.study.common import (
    code_of,
    commit,
    guarded,
    package_files,
    parser,
    runs_folder,
)
from softnn.workers import workers

STRENGTHS = (0.02, 0.05, 0.1, 0.2, 0.4, 1.0)
LEVELS = (0.002, 0.005, 0.01)  # of noise, shares of the stress range
COLOURS = CORRELATION_S  # [s], by name
NULL = "null"
HERE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Order:
    """One case of a cell; nothing of it depends on the rest of the grid."""

    effect: str  # or `NULL`
    strength: float
    level: float
    colour: str
    index: int
    seed: int
    side: str

    @property
    def name(self) -> str:
        said = json.dumps(asdict(self), sort_keys=True)
        return "case-" + hashlib.sha256(said.encode()).hexdigest()[:12]


@dataclass(frozen=True)
class Grid:
    """What is asked: `cases` in each cell of effect, strength, level and colour."""

    seed: int
    effects: tuple[str, ...]
    strengths: tuple[float, ...]
    levels: tuple[float, ...]
    colours: tuple[str, ...]
    cases: int
    nulls: int  # of each colour
    side: str = SIDES[0]

    def orders(self) -> list[Order]:
        """All cases, one of every cell before the second of any."""
        wanted, mine = [], (self.seed, self.side)
        for i in range(max(self.cases, self.nulls)):
            for colour in self.colours:
                if i < self.cases:
                    wanted += [
                        Order(effect, strength, level, colour, i, *mine)
                        for level in self.levels
                        for effect in self.effects
                        for strength in self.strengths
                    ]
                if i < self.nulls:
                    level = self.levels[i % len(self.levels)]
                    wanted.append(Order(NULL, 1.0, level, colour, i, *mine))
        return wanted


# --- one case -------------------------------------------------------------------------


def outcome(order: Order) -> dict[str, Any]:
    """Forge a case, diagnose what may be seen of it, compare with the answer."""
    from softnn.mismatch.case import read_case
    from softnn.mismatch.diagnosis import diagnose

    effect = grid.NOTHING if order.effect == NULL else order.effect
    memory, name = COLOURS[order.colour], order.name
    how = effect, order.strength, order.level, memory, order.side
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        case = grid.at(order.seed, order.index, *how)
        forging.write(case, name, place, [order.seed, order.index])
        truth = json.loads((place / "truth" / name / "truth.json").read_text("utf-8"))
        found: Mapping[str, Any] = scoring.ABSENT
        error = None
        try:
            found = diagnose(read_case(place / "cases" / name), None, 0).result
        except Exception as reason:  # counts as not named; the others go on
            error = f"{type(reason).__name__}: {reason}"
    return row_of(order, truth, found, error)


def row_of(
    order: Order,
    truth: Mapping[str, Any],
    found: Mapping[str, Any],
    error: str | None,
) -> dict[str, Any]:
    """What is kept of a case."""
    seen = dict(zip(truth["effects"], truth["oracle_power"], strict=True))
    told = {k: asdict(order)[k] for k in ("effect", "strength", "level", "colour")}
    return told | {
        "number": order.index,
        "model": truth["model"],
        "verdict": found["verdict"],
        "selected": list(found["selected"]),
        "equivalent": sorted(scoring.equivalents(found) - set(found["selected"])),
        "named": order.effect in found["selected"],
        "right": scoring.right(read_truth(order.name, truth), found),
        "oracle": seen.get(order.effect),
        "energy": truth.get("energy_alone", {}).get(order.effect),
        "samples": sum(r["samples"] for r in truth["recordings"]),
        "base_nrmse": found.get("fit", {}).get("before", {}).get("nrmse"),
        "sigma_over_true": noise_ratio(truth, found),
        "correlation_s": found.get("noise", {}).get("correlation_time_s"),
        "seconds": found.get("seconds"),
        "error": error,
    }


def noise_ratio(truth: Mapping[str, Any], found: Mapping[str, Any]) -> float | None:
    """The noise as the diagnosis read it off, over the true one."""
    sigma = found.get("noise", {}).get("sigma_MPa")
    true = sum(truth["noise"]["sigma_MPa"]) / len(truth["noise"]["sigma_MPa"])
    return None if sigma is None else float(sigma) / true


def outcomes(
    wanted: Sequence[Order], jobs: int, scheduler: str | None = None
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and outcome of every case, as they come."""
    if jobs == 1 and scheduler is None:
        for order in wanted:
            yield order.name, outcome(order)
        return
    with workers(jobs, scheduler) as pool:
        futures = {pool.submit(outcome, order): order.name for order in wanted}
        for future in as_completed(futures):
            yield futures[future], future.result()


# --- the command ----------------------------------------------------------------------


def code() -> str:
    """A hash of what makes and diagnoses a case."""
    forge = (HERE / "hands").glob("*.py")
    return code_of([*package_files(), Path(scoring.__file__), *forge])


def make_parser() -> argparse.ArgumentParser:
    p = parser("limits", __doc__)
    p.add_argument("--cases", type=int, help="in each cell (10; 2 with --quick)")
    p.add_argument("--nulls", type=int, help="of each colour (400; 30 with --quick)")
    p.add_argument("--effects", nargs="+", default=EFFECTS, metavar="EFFECT")
    p.add_argument("--strengths", nargs="+", type=float, metavar="X")
    p.add_argument("--levels", nargs="+", type=float, metavar="X", help="of noise")
    p.add_argument("--colours", nargs="+", default=tuple(COLOURS), choices=COLOURS)
    p.add_argument("--side", choices=SIDES, default=SIDES[0], help="of the laws")
    p.add_argument("--quick", action="store_true", help="one level, few cases")
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    p.add_argument("--scheduler", metavar="tcp://...", help="of a Dask cluster")
    p.add_argument("--store", type=Path, help="database of outcomes (mlruns/...)")
    p.add_argument("--report", action="store_true", help="of what is there, no more")
    p.add_argument("--tracking", help="MLflow address (mlruns/mlflow.db)")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.limits`; returns the exit code."""
    arguments = make_parser().parse_args(argv)
    return guarded(lambda: run(arguments))


def grid_of(a: argparse.Namespace) -> Grid:
    """The grid asked for; --smoke asks for one case and one null."""
    check_names(a.effects)
    if a.smoke:
        return Grid(
            a.seed, ("zero_offset",), (1.0,), (0.005,), ("white",), 1, 1, a.side
        )
    few = a.quick
    asked = Grid(
        a.seed,
        tuple(n for n in EFFECTS if n in a.effects),
        tuple(sorted(set(a.strengths or (STRENGTHS[1:] if few else STRENGTHS)))),
        tuple(sorted(set(a.levels or (LEVELS[1:2] if few else LEVELS)))),
        tuple(c for c in COLOURS if c in a.colours),
        (2 if few else 10) if a.cases is None else a.cases,
        (30 if few else 400) if a.nulls is None else a.nulls,
        a.side,
    )
    levels = asked.levels
    if min(asked.strengths) <= 0 or not 0 < min(levels) <= max(levels) < 0.5:
        raise InputError("--strengths must be above 0, --levels between 0 and 0.5")
    if min(asked.cases, asked.nulls, asked.seed) < 0 or a.jobs < 1:
        raise InputError("--cases, --nulls and --seed must be 0 or more, --jobs 1")
    return asked


def run(a: argparse.Namespace) -> None:
    asked = grid_of(a)
    home = runs_folder(a.smoke)
    file = a.store or home / "limits" / f"seed-{asked.seed}.sqlite"
    with Store(file, code()) as store:
        wanted = asked.orders()
        if not a.report:
            fill(store, wanted, 1 if a.smoke else a.jobs, a.scheduler)
        rows = pick(store.rows(), wanted)
    if not rows:
        raise InputError(f"{store.path} holds no case of this grid and this code")
    whole = len(rows) == len(wanted) and asked.effects == EFFECTS
    record = {
        "grid": asdict(asked),
        "forge": "hands",
        "commit": commit(),
        "cases": len(rows),
        "missing": len(wanted) - len(rows),
        "smoke": a.smoke,
        "published": a.publish
        and whole
        and asked.seed >= FIRST_TRIAL_SEED
        and not a.smoke,
    }
    report(rows, record, home / "limits" / f"seed-{asked.seed}", a.tracking)


def fill(
    store: Store,
    wanted: Sequence[Order],
    jobs: int,
    scheduler: str | None = None,
) -> None:
    """Diagnose what has not been diagnosed, showing how far it is."""
    from tqdm import tqdm

    done = store.rows().keys()
    rest = [order for order in wanted if order.name not in done]
    before = len(wanted) - len(rest)
    if before:
        print(f"{before} of {len(wanted)} cases were diagnosed before")
    with tqdm(total=len(wanted), initial=before, unit="case", file=sys.stderr) as bar:
        for name, row in outcomes(rest, min(jobs, max(len(rest), 1)), scheduler):
            store.add(name, row)
            bar.update()


def pick(
    rows: Mapping[str, dict[str, Any]], wanted: Iterable[Order]
) -> list[dict[str, Any]]:
    """Rows of the grid, in its order: how they came about makes no difference."""
    return [rows[order.name] for order in wanted if order.name in rows]
