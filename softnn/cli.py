# PYTHON_ARGCOMPLETE_OK
"""The `softnn` command: one function a subcommand, errors as one line, exit code 2."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Collection, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NoReturn

import argcomplete
import numpy as np

from softnn import __version__
from softnn.app.command import add_app
from softnn.contracts import InputError, nearest
from softnn.datasets.command import add_data
from softnn.export.command import add_export
from softnn.mismatch.commands import add_demo, add_diagnose, add_plan, add_simulate
from softnn.readers.arguments import add_options, options_of
from softnn.recording import Recording


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, as all others."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see {self.prog} --help")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; 0 when all went well, 2 for input that cannot be used."""
    parser = _Parser(
        prog="softnn",
        description="Recordings of soft materials, and models of them.",
        epilog="To begin: softnn demo --out demo",
    )
    parser.add_argument("--version", action="version", version=f"softnn {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_read(commands)
    add_diagnose(commands)
    add_plan(commands)
    add_simulate(commands)
    add_export(commands)
    add_demo(commands)
    add_data(commands)
    add_app(commands)
    _add_rerun(commands)
    argcomplete.autocomplete(parser)  # ends here where a shell asks
    words = sys.argv[1:] if argv is None else list(argv)
    try:
        if words and not words[0].startswith("-") and words[0] not in commands.choices:
            raise InputError(
                f"no command {words[0]!r}{nearest(words[0], commands.choices)}; "
                f"allowed: {', '.join(commands.choices)}"
            )
        if any(not word.strip() for word in words):
            raise InputError("an argument is empty; is a variable of the shell unset?")
        arguments = parser.parse_args(words)
        arguments.words = words
        return int(arguments.run(arguments))
    except InputError as error:
        print(f"softnn: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # `softnn read ... | head`
        sys.stderr.close()
        return 0
    except OSError as error:  # a disk that is full or gone, rights that are missing
        where = f"{error.filename}: " if error.filename else ""
        print(f"softnn: {where}{error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("softnn: stopped; files that are written are whole", file=sys.stderr)
        return 130


# -- rerun -----------------------------------------------------------------------------


def _add_rerun(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "rerun",
        help="the networks of an MLflow run, trained again",
        description="Train the networks of one MLflow run again; compare the figures.",
    )
    parser.add_argument("run_id", metavar="RUN_ID", help="of one trial")
    parser.add_argument("--tracking", metavar="ADDRESS", help="MLflow's address")
    parser.set_defaults(run=_run_rerun)


def _run_rerun(arguments: argparse.Namespace) -> int:
    from softnn.study import rerun

    return int(rerun.command(arguments.run_id, arguments.tracking))


# -- read ------------------------------------------------------------------------------


def _add_read(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "read",
        help="a testing machine's files -> tidy CSV",
        description="Show what a testing machine's files hold; --out writes tidy CSV.",
        epilog="Example: softnn read Specimen_1.csv --length 33 --area 18 --out tidy",
    )
    parser.add_argument("files", nargs="+", metavar="FILE|FOLDER")
    parser.add_argument("--out", metavar="DIR", help="write tidy CSV and a plot here")
    add_options(parser)
    parser.set_defaults(run=_run_read)


def _run_read(arguments: argparse.Namespace) -> int:
    from softnn.readers import read
    from softnn.readers.folder import all_lacking, check_given, check_rows, files_of
    from softnn.readers.lacking import Lacking, NoRecording
    from softnn.readers.sizes import row_of, specimens

    options = options_of(arguments)
    out = Path(arguments.out) if arguments.out else None
    taken: set[str] = set()
    written: dict[str, Recording] = {}
    failures = 0
    told: list[str] = []
    # Each with the folder it was found in, which may hold files that are no test.
    files: list[tuple[Path, Path | None]] = []
    sizes: dict[Path, dict[str, dict[str, Any]]] = {}
    for given in map(Path, arguments.files):
        if given.is_dir():
            inner, notes = files_of(given)
            if not inner:
                print(f"softnn: {given}: no recordings in it", file=sys.stderr)
                failures += 1
            files += [(file, given) for file in inner]
            sizes[given] = specimens(given)
            told += notes
        else:
            files.append((given, None))
    sources = {file.resolve() for file, _ in files}
    found: list[Recording] = []
    lacking: dict[str, Lacking] = {}
    kept: set[Path] = set()  # folders with a recording
    for file, folder in files:
        shown = (file if folder is None else file.relative_to(folder)).as_posix()
        row = row_of({} if folder is None else sizes[folder], shown)
        try:
            found += read(file, replace(options, **row))
        except InputError as error:  # the other files are still worth reading
            if isinstance(error, Lacking):
                lacking[shown if len(arguments.files) == 1 else file.as_posix()] = error
            else:
                print(f"softnn: {error}", file=sys.stderr)
            if folder is None or not isinstance(error, NoRecording):
                failures += 1
            else:
                continue
        if folder is not None:
            kept.add(folder)
    # A folder of nothing but pictures and notes is not what was meant.
    failures += len({f for _, f in files if f is not None} - kept)
    for folder, rows in sizes.items():
        try:
            check_rows(rows, folder, [file for file, of in files if of == folder])
        except InputError as error:
            print(f"softnn: {error}", file=sys.stderr)
            failures += 1
    if lacking:
        print(f"softnn: {all_lacking(lacking, len(files), bool(found))}",
              file=sys.stderr)  # fmt: skip
    if found:
        try:
            check_given(options, found, [file for file, _ in files])
        except InputError as error:
            print(f"softnn: {error}", file=sys.stderr)
            failures += 1
    for recording, odd in zip(found, _oddities(found), strict=True):
        told.append(describe(recording))
        told += [f"  odd:  {_printable(line)}" for line in odd]
        if out is not None:
            path = write_tidy(recording, out, taken, sources)
            written[path.name] = recording
            told.append(f"  written to  {path}")
        told.append("")
    if out is not None and written:
        from softnn.readers.tidy import write_index

        write_index(out, written)  # specimens, and rates, are in no column of a file
    if told:
        print("\n".join(told))  # last: whoever reads on may close the pipe early
    return 2 if failures else 0


def _oddities(found: Sequence[Recording]) -> list[list[str]]:
    """What is odd in each recording, with advice for its file alone if others are not.

    `softnn read` accepts all numbers; it is `diagnose` that has to be told.
    """
    from softnn.mismatch.case import check_sizes
    from softnn.plausible import accidents, check_plausible

    def told(one: Recording, alone: bool) -> list[str]:
        try:
            check_sizes(one, one.name or None, alone)
            return check_plausible(one, alone=alone) + accidents(one)[1]
        except InputError as error:
            return [f"{error}".replace("--as-is", "--as-is to softnn diagnose")]

    odd = [told(one, False) for one in found]
    wrong = {one.source for one, lines in zip(found, odd, strict=True) if lines}
    if len(wrong) < len({one.source for one in found}):
        odd = [told(one, True) for one in found]
    return odd


def describe(recording: Recording) -> str:
    """Return how softnn reads a recording: facts, columns, notes, a small plot."""
    strain, stress = recording.strain, recording.stress_MPa
    axes = recording.axes
    facts = {
        "specimen": recording.specimen,
        "material": recording.material,
        "rows": f"{len(recording)}",
        "duration": f"{recording.time_s[-1] - recording.time_s[0]:.6g} s",
        "rate": f"{recording.rate_per_s:.4g} {axes.rate}"
        if recording.rate_per_s
        else "",
        axes.strain.name: f"{np.nanmin(strain):.4g} to {np.nanmax(strain):.4g}"
        + (f" {axes.strain.unit}" if axes.component else ""),
        axes.stress.name: f"{np.nanmin(stress):.4g} to {np.nanmax(stress):.4g} "
        f"{axes.stress.unit}",
        "geometry": ", ".join(
            f"{f.name.rsplit('_', 1)[0]} {getattr(recording.geometry, f.name):.6g} "
            f"{f.name.rsplit('_', 1)[1]}"
            for f in fields(recording.geometry)
            if getattr(recording.geometry, f.name) is not None
        ),
    }
    understood = recording.log[0].arguments if recording.log else {}
    facts["dialect"] = understood.get("dialect", "")
    for role, column in understood.get("columns", {}).items():
        facts[f"{role} from"] = column
    lines = [_printable(recording.name)]
    lines += [
        f"  {key:<18}{_printable(value)}" for key, value in facts.items() if value
    ]
    lines += [f"  note: {_printable(note)}" for note in understood.get("notes", [])]
    return "\n".join(lines + text_plot(strain, stress))


def _printable(text: str) -> str:
    """Text of a file on a terminal: no control characters."""
    return "".join(c if c.isprintable() else "?" for c in text)[:400]


def text_plot(
    x: np.ndarray, y: np.ndarray, width: int = 56, height: int = 9
) -> list[str]:
    """Points of y over x as lines of text, frame and extremes included.

    >>> print("\\n".join(text_plot(np.arange(3.0), np.arange(3.0), 3, 3)))
               2 |  *
                 | *
               0 |*
                  0 to 2
    """
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = x[keep], y[keep]
    if not len(x):
        return []
    canvas = np.full((height, width), " ")

    def place(values: np.ndarray, cells: int) -> np.ndarray:
        span = np.ptp(values)
        fraction = (values - values.min()) / span if span > 0 else 0 * values
        return np.rint(fraction * (cells - 1)).astype(int)

    canvas[height - 1 - place(y, height), place(x, width)] = "*"
    labels = [""] * height
    labels[0], labels[-1] = f"{y.max():.4g}", f"{y.min():.4g}"
    rows = [
        f"{label:>12} |{''.join(row).rstrip()}"
        for label, row in zip(labels, canvas, strict=True)
    ]
    return [*rows, f"{'':>12}  {x.min():.4g} to {x.max():.4g}"]


def write_tidy(
    recording: Recording,
    folder: Path,
    taken: set[str],
    sources: Collection[Path] = (),
) -> Path:
    """The recording as tidy CSV in `folder`, with a plot beside it; its path.

    The name holds letters, digits, `.`, `_` and `-` only, so it cannot lead out of
    the folder. `taken` are names already written by this command, which are not
    used again. Raises `InputError` where it would write over one of `sources`.
    """
    from softnn.readers.tidy import spare, write_table

    stem = re.sub(r"[^A-Za-z0-9._-]+", "_", recording.name).strip("._-")[:100]
    stem = base = stem if stem not in ("", "index") else "recording"
    count = 1
    while stem.casefold() in taken:
        count += 1
        stem = f"{base}-{count}"
    taken.add(stem.casefold())
    path = folder / f"{stem}.csv"
    spare(path, sources)
    write_table(path, recording.columns)
    picture = path.with_suffix(".png")
    try:
        _draw(recording, picture)
    except OSError as error:
        picture.unlink(missing_ok=True)
        reason = error.strerror or error
        raise InputError(f"cannot be written: {reason}", file=picture) from None
    return path


def _draw(recording: Recording, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(recording.strain, recording.stress_MPa, linewidth=1, color="tab:blue")
    strain, stress = (
        a.label.capitalize() if a.unit == "-" else f"{a.name.capitalize()} [{a.unit}]"
        for a in (recording.axes.strain, recording.axes.stress)
    )
    left.set(xlabel=strain, ylabel=stress)
    right.plot(recording.time_s, recording.strain, linewidth=1, color="tab:grey")
    right.set(xlabel="Time [s]", ylabel=strain)
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    # Only the file's own name, as plain text: "$" would be read as mathematics.
    title = _printable(recording.name).replace("$", r"\$")
    figure.suptitle(title if title.isascii() else path.stem, fontsize=10)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(main())
