"""Which network for which use: inputs, neurons, regularisation and lag in one search?

One search a material over input architectures (those of Table 6.3, with the stress fed
back as in section 6.4.1, with filtered strains and Gaussian units as in 8.3, and gated
recurrent units), 1 to 20 neurons, three ways of regularisation, and the lag of past
inputs as a time. There are two objectives: the error by random folds, as published, and
the error at strain rates never seen (by recording where a set has one rate). The answer
is their Pareto front, with piecewise-linear models and gradient-boosted trees on the
same folds beside it.

A recurrent network goes through whole recordings. Of samples held out it sees the
strain, as others see it in lags and filters, never the stress; only what it says of
them is judged. It has no Bayesian regularisation.

Optuna prunes for one objective only, so folds are stopped by a rule of this study: the
unseen rates are judged whole, then random folds four at a time, until a network on the
present front is better at unseen rates and, by Wilcoxon's signed ranks over the folds
so far (one-sided, 0.1), by random folds too. A stopped trial keeps the mean of its
folds for the search and is never on the front.

Trials are drawn by Parzen estimators or NSGA-II (`--sampler`), or are all that the
thesis tabulates (`python -m studies.grid`): four inputs, each count of neurons, three
ways of regularisation, lags of one sample, every fold.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from bench.architectures import compared
from bench.architectures.choices import FINALISTS
from bench.architectures.page import result_files
from bench.architectures.report import draw
from bench.architectures.search import keep, searched
from bench.architectures.trials import FIRST_OF, TRAINING, trials_of
from softnn.contracts import InputError
from softnn.study.common import RESULTS, guarded, save_figure, write_result
from softnn.study.material_data import prepared
from softnn.study.settings import (
    Places,
    Settings,
    add_worker,
    places_of,
    settings_of,
    smoked,
    study_parser,
)
from softnn.study.sweep import headline_of_all

DEFAULTS = Settings(samples=100)  # neighbours in time say the same thing twice
TRIALS = 300
STUDY = "architectures"
FILES = {"tpe": STUDY, "grid": "grid"}  # published results, by sampler
DRAWN = {"grid": compared.draw}  # as other than a front
BEST = Path(__file__).with_name("best")


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.architectures`; returns the exit code."""
    made = study_parser(
        "architectures", __doc__, DEFAULTS, omit="inputs split regularisation lag-s"
    )
    made.add_argument("--trials", type=int, help=f"({TRIALS}; a grid has its own)")
    made.add_argument("--sampler", default="tpe", help=", ".join(FIRST_OF))
    made.add_argument(
        "--keep-best",
        action="store_true",
        help="write the recommended networks to studies/best, for the tests to hold",
    )
    made.add_argument(
        "--keep-published",
        action="store_true",
        help="the same with published choices, of --material or all; no search",
    )
    add_worker(made)
    arguments = made.parse_args(argv)

    def work() -> None:
        if arguments.keep_published:
            return keep_published(RESULTS, BEST, arguments.material)
        settings = settings_of(arguments, DEFAULTS)
        trials = trials_of(arguments.sampler, arguments.trials, TRIALS)
        usual = replace(
            DEFAULTS,
            material=settings.material,
            data=settings.data,
            cycles=settings.cycles,
        )
        published = settings == usual and arguments.sampler in FILES
        places = places_of(arguments, published)
        if arguments.smoke:
            run(smoked(settings), places, min(trials, 6), sampler=arguments.sampler)
        else:
            file = FILES.get(arguments.sampler, STUDY)
            keep_best = arguments.keep_best
            run(settings, places, trials, keep_best, arguments.sampler, file=file)

    return guarded(work)


def keep_published(results: Path, folder: Path, material: str | None) -> None:
    """Train the published choices, and write them to a folder.

    Those of one material, or of all if it is None.
    """
    for result in result_files(results).values():
        wanted = [m for m in result["materials"] if material in (None, m["material"])]
        if wanted:
            given = result["settings"]
            settings = Settings(**{**given, "neurons": tuple(given["neurons"])})
            known = {data.label: data for data in prepared(settings)}
            for one in wanted:
                keep(one, known[one["label"]], settings, folder)


def run(
    settings: Settings,
    places: Places,
    trials: int,
    keep_best: bool = False,
    sampler: str = "tpe",
    study: str = STUDY,
    file: str = STUDY,
    finalists: int = FINALISTS,
    compare: bool = False,
) -> dict[str, Any]:
    """The study of every material asked for; returns what was written.

    `study` names the experiment in MLflow, `file` the result file, which is written
    after each material; `compare` as for `bench.architectures.search.searched`.
    """
    found: list[dict[str, Any]] = []
    skipped: dict[str, str] = {}
    name = settings.file_name(file)

    def written() -> str:
        files = save_figure(DRAWN.get(sampler, draw)(found), name, places.results)
        path = write_result(
            name,
            headline_of_all(found),
            {
                "settings": asdict(settings),
                "training": asdict(TRAINING),
                "sampler": sampler,
                "materials": found,
                "left_out": skipped,
            },
            seed=settings.seed,
            data={one["label"]: one["data_sha256"] for one in found},
            folder=places.results,
        )
        return f"result: {path}; figure: {files[0]}"

    materials = prepared(settings)
    about = sampler, study, finalists, compare
    for data in materials:
        try:
            told = searched(data, settings, places, trials, *about)
            if told is None:
                continue
            found.append(told)
            if keep_best:
                keep(told, data, settings, BEST)
        except InputError as reason:
            if len(materials) == 1:
                raise
            skipped[data.label] = str(reason)
            print(f"\n{data.label}: left out: {reason}")
            continue
        said = written()
    if places.worker:
        return {}
    if not found:
        raise InputError(f"no material can be judged: {'; '.join(skipped.values())}")
    if skipped:
        said = written()
    print(f"\n{said}; runs: {places.tracking} (make ui)")
    return {"headline": headline_of_all(found), "materials": found}


if __name__ == "__main__":
    sys.exit(main())
