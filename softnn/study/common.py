"""What every study shares: its command line, its result file, its figures.

A study is a module with `main(argv=None) -> int` that ends in

    if __name__ == "__main__":
        sys.exit(main())

whose options come from `parser`, whose work is done within `guarded`, and which hands
its findings to `write_result`. A run writes under `mlruns/results`; with `--publish` it
replaces the project's own results in `studies/results`. With `--smoke` it takes
seconds, on data as small as can be, and writes under `mlruns/smoke`.
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
import subprocess
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

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS = Path(softnn.__file__).parents[1] / "studies" / "results"
AFTER_S = 0.01  # after which a lost interrupt is sent again: the callback is over
RUNS = Path("mlruns")  # below the folder the study is started in; ignored by git
SHOWING = ("cli.py", "report.py", "tracking.py")  # files that show results
MADE_BY_CODE = ("--", ".", ":!studies/results", ":!docs", ":!README.md")
PACKAGES = ("numpy", "scipy", "pandas", "torch", "optuna", "mlflow")


class Parser(argparse.ArgumentParser):
    """Prints a wrong option in one line, as `InputError` does, and exits with 2."""

    def error(self, message: str) -> NoReturn:
        print(f"{self.prog}: {message}; --help lists the options", file=sys.stderr)
        raise SystemExit(2)


def parser(name: str, doc: str | None) -> Parser:
    """A parser for `python -m studies.NAME`, with --seed, --smoke and --publish.

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
    made.add_argument(
        "--publish",
        action="store_true",
        help="write into studies/results, not mlruns/results",
    )
    return made


def guarded(work: Callable[[], None]) -> int:
    """The exit code of `work`: 0, 2 for unusable input, 130 for ctrl-C or `kill`."""
    commit()  # of the code as it was loaded: a long study may outlive it
    try:
        with killed_as_by_ctrl_c(), lost_interrupts_sent_again():
            work()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nstopped; finished trials are kept", file=sys.stderr)
        return 130
    return 0


@contextmanager
def killed_as_by_ctrl_c() -> Iterator[None]:
    """Make a command that a study has started end with the study."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def lost_interrupts_sent_again() -> Iterator[None]:
    """Make ctrl-C end a study even where Python would print and forget it.

    The interrupt may arrive while the garbage collector calls back, as it does for
    SQLAlchemy's connections. An exception there reaches `sys.unraisablehook` alone. If
    the hook raised it, it would be lost again, so a thread sends the signal afterwards.
    """
    before = sys.unraisablehook

    def hook(lost: sys.UnraisableHookArgs) -> None:
        if issubclass(lost.exc_type, KeyboardInterrupt):
            again = threading.Timer(AFTER_S, _interrupt)
            again.daemon = True
            again.start()
        else:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


def _interrupt() -> None:
    if hasattr(signal, "pthread_kill"):  # wakes the main thread from a sleep too
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)


def runs_folder(smoke: bool = False) -> Path:
    """Return the folder of runs and of stores that a stopped study goes on from."""
    return RUNS / "smoke" if smoke else RUNS


def results_folder(smoke: bool = False, publish: bool = False) -> Path:
    """Return the folder of results: of the project if published, else of the runs."""
    return RESULTS if publish and not smoke else runs_folder(smoke) / "results"


def database(given: str | None, smoke: bool, name: str = "mlflow") -> str:
    """Return the address given, or that of NAME.db in the folder of runs."""
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
    """Write FOLDER/NAME.json and return its path.

    The folder is that of `results_folder` by default.

    `headline` is flat: the figures that a text may quote, fractions as fractions, with
    the unit in the name. `body` has all other results. `data` maps the data used to
    their hash (`softnn.recording.data_hash`). The file also has the date, the commit
    (see `commit`), the versions, the machine, and the study. NaN and infinity become
    null.

    Raises `InputError` for a headline that is not flat.
    """
    nested = [k for k, v in headline.items() if isinstance(v, Mapping | list | tuple)]
    if nested:
        raise InputError(f"headline of {name} is not flat: {', '.join(nested)}")
    content = {
        "study": name,
        "headline": headline,
        **{k: v for k, v in provenance().items() if k != "softnn"},
        "seed": seed,
        "data": data or {},
        "versions": versions(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        **{k: v for k, v in body.items() if k not in ("study", "headline")},
    }
    folder = results_folder() if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    json_file.write(path, content)
    return path


def provenance() -> dict[str, str]:
    """Return date, version, commit and study of a result made now.

    If one result file keeps parts of several runs, each part has its own.
    """
    found = {
        "made": datetime.now(UTC).strftime("%Y-%m-%d"),
        "softnn": softnn.__version__,
        "commit": commit(),
        "made_by": running_study(),
    }
    return {k: v for k, v in found.items() if v is not None}


def made_with(found: Mapping[str, Any]) -> str:
    """A sentence on the version, commit and date of a result, or of a part of one.

    >>> made_with({"softnn": "0.1.0", "commit": "f85995a", "made": "2026-11-27"})
    'Made with softnn 0.1.0 at commit f85995a, 2026-11-27.'
    """
    about = dict.fromkeys(("softnn", "commit", "made"), "unknown")
    about |= provenance_of(found)
    return "Made with softnn {softnn} at commit {commit}, {made}.".format(**about)


def provenance_of(found: Mapping[str, Any]) -> dict[str, str]:
    """Date, version and commit that a result file, or a part of one, states."""
    about = {**found.get("versions", {}), **found}
    return {k: about[k] for k in ("made", "softnn", "commit") if about.get(k)}


@cache
def commit() -> str | None:
    """The short hash of the commit that runs; None outside of a git checkout.

    It ends in `-dirty` if tracked files differ from the commit. Results and pages do
    not count: the first study of several would make all later ones dirty.
    """
    root = Path(softnn.__file__).parents[1]

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(root), *words], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")) != root.resolve():
            return None  # installed below a checkout of something else
        head = git("rev-parse", "--short", "HEAD")
        changed = git("status", "--porcelain", "--untracked-files=no", *MADE_BY_CODE)
    except (OSError, subprocess.CalledProcessError):
        return None
    return f"{head}-dirty" if changed else head


def running_study() -> str | None:
    """The module that `python -m` runs, where it is one of the studies."""
    spec = getattr(sys.modules.get("__main__"), "__spec__", None)
    name = getattr(spec, "name", "")
    return name if name.startswith("studies.") else None


def versions() -> dict[str, str]:
    """Return the versions of the packages that a result depends on."""
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


def code_of(files: Iterable[Path]) -> str:
    """Return a short hash of the code in files; comments and docstrings do not count.

    It keys the stores that a stopped study goes on from, and nothing else.
    """
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(_tree(file, file.stat().st_mtime_ns))
    return digest.hexdigest()[:12]


@cache
def _tree(file: Path, _changed: int) -> bytes:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            if ast.get_docstring(node, clean=False) is not None:
                node.body = node.body[1:]
    return ast.dump(tree).encode()


def package_files() -> list[Path]:
    """Return the files of softnn that results depend on, not those that show them."""
    package = Path(softnn.__file__).parent
    return [
        f
        for f in package.rglob("*.py")
        if f.name not in SHOWING and f.parent != Path(__file__).parent
    ]


def markdown(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table as Markdown, with columns padded to equal width.

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
"""Okabe and Ito's palette (2008): which colour-blind readers can distinguish."""
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
    folder = results_folder() if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png", folder / f"{name}.svg"]
    figure.savefig(paths[0], dpi=150)
    figure.savefig(paths[1], metadata={"Date": None})
    return paths
