"""Which physics was left out? Concealed cases, forged, diagnosed, then scored.

Cases are forged and their key sealed (its hash goes into the record first); then the
command `softnn diagnose` is run on the cases alone; only when all diagnoses are
written is the key opened. Seeds below 10000 are for development; a trial with a seed
from 10000 on, of all effects, is written to studies/results/concealed.json.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softnn.contracts import InputError
from studies.common import (
    FAINT,
    RUNS,
    fingerprint,
    guarded,
    markdown,
    new_figure,
    parser,
    percent,
    results_folder,
    save_figure,
    write_result,
)
from studies.concealed import forge, rivals, scoring

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SOFTNN = [sys.executable, "-m", "softnn.cli"]
TIMED_CASES = 3  # diagnosed once more, one at a time, for the time a user waits


def make_parser() -> argparse.ArgumentParser:
    p = parser("concealed", __doc__)
    p.add_argument("--cases", type=int, default=20, help="of each effect (20)")
    p.add_argument("--nulls", type=int, help="ten times --cases")
    p.add_argument("--pairs", type=int, help="three times --cases")
    p.add_argument("--unlisted", type=int, help="three times --cases")
    p.add_argument("--only", nargs="+", default=[], metavar="EFFECT")
    p.add_argument("--strength", type=float, default=1.0, help="of the effects (1)")
    p.add_argument("--dirty", type=float, default=0.15, help="share of cases (0.15)")
    p.add_argument("--simulated", type=float, default=0.1, help="share of cases (0.1)")
    p.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    p.add_argument("--out", type=Path, help="where cases and diagnoses go (mlruns/...)")
    p.add_argument("--tracking", help="MLflow address (mlruns/mlflow.db)")
    only = p.add_mutually_exclusive_group()
    only.add_argument("--forge-only", type=Path, metavar="DIR", help="forge, no more")
    only.add_argument("--resume", type=Path, metavar="DIR", help="diagnose the rest")
    only.add_argument(
        "--score-only", type=Path, metavar="DIR", help="of an earlier run"
    )
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.concealed`; returns the exit code."""
    arguments = make_parser().parse_args(argv)
    return guarded(lambda: run(arguments))


def run(a: argparse.Namespace) -> None:
    orders = orders_of(a)
    label = f"strength-{a.strength:g}"
    if a.forge_only:
        digest = forge_into(orders, a.forge_only, a.jobs)
        print(f"{len(orders)} cases in {a.forge_only / 'cases'}; key SHA-256 {digest}")
        return
    if a.score_only or a.resume:
        folder = a.score_only or a.resume
        if not (folder / "record.json").exists():
            raise InputError(f"{folder} holds no record.json; name a trial's folder")
        record = json.loads((folder / "record.json").read_text())
    else:
        home = RUNS / "smoke" if a.smoke else RUNS
        stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
        folder = a.out or home / "concealed" / f"{label}-seed-{a.seed}-{stamp}"
        record = {
            "label": label,
            "strength": a.strength,
            "seed": a.seed,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "published": a.seed >= forge.FIRST_TRIAL_SEED and not (a.only or a.smoke),
            "smoke": a.smoke,
            "cases": len(orders),
            "key_sha256": forge_into(orders, folder, a.jobs),
        }
        write_record(folder, record)  # the hash is on file before anything is diagnosed
        print(f"{len(orders)} cases forged; key SHA-256 {record['key_sha256']}")
    if not a.score_only:
        record |= diagnose(folder, a.jobs, record["seed"])
        write_record(folder, record)
    answers = forge.open_key(folder)
    diagnoses = scoring.read_diagnoses(answers, folder / "diagnoses")
    times = {c["case"]: scoring.read_times(c, folder / "cases") for c in answers}
    simulated = simulate_unseen(folder, answers)
    scores = scoring.score(answers, diagnoses, times, simulated)
    explain_misses(scores["misses"], answers)
    report(folder, record, scores, a.tracking)


def orders_of(a: argparse.Namespace) -> list[forge.Order]:
    """The cases asked for; --smoke asks for three."""
    unknown = set(a.only) - set(forge.NAMES)
    if unknown:
        raise InputError(
            f"no effect is called {sorted(unknown)[0]!r}; "
            f"allowed are {', '.join(forge.NAMES)}"
        )
    if not a.strength > 0:
        raise InputError(f"strength is {a.strength:g}; it must be above 0")
    if a.cases < 0 or a.seed < 0:
        raise InputError("--cases and --seed must be 0 or more")
    if a.smoke:
        few = ["zero_offset"]
        return forge.plan(
            a.seed, a.strength, each=1, nulls=1, pairs=0, unlisted=1, only=few
        )
    return forge.plan(
        a.seed,
        a.strength,
        each=a.cases,
        nulls=10 * a.cases if a.nulls is None else a.nulls,
        pairs=3 * a.cases if a.pairs is None else a.pairs,
        unlisted=3 * a.cases if a.unlisted is None else a.unlisted,
        only=a.only,
        dirty=a.dirty,
        simulated=a.simulated,
    )


def forge_into(orders: Sequence[forge.Order], folder: Path, jobs: int) -> str:
    try:
        return forge.forge(orders, folder, jobs)
    except FileExistsError as error:
        raise InputError(str(error)) from None


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    (folder / "record.json").write_text(json.dumps(record, indent=1) + "\n")


def explain_misses(
    misses: Sequence[dict[str, Any]], answers: Sequence[dict[str, Any]]
) -> None:
    """Add to wrongly named cases whether anybody could have told the two apart."""
    by_name = {a["case"]: a for a in answers}
    for miss in misses:
        if miss["group"] not in ("single", "pair") or not miss["selected"]:
            continue
        answer = by_name[miss["case"]]
        power = rivals.distinct_power(forge.order_of(answer), answer)
        miss["nearest_rivals"] = dict(list(power.items())[:3])
        wrong = set(miss["selected"]) - set(answer["effects"])
        if any(power.get(w, 1.0) < 0.8 for w in wrong):
            miss["cause"] = "cannot be told from what was named, says the oracle"


def diagnose(folder: Path, jobs: int, seed: int) -> dict[str, Any]:
    """Run the command on the cases, as a user would; how long it took.

    It is told the folders of the cases and nothing else. Cases that have a diagnosis
    from an interrupted run are left out.
    """
    cases = [
        str(case.resolve())
        for case in sorted((folder / "cases").iterdir())
        if not (folder / "diagnoses" / case.name / "diagnosis.json").exists()
    ]
    if not cases:
        return {}
    command = [*SOFTNN, "diagnose", "--seed", str(seed), "--jobs"]
    begun = time.perf_counter()
    out = str((folder / "diagnoses").resolve())
    done = subprocess.run([*command, str(jobs), "--out", out, *cases], check=False)
    wall = time.perf_counter() - begun
    single = []
    for case in cases[:TIMED_CASES]:
        begun = time.perf_counter()
        out = str((folder / "timed").resolve())
        subprocess.run(
            [*command, "2", "--out", out, case],
            check=False,
            stdout=subprocess.DEVNULL,
        )
        single.append(time.perf_counter() - begun)
    return {
        "diagnose_exit": done.returncode,
        "wall_s": wall,
        "jobs": jobs,
        "seconds_a_case": wall / len(cases),
        "seconds_alone": sorted(single)[len(single) // 2] if single else None,
    }


def simulate_unseen(
    folder: Path, answers: Sequence[Mapping[str, Any]]
) -> dict[str, np.ndarray]:
    """Stress of the corrected models for programmes that stayed in the key, by case.

    `softnn simulate` as a user calls it, but in this process. A model that cannot be
    simulated is left out, and said.
    """
    from softnn.cli import main as softnn

    inputs, found = folder / "unseen", {}
    inputs.mkdir(exist_ok=True)
    for answer in answers:
        name = answer["case"]
        model = folder / "diagnoses" / name / "model.json"
        if answer["unseen"] is None or not model.exists():
            continue
        file = inputs / f"{name}.csv"
        columns = {k: v for k, v in answer["unseen"].items() if k != "clean_MPa"}
        pd.DataFrame(columns).to_csv(file, index=False)
        command = ["simulate", str(model), str(file), "--out", str(inputs / "out")]
        with redirect_stdout(io.StringIO()):
            code = softnn(command)
        if code == 0:
            table = pd.read_csv(inputs / "out" / file.name)
            found[name] = table["simulated_MPa"].to_numpy()
        else:
            print(f"{name}: softnn simulate ended with {code}", file=sys.stderr)
    return found


# --- what is reported -----------------------------------------------------------------


def bars(scores: Mapping[str, Any], record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The table of what must be shown: what, value, interval, bar, met."""
    plain = record["strength"] >= 1
    groups = scores["groups"]
    rows = []

    def row(key: str, what: str, found: Any, bar: float, least: bool = True) -> None:
        entry = found if isinstance(found, dict) else {"rate": found}
        value = entry.get("rate")
        met = None
        if value is not None:
            met = bool(value >= bar) if least else bool(value <= bar)
        rows.append({"key": key, "what": what, "bar": bar, "met": met, **entry})

    row(
        "single_right",
        "one effect: it and nothing else",
        groups.get("single"),
        0.95 if plain else 0.90,
    )
    row("null_right", "nothing: nothing_missing", groups.get("null"), 0.98)
    row("pair_right", "two effects: both and only both", groups.get("pair"), 0.85)
    row(
        "unlisted_not_wrong",
        "not on the list: no confident name",
        groups.get("unlisted"),
        0.95,
    )
    row("region_f1", "regions, median F1", scores["region_f1"], 0.8)
    row(
        "heldout_over_floor",
        "held-out NRMSE over the noise, median",
        scores["heldout_over_floor"],
        1.2,
        least=False,
    )
    row(
        "unseen_over_floor",
        "NRMSE on an unseen programme over the noise, median",
        scores["unseen_over_floor"],
        1.2,
        least=False,
    )
    row("power_over_oracle", "found, over the oracle's power", scores["power"], 0.8)
    row("seconds_alone", "one case, s", record.get("seconds_alone"), 10.0, least=False)
    return rows


def report(
    folder: Path,
    record: Mapping[str, Any],
    scores: Mapping[str, Any],
    tracking: str | None,
) -> None:
    """Print, write and track what came out."""
    rows = bars(scores, record)
    label = str(record["label"])
    note = as_markdown(rows, scores)
    print(note)
    headline: dict[str, float | None] = {}
    for row in rows:
        headline[f"{label}/{row['key']}"] = row.get("rate")
        if "low" in row:
            headline[f"{label}/{row['key']}_low"] = row["low"]
            headline[f"{label}/{row['key']}_high"] = row["high"]
    where = results_folder() if record["published"] else folder
    trials: dict[str, Any] = {}
    earlier = where / "concealed.json"
    if record["published"] and earlier.exists():  # the other strengths stay
        old = json.loads(earlier.read_text(encoding="utf-8"))
        trials = {k: v for k, v in old["trials"].items() if k != label}
        kept = {k: v for k, v in old["headline"].items() if k.split("/")[0] in trials}
        headline = kept | headline
    trials[label] = {"record": record, "bars": rows, **scores}
    written = write_result(
        "concealed",
        headline,
        {"trials": trials},
        seed=record["seed"],
        data={f"{k} key": t["record"]["key_sha256"] for k, t in trials.items()},
        folder=where,
    )
    figures = save_figure(
        confusion_figure(scores["confusion"]), f"concealed-{label}", where
    )
    track(record, headline, note, [written, *figures, folder / "seal.json"], tracking)


def as_markdown(rows: Sequence[Mapping[str, Any]], scores: Mapping[str, Any]) -> str:
    """The tables of a trial: bars, effect by effect, causes of the misses."""

    def interval(r: Mapping[str, Any]) -> str | None:
        if "low" not in r:
            return None
        return f"{percent(r['low'], 1)} to {percent(r['high'], 1)}"

    def shown(r: Mapping[str, Any]) -> str | None:
        value = r.get("rate")
        if value is None:
            return None
        return percent(value, 1) if "low" in r else f"{value:.3g}"

    says = {True: "yes", False: "no", None: None}
    first = markdown(
        ["what", "found", "95 % interval", "cases", "bar", "met"],
        [
            [
                r["what"],
                shown(r),
                interval(r),
                r.get("of"),
                f"{r['bar']:g}",
                says[r["met"]],
            ]
            for r in rows
        ],
    )
    second = markdown(
        ["effect", "right and only", "95 % interval", "cases", "oracle", "F1"],
        [
            [
                name,
                percent(e["rate"], 1),
                interval(e),
                e["of"],
                f"{e['oracle_power']:.2f}",
                None if e["f1"] is None else f"{e['f1']:.2f}",
            ]
            for name, e in scores["effects"].items()
        ],
    )
    causes: dict[tuple[str, str], int] = {}
    for m in scores["misses"]:
        key = (m["effects"] or m["group"], m["cause"])
        causes[key] = causes.get(key, 0) + 1
    third = markdown(
        ["missed", "cause", "cases"],
        [[what, why, n] for (what, why), n in sorted(causes.items())],
    )
    return "\n\n".join([first, second, third])


def confusion_figure(counts: Mapping[str, Mapping[str, int]]) -> Figure:
    """Rows: what was planted; columns: what was named. Shares of the row."""
    rows = list(counts)
    used = {c for row in counts.values() for c in row}
    columns = [
        c
        for c in (
            *forge.NAMES,
            scoring.AND_MORE,
            scoring.SEVERAL,
            *scoring.VERDICTS,
        )
        if c in used or c in rows
    ]
    figure = new_figure(2.6 + 0.3 * len(columns), 2.2 + 0.24 * len(rows))
    axes = figure.subplots()
    shares = [
        [counts[r].get(c, 0) / max(1, sum(counts[r].values())) for c in columns]
        for r in rows
    ]
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for i, r in enumerate(rows):
        for j, c in enumerate(columns):
            if counts[r].get(c):
                axes.text(
                    j,
                    i,
                    str(counts[r][c]),
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white" if shares[i][j] > 0.5 else "black",
                )
    axes.set_xticks(range(len(columns)), [c.replace("_", " ") for c in columns])
    axes.tick_params(axis="x", rotation=90, length=0)
    axes.set_yticks(range(len(rows)), [r.replace("_", " ") for r in rows])
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("named")
    axes.set_ylabel("planted")
    for side in axes.spines.values():
        side.set_visible(True)
        side.set_color(FAINT)
    return figure


def track(
    record: Mapping[str, Any],
    metrics: Mapping[str, float | None],
    note: str,
    files: Sequence[Path],
    uri: str | None,
) -> None:
    """One MLflow run for the trial, with its figures and its table."""
    from softnn.tracking import Tracker

    home = RUNS / "smoke" if record["smoke"] else RUNS
    label = f"{record['label']}/"
    with Tracker(
        uri or f"sqlite:///{(home / 'mlflow.db').as_posix()}",
        "concealed",
        study=f"concealed {record['label']}",
        identity=fingerprint(dict(record)),
        name=f"{record['label']} seed {record['seed']}",
        parameters={k: record[k] for k in ("strength", "seed", "cases", "jobs")},
        data=("sealed key", str(record["key_sha256"])),
    ) as tracker:
        tracker.result(
            {
                k.removeprefix(label): v
                for k, v in metrics.items()
                if v is not None and k.startswith(label)
            },
            note=note,
            files=files,
        )
