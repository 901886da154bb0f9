"""Thresholds and options of the rivals, from cases with development seeds.

`python -m studies.rivals.tuning` forges cases at two strengths, lets every method look
at them with each of its options, and keeps what names best: the mean of the shares of
single effects named right and alone, of nulls called nothing, and of unlisted things
not named. Methods that only predict keep what predicts best. Written to tuned.json.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from bench import scoring
from bench.concealed import details, orders, sealing
from bench.rivals import classifier, methods
from bench.rivals.naming import Found, Rule, diagnosis
from bench.rivals.problem import read
from softnn import json_file
from softnn.contracts import InputError
from softnn.study.common import guarded, parser, runs_folder

STRENGTHS = (1.0, 0.3)
GRID = tuple(
    Rule(share, least, enough)
    for share, least, enough in itertools.product(
        (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9),
        (-1.0, 0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9),
        (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99),
    )
)
PREDICTED = 3  # cases at each strength for methods that only predict, and slowly
GROUPS = ("single", "null", "unlisted")


def make_parser() -> argparse.ArgumentParser:
    p = parser("rivals.tuning", __doc__)
    p.set_defaults(seed=7100)
    p.add_argument("--cases", type=int, default=1, help="of each effect (1)")
    p.add_argument("--nulls", type=int, default=8, help="at each strength (8)")
    p.add_argument("--unlisted", type=int, default=8, help="at each strength (8)")
    p.add_argument("--lessons", type=int, default=12, help="of each effect (12)")
    p.add_argument("--methods", nargs="+", default=[], metavar="NAME")
    p.add_argument("--jobs", type=int, default=1, help="for the lessons (1)")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    arguments = make_parser().parse_args(argv)
    return guarded(lambda: run(arguments))


def run(a: argparse.Namespace) -> None:
    from tqdm import tqdm

    if a.seed + len(STRENGTHS) > orders.FIRST_TRIAL_SEED:
        raise InputError(
            f"seed is {a.seed}; tuning is for seeds below {orders.FIRST_TRIAL_SEED}"
        )
    wanted = [methods.method(n) for n in a.methods] or list(methods.METHODS)
    wanted = [m for m in wanted if m.tuned and not m.missing]
    home = runs_folder(a.smoke)
    lessons = None
    if any(m.lessons for m in wanted):
        lessons = classifier.lessons(a.lessons, a.jobs, home / "rivals")
    looked: list[dict[str, Any]] = []
    with TemporaryDirectory() as scratch:
        for i, strength in enumerate(STRENGTHS):
            plan = orders.plan(
                a.seed + i,
                strength,
                each=a.cases,
                nulls=a.nulls,
                pairs=0,
                unlisted=a.unlisted,
                only=("zero_offset",) if a.smoke else (),
            )
            folder = Path(scratch) / str(i)
            sealing.write_cases(plan, folder)
            for n, key in enumerate(tqdm(sealing.open_key(folder), unit="case")):
                some = [m for m in wanted if m.names or n < PREDICTED]
                looked.append(case(folder / "cases" / key["case"], key, some, lessons))
    chosen = {m.name: choose(m, looked) for m in wanted}
    path = home / "tuned.json" if a.smoke else methods.TUNED
    kept = json.loads(path.read_text())["methods"] if path.exists() else {}
    about = {
        "seeds": [a.seed + i for i in range(len(STRENGTHS))],
        "strengths": list(STRENGTHS),
        "cases": len(looked),
    }
    content = {"methods": kept | {n: c | about for n, c in chosen.items()}}
    json_file.write(path, content)
    for name, one in chosen.items():
        print(name, one)


def case(
    folder: Path,
    key: Mapping[str, Any],
    wanted: Iterable[methods.Method],
    lessons: Path | None,
) -> dict[str, Any]:
    """What every method finds in a case with each of its options, and the truth."""
    problem = read(folder)
    found = {}
    for one in wanted:
        for i, options in enumerate(one.options):
            made, _ = methods.look(one, problem, key["seed"], options, lessons)
            found[one.name, i] = made
    return {"group": key["group"], "effects": key["effects"], "found": found}


def choose(one: methods.Method, looked: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The best of a method's options, with the best rule for it."""
    if not one.names:
        errors = [
            float(
                np.median(
                    [
                        c["found"][one.name, i].heldout_nrmse
                        for c in looked
                        if (one.name, i) in c["found"]
                    ]
                )
            )
            for i in range(len(one.options))
        ]
        best = int(np.argmin(errors))
        return {"options": one.options[best], "heldout_nrmse": errors[best]}
    tried = []
    for i, options in enumerate(one.options):
        rule, value, rates = best_rule([(c, c["found"][one.name, i]) for c in looked])
        tried.append((value, options, rule, rates))
    value, options, rule, rates = max(tried, key=lambda t: t[0])
    return {"options": options, "rule": vars(rule), "value": value, "rates": rates}


def best_rule(
    cases: Sequence[tuple[Mapping[str, Any], Found]],
) -> tuple[Rule, float, dict[str, float]]:
    """The rule of the grid with the largest mean rate; the middle one among equals."""
    values = []
    for rule in GRID:
        rates = rates_of(cases, rule)
        values.append(float(np.mean(list(rates.values()))))
    top = max(values)
    equals = [r for r, v in zip(GRID, values, strict=True) if v > top - 1e-9]
    table = np.array([[r.share, r.least, r.enough] for r in equals])
    middle = np.median(table, axis=0)
    rule = equals[int(np.argmin(np.abs(table - middle).sum(axis=1)))]
    return rule, top, rates_of(cases, rule)


def rates_of(
    cases: Sequence[tuple[Mapping[str, Any], Found]], rule: Rule
) -> dict[str, float]:
    right: dict[str, list[bool]] = {g: [] for g in GROUPS}
    for truth, found in cases:
        made = diagnosis(found, rule, 0.0, 0.0)
        right[truth["group"]].append(scoring.right(details.hidden_in(truth), made))
    return {g: float(np.mean(v)) for g, v in right.items() if v}
