"""What every study shares: its command line, its result file, its figures.

A study is a module with `main(argv=None) -> int` that ends in

    if __name__ == "__main__":
        sys.exit(main())

whose options come from `parser`, whose work is done within `guarded`, and which hands
its findings to `write_result`. With `--smoke` it takes seconds, on data as small as
can be, and writes under `mlruns/smoke`, where nobody mistakes it for a result.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import math
import os
import platform
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import softnn
from softnn import json_file
from softnn.contracts import InputError
from softnn.json_file import plain
from softnn.study.code import files_of, running_study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS = Path(softnn.__file__).parents[1] / "studies" / "results"
RUNS = Path("mlruns")  # below the folder the study is started in; ignored by git
SHOWING = ("cli.py", "report.py", "tracking.py")  # what is found, not finding it
PACKAGES = ("numpy", "scipy", "pandas", "torch", "optuna", "mlflow")


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as `InputError` does, and exits with 2."""

    def error(self, message: str) -> NoReturn:
        print(f"{self.prog}: {message}; --help lists the options", file=sys.stderr)
        raise SystemExit(2)


def parser(name: str, doc: str | None) -> Parser:
    """A parser for `python -m studies.NAME`, with --seed and --smoke.

    `doc` is the docstring of the study; its first line is the question it answers.
    """
    made = Parser(
        prog=f"python -m studies.{name}",
        description=doc,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("--seed", type=int, default=0, help="of everything random (0)")
    made.add_argument(
        "--smoke", action="store_true", help="seconds, on tiny data, to see it run"
    )
    return made


def guarded(work: Callable[[], None]) -> int:
    """The exit code of `work`: 0, 2 for unusable input, 130 for ctrl-C or `kill`."""
    try:
        with killed_as_by_ctrl_c():
            work()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nstopped; what is finished is kept", file=sys.stderr)
        return 130
    return 0


@contextmanager
def killed_as_by_ctrl_c() -> Iterator[None]:
    """So that a command which a study has started ends with it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def runs_folder(smoke: bool = False) -> Path:
    """Where runs and what can be gone on with lie."""
    return RUNS / "smoke" if smoke else RUNS


def results_folder(smoke: bool = False) -> Path:
    """Where results lie: in the project, or under `mlruns/smoke`."""
    return runs_folder(smoke) / "results" if smoke else RESULTS


def database(given: str | None, smoke: bool, name: str = "mlflow") -> str:
    """The address given, or that of NAME.db where runs lie."""
    return given or f"sqlite:///{(runs_folder(smoke) / name).as_posix()}.db"


def write_result(
    name: str,
    headline: Mapping[str, float | int | str | bool | None],
    body: Mapping[str, Any],
    *,
    seed: int | None = None,
    data: Mapping[str, str] | None = None,
    folder: Path | None = None,
) -> Path:
    """Write FOLDER/NAME.json and return its path; the folder is `RESULTS` by default.

    `headline` is flat: the figures that a text may quote, fractions as fractions, the
    unit in the name where there is one. `body` is whatever else the study found. `data`
    maps what was used to its hash (`softnn.recording.data_hash`). Beside them stand the
    versions, the machine, the date, and the study that was run with a hash of its code
    (see `softnn.study.code`). NaN and infinity become null.

    Raises `InputError` for a headline that is not flat.
    """
    nested = [k for k, v in headline.items() if isinstance(v, Mapping | list | tuple)]
    if nested:
        raise InputError(f"headline of {name} is not flat: {', '.join(nested)}")
    content = {
        "study": name,
        "headline": headline,
        "made": datetime.now(UTC).strftime("%Y-%m-%d"),
        "seed": seed,
        "data": data or {},
        "versions": versions(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        **made_by(running_study()),
        **{k: v for k, v in body.items() if k not in ("study", "headline")},
    }
    folder = RESULTS if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    json_file.write(path, content)
    return path


def made_by(study: str | None) -> dict[str, str]:
    """What a result says of the code that made it: nothing, outside of a study."""
    if study is None:
        return {}
    return {"made_by": study, "made_by_code": code_of(files_of(study), words=False)}


def versions() -> dict[str, str]:
    """Versions of what a result depends on."""
    found = {"python": platform.python_version(), "softnn": softnn.__version__}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "absent"
    return found


def fingerprint(content: Any, *, files: Iterable[Path] = ()) -> str:
    """A short hash of JSON-ready content and of the code in files: see `code_of`."""
    digest = hashlib.sha256(json.dumps(plain(content), sort_keys=True).encode())
    digest.update(code_of(files).encode())
    return digest.hexdigest()[:12]


def code_of(files: Iterable[Path], words: bool = True) -> str:
    """A short hash of what Python files do: remarks and layout do not count.

    Nor do docstrings without `words`.
    """
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(_tree(file, file.stat().st_mtime_ns, words))
    return digest.hexdigest()[:12]


@cache
def _tree(file: Path, _changed: int, words: bool) -> bytes:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in [] if words else ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            if ast.get_docstring(node, clean=False) is not None:
                node.body = node.body[1:]
    return ast.dump(tree).encode()


def package_files() -> list[Path]:
    """The files of softnn on which results depend: not those that only show them."""
    package = Path(softnn.__file__).parent
    return [
        f
        for f in package.rglob("*.py")
        if f.name not in SHOWING and f.parent != Path(__file__).parent
    ]


def markdown(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table as Markdown, its columns padded so that it reads well as it is.

    >>> print(markdown(["model", "NRMSE"], [["PL-SLS", "2.27 %"], ["network", None]]))
    | model   |  NRMSE |
    | :------ | -----: |
    | PL-SLS  | 2.27 % |
    | network |      - |
    """
    cells = [["-" if c is None else str(c) for c in row] for row in rows]
    columns = list(zip(header, *cells, strict=True))
    widths = [max(3, *(len(c) for c in column)) for column in columns]
    sides = [">" if _numbers(column[1:]) else "<" for column in columns]

    def line(row: Sequence[str]) -> str:
        padded = (f"{c:{s}{w}}" for c, s, w in zip(row, sides, widths, strict=True))
        return "| " + " | ".join(padded) + " |"

    rules = [
        ":" + "-" * (w - 1) if s == "<" else "-" * (w - 1) + ":"
        for s, w in zip(sides, widths, strict=True)
    ]
    return "\n".join([line(header), line(rules), *map(line, cells)])


def _numbers(cells: Sequence[str]) -> bool:
    return all(c == "-" or c.lstrip("-+")[:1].isdigit() for c in cells)


def percent(fraction: float | None, digits: int = 2) -> str | None:
    """A fraction as it is printed; None stays None.

    >>> percent(0.0504), percent(None)
    ('5.04 %', None)
    """
    if fraction is None or not math.isfinite(fraction):
        return None
    return f"{100 * fraction:.{digits}f} %"


# --- figures --------------------------------------------------------------------------

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Okabe and Ito's palette (2008): told apart by colour-blind readers too."""
INK, FAINT = "#222222", "#8a8a8a"


def new_figure(width: float = 7.2, height: float = 3.2) -> Figure:
    """An empty figure [inches], without a window system behind it."""
    from matplotlib import rcParams
    from matplotlib.figure import Figure

    rcParams.update(
        {
            "font.size": 9,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.edgecolor": FAINT,
            "axes.labelcolor": INK,
            "axes.titlesize": 9,
            "axes.titlelocation": "left",
            "xtick.color": INK,
            "ytick.color": INK,
            "legend.frameon": False,
            "svg.hashsalt": "softnn",  # the same figure is the same file
        }
    )
    return Figure(figsize=(width, height), layout="constrained")


def save_figure(figure: Figure, name: str, folder: Path | None = None) -> list[Path]:
    """Write NAME.png and NAME.svg beside the result; their paths."""
    folder = RESULTS if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png", folder / f"{name}.svg"]
    figure.savefig(paths[0], dpi=150)
    figure.savefig(paths[1], metadata={"Date": None})
    return paths
