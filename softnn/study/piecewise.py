"""What the studies of piecewise-linear models share: their data, options and runs."""

from __future__ import annotations

import argparse
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn import prepare
from softnn.contracts import InputError
from softnn.materials import MATERIALS, table
from softnn.readers.tidy import load
from softnn.recording import Recording, data_hash
from softnn.study.baselines import (
    RULES,
    TOLERANCES,
    RelaxationTest,
    Variant,
    fitted_curve,
    relaxation_tests,
    variants,
)
from softnn.study.common import (
    RUNS,
    Parser,
    database,
    fingerprint,
    guarded,
    new_figure,
    parser,
    results_folder,
    runs_folder,
    save_figure,
    write_result,
)
from softnn.study.material_data import prepared
from softnn.study.settings import Settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# A set without relaxation tests may take branches from another of the same material.
HOLDS = {"vhb4910-hossain2012-digitised": "vhb4910-zhao"}


@dataclass(frozen=True)
class Case:
    """One material: mean curves of its rates, and branches from its holds."""

    source: str
    material: str
    curves: list[Recording]
    tests: list[RelaxationTest]
    variants: list[Variant]
    holds_from: str
    digest: str

    @property
    def label(self) -> str:
        kind = "virtual specimens" if self.source == "virtual" else self.source
        return f"{self.material}, {kind}"

    @property
    def fitted(self) -> Recording:
        """The curve the thesis takes k* from."""
        return fitted_curve(self.curves)

    def primary(self, model: str) -> Variant:
        """The thesis's way to branches, from the longest hold (of the least strain)."""
        mine = [v for v in self.variants if v.model == model and v.rule == RULES[model]]
        return max(
            mine, key=lambda v: (round(np.log(v.held_s), 1), -abs(v.held_strain))
        )

    def published(self, number: str, model: str) -> dict[str, Any] | None:
        """The row of a published table, for a virtual material."""
        if self.source != "virtual":
            return None
        return table(number).row(material=self.material, model=model)


@dataclass(frozen=True)
class Work:
    """The settings of one study, and the folder of its results."""

    cases: list[Case]
    tolerances: tuple[float, ...]
    name: str
    seed: int
    smoke: bool
    tracking: str
    folder: Path
    figures: Path


def options(name: str, doc: str | None) -> Parser:
    made = parser(name, doc)
    made.add_argument("--material", default="all", help="a material, or all (all)")
    made.add_argument(
        "--data",
        default="virtual",
        metavar="SOURCE",
        help="virtual, a set of recordings in SOFTNN_DATA, a folder or a tidy CSV",
    )
    made.add_argument(
        "--holds", metavar="SOURCE", help="relaxation tests, where they lie elsewhere"
    )
    made.add_argument(
        "--as-is", action="store_true", help="take implausible numbers as they stand"
    )
    made.add_argument("--tracking", help=f"MLflow (sqlite:///{RUNS}/mlflow.db)")
    made.add_argument("--out", type=Path, metavar="FOLDER", help="for the result")
    return made


def carry_out(
    name: str,
    doc: str | None,
    argv: Sequence[str] | None,
    study: Callable[[Work, Case], dict[str, Any]],
    draw: Callable[[Work, list[Case], list[dict[str, Any]]], Figure],
) -> int:
    """The command of a study: one call of `study` a material, a figure, a result."""
    arguments = options(name, doc).parse_args(argv)

    def work() -> None:
        asked = asked_for(name, arguments)
        found = []
        for case in asked.cases:
            one = study(asked, case)
            track(name, asked, case, one)
            found.append(one)
        # A figure of real recordings would publish recordings that belong to others.
        figures = save_figure(
            draw(asked, asked.cases, found), asked.name, asked.figures
        )
        headline = {
            key if len(found) == 1 else f"{one['material']}_{key}": value
            for one in found
            for key, value in one["headline"].items()
        }
        path = write_result(
            asked.name,
            headline,
            {"materials": [without_trials(one) for one in found]},
            seed=asked.seed,
            data={case.label: case.digest for case in asked.cases},
            folder=asked.folder,
        )
        print(f"\nresult: {path}; figure: {figures[0]}; runs: {asked.tracking}")

    return guarded(work)


def asked_for(name: str, arguments: argparse.Namespace) -> Work:
    home = runs_folder(arguments.smoke)
    material, data = arguments.material, arguments.data
    if arguments.smoke and data == "virtual" and material == "all":
        material = "NatPolR"
    source = Path(data).stem
    whole = material == "all"
    named = [name] + ([] if data == "virtual" else [source])
    named += [] if whole else ["".join(c for c in material if c.isalnum())]
    project = results_folder(arguments.smoke, arguments.publish)
    local = home / "results"
    return Work(
        cases=cases(
            data,
            material,
            arguments.holds,
            arguments.seed,
            arguments.smoke,
            arguments.as_is,
        ),
        tolerances=TOLERANCES[::4] if arguments.smoke else TOLERANCES,
        name="-".join(named),
        seed=arguments.seed,
        smoke=arguments.smoke,
        tracking=database(arguments.tracking, arguments.smoke),
        folder=arguments.out or (project if whole else local),
        figures=arguments.out or (project if whole and data == "virtual" else local),
    )


def cases(
    data: str,
    material: str,
    holds: str | None,
    seed: int,
    smoke: bool = False,
    as_is: bool = False,
) -> list[Case]:
    """The materials asked for. Raises `InputError` for one without a hold."""
    if data == "virtual" and material not in (*MATERIALS, "all"):
        raise InputError(
            f"no material {material!r}; there are {', '.join(MATERIALS)} and all"
        )
    settings = Settings(
        data=data,
        material=material,
        seed=seed,
        samples=60 if smoke else None,
        as_is=as_is,
    )
    holds = holds or HOLDS.get(data)
    made = []
    for one in prepared(settings):
        relaxation, origin = one.relaxation, "the same recordings"
        if holds:
            relaxation = [r for r in load(holds) if r.test == "relaxation"]
            origin = holds
        if not relaxation:
            raise InputError(
                f"{one.label}: no relaxation test to take branches from; give --holds"
            )
        made.append(
            Case(
                source=one.source,
                material=one.material,
                curves=prepare.unify(one.tensile),
                tests=relaxation_tests(relaxation),
                variants=list(variants(relaxation)),
                holds_from=origin,
                digest=data_hash([*one.tensile, *relaxation]),
            )
        )
    return made


def track(name: str, work: Work, case: Case, found: Mapping[str, Any]) -> None:
    """A parent run of the material, a nested run for each of `found["trials"]`."""
    from softnn.tracking import Tracker

    key = fingerprint([work.name, case.material, case.digest, work.tolerances])
    with Tracker(
        work.tracking,
        name,
        study=f"{name}-{key}",
        identity=uuid.uuid4().hex,
        name=case.label,
        parameters={
            "material": case.material,
            "holds": case.holds_from,
            "seed": work.seed,
            "tolerances": ", ".join(f"{t:g}" for t in work.tolerances),
        },
        data=(case.source, case.digest),
    ) as tracker:
        now = datetime.now()
        for trial in found["trials"]:
            tracker.trial(
                trial["name"],
                trial["parameters"],
                trial["metrics"],
                started=trial.get("started", now),
                ended=trial.get("ended", now),
            )
        figures = {
            k: float(v)
            for k, v in found["headline"].items()
            if isinstance(v, int | float) and np.isfinite(v)
        }
        tracker.result(
            figures,
            note=f"**{case.label}**\n\n{found['text']}",
            texts={f"{name}.md": found["text"]},
        )


def without_trials(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part for the result file: no trials, no text, nothing for figures."""
    return {k: v for k, v in found.items() if k not in ("trials", "text", "drawn")}


def panels(number: int, height: float = 2.4, columns: int = 4) -> tuple[Figure, list]:
    """A figure of equal panels; the surplus ones are hidden."""
    columns = min(number, columns)
    rows = -(-number // columns)
    figure = new_figure(max(4.4, 2.6 * columns), height * rows + 0.4)
    grid: list[Axes] = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for axes in grid[number:]:
        axes.set_visible(False)
    return figure, grid[:number]


def note_errors(axes: Axes, rows: Mapping[str, Sequence[float | None]]) -> None:
    """Errors [fractions] of both models in a corner: as published, as found."""
    lines = [
        f"{name}: {', '.join(f'{100 * v:.2f}' for v in errors if v is not None)} %"
        for name, errors in rows.items()
        if any(v is not None for v in errors)
    ]
    axes.text(
        0.98,
        0.02,
        "\n".join(lines),
        transform=axes.transAxes,
        fontsize=6,
        ha="right",
        va="bottom",
    )


def legend_below(figure: Figure, axes: Axes, number: int) -> None:
    """One legend for all panels, as wide as they are."""
    handles, labels = axes.get_legend_handles_labels()
    columns = 3 if number > 2 else 1
    figure.legend(
        handles, labels, loc="outside lower center", ncols=columns, fontsize=8
    )


def speed_label(case: Case, curve: Recording) -> str:
    """The rate of a curve: a crosshead speed for the virtual materials."""
    rate = curve.rate_per_s
    if rate is None:
        return "rate not given"
    if case.source == "virtual":
        return f"{round(rate * 33 * 60)} mm/min"
    return f"{rate:.3g} /s"
