"""What the detection limits say: shares with intervals, the oracle, table, figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import ledger
from bench.limits.summary import (
    ALARM_BAR,
    ALARM_BOUND,
    CORRELATION_S,
    RATIO_BAR,
    WANTED,
    summarise,
)
from bench.reporting import ends, tracked
from softnn.study.common import (
    COLOURS,
    FAINT,
    database,
    fingerprint,
    markdown,
    new_figure,
    percent,
    results_folder,
    save_figure,
    write_result,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# --- what is written ------------------------------------------------------------------


def headline_of(found: Mapping[str, Any]) -> dict[str, Any]:
    effects, nulls = found["effects"], found["nulls"]
    ratios = {name: e["ratio"] for name, e in effects.items()}
    headline: dict[str, Any] = {
        "power_ratio_mean": float(np.mean(list(ratios.values()))) if ratios else None,
        "power_ratio_least": min(ratios.values(), default=None),
        "effects": len(ratios),
        "effects_at_bar": sum(r >= RATIO_BAR for r in ratios.values()),
        "power_ratio_bar": RATIO_BAR,
        "false_alarm_bar": ALARM_BAR,
        "false_alarm_bound_bar": ALARM_BOUND,
        "seconds_a_case": found["seconds_a_case"],
    }
    for colour, n in nulls.items():
        headline[f"false_alarm/{colour}"] = n["false_alarm"]["rate"]
        headline[f"false_alarm_high/{colour}"] = n["false_alarm"]["high"]
        headline[f"nulls/{colour}"] = n["false_alarm"]["of"]
    for colour in nulls:
        of = [
            e["colours"][colour]["ratio"]
            for e in effects.values()
            if colour in e["colours"]
        ]
        headline[f"power_ratio_mean/{colour}"] = float(np.mean(of)) if of else None
    for name, e in effects.items():
        headline[f"power_ratio/{name}"] = e["ratio"]
        headline[f"power_ratio_listed/{name}"] = e["ratio_listed"]
        headline[f"smallest_strength/{name}"] = e["smallest_strength"]
        headline[f"smallest_signal/{name}"] = e["smallest_signal"]
    return headline


def tables(found: Mapping[str, Any]) -> dict[str, str]:
    """All effects, the nulls, colours, noise, what visible effects were missed for."""
    effects = found["effects"]
    strengths = sorted({s for e in effects.values() for s in e["strengths"]}, key=float)
    rows = []
    for name, e in effects.items():
        named = [
            e["strengths"].get(s, {}).get("named", {}).get("rate") for s in strengths
        ]
        rows.append(
            [
                name,
                *(percent(n, 0) for n in named),
                percent(e["right"]["rate"], 0),
                f"{e['ratio']:.2f} ({e['ratio_low']:.2f} to {e['ratio_high']:.2f})",
                number(e["ratio_listed"]),
                number(e["smallest_strength"]),
                number(e["smallest_signal"]),
                number(e["oracle_smallest_signal"]),
            ]
        )
    return {
        "effects": markdown(
            [
                "effect",
                *(f"named at {s}" for s in strengths),
                "right and alone",
                "over the oracle",
                "or listed as equivalent",
                "90 % from strength",
                "from signal/noise",
                "oracle's",
            ],
            rows,
        ),
        "nulls": markdown(
            ["nulls", "false alarms", "95 % interval", "cases", "false names"],
            [
                [
                    colour,
                    percent(n["false_alarm"]["rate"], 1),
                    f"{percent(n['false_alarm']['low'], 1)} to "
                    f"{percent(n['false_alarm']['high'], 1)}",
                    n["false_alarm"]["of"],
                    percent(n["false_name"]["rate"], 1),
                ]
                for colour, n in found["nulls"].items()
            ],
        ),
        "colours": colour_table(effects),
        "noise": noise_table(found["noise"]),
        "missed": markdown(
            ["visible to the oracle, not right", "said instead", "cases"],
            [
                [name, what, count]
                for name, e in effects.items()
                for what, count in e["visible_but_missed"].items()
            ],
        ),
    }


def colour_table(effects: Mapping[str, Any]) -> str:
    """Power ratio and smallest strength by colour of the noise."""
    colours = list(dict.fromkeys(c for e in effects.values() for c in e["colours"]))
    rows = []
    for name, e in effects.items():
        parts = [e["colours"].get(c, {}) for c in colours]
        rows.append(
            [
                name,
                *(number(p.get("ratio")) for p in parts),
                *(number(p.get("smallest_strength")) for p in parts),
            ]
        )
    heads = [f"over the oracle, {c}" for c in colours]
    return markdown(["effect", *heads, *(f"90 % from, {c}" for c in colours)], rows)


def noise_table(noise: Mapping[str, Any]) -> str:
    """What the diagnoses took the noise for, beside what it was."""

    def told(entry: Mapping[str, float] | None) -> str | None:
        if entry is None:
            return None
        return f"{entry['median']:.2f} ({entry['low']:.2f} to {entry['high']:.2f})"

    heads = ["noise", "its correlation, s", "estimated, s (80 %)"]
    return markdown(
        [*heads, "size over the true one (80 %)"],
        [
            [
                colour,
                f"{CORRELATION_S[colour]:g}",
                told(n.get("correlation_s")),
                told(n.get("sigma_over_true")),
            ]
            for colour, n in noise.items()
        ],
    )


def number(value: float | None) -> str | None:
    return None if value is None else f"{value:.2g}"


def effect_figure(name: str, entry: Mapping[str, Any]) -> Figure:
    """Share named, and the oracle's power, against strength; a panel a colour."""
    colours = entry["colours"]
    figure = new_figure(2.5 * len(colours) + 0.6, 2.7)
    panels = figure.subplots(1, len(colours), sharey=True, squeeze=False)[0]
    for axes, (colour, part) in zip(panels, colours.items(), strict=True):
        curve(axes, part["strengths"])
        axes.set_title("white noise" if colour == "white" else f"{colour} correlation")
        axes.set_xlabel("strength")
    panels[0].set_ylabel(f"cases of {name.replace('_', ' ')}")
    panels[0].legend(fontsize=7, loc="best")
    return figure


def curve(axes: Axes, strengths: Mapping[str, Any]) -> None:
    """One panel: named with its interval, right and alone, and the oracle."""
    keys = sorted(strengths, key=float)
    x = [float(k) for k in keys]
    named = [strengths[k]["named"] for k in keys]
    middle = [n["rate"] for n in named]
    power = [strengths[k]["oracle_power"] for k in keys]
    right = [strengths[k]["right"]["rate"] for k in keys]
    axes.axhline(WANTED, color=FAINT, linewidth=0.6, linestyle=":")
    axes.plot(x, power, color=COLOURS[1], linestyle="--", label="oracle")
    axes.plot(x, right, color=COLOURS[2], linewidth=0.9, label="named, alone")
    axes.errorbar(
        x,
        middle,
        ends(named),
        color=COLOURS[0],
        marker="o",
        ms=3,
        elinewidth=0.8,
        capsize=2,
        label="named",
    )
    axes.set_xscale("log")
    axes.set_xticks(x, keys)
    axes.minorticks_off()
    axes.set_ylim(-0.03, 1.03)


def report(
    rows: Sequence[Mapping[str, Any]],
    record: Mapping[str, Any],
    folder: Path,
    tracking: str | None,
) -> None:
    """Print, write and track what came out; trial seeds into the project's results."""
    found = summarise(rows, record["grid"]["seed"])
    said_all, headline = tables(found), headline_of(found)
    print("\n\n".join(said_all.values()))
    if record["missing"]:
        print(
            f"{record['missing']} cases of the grid are missing; this is a part of it"
        )
    where = folder
    if record["published"] or record["smoke"]:
        where = results_folder(record["smoke"], record["published"])
        ledger.enter(opening_of(record, rows), where)
    written = write_result(
        "limits",
        headline,
        {"record": record, **found},
        seed=record["grid"]["seed"],
        folder=where,
    )
    files = [written]
    for name, entry in found["effects"].items():
        files += save_figure(effect_figure(name, entry), f"limits-{name}", where)
    print(f"written to {where}")
    track(record, headline, said_all, files, tracking)


def opening_of(
    record: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]
) -> ledger.Row:
    """What the ledger keeps of a grid."""
    nulls = [r["right"] for r in rows if r["effect"] == "null"]
    single = [r["named"] for r in rows if r["effect"] != "null"]
    parts = {k: v for k, v in (("null", nulls), ("single", single)) if v}
    seed = record["grid"]["seed"]
    return {
        "trial": f"limits {seed} {record['commit']}",
        "opened": datetime.now(UTC).strftime("%Y-%m-%d"),
        **{"generator": "forge, grid", "side": None, "seed": seed, "what": "limits"},
        "counts": {k: len(v) for k, v in parts.items()},
        "right": {k: f"{sum(v)} of {len(v)}" for k, v in parts.items()},
        "commit": record["commit"],
    }


def track(
    record: Mapping[str, Any],
    headline: Mapping[str, Any],
    said_all: Mapping[str, str],
    files: Sequence[Path],
    uri: str | None,
) -> None:
    """One MLflow run for the grid, with its table and figures."""
    grid, identity = record["grid"], fingerprint(dict(record))
    tracked(
        "limits",
        headline,
        database(uri, record["smoke"]),
        study=f"limits seed {grid['seed']}",
        identity=identity,
        name=f"seed {grid['seed']}, {record['cases']} cases",
        parameters={"seed": grid["seed"], "cases": record["cases"]}
        | {k: str(grid[k]) for k in ("strengths", "levels", "colours")},
        data=("forged cases", identity),
        # A description holds 8000 characters; all of it is an artifact.
        note="\n\n".join([said_all["effects"], said_all["nulls"]]),
        files=files,
        texts={"limits.md": "\n\n".join(said_all.values()) + "\n"},
    )
