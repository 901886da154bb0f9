"""What a trial says: the table of bars, effect by effect, causes, confusion."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.common import (
    FAINT,
    RUNS,
    fingerprint,
    markdown,
    new_figure,
    percent,
    results_folder,
    save_figure,
    write_result,
)
from studies.concealed import orders, scoring

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def bars(scores: Mapping[str, Any], record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The table of what must be shown: what, value, interval, bar, met."""
    plain = record["strength"] >= 1
    groups = scores["groups"]
    rows = []

    def row(key: str, what: str, found: Any, bar: float, least: bool = True) -> None:
        entry = found if isinstance(found, dict) else {"rate": found}
        value = entry.get("rate")
        met = None
        if value is not None and math.isfinite(value):  # no case, no verdict
            met = bool(value >= bar) if least else bool(value <= bar)
        rows.append({"key": key, "what": what, "bar": bar, "met": met, **entry})

    row(
        "single_right",
        "one effect: it and nothing else",
        groups.get("single"),
        0.95 if plain else 0.90,
    )
    hidden = scores["concealment"]
    limit = percent(hidden["accepted_below_nrmse"], 0)
    row(
        "accepted_right",
        f"the same where the base alone is within {limit}",
        hidden["groups"].get("single", {}).get("right"),
        0.90,
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
    hidden = concealment_table(scores["concealment"])
    causes: dict[tuple[str, str], int] = {}
    for m in scores["misses"]:
        key = (m["effects"] or m["group"], m["cause"])
        causes[key] = causes.get(key, 0) + 1
    third = markdown(
        ["missed", "cause", "cases"],
        [[what, why, n] for (what, why), n in sorted(causes.items())],
    )
    return "\n\n".join([first, second, hidden, third])


def interval(r: Mapping[str, Any]) -> str | None:
    if r.get("low") is None or not math.isfinite(r["low"]):
        return None
    return f"{percent(r['low'], 1)} to {percent(r['high'], 1)}"


def concealment_table(hidden: Mapping[str, Any]) -> str:
    """Effect by effect: what was found where the base alone looks good enough."""
    limit = percent(hidden["accepted_below_nrmse"], 0)
    return markdown(
        [
            "effect",
            "base alone, median NRMSE",
            f"cases within {limit}",
            "named in those",
            "right and only",
            "95 % interval",
        ],
        [
            [
                name,
                percent(e["base_nrmse"], 1),
                f"{e['accepted']['right']} of {e['accepted']['of']}",
                percent(e["named"]["rate"], 0),
                percent(e["right"]["rate"], 0),
                interval(e["right"]),
            ]
            for name, e in (
                *hidden["effects"].items(),
                *((f"all of {g}", e) for g, e in hidden["groups"].items()),
            )
        ],
    )


def confusion_figure(counts: Mapping[str, Mapping[str, int]]) -> Figure:
    """Rows: what was planted; columns: what was named. Shares of the row."""
    rows = list(counts)
    used = {c for row in counts.values() for c in row}
    columns = [
        c
        for c in (
            *orders.NAMES,
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
    study: str = "concealed",
) -> None:
    """One MLflow run for the trial, with its figures and its table."""
    from softnn.tracking import Tracker

    home = RUNS / "smoke" if record["smoke"] else RUNS
    label = f"{record['label']}/"
    with Tracker(
        uri or f"sqlite:///{(home / 'mlflow.db').as_posix()}",
        study,
        study=f"{study} {record['label']}",
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
