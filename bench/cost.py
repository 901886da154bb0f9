r"""What does a diagnosis cost, against the number of samples and of candidate effects?

Cases by other hands, of seven recordings each, are written down with more and more
samples, and diagnosed one at a time in this process; then with more and more effects to
choose from.
Two curves stand over the samples. As it is: the search looks at no more than a thousand
samples a recording (`thin`: evenly spaced, every reversal kept), and regions, figures
and errors at no more than six thousand, so beyond these the cost is that of reading.
Unthinned: the same code told to use every sample, which is what its algorithms cost.
A slope on log-log axes of 1 is linear; what is paid once per case makes it less.

Seconds mean something on an idle machine only. What is finished is kept (--fresh starts
anew).
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import numpy as np
import pandas as pd

from bench.hands.bases import Base
from bench.hands.drawing import draw_setup, strength_for
from bench.hands.families import DEVELOPMENT
from bench.hands.grid import CLEAR
from bench.hands.noises import given
from bench.hands.orders import laws_of
from bench.hands.programmes import Course
from bench.hands.testing import Planted, Setup, simulate
from bench.trials.trial import check_names
from softnn.contracts import InputError
from softnn.database import Store
from softnn.mismatch import accounts, base, prediction
from softnn.mismatch.case import read_case
from softnn.mismatch.diagnosis import diagnose
from softnn.study.common import (
    COLOURS,
    code_of,
    fingerprint,
    guarded,
    markdown,
    new_figure,
    package_files,
    parser,
    results_folder,
    runs_folder,
    save_figure,
    write_result,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RECORDINGS, LEVEL = 7, 0.005
# One of each stage, and none: what has to be searched for decides the time.
PLANTED = ("", "slack", "mullins_softening", "zero_offset")
SIZES = (250, 500, 1000, 2000, 5000, 10_000, 20_000)
UNTHINNED = (250, 500, 1000, 2000, 5000)
POOLS = (1, 2, 4, 8, 12, 19)
USUAL = 1000  # samples a recording while the effects vary
EVERY = 10**9


@dataclass(frozen=True)
class Specimen:
    """A case by other hands before it is sampled."""

    effect: str
    setup: Setup
    planted: Planted

    def sampled(self, samples: int) -> tuple[Setup, list[np.ndarray]]:
        """The test with so many samples in each recording, and its clean stress."""
        courses = [resampled(c, samples) for c in self.setup.courses]
        setup = replace(self.setup, courses=courses)
        return setup, simulate(setup, self.planted)

    def write(self, folder: Path, samples: int, seed: int) -> None:
        """The recordings, each of so many samples at one interval, with white noise."""
        setup, clean = self.sampled(samples)
        sigma = LEVEL * float(np.ptp(np.concatenate(clean)))
        rng = np.random.default_rng([seed, samples])
        (folder / "recordings").mkdir(parents=True)
        for i, (c, stress) in enumerate(zip(setup.courses, clean, strict=False)):
            table = {
                "time_s": c.time_s,
                "strain": c.strain,
                "stress_MPa": stress + sigma * rng.standard_normal(samples),
            }
            file = folder / "recordings" / f"recording-{i + 1:02d}.csv"
            pd.DataFrame(table).to_csv(file, index=False, float_format="%.8g")
        (folder / "case.toml").write_text(f'model = "{self.setup.model}"\n')


def resampled(course: Course, samples: int) -> Course:
    """The same course, read so many times at one interval."""
    time = np.linspace(course.time_s[0], course.time_s[-1], samples)
    strain, warmth = (
        np.interp(time, course.time_s, x) for x in (course.strain, course.warmth_C)
    )
    rate = float((samples - 1) / (time[-1] - time[0]))
    return Course(course.kind, rate, time, strain, warmth)


def specimen(effect: str, seed: int) -> Specimen:
    """A case of seven recordings, pl-wiechert, one virgin specimen for each of them."""
    laws = tuple(laws_of(effect, DEVELOPMENT)[:1]) if effect else ()
    for number in range(1000):
        rng = np.random.default_rng([seed, number])
        setup, _, specimens, _ = draw_setup(
            rng, DEVELOPMENT, laws, "pl-wiechert", number
        )
        if setup.n != RECORDINGS or setup.continued or specimens != "none":
            continue
        planted: Planted = []
        if laws:
            act = laws[0].make(rng, setup)
            base = Base(setup, given(LEVEL, 0.0, simulate(setup, ())), False)
            planted = [(act, strength_for(base, act, CLEAR)[0])]
        return Specimen(effect, setup, planted)
    raise InputError(f"seed {seed} gives no suitable case; try another")


# --- timing ---------------------------------------------------------------------------


@contextmanager
def unthinned() -> Iterator[None]:
    """Every sample is used, in the search and after it."""
    with (
        mock.patch.object(base, "SEARCH", EVERY),
        mock.patch.object(base, "REPORT", EVERY),
    ):
        yield


@contextmanager
def pool_of(names: Sequence[str]) -> Iterator[None]:
    """Only these effects are candidates, as far as the recordings could show them."""
    usual = accounts.candidates

    def fewer(*arguments: Any) -> Any:
        return [e for e in usual(*arguments) if e.id in names]

    with (
        mock.patch.object(accounts, "candidates", fewer),
        mock.patch.object(prediction, "candidates", fewer),
    ):
        yield


def pools(one: Specimen, folder: Path, sizes: Sequence[int]) -> list[list[str]]:
    """Growing choices among what the case could show, the planted effect first."""
    shown: list[str] = []
    usual = accounts.candidates

    def listen(*arguments: Any) -> Any:
        found = usual(*arguments)
        shown[:] = [e.id for e in found]
        return found

    with mock.patch.object(accounts, "candidates", listen):
        diagnose(read_case(folder))
    rng = np.random.default_rng(len(shown))
    others = [str(n) for n in rng.permutation(shown) if n != one.effect]
    ranked = ([one.effect] if one.effect else []) + others
    return [ranked[:k] for k in sorted({min(k, len(ranked)) for k in sizes})]


def timed(folder: Path, repeats: int) -> dict[str, Any]:
    """Seconds to read a case and to diagnose it, least of several; what was named."""
    reading, working = [], []
    for _ in range(repeats):
        begun = time.perf_counter()
        case = read_case(folder)
        reading.append(time.perf_counter() - begun)
        begun = time.perf_counter()
        found = diagnose(case)
        working.append(time.perf_counter() - begun)
    return {
        "read_s": min(reading),
        "diagnose_s": min(working),
        "seconds": min(reading) + min(working),
        "selected": found.result["selected"],
    }


def measure(a: argparse.Namespace, store: Store) -> list[dict[str, Any]]:
    """Rows of all timings: which curve, which effect, how many."""
    from tqdm import tqdm

    rows: list[dict[str, Any]] = []
    known = store.rows()
    total = len(a.effects) * (len(a.sizes) + len(a.unthinned) + len(a.pools))
    bar = tqdm(total=total, unit="timing", file=sys.stderr)
    for effect in a.effects:
        one = specimen(effect, a.seed)
        with tempfile.TemporaryDirectory() as place:
            folders = {}
            for n in sorted({*a.sizes, *a.unthinned, a.usual}):
                folders[n] = Path(place) / str(n)
                one.write(folders[n], n, a.seed)
            choices = pools(one, folders[a.usual], a.pools)  # compiles what is compiled

            def add(curve: str, count: int, folder: Path, name: str = effect) -> None:
                row = {"curve": curve, "planted": name, "count": count}
                key = fingerprint([row, a.usual, a.repeats, a.seed])
                if key not in known:
                    store.add(key, row | timed(folder, a.repeats))
                    known[key] = store.rows()[key]
                rows.append(known[key])
                bar.update()

            for n in a.sizes:
                add("samples", n, folders[n])
            with unthinned():
                for n in a.unthinned:
                    add("unthinned", n, folders[n])
            for names in choices:
                with pool_of(names):
                    add("effects", len(names), folders[a.usual])
    bar.close()
    return rows


# --- what is said ---------------------------------------------------------------------


def slope(count: Sequence[float], seconds: Sequence[float]) -> float | None:
    """Exponent of a power law through the points, by least squares in logarithms.

    >>> round(slope([10, 100, 1000], [2.0, 20.0, 200.0]), 12)
    1.0
    """
    if len(set(count)) < 2:
        return None
    return float(np.polyfit(np.log(count), np.log(seconds), 1)[0])


def curve_of(rows: Sequence[dict[str, Any]], name: str) -> dict[str, Any]:
    """Mean seconds over the cases at every count that all of them have; slopes."""
    table = pd.DataFrame([r for r in rows if r["curve"] == name])
    wide = table.pivot(index="count", columns="planted", values="seconds").dropna()
    mean = wide.mean(axis=1)
    counts, seconds = [int(n) for n in mean.index], [float(v) for v in mean]
    read = table.groupby("count").read_s.mean()
    # What is paid once a case, and for one more.
    each, once = (
        np.polyfit(counts, seconds, 1) if len(counts) > 1 else (float("nan"),) * 2
    )
    return {
        "counts": counts,
        "seconds": seconds,
        "read_s": [float(read[n]) for n in counts],
        "slope": slope(counts, seconds),
        "slope_upper_half": slope(
            counts[len(counts) // 2 :], seconds[len(counts) // 2 :]
        ),
        "seconds_for_one_more": float(each),
        "seconds_once": float(once),
    }


def as_markdown(curves: dict[str, dict[str, Any]]) -> str:
    heads = {
        "samples": "samples a recording",
        "unthinned": "samples, all used",
        "effects": "effects to choose from",
    }
    tables = []
    for name, c in curves.items():
        rows = [
            [n, f"{s:.2f}", f"{r:.2f}"]
            for n, s, r in zip(c["counts"], c["seconds"], c["read_s"], strict=True)
        ]
        if c["slope"] is not None:
            rows.append(["slope", f"{c['slope']:.2f}", None])
        tables.append(markdown([heads[name], "seconds a case", "of it reading"], rows))
    return "\n\n".join(tables)


def cost_figure(curves: dict[str, dict[str, Any]]) -> Figure:
    """Seconds against samples and against effects, both on log-log axes."""
    figure = new_figure(7.2, 3.0)
    left, right = figure.subplots(1, 2)
    draw(left, curves["samples"], "as it is (thinned)", COLOURS[0])
    draw(left, curves["unthinned"], "every sample", COLOURS[1])
    left.set_xticks(curves["samples"]["counts"], curves["samples"]["counts"])
    left.tick_params(axis="x", labelrotation=45)
    left.set_xlabel(f"samples in each of {RECORDINGS} recordings")
    draw(right, curves["effects"], "", COLOURS[0])
    right.set_xticks(curves["effects"]["counts"], curves["effects"]["counts"])
    right.set_xlabel("effects to choose from")
    left.set_ylabel("seconds a case")
    return figure


def draw(axes: Axes, curve: dict[str, Any], name: str, colour: str) -> None:
    told = "" if curve["slope"] is None else f"slope {curve['slope']:.2f}"
    label = ", ".join(p for p in (name, told) if p)
    axes.loglog(
        curve["counts"], curve["seconds"], color=colour, marker="o", ms=3, label=label
    )
    low, high = axes.get_ylim()
    marks = (0.1, 0.2, 0.3, 0.5, 1, 2, 3, 5, 10, 20, 30, 50, 100)
    seconds = [s for s in marks if low < s < high]
    axes.set_yticks(seconds, [f"{s:g}" for s in seconds])
    axes.minorticks_off()
    axes.legend(fontsize=7)


# --- the command ----------------------------------------------------------------------


def make_parser() -> argparse.ArgumentParser:
    p = parser("cost", __doc__)
    p.add_argument("--sizes", nargs="+", type=int, default=SIZES, metavar="N")
    p.add_argument("--unthinned", nargs="+", type=int, default=UNTHINNED, metavar="N")
    p.add_argument("--pools", nargs="+", type=int, default=POOLS, metavar="N")
    p.add_argument("--effects", nargs="+", default=PLANTED, metavar="EFFECT")
    p.add_argument("--repeats", type=int, default=2, help="the least counts (2)")
    p.add_argument("--out", type=Path, help="folder (mlruns/results)")
    p.add_argument("--fresh", action="store_true", help="forget finished timings")
    p.set_defaults(usual=USUAL)
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.cost`; returns the exit code."""
    arguments = make_parser().parse_args(argv)
    return guarded(lambda: run(arguments))


def run(a: argparse.Namespace) -> None:
    check_names([name for name in a.effects if name])
    if min(*a.sizes, *a.unthinned) < 50 or min(*a.pools, a.repeats) < 1:
        raise InputError("sizes start at 50 samples, --pools and --repeats at 1")
    if a.smoke:
        a.effects, a.repeats, a.usual = ("zero_offset",), 1, 100
        a.sizes, a.unthinned, a.pools = (100, 200), (100, 200), (1, 3)
    file = runs_folder(a.smoke) / "cost.sqlite"
    with Store(file, code_of(package_files()), fresh=a.smoke or a.fresh) as store:
        rows = measure(a, store)
    names = ("samples", "unthinned", "effects")
    curves = {name: curve_of(rows, name) for name in names}
    print(as_markdown(curves))
    usual = dict(
        zip(curves["samples"]["counts"], curves["samples"]["seconds"], strict=True)
    )
    headline = {
        "seconds_of_7_by_1000": usual.get(USUAL),
        "slope_samples": curves["samples"]["slope"],
        "slope_samples_unthinned": curves["unthinned"]["slope"],
        "slope_effects": curves["effects"]["slope"],
        "seconds_for_one_more_effect": curves["effects"]["seconds_for_one_more"],
        "search_samples": base.SEARCH,
        "report_samples": base.REPORT,
        "cores": os.cpu_count(),
    }
    folder = a.out or results_folder(a.smoke, a.publish)
    body = {"curves": curves, "timings": rows, "repeats": a.repeats, "forge": "hands"}
    written = write_result("cost", headline, body, seed=a.seed, folder=folder)
    save_figure(cost_figure(curves), "cost", folder)
    print(f"written to {written}")
