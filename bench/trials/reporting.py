"""What a trial says: the table of bars, effect by effect, causes, confusion."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench import scoring
from bench.hands.families import EFFECTS
from bench.reporting import cell, publish, track
from bench.trials import noise_check
from softnn.study.common import FAINT, markdown, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_CAUSES = 20


def bars(scores: Mapping[str, Any], record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The table of what must be shown: what, value, interval, bar, met."""
    seen, rows = scores["visible"], []
    naming, told = seen["naming"], seen["calibration"]

    def row(key: str, what: str, found: Any, bar: float, least: bool = True) -> None:
        entry = found if isinstance(found, dict) else {"rate": found}
        value = entry.get("rate")
        met = None
        if value is not None and math.isfinite(value):  # no case, no verdict
            met = bool(value >= bar) if least else bool(value <= bar)
        rows.append({"key": key, "what": what, "bar": bar, "met": met, **entry})

    unsure = seen["unsure"].get("alien")
    row("single_right", "one effect: it and nothing else", naming.get("single"), 0.92)
    row(
        "true_first", "a true effect leads the candidates", seen["ranking"]["all"], 0.97
    )
    row("null_right", "nothing: nothing_missing", naming.get("null"), 0.98)
    row("pair_right", "two effects: both and only both", naming.get("pair"), 0.85)
    row("alien_unnamed", "on no list: nothing named", naming.get("alien"), 0.85)
    row("alien_unsure", "on no list: no name at 0.9 or more", unsure, 0.97)
    row("sure_right", "names at 0.9 or more that are right", told.get("sure"), 0.95)
    row("gap", "probabilities off by, mean", told.get("gap"), 0.05, least=False)
    if "region_f1" in scores:
        row("region_f1", "regions, median F1", scores["region_f1"], 0.8)
    if "held_ratio" in scores:
        what = "noise-free held recordings: error over the base's, median"
        row("held_ratio", what, scores["held_ratio"], 0.2, least=False)
    row("seconds_alone", "one case, s", record.get("seconds_alone"), 6.0, least=False)
    return rows


def report(
    folder: Path,
    record: Mapping[str, Any],
    scores: Mapping[str, Any],
    tracking: str | None,
) -> None:
    """Print, write and track what came out."""
    rows, label = bars(scores, record), str(record["label"])
    note = as_markdown(rows, scores)
    if record["opened_before"]:
        note = f"Opened before: {'; '.join(record['opened_before'])}.\n\n{note}"
    print(note)
    headline: dict[str, float | None] = {}
    for row in rows:
        headline[f"{label}/{row['key']}"] = row.get("rate")
        if "low" in row:
            headline[f"{label}/{row['key']}_low"] = row["low"]
            headline[f"{label}/{row['key']}_high"] = row["high"]
    told = {k: v for k, v in record.items() if k != "cases_in"}
    trial = {"record": told, "bars": rows, **scores}
    written = publish("hands", record, headline, trial, folder)
    figure = confusion_figure(scores["confusion"])
    figures = save_figure(figure, f"hands-{label}", written.parent)
    track(record, headline, note, [written, *figures, folder / "record.json"], tracking)


def as_markdown(rows: Sequence[Mapping[str, Any]], scores: Mapping[str, Any]) -> str:
    """The tables of a trial: bars, what is seen and what is not, causes of misses."""
    tables = [bars_table(rows), parts_table(scores), effects_table(scores)]
    tables += [calibration_table(scores["all"]["calibration"])]
    if "located" in scores:
        tables.append(located_table(scores["located"]))
    if "noise_check" in scores:
        tables.append(noise_check.table(scores["noise_check"]))
    return "\n\n".join([*tables, causes_table(scores["misses"])])


def causes_table(misses: Sequence[Mapping[str, Any]], head: str = "planted") -> str:
    """Misses by what was planted and why, the most frequent first."""
    several = {
        "pair": "two effects",
        "mixed": "one beside something on no list",
        "bent": "laws that are wrong",
    }
    counts = Counter(
        (several.get(m["cls"]) or "".join(m["effects"]) or m["cls"], m["cause"])
        for m in misses
    )
    shown = counts.most_common(MOST_CAUSES)
    rows: list[list[Any]] = [[what, why, n] for (what, why), n in shown]
    if rest := len(misses) - sum(n for _, n in shown):
        rows.append(["others", "one or few of a kind", rest])
    return markdown([head, "why", "cases"], rows)


def bars_table(rows: Sequence[Mapping[str, Any]]) -> str:
    says = {True: "yes", False: "no", None: None}
    cells = []
    for r in rows:
        value = r.get("rate")
        found = cell(r) if "of" in r else None if value is None else f"{value:.3g}"
        cells.append([r["what"], found, f"{r['bar']:g}", says[r["met"]]])
    return markdown(["what, in cases to be seen", "found", "bar", "met"], cells)


def parts_table(scores: Mapping[str, Any]) -> str:
    """Class by class, of the cases to be seen and of the others, and by noise."""
    heads = ["cases", "class", "right", "true effect first", "none at 0.9", "verdicts"]
    rows = []
    for where in ("visible", "others"):
        some = scores[where]
        for cls, entry in some["naming"].items():
            verdicts = some["verdict"][cls].items()
            said = ", ".join(f"{v} {n}" for v, n in sorted(verdicts))
            first = cell(some["ranking"].get(cls))
            rows.append(
                [where, cls, cell(entry), first, cell(some["unsure"][cls]), said]
            )
    for kind, classes in scores["visible"]["noise"].items():
        rows += [[kind, c, cell(e), None, None, None] for c, e in classes.items()]
    return markdown(heads, rows)


def effects_table(scores: Mapping[str, Any]) -> str:
    """Effect by effect, of the cases to be seen."""
    rows = [
        [name, cell(e), cell(e["first"]), cell(e["named"])]
        for name, e in scores["visible"]["effects"].items()
    ]
    heads = ["effect", "alone and right", "first", "named, beside another too"]
    return markdown(heads, rows)


def located_table(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Location, and gain on held recordings without noise, class by class."""
    heads = ["cases", "regions, median F1", "of", "error over the base's, median"]
    names = {"all": "with an effect", "shared": "no fault of single recordings"}
    rows = [
        [
            names.get(name, name),
            None if e["f1"] is None else f"{e['f1']:.2f}",
            e["f1_of"],
            None if e["held_ratio"] is None else f"{e['held_ratio']:.2f}",
            e["held_harmed"],
            e["held_of"],
        ]
        for name, e in found.items()
    ]
    return markdown([*heads, "harmed", "of"], rows)


def calibration_table(told: Mapping[str, Any]) -> str:
    """Of names at a probability, how many are right."""
    if not told["of"]:
        return "No name was given a probability."
    rows = [[f"{d['from']:.1f}", f"{d['mean']:.2f}", cell(d)] for d in told["deciles"]]
    area = "-" if told["auc"] is None else f"{told['auc']:.2f}"
    return (
        markdown(["probability from", "mean", "right"], rows)
        + f"\n\n{told['of']} names; mean log score {told['log_score']:.3f}, Brier "
        f"score {told['brier']:.3f}, AUC {area}."
    )


def confusion_figure(counts: Mapping[str, Mapping[str, int]]) -> Figure:
    """Rows: what was planted; columns: what was named, or the verdict, as shares."""
    rows, used = list(counts), {c for row in counts.values() for c in row}
    names = (*EFFECTS, scoring.AND_MORE, scoring.SEVERAL)
    columns = [c for c in names if c in used or c in rows]
    columns += sorted(used - set(names))
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
