"""Real recordings: does anything that a user would pick instead predict better?

Every rival predicts the recordings that `python -m studies.recordings` predicts, from
the recordings that softnn fits there. Errors of the base and of softnn are those of
the published result of that study. A stopped run goes on; a published error is not
computed again while recordings, options and the code of the rivals stay the same.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.recordings.groups import Group, Split, discover
from bench.recordings.rows import MAIN
from bench.recordings.virtual import made_up
from bench.reporting import tracked
from bench.rivals import choice, features, laws, learners, methods, network_b, problem
from bench.rivals.choice import Method, judged, least
from bench.rivals.table import (
    ABOUT,
    ANY,
    BASE,
    BEST_LAW,
    SOFTNN,
    as_markdown,
    joined,
    summary,
    verdict,
)
from softnn.contracts import InputError
from softnn.database import Store
from softnn.readers.tidy import data_folder
from softnn.recording import data_hash
from softnn.study.common import (
    RESULTS,
    database,
    fingerprint,
    guarded,
    parser,
    provenance_of,
    results_folder,
    runs_folder,
    write_result,
)

NAME = "rivals"
PARTS = (choice, features, laws, learners, network_b, problem)
CODE = [Path(str(part.__file__)) for part in PARTS]
SMOKE = ("pl_sls", "yeoh", "trees")
OWN = {
    BASE: f"softnn without effects (base {MAIN})",
    SOFTNN: "softnn",
    BEST_LAW: "the published law that inner folds pick",
    ANY: "the rival that inner folds pick",
}


def make_parser() -> argparse.ArgumentParser:
    p = parser(NAME, __doc__)
    p.add_argument("--sets", nargs="+", default=[], metavar="SET", help="not all")
    p.add_argument("--methods", nargs="+", default=[], metavar="NAME", help="not all")
    p.add_argument("--data", type=Path, metavar="DIR", help="in place of SOFTNN_DATA")
    p.add_argument("--samples", type=int, default=6000, help="a recording, most (6000)")
    p.add_argument("--tracking", help="MLflow address (mlruns/mlflow.db)")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.rivals`; returns the exit code."""
    arguments = make_parser().parse_args(argv)
    return guarded(lambda: run(arguments))


def run(a: argparse.Namespace) -> None:
    wanted = methods.chosen(list(SMOKE) if a.smoke and not a.methods else a.methods)
    for one in filter(methods.missing, wanted):
        print(f"{one.name}: skipped, no {one.package}; {methods.INSTALL} has it")
    wanted = [m for m in wanted if not methods.missing(m)]
    if not wanted:
        raise InputError("no rival is left to run")
    groups, recordings = made_up(a.seed), made_up_rows(a.seed)
    if not a.smoke:
        folder = a.data or data_folder()
        if not any(folder.glob("*/index.csv")):
            print(
                f"no sets of recordings in {folder}; set SOFTNN_DATA to their folder. "
                "Nothing done"
            )
            return
        groups, _ = discover(folder, a.sets)
        recordings = published_recordings()
    splits = [(g, s) for g in groups for s in g.splits]
    with Store(runs_folder(a.smoke) / NAME / "rows.sqlite", fresh=a.smoke) as store:
        rows = predicted(splits, wanted, a, store)
    report(rows, recordings, wanted, groups, a)


def published_recordings() -> dict[str, Any]:
    """The published result of the study of real recordings."""
    file = RESULTS / "recordings.json"
    if not file.exists():
        raise InputError(
            f"{file} is missing; python -m studies.recordings --publish makes it"
        )
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def made_up_rows(seed: int) -> dict[str, Any]:
    """In place of it for --smoke: errors of nothing that was diagnosed."""
    rows = [
        {
            **about(group, split),
            "base": MAIN,
            "kind": "split",
            "unseen": {"before": 0.1, "after": 0.05},
        }
        for group in made_up(seed)
        for split in group.splits
    ]
    return {"rows": rows}


def about(group: Group, split: Split) -> dict[str, Any]:
    own = {"split": split.by, "label": split.label, "outside": split.outside}
    return {"set": group.set, "group": group.name, **own}


def key_of(group: Group, split: Split, method: Method, samples: int, seed: int) -> str:
    """What an error depends on: recordings, split, options and the rivals' code."""
    parts = [split.by, split.label, split.fit, split.unseen, group.specimens]
    options = [method.name, method.options, method.quick]
    content = [data_hash(group.recordings), *parts, *options, samples, seed]
    return fingerprint(content, files=CODE)


def predicted(
    splits: Sequence[tuple[Group, Split]],
    wanted: Sequence[Method],
    a: argparse.Namespace,
    store: Store,
) -> list[dict[str, Any]]:
    """A row for each split, with what every rival made of it."""
    from tqdm import tqdm

    known = at_hand() | store.rows()
    out = []
    for group, split in tqdm(splits, unit="prediction", desc=NAME, disable=None):
        keys = {m.name: key_of(group, split, m, a.samples, a.seed) for m in wanted}
        todo = [m for m in wanted if keys[m.name] not in known]
        if todo:
            given = problem.problem_of(group, split, a.samples)
        for one in todo:
            told = judged(one, given, a.seed)
            store.add(keys[one.name], told)
            known[keys[one.name]] = told
        found = [{**known[k], "key": k} for k in keys.values()]
        out.append({**about(group, split), "found": found, "errors": errors_of(found)})
    return out


def at_hand() -> dict[str, dict[str, Any]]:
    """What the published result holds, by key."""
    file = RESULTS / f"{NAME}.json"
    if not file.exists():
        return {}
    told = json.loads(file.read_text(encoding="utf-8"))
    return {f["key"]: f for r in told["rows"] for f in r["found"]}


def errors_of(found: Sequence[dict[str, Any]]) -> dict[str, float | None]:
    """The NRMSE of each rival, and of those that the inner folds would pick."""
    errors = {f["method"]: f["nrmse"] for f in found}
    law = [m.name for m in methods.METHODS if m.law]
    errors[BEST_LAW] = least(found, law)["nrmse"]
    errors[ANY] = least(found, list(errors))["nrmse"]
    return errors


def report(
    rows: Sequence[dict[str, Any]],
    recordings: dict[str, Any],
    wanted: Sequence[Method],
    groups: Sequence[Group],
    a: argparse.Namespace,
) -> None:
    """Print, write and track what came out."""
    own = [r for r in recordings["rows"] if (r["base"], r["kind"]) == (MAIN, "split")]
    table = joined(rows, own)
    if not table:
        raise InputError(
            "none of these predictions is in studies/results/recordings.json"
        )
    what = OWN | {m.name: m.what for m in wanted}
    found = summary(table, a.seed)
    note = "\n\n".join([as_markdown(found, what), ABOUT, verdict(found, what)])
    print(note)
    head: dict[str, Any] = {"predictions": len(table)}
    for name, one in found.items():
        keys = ("median", "ratio", "ratio_low", "ratio_high", "ahead", "best")
        head |= {f"{name}/{k}": one[k] for k in keys}
    partial = bool(a.sets or a.methods)
    folder = results_folder(a.smoke, a.publish and not partial)
    data = {g.label: data_hash(g.recordings) for g in groups}
    body = {
        "recordings_study": provenance_of(recordings),
        "samples": a.samples,
        "methods": what,
        "summary": found,
        "predictions": table,
        "rows": [{k: v for k, v in r.items() if k != "errors"} for r in rows],
    }
    path = write_result(NAME, head, body, seed=a.seed, data=data, folder=folder)
    print(f"\nresult: {path}")
    digest = fingerprint(data)
    tracked(
        NAME,
        head,
        database(a.tracking, a.smoke),
        study=NAME,
        identity=fingerprint([digest, note]),
        name="rivals on real recordings",
        parameters={"samples": a.samples, "seed": a.seed},
        data=("recordings", digest),
        note=note,
        files=[path],
    )
