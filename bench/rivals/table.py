"""What the comparison says: the table, the figure, the result file, MLflow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import scoring
from bench.concealed import details
from bench.reporting import ends, publish, track
from softnn.study.common import (
    COLOURS,
    FAINT,
    INK,
    markdown,
    new_figure,
    percent,
    save_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SOFTNN = "softnn"
VERSUS = "held out, softnn over it"
DRAWS = 2000  # of the cases, for an interval
PAIRED = ("heldout_nrmse", "over_floor")  # columns that compare case by case
ACCEPTED = 0.05  # NRMSE of the refitted base that a practitioner would take for good


@dataclass(frozen=True)
class Column:
    key: str
    head: str
    more: bool  # whether more is better
    rate: bool = False


COLUMNS = (
    Column("right", "right and alone", True, True),
    Column("accepted", f"the same, base under {ACCEPTED:.0%}", True, True),
    Column("alarms", "false alarms", False, True),
    Column("wrong", "wrong name on unlisted", False, True),
    Column("heldout_nrmse", "held-out NRMSE", False),
    Column("over_floor", "over the noise", False),
    Column("seconds", "s a case", False),
)


def scores(
    answers: Sequence[Mapping[str, Any]],
    given: Mapping[str, Mapping[str, Any]],
    accepted: Mapping[str, bool],
    names: bool = True,
) -> dict[str, Any]:
    """One row of the table: what one method gave, against the key.

    `given` are its answers by case in the form of diagnosis.json; `accepted` says in
    which cases the refitted base looks good.
    """
    groups: dict[str, list[tuple[Mapping[str, Any], Mapping[str, Any]]]] = {}
    for answer in answers:
        pair = (answer, given[answer["case"]])
        groups.setdefault(answer["group"], []).append(pair)
    singles = groups.get("single", [])
    nulls, unlisted = groups.get("null", []), groups.get("unlisted", [])

    def rate(flags: Sequence[bool]) -> dict[str, Any] | None:
        return scoring.Rate(sum(flags), len(flags)).entry() if names else None

    hit = [scoring.right(details.hidden_in(a), d) for a, d in singles]
    held = [d.get("fit", {}).get("after", {}).get("heldout_nrmse") for _, d in singles]
    by: dict[str, list[bool]] = {}
    for (a, _), h in zip(singles, hit, strict=True):
        by.setdefault(a["effects"][0], []).append(h)
    return {
        "right": rate(hit),
        "accepted": rate(
            [h for (a, _), h in zip(singles, hit, strict=True) if accepted[a["case"]]]
        ),
        "alarms": rate([not scoring.right(details.hidden_in(a), d) for a, d in nulls]),
        "named_nulls": rate([bool(d["selected"]) for _, d in nulls]),
        "wrong": rate([bool(d["selected"]) for _, d in unlisted]),
        "heldout_nrmse": scoring.median(held),
        "over_floor": scoring.median(
            details.heldout_over_floor(a, d) for a, d in singles
        ),
        "null_over_floor": scoring.median(
            details.heldout_over_floor(a, d) for a, d in nulls
        ),
        "seconds": scoring.median(given[a["case"]].get("seconds") for a in answers),
        "effects": {e: rate(v) for e, v in sorted(by.items())} if names else {},
        "failed": sum(given[a["case"]]["verdict"] == "no diagnosis" for a in answers),
    }


def paired(
    answers: Sequence[Mapping[str, Any]],
    own: Mapping[str, Mapping[str, Any]],
    other: Mapping[str, Mapping[str, Any]],
) -> dict[str, float | int] | None:
    """Held-out NRMSE of one method over that of another, case by case.

    Geometric mean over single effects, with a bootstrap interval of 95 % over cases;
    None where no case has both.
    """
    logs = []
    for a in answers:
        if a["group"] != "single":
            continue
        mine, theirs = (
            g[a["case"]].get("fit", {}).get("after", {}).get("heldout_nrmse")
            for g in (own, other)
        )
        if mine and theirs:
            logs.append(np.log(mine / theirs))
    if not logs:
        return None
    rng = np.random.default_rng(0)
    means = rng.choice(logs, (DRAWS, len(logs))).mean(axis=1)
    low, high = np.exp(np.quantile(means, [0.025, 0.975]))
    return {
        "ratio": float(np.exp(np.mean(logs))),
        "low": float(low),
        "high": float(high),
        "of": len(logs),
    }


def value(row: Mapping[str, Any], column: Column) -> float | None:
    entry = row[column.key]
    if column.rate:
        return None if entry is None or not entry["of"] else float(entry["rate"])
    return None if entry is None else float(entry)


def wins(rows: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Where a rival does better than softnn, and whether the intervals part."""
    if SOFTNN not in rows:
        return []
    out = []
    for column in COLUMNS:
        own = value(rows[SOFTNN], column)
        for name, row in rows.items():
            other = value(row, column)
            if name == SOFTNN or own is None or other is None:
                continue
            if not (other > own if column.more else other < own):
                continue
            apart = None
            if column.rate:
                a, b = rows[SOFTNN][column.key], row[column.key]
                apart = bool(a["high"] < b["low"] or b["high"] < a["low"])
            elif column.key in PAIRED and row.get("paired"):
                apart = bool(row["paired"]["low"] > 1)
            out.append(
                {
                    "rival": name,
                    "column": column.key,
                    "rival_value": other,
                    "softnn_value": own,
                    "apart": apart,
                }
            )
    return out


def versus(row: Mapping[str, Any]) -> str | None:
    """Held-out NRMSE of softnn over that of this rival, under 1 where softnn leads."""
    p = row.get("paired")
    return f"{p['ratio']:.2f} ({p['low']:.2f} to {p['high']:.2f})" if p else None


def as_markdown(rows: Mapping[str, Mapping[str, Any]], what: Mapping[str, str]) -> str:
    """The table, the best of each column marked, and the sentences on who wins."""
    best = {}
    for c in COLUMNS:
        known = [v for r in rows.values() if (v := value(r, c)) is not None]
        best[c.key] = (max if c.more else min)(known) if known else None

    def cell(row: Mapping[str, Any], c: Column) -> str | None:
        v = value(row, c)
        if v is None:
            return None
        if c.rate:
            e = row[c.key]
            low, high = percent(e["low"], 0), percent(e["high"], 0)
            text = f"{percent(v, 0)} ({low} to {high})"
        elif c.key == "heldout_nrmse":
            text = str(percent(v))
        else:
            text = f"{v:.2f}"
        return text + " *" if v == best[c.key] else text

    table = markdown(
        ["method", *(c.head for c in COLUMNS), VERSUS],
        [
            [what.get(n, n), *(cell(r, c) for c in COLUMNS), versus(r)]
            for n, r in rows.items()
        ],
    )
    heads = {c.key: c.head for c in COLUMNS}
    found = wins(rows)
    lines = [
        f"- {what.get(w['rival'], w['rival'])} beats softnn on {heads[w['column']]}: "
        f"{w['rival_value']:.3g} against {w['softnn_value']:.3g}"
        + ("" if w["apart"] is not False else ", within the intervals")
        for w in found
    ]
    if not lines and SOFTNN in rows:
        lines = ["No rival beats softnn on any column."]
    return "\n\n".join(
        [
            table,
            "\\* best of its column; in brackets intervals of 95 %: Wilson's, and for "
            "held-out NRMSE of softnn over that of a rival, geometric mean over the "
            "same cases, the bootstrap.",
        ]
        + ["\n".join(lines)]
    )


def figure(rows: Mapping[str, Mapping[str, Any]], what: Mapping[str, str]) -> Figure:
    """Naming against false alarms, with intervals; up and to the left is better."""
    made = new_figure(6.4, 4.2)
    axes = made.subplots()
    shown = [
        (name, row)
        for name, row in rows.items()
        if all(row[key] and row[key]["of"] for key in ("right", "alarms"))
    ]
    for i, (name, row) in enumerate(shown):
        x, y = row["alarms"], row["right"]
        over = (
            0 < other["right"]["rate"] - y["rate"] < 0.06
            and abs(other["alarms"]["rate"] - x["rate"]) < 0.2
            for _, other in shown
        )
        colour = INK if name == SOFTNN else COLOURS[i % len(COLOURS)]
        axes.errorbar(
            x["rate"],
            y["rate"],
            xerr=ends([x]),
            yerr=ends([y]),
            fmt="o",
            color=colour,
            ecolor=FAINT,
            elinewidth=0.7,
            markersize=7 if name == SOFTNN else 5,
        )
        axes.annotate(
            what.get(name, name),
            (x["rate"], y["rate"]),
            xytext=(6, -11 if any(over) else 5),
            textcoords="offset points",
            color=colour,
            fontsize=8,
        )
    axes.set_xlim(-0.03, 1.03)
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel("false alarms where nothing is missing")
    axes.set_ylabel("single effects named right and alone")
    return made


def report(
    folder: Path,
    record: Mapping[str, Any],
    rows: Mapping[str, Mapping[str, Any]],
    what: Mapping[str, str],
    body: Mapping[str, Any],
    tracking: str | None,
) -> None:
    """Print, write and track what came out."""
    label, note = str(record["label"]), as_markdown(rows, what)
    print(note)
    headline: dict[str, float | None] = {}
    for name, row in rows.items():
        for c in COLUMNS:
            headline[f"{label}/{name}/{c.key}"] = value(row, c)
            entry = row[c.key]
            if c.rate and entry is not None:
                headline[f"{label}/{name}/{c.key}_low"] = entry["low"]
                headline[f"{label}/{name}/{c.key}_high"] = entry["high"]
    trial = {"record": record, "table": rows, "wins": wins(rows), **body}
    written = publish("rivals", record, headline, trial, folder)
    figures = save_figure(figure(rows, what), f"rivals-{label}", written.parent)
    files = [written, *figures, folder / "seal.json"]
    track(record, headline, note, files, tracking, "rivals")
