"""`softnn diagnose`, `softnn simulate` and `softnn demo`: they parse and print."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softnn.contracts import Chunk, InputError, nearest
from softnn.json_file import plain, write
from softnn.models.units import BASES
from softnn.readers.arguments import add_options, options_of

if TYPE_CHECKING:
    from softnn.mismatch.batch import Job

__all__ = ["add_demo", "add_diagnose", "add_simulate", "write"]


def add_diagnose(commands: Any) -> None:
    parser = commands.add_parser(
        "diagnose",
        help="where a simulation and recordings differ, and which physics was left out",
        description="Locate, explain, model and verify the mismatch of each case: a "
        "folder of CSV files or machine exports (recordings/*.csv and case.toml, if "
        "wanted); files named one by one are one case together.",
        epilog="Examples: softnn diagnose my_recordings --out found; "
        "softnn diagnose a.csv b.csv --out found --model sls; "
        "softnn diagnose Specimen_*.csv --length 33 --area 18 --out found",
    )
    parser.add_argument("cases", nargs="+", metavar="CASE|FILE")
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument(
        "--model",
        metavar="|".join(BASES) + "|FILE",
        help="the base (default: as the case says, else its simulated_MPa, "
        "else pl-wiechert), or a model.json",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help="use the workers of this Dask cluster, which see the same folders",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="leave cases alone that --out has a diagnosis of, from the same data, "
        "case.toml, model and seed",
    )
    parser.add_argument(
        "--tracking", metavar="URI", help="log each diagnosis to this MLflow address"
    )
    parser.add_argument(
        "--json", action="store_true", help="print what was found as JSON, nothing else"
    )
    parser.add_argument(
        "--as-is", action="store_true", help="take implausible numbers as they stand"
    )
    add_options(parser)
    parser.set_defaults(run=diagnose)


def add_simulate(commands: Any) -> None:
    parser = commands.add_parser(
        "simulate",
        help="stress of a model.json over the strain of recordings",
        description="Write time_s, strain, simulated_MPa (and stress_MPa where the "
        "recording has it) for each recording; the stress is never used. A network "
        "gets a column outside: 1 strain, 2 rate, 4 direction never shown to it, added "
        "up.",
        epilog="Example: softnn simulate found/case/model.json new.csv --out simulated",
    )
    parser.add_argument("model", metavar="MODEL.json")
    parser.add_argument("recordings", nargs="+", metavar="RECORDING.csv")
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument(
        "--like",
        metavar="NAME",
        help="with what the model knows of this one of its recordings alone (its slip, "
        "its offset), whatever the file is called",
    )
    parser.add_argument(
        "--as-is", action="store_true", help="take implausible numbers as they stand"
    )
    parser.set_defaults(run=simulate)


def add_demo(commands: Any) -> None:
    parser = commands.add_parser(
        "demo",
        help="conceal an effect in made-up recordings, and find it",
        description="Write virtual recordings with an effect that the simulation "
        "lacks, diagnose them, and say where the report is; half a minute.",
        epilog="Example: softnn demo --out demo --effect slack",
    )
    parser.add_argument("--out", required=True, metavar="DIR")
    parser.add_argument("--effect", default="mullins_softening", metavar="NAME")
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.set_defaults(run=demo)


# -- diagnose --------------------------------------------------------------------------


def diagnose(arguments: argparse.Namespace) -> int:
    from softnn.mismatch import batch

    _whole("--jobs", arguments.jobs, 1)
    _whole("--seed", arguments.seed, 0)
    out = Path(arguments.out)
    jobs = batch.jobs_of(
        arguments.cases,
        out,
        arguments.model,
        seed=arguments.seed,
        resume=arguments.resume,
        options=options_of(arguments),
        as_is=arguments.as_is,
        aloud=len(arguments.cases) == 1 and not arguments.json,
    )
    with batch.alone(out):
        return _run(arguments, out, jobs)


def _run(arguments: argparse.Namespace, out: Path, jobs: list[Job]) -> int:
    from tqdm import tqdm

    from softnn.mismatch import batch
    from softnn.report import write_index

    rows: list[dict[str, Any]] = [{} for _ in jobs]
    # Nothing but results where nobody looks on.
    bar = tqdm(total=len(jobs), unit="case", disable=len(jobs) < 2 or None)
    for i, outcome in batch.run(jobs, arguments.jobs, arguments.scheduler):
        name = batch.case_name(jobs[i].source)
        bar.update()
        rows[i] = {"case": name, "result": outcome.result}
        if outcome.result is None:
            rows[i] |= {"error": outcome.line}
            with bar.external_write_mode(file=sys.stderr):
                print(f"softnn: {outcome.line}", file=sys.stderr, flush=True)
            continue
        rows[i] |= {"page": f"{jobs[i].out.name}/report.html"}
        if not arguments.json:
            with bar.external_write_mode(file=sys.stdout):
                print(f"{jobs[i].out.name}: {outcome.line}", flush=True)
                print(f"Next: {outcome.result['answer']['next']}", flush=True)
    bar.close()
    page = write_index(rows, out) if len(jobs) > 1 else jobs[0].out / "report.html"
    if arguments.json:
        print(json.dumps([plain(row) for row in rows], indent=1))
    elif page.exists() and sys.stdout.isatty():
        print(f"report: {page}")
    if arguments.tracking:
        from softnn.mismatch.record import log

        log(arguments.tracking, [job.out for job in jobs], arguments.seed)
    return 2 if any(row["result"] is None for row in rows) else 0


def _whole(option: str, value: int, least: int) -> None:
    if value < least:
        raise InputError(f"{option} is {value}; allowed is {least} and above")


# -- simulate --------------------------------------------------------------------------


def simulate(arguments: argparse.Namespace) -> int:
    import pandas as pd

    from softnn.mismatch import batch
    from softnn.mismatch.histories import (
        beyond,
        check_reach,
        known_by_name,
        outside,
        read_history,
    )
    from softnn.model_file import read_model
    from softnn.recording import bridged

    model = read_model(arguments.model)
    axes = model.axes
    files = [Path(f) for f in arguments.recordings]
    stems = [f.stem for f in files]
    for i, stem in enumerate(stems):
        if stem in stems[:i]:
            raise InputError(f"two recordings are called {stem!r}; rename one")
    out = Path(arguments.out)
    batch.writable(out)
    chunks, given, measured = [], [], []
    for file in files:
        frame = read_history(file, axes)
        time = frame["time_s"].to_numpy(float)
        strain = bridged(frame[axes.strain.column].to_numpy(float), time)
        warm = frame.get("temperature_C")
        chunks.append(
            Chunk(time, strain, None if warm is None else warm.to_numpy(float))
        )
        simulated = frame.get(axes.simulated)
        given.append(
            None
            if simulated is None or not model.needs_simulated
            else bridged(simulated.to_numpy(float), time)
        )
        measured.append(frame.get(axes.stress.column))
    if not arguments.as_is:
        check_reach(model, stems, chunks)
    called = stems
    if arguments.like is not None:
        known = known_by_name(model)
        if arguments.like not in known:
            raise InputError(
                f"--like is {arguments.like!r}{nearest(arguments.like, known)}; the "
                f"model knows {', '.join(known) or 'no recording by name'}"
            )
        called = [arguments.like] * len(stems)
    stress = model.stress(called, chunks, given)
    for line in beyond(model, stems, chunks, arguments.like is None):
        print(f"softnn: {line}", file=sys.stderr)
    for file, chunk, s, m in zip(files, chunks, stress, measured, strict=True):
        table: dict[str, Any] = {
            "time_s": chunk.time_s,
            axes.strain.column: chunk.strain,
            axes.simulated: s,
        }
        if m is not None:
            table[axes.stress.column] = m.to_numpy(float)
        told = f"{file.stem}: {len(s)} samples"
        if hasattr(model, "outside"):
            table["outside"] = model.outside(chunk)
            told += outside(table["outside"])
        pd.DataFrame(table).to_csv(
            out / f"{file.stem}.csv", index=False, float_format="%.9g"
        )
        print(told)
    return 0


# -- demo ------------------------------------------------------------------------------


def demo(arguments: argparse.Namespace) -> int:
    from softnn.mismatch import batch
    from softnn.mismatch.demo import conceal

    _whole("--seed", arguments.seed, 0)
    out = Path(arguments.out)
    batch.writable(out)
    names = conceal(out / "case", arguments.effect, arguments.seed)
    print(f"Concealed {arguments.effect} in {len(names)} recordings in {out / 'case'}.")
    (job,) = batch.jobs_of([str(out / "case")], out / "found", None)
    outcome = batch.diagnose_one(job)
    print(outcome.line)
    if outcome.result is not None:
        print(f"Next: {outcome.result['answer']['next']}")
    print(f"report: {job.out / 'report.html'}")
    print(f"Your own: softnn diagnose FOLDER_OR_FILES --out {out / 'mine'}")
    return 0 if outcome.result is not None else 2
