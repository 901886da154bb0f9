"""What the detection limits say: shares with intervals, the oracle, table, figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from bench import ledger
from bench.scoring import Rate
from softnn.study.common import (
    COLOURS,
    FAINT,
    fingerprint,
    markdown,
    new_figure,
    percent,
    results_folder,
    runs_folder,
    save_figure,
    write_result,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Correlation times [s]; at the usual intervals neighbours correlate by 0, 0.5 and 0.9.
CORRELATION_S = {"white": 0.0, "short": 0.1, "long": 1.0}
WANTED = 0.9  # share of cases from which an effect counts as named
SEEN = 0.9  # oracle power from which a case not named is a miss of the diagnosis
RATIO_BAR, ALARM_BAR, ALARM_BOUND = 0.8, 0.02, 0.04
DRAWS = 1000


def summarise(rows: Sequence[Mapping[str, Any]], seed: int = 0) -> dict[str, Any]:
    """Everything that is reported, JSON-ready."""
    # Rows of an older store have no list of equivalents.
    table = pd.DataFrame([{"equivalent": [], **row} for row in rows])
    singles = table[table.effect != "null"].copy()
    singles["signal"] = signal(singles)
    return {
        "effects": {
            str(name): of_effect(part, np.random.default_rng(seed))
            for name, part in singles.groupby("effect", sort=False)
        },
        "nulls": {
            str(colour): of_nulls(part)
            for colour, part in table[table.effect == "null"].groupby(
                "colour", sort=False
            )
        },
        "noise": {
            str(colour): of_noise(part)
            for colour, part in table.groupby("colour", sort=False)
        },
        "lists": of_lists(singles),
        "errors": dict(Counter(e for e in table.error if e)),
        "seconds_a_case": float(table.seconds.median()),
    }


def signal(singles: pd.DataFrame) -> pd.Series:
    """What a refit leaves of an effect, root mean square a sample, over the noise.

    In whitened samples, where the noise is coloured.
    """
    return np.sqrt(singles.energy.astype(float).clip(lower=0) / singles.samples)


def of_effect(part: pd.DataFrame, rng: np.random.Generator) -> dict[str, Any]:
    low, high = ratio_interval(part, rng)
    seen = part[(part.oracle >= SEEN) & ~part.right]
    return {
        **shares(part),
        "ratio_listed": listed(part).mean() / float(part.oracle.mean()),
        "ratio_low": low,
        "ratio_high": high,
        "smallest_strength": smallest_strength(part),
        "smallest_signal": smallest_signal(part.signal, part.named),
        "oracle_smallest_signal": smallest_signal(part.signal, part.oracle),
        "strengths": by(part, "strength"),
        "levels": {k: limit(p) for k, p in groups(part, "level")},
        "colours": {
            k: {**limit(p), "strengths": by(p, "strength")}
            for k, p in groups(part, "colour")
        },
        "cells": [
            {"level": level, "colour": colour, **limit(p), **by(p, "strength")}
            for (level, colour), p in part.groupby(["level", "colour"], sort=False)
        ],
        "visible_but_missed": dict(
            Counter(said(r) for r in seen.to_dict("records")).most_common()
        ),
    }


def listed(part: pd.DataFrame) -> pd.Series:
    """Whether the effect is what was named, or listed as equivalent to that."""
    return pd.Series(
        [
            row["named"] or row["effect"] in row["equivalent"]
            for row in part.to_dict("records")
        ],
        index=part.index,
    )


def of_lists(singles: pd.DataFrame) -> dict[str, Any]:
    """How much is listed as equivalent to what is named, where something is."""
    named = singles[singles.selected.map(len) > 0]
    lengths = named.equivalent.map(len)
    return {
        "with_a_list": Rate(int((lengths > 0).sum()), len(named)).entry(),
        "mean_length": float(lengths.mean()) if len(named) else None,
    }


def groups(part: pd.DataFrame, column: str) -> list[tuple[str, pd.DataFrame]]:
    return [
        (f"{k:g}" if isinstance(k, float) else str(k), p)
        for k, p in part.groupby(column, sort=False)
    ]


def by(part: pd.DataFrame, column: str) -> dict[str, Any]:
    return {k: shares(p) for k, p in groups(part, column)}


def shares(part: pd.DataFrame) -> dict[str, Any]:
    """Named, right and alone, and the oracle, over all cases of a part."""
    power = float(part.oracle.mean())
    return {
        "named": Rate(int(part.named.sum()), len(part)).entry(),
        "right": Rate(int(part.right.sum()), len(part)).entry(),
        "oracle_power": power,
        "ratio": float(part.named.mean()) / power,
        "signal": float(part.signal.median()),
    }


def limit(part: pd.DataFrame) -> dict[str, Any]:
    return {
        "ratio": float(part.named.mean() / part.oracle.mean()),
        "smallest_strength": smallest_strength(part),
        "smallest_signal": smallest_signal(part.signal, part.named),
    }


def smallest_strength(part: pd.DataFrame) -> float | None:
    """The smallest strength from which on 90 % of the cases are named."""
    found = None
    for strength, p in sorted(part.groupby("strength"), reverse=True):
        if p.named.mean() < WANTED:
            break
        found = float(strength)
    return found


def smallest_signal(size: pd.Series, named: pd.Series) -> float | None:
    """The visible signal from which on 90 % are named, by isotonic regression.

    None where 90 % is not reached. `named` may be a chance, too: the oracle's.
    """
    from sklearn.isotonic import IsotonicRegression

    share = IsotonicRegression().fit_transform(size, named.astype(float))
    reached = np.asarray(size)[share >= WANTED - 1e-12]
    return float(reached.min()) if len(reached) else None


def ratio_interval(part: pd.DataFrame, rng: np.random.Generator) -> tuple[float, float]:
    """95 % of the power ratio: bootstrap over specimens, which share all strengths."""
    sums = part.groupby("number").agg(named=("named", "sum"), oracle=("oracle", "sum"))
    drawn = rng.integers(0, len(sums), (DRAWS, len(sums)))
    named, oracle = (sums[c].to_numpy()[drawn].sum(axis=1) for c in ("named", "oracle"))
    low, high = np.quantile(named / oracle, [0.025, 0.975])
    return float(low), float(high)


def said(row: Mapping[str, Any]) -> str:
    return " + ".join(sorted(row["selected"])) or str(row["verdict"])


def of_nulls(part: pd.DataFrame) -> dict[str, Any]:
    """False alarms: anything said but `nothing_missing`; and false names among them."""
    alarms = part[part.verdict != "nothing_missing"]
    false = part[part.selected.map(len) > 0]
    return {
        "false_alarm": Rate(len(alarms), len(part)).entry(),
        "false_name": Rate(len(false), len(part)).entry(),
        "said": dict(Counter(said(r) for r in alarms.to_dict("records"))),
    }


def of_noise(part: pd.DataFrame) -> dict[str, Any]:
    """The noise as the diagnoses read it off: everything is weighed by it."""

    def spread(column: str) -> dict[str, float]:
        values = part[column].dropna().astype(float)
        low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
        return {"low": float(low), "median": float(middle), "high": float(high)}

    columns = ("sigma_over_true", "correlation_s")
    return {c: spread(c) for c in columns if c in part and part[c].notna().any()}


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
    bars = [
        [n["rate"] - n["low"] for n in named],
        [n["high"] - n["rate"] for n in named],
    ]
    power = [strengths[k]["oracle_power"] for k in keys]
    right = [strengths[k]["right"]["rate"] for k in keys]
    axes.axhline(WANTED, color=FAINT, linewidth=0.6, linestyle=":")
    axes.plot(x, power, color=COLOURS[1], linestyle="--", label="oracle")
    axes.plot(x, right, color=COLOURS[2], linewidth=0.9, label="named, alone")
    axes.errorbar(
        x,
        middle,
        bars,
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
        where = results_folder(record["smoke"])
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
        "trial": f"limits {seed} {record['code']}",
        "opened": datetime.now(UTC).strftime("%Y-%m-%d"),
        **{"generator": "forge, grid", "side": None, "seed": seed, "what": "limits"},
        "counts": {k: len(v) for k, v in parts.items()},
        "right": {k: f"{sum(v)} of {len(v)}" for k, v in parts.items()},
        "code": [record["code"]],
    }


def track(
    record: Mapping[str, Any],
    headline: Mapping[str, Any],
    said_all: Mapping[str, str],
    files: Sequence[Path],
    uri: str | None,
) -> None:
    """One MLflow run for the grid, with its table and figures."""
    from softnn.tracking import Tracker

    home = runs_folder(record["smoke"])
    grid = record["grid"]
    identity = fingerprint(dict(record))
    with Tracker(
        uri or f"sqlite:///{(home / 'mlflow.db').as_posix()}",
        "limits",
        study=f"limits seed {grid['seed']}",
        identity=identity,
        name=f"seed {grid['seed']}, {record['cases']} cases",
        parameters={"seed": grid["seed"], "cases": record["cases"]}
        | {k: str(grid[k]) for k in ("strengths", "levels", "colours")},
        data=("forged cases", identity),
    ) as tracker:
        metrics = {
            k: float(v) for k, v in headline.items() if isinstance(v, int | float)
        }
        # A description holds 8000 characters; all of it is an artifact.
        note = "\n\n".join([said_all["effects"], said_all["nulls"]])
        texts = {"limits.md": "\n\n".join(said_all.values()) + "\n"}
        tracker.result(metrics, note=note, files=files, texts=texts)
