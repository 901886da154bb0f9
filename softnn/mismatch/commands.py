"""`softnn diagnose`, `plan`, `simulate` and `demo`: they parse and print."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softnn import readers
from softnn.cards import UNITS
from softnn.contracts import InputError, nearest
from softnn.json_file import plain, write
from softnn.models import bergstrom_boyce, hyperelastic, units
from softnn.readers.arguments import add_options, options_of

if TYPE_CHECKING:
    from softnn.mismatch.batch import Job

__all__ = ["add_demo", "add_diagnose", "add_plan", "add_simulate", "write"]


def add_diagnose(commands: Any) -> None:
    parser = commands.add_parser(
        "diagnose",
        help="where a simulation and recordings differ, and which physics was left out",
        description="Locate, explain, model and verify the mismatch of each case: a "
        "folder of recordings, subfolders included, as CSV files or machine exports; "
        "files named one by one are one case together. Files that are no recordings "
        "are passed over and named.",
        epilog="Examples: softnn diagnose my_recordings --out found; "
        "softnn diagnose a.csv b.csv --out found --model sls; "
        "softnn diagnose Specimen_*.csv --length 33 --area 18 --out found; "
        "softnn diagnose my_recordings --template",
    )
    parser.add_argument("cases", nargs="+", metavar="CASE|FILE")
    parser.add_argument("--out", metavar="DIR", help="where the reports go")
    parser.add_argument(
        "--model",
        metavar="BASE|auto|FILE",
        help=f"the base (default: as the case says, else its simulated_MPa, else "
        f"pl-wiechert), or a model.json. Bases: {', '.join(units.BASES)}; the "
        f"hyperelastic laws {', '.join(hyperelastic.LAWS)}, each alone or with "
        f"-prony; {bergstrom_boyce.NAME}. Options of laws: yeoh-prony:shear, "
        "hyperfoam:nu=0.3. auto: the one that predicts recordings left out best. A "
        "material card: an Abaqus .inp, an Ansys .mac, a FEBio .feb, or FILE#MATERIAL",
    )
    parser.add_argument(
        "--refit",
        action="store_true",
        help="fit the moduli of a material card too; else it stays as it is",
    )
    parser.add_argument(
        "--card-unit",
        metavar="|".join(UNITS),
        help="unit of stress of a material card, where neither it nor the recordings "
        "tell it",
    )
    parser.add_argument(
        "--template",
        action="store_true",
        help="write FOLDER/specimens.csv, a row a file, for sizes that differ",
    )
    parser.add_argument(
        "--skip",
        action="append",
        default=[],
        metavar="FILE",
        help="leave a file of the folder alone; may be a pattern, as 'old*'",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    parser.add_argument(
        "--scheduler",
        metavar="tcp://HOST:PORT",
        help="use the workers of this Dask cluster, which see the same folders",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N")
    parser.add_argument(
        "--tolerance",
        type=float,
        default=0.02,
        metavar="FRACTION",
        help="error of prediction that is good enough, as 0.02 for 2 %% (the default)",
    )
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
        "recording has it) for each recording, and print the error. The stress is not "
        "used. Takes every file that diagnose takes, and CSV without stress. A network "
        "gets a column outside: 1 strain, 2 rate, 4 direction never shown to it, added "
        "up.",
        epilog="Example: softnn simulate found/case/model.json new.csv --out simulated",
    )
    parser.add_argument(
        "model",
        metavar="MODEL.json",
        help="a model.json, a network.json, or models:/NAME@ALIAS of MLflow",
    )
    parser.add_argument("recordings", nargs="+", metavar="FILE|FOLDER")
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
    parser.add_argument("--skip", action="append", default=[], metavar="FILE")
    add_options(parser)
    parser.set_defaults(run=simulate)


def add_plan(commands: Any) -> None:
    parser = commands.add_parser(
        "plan",
        help="the recording to make next, to tell what a diagnosis could not",
        description="Compute the strain programme on which the models that a diagnosis "
        "has left differ most, and write it to next_recording.csv beside "
        "diagnosis.json. Strains, rates and directions are those recorded so far, "
        "unless you say what else the machine and the specimen allow.",
        epilog="Example: softnn plan found/case --minutes 20 --max-strain 0.5",
    )
    parser.add_argument("found", metavar="FOUND", help="a folder of softnn diagnose")
    parser.add_argument(
        "--minutes", type=float, metavar="N", help="longest duration of the recording"
    )
    parser.add_argument(
        "--max-strain",
        type=float,
        metavar="X",
        help="largest strain, as 0.5 for 50 %% (of a component in its own unit)",
    )
    parser.add_argument(
        "--max-rate", type=float, metavar="R", help="largest strain rate, 1/s"
    )
    parser.add_argument("--json", action="store_true", help="print the plan as JSON")
    parser.set_defaults(run=planned)


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
    if not 0 < arguments.tolerance < 1:
        raise InputError(
            f"--tolerance is {arguments.tolerance:g}; allowed is a fraction above 0 "
            "and below 1, as 0.02 for 2 %"
        )
    if arguments.template:
        return _template(arguments)
    if arguments.out is None:
        raise InputError("--out is missing; say where the reports go, as --out found")
    out = Path(arguments.out)
    jobs = batch.jobs_of(
        arguments.cases,
        out,
        arguments.model,
        refit=arguments.refit,
        card_unit=arguments.card_unit,
        seed=arguments.seed,
        tolerance=arguments.tolerance,
        resume=arguments.resume,
        options=options_of(arguments),
        skip=tuple(arguments.skip),
        as_is=arguments.as_is,
        command=("softnn", *arguments.words),
    )
    with batch.alone(out):
        return _run(arguments, out, jobs)


def _template(arguments: argparse.Namespace) -> int:
    from softnn.readers.folder import files_of, write_template

    for folder in map(Path, arguments.cases):
        if not folder.is_dir():
            raise InputError("no such folder; --template is for folders", file=folder)
        inner = folder / "recordings"
        inner = inner if inner.is_dir() else folder
        files, notes = files_of(inner, arguments.skip)
        if not files:
            passed = f"; passed over: {'; '.join(notes[:5])}" if notes else ""
            raise InputError(f"no recordings in it{passed}", file=folder)
        path = write_template(inner, files, options_of(arguments), readers.read)
        print(
            f"{path}: a row a recording. Fill in the sizes in mm (mm2 of an area), "
            f"then: softnn diagnose {shlex.quote(str(folder))} --out found"
        )
    return 0


def _run(arguments: argparse.Namespace, out: Path, jobs: list[Job]) -> int:
    from tqdm import tqdm

    from softnn.mismatch import batch
    from softnn.progress import Shown, heard
    from softnn.report import write_index

    rows: list[dict[str, Any]] = [{} for _ in jobs]
    single = len(jobs) == 1
    shown = Shown(batch.case_name(jobs[0].source), quiet=not single or arguments.json)
    # The progress bar of this process does not reach other machines.
    if single and not (arguments.json or arguments.scheduler):
        jobs[0] = replace(jobs[0], say=shown.say)
    bar = tqdm(total=len(jobs), unit="case", disable=single or None)
    with shown, heard(shown if single else None):
        for i, outcome in batch.run(jobs, arguments.jobs, arguments.scheduler):
            bar.update()
            rows[i] = {"case": jobs[i].out.name, "result": outcome.result}
            if outcome.result is None:
                rows[i] |= {"error": outcome.line}
                shown.clear()
                with bar.external_write_mode(file=sys.stderr):
                    print(f"softnn: {outcome.line}", file=sys.stderr, flush=True)
                continue
            rows[i] |= {"page": f"{jobs[i].out.name}/report.html"}
            if not arguments.json:
                shown.clear()
                with bar.external_write_mode(file=sys.stdout):
                    print(f"{jobs[i].out.name}: {outcome.line}", flush=True)
                    print(f"Next: {outcome.result['answer']['next']}", flush=True)
    bar.close()
    done = any(row["result"] is not None for row in rows)
    page = write_index(rows, out) if not single else jobs[0].out / "report.html"
    if arguments.json:
        print(json.dumps([plain(row) for row in rows], indent=1))
    elif done:
        print(f"report: {page}")
    elif page.exists() and single:
        print(f"softnn: {page} is of an earlier run", file=sys.stderr)
    if arguments.tracking:
        from softnn.mismatch.record import log

        log(arguments.tracking, [job.out for job in jobs], arguments.seed)
    return 2 if any(row["result"] is None for row in rows) else 0


def _whole(option: str, value: int, least: int) -> None:
    if value < least:
        raise InputError(f"{option} is {value}; allowed is {least} and above")


# -- plan ------------------------------------------------------------------------------


def planned(arguments: argparse.Namespace) -> int:
    from softnn.mismatch import plan, words
    from softnn.report.phrases import opened

    limits = plan.Limits(arguments.minutes, arguments.max_strain, arguments.max_rate)
    folder, result = plan.read(Path(arguments.found))
    found = plan.Alternatives.from_dict(result["alternatives"]).plan(limits)
    advice = None if found is None else found.to_dict()
    path = plan.write(found, folder)
    if arguments.json:
        print(json.dumps(plain(advice), indent=1))
        return 0
    if advice is None:
        print("Nothing is left to tell: one model has nearly all of the probability.")
        return 0
    print(words.record(advice, result))
    if path is not None:
        print(f"{opened(advice['why'])}.")
        print(f"written to {path}")
    return 0


# -- simulate --------------------------------------------------------------------------


def simulate(arguments: argparse.Namespace) -> int:
    from softnn.metrics import nrmse, r2
    from softnn.mismatch import batch
    from softnn.mismatch.api import histories, load_model
    from softnn.mismatch.histories import (
        beyond,
        check_reach,
        known_by_name,
        outside,
    )
    from softnn.readers.tidy import spare, write_table
    from softnn.recording import bridged

    model = load_model(arguments.model)
    axes = model.axes
    every, notes = histories(
        arguments.recordings, axes, options_of(arguments), arguments.skip
    )
    out = Path(arguments.out)
    batch.writable(out)
    names, chunks = [h.name for h in every], [h.chunk for h in every]
    needed = [
        None
        if h.simulated is None or not model.needs_simulated
        else bridged(h.simulated, h.chunk.time_s)
        for h in every
    ]
    if not arguments.as_is:
        check_reach(model, names, chunks)
    called = names
    if arguments.like is not None:
        known = known_by_name(model)
        if arguments.like not in known:
            raise InputError(
                f"--like is {arguments.like!r}{nearest(arguments.like, known)}; the "
                f"model knows {', '.join(known) or 'no recording by name'}"
            )
        called = [arguments.like] * len(names)
    taken: set[str] = set()
    paths = [out / f"{batch.file_name(name, taken)}.csv" for name in names]
    given = [Path(p) for p in arguments.recordings]
    sources = {f.resolve() for p in given for f in (p, *p.rglob("*"))}
    for path in paths:
        spare(path, sources)
    stress = model.stress(called, chunks, needed)
    for line in [*notes, *beyond(model, names, chunks, arguments.like is None)]:
        print(f"softnn: {line}", file=sys.stderr)
    lines = []
    for history, s, path in zip(every, stress, paths, strict=True):
        chunk, measured = history.chunk, history.measured
        table: dict[str, Any] = {
            "time_s": chunk.time_s,
            axes.strain.column: chunk.strain,
            axes.simulated: s,
        }
        told = f"{history.name}: {len(s)} samples"
        if measured is not None:
            table[axes.stress.column] = measured
            told += (
                f", error {100 * nrmse(s, measured):.3g} % of the stress, "
                f"R2 {r2(s, measured):.3g}"
            )
        if hasattr(model, "outside"):
            table["outside"] = model.outside(chunk)
            told += outside(table["outside"])
        write_table(path, table)
        lines.append(f"{told}; written to {path}")
    print("\n".join(lines))
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
