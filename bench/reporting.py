"""What all trials report alike: shares and intervals, a result file, an MLflow run."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from tqdm import tqdm

from softnn.contracts import InputError
from softnn.database import Store
from softnn.study import common
from softnn.study.common import code_of, package_files
from softnn.workers import workers


def carried_out(
    file: Path, tasks: Mapping[str, Sequence[Any]], a: argparse.Namespace
) -> dict[str, dict[str, Any]]:
    """Rows of all tasks that are finished, by name; those at hand are not made again.

    `tasks` has a function and its arguments by name.
    `a` are the options of a study: smoke, fresh, jobs, finished. Raises `InputError`
    where none is finished.
    """
    with (
        Store(file, code_of(package_files()), fresh=a.smoke or a.fresh) as store,
        workers(1 if a.smoke else a.jobs) as pool,
    ):
        known = store.rows()
        futures = {
            pool.submit(*task): name
            for name, task in tasks.items()
            if name not in known and not a.finished
        }
        for future in tqdm(as_completed(futures), total=len(futures), unit="case"):
            store.add(futures[future], future.result())
        rows = {name: row for name, row in store.rows().items() if name in tasks}
    if not rows:
        raise InputError("none of these cases is finished; leave --finished away")
    return rows


def cell(entry: Mapping[str, Any] | None) -> str | None:
    """A rate as counts and interval; None where there is no case.

    >>> cell({"right": 1, "of": 4, "low": 0.0456, "high": 0.6994})
    '1 of 4 (5 to 70 %)'
    """
    if not entry or not entry["of"]:
        return None
    ends = f"{common.percent(entry['low'], 0)} to {common.percent(entry['high'], 0)}"
    return f"{entry['right']} of {entry['of']} ({ends.replace(' %', '', 1)})"


def share(entry: Mapping[str, Any] | None) -> str | None:
    """A rate with its interval.

    >>> share({"rate": 0.5, "low": 0.25, "high": 0.75, "of": 8})
    '50 % (25 to 75)'

    One miss in many is not none.

    >>> share({"rate": 0.995, "low": 0.972, "high": 0.9991, "of": 200})
    '99.5 % (97 to 99.9)'
    """
    if not entry or entry.get("rate") is None or not entry.get("of"):
        return None
    # All or none needs no tenth.
    ends = entry["rate"] in (0, 1)
    rate, low, high = (
        f"{100 * v:.{int(not ends and (0 < v < 0.01 or 0.99 < v < 1))}f}"
        for v in (entry["rate"], entry["low"], entry["high"])
    )
    return f"{rate} % ({low} to {high})"


def ends(rates: Sequence[Mapping[str, Any]]) -> list[list[float]]:
    """How far intervals reach below and above, for error bars."""
    below = [r["rate"] - r["low"] for r in rates]
    return [below, [r["high"] - r["rate"] for r in rates]]


def between(mark: str, text: str, made: str) -> str:
    """A text with what was made between its two marks; the same where it has none.

    >>> between("--", "a\\n--\\nold\\n--\\nb", "new").split("--")
    ['a\\n', '\\n\\nnew\\n\\n', '\\nb']
    """
    parts = text.split(mark)
    if len(parts) != 3:
        return text
    return mark.join([parts[0], f"\n\n{made}\n\n", parts[2]])


def publish(
    name: str,
    record: Mapping[str, Any],
    headline: Mapping[str, float | None],
    trial: Mapping[str, Any],
    folder: Path,
) -> Path:
    """Write a trial into NAME.json, beside those of other labels; the path.

    It goes to the project's results if it is to be published, else into `folder`. Each
    trial's record states the commit that diagnosed its cases, and the date.
    """
    label = str(record["label"])
    trials: dict[str, Any] = {}
    published = bool(record["published"])
    where = common.results_folder(publish=True) if published else folder
    earlier = where / f"{name}.json"
    if published and earlier.exists():
        old = json.loads(earlier.read_text(encoding="utf-8"))
        trials = {k: v for k, v in old["trials"].items() if k != label}
        kept = {k: v for k, v in old["headline"].items() if k.split("/")[0] in trials}
        headline = kept | dict(headline)
    trials[label] = trial
    keys = {f"{k} key": t["record"]["key_sha256"] for k, t in trials.items()}
    return common.write_result(
        name, headline, {"trials": trials}, seed=record["seed"], data=keys, folder=where
    )


def track(
    record: Mapping[str, Any],
    metrics: Mapping[str, float | None],
    note: str,
    files: Sequence[Path],
    uri: str | None,
    study: str = "concealed",
) -> None:
    """One MLflow run for a trial with a sealed key, with its figures and its table."""
    label = f"{record['label']}/"
    tracked(
        study,
        {k.removeprefix(label): v for k, v in metrics.items() if k.startswith(label)},
        common.database(uri, record["smoke"]),
        study=f"{study} {record['label']}",
        identity=common.fingerprint(dict(record)),
        name=f"{record['label']} seed {record['seed']}",
        parameters={
            k: record.get(k) for k in ("strength", "side", "seed", "cases", "jobs")
        },
        data=("sealed key", str(record["key_sha256"])),
        note=note,
        files=files,
    )


def tracked(
    experiment: str,
    metrics: Mapping[str, Any],
    uri: str,
    *,
    note: str,
    files: Sequence[Path],
    texts: Mapping[str, str] | None = None,
    **about: Any,
) -> None:
    """One MLflow run; `about` is what `softnn.tracking.Tracker` asks for."""
    from softnn.tracking import Tracker

    numbers = {k: float(v) for k, v in metrics.items() if isinstance(v, int | float)}
    with Tracker(uri, experiment, **about) as tracker:
        tracker.result(numbers, note=note, files=files, texts=texts)
