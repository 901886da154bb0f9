"""Errors of the rivals beside those of the base and of softnn: table and summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softnn.study.common import markdown, percent

SOFTNN, BASE = "softnn", "base"
BEST_LAW, ANY = "best_law", "best_rival"
DRAWS = 4000  # of the predictions, for an interval
WORST = 1.0  # NRMSE of no stress at all; a larger one counts as it in a mean

Row = Mapping[str, Any]


def key_of(row: Row) -> str:
    """Name of a prediction: set, group and the recordings held out."""
    return " ".join(
        filter(None, (row["set"], row["group"], row["split"], row["label"]))
    )


def joined(rivals: Sequence[Row], recordings: Sequence[Row]) -> list[dict[str, Any]]:
    """Predictions with the errors of all methods, those of the base and softnn first.

    `recordings` are rows of the study of real recordings; predictions that either lacks
    are left out.
    """
    own = {key_of(r): r["unseen"] for r in recordings if r["unseen"]}
    out = []
    for row in rivals:
        known = own.get(key_of(row))
        if known is not None:
            errors = {BASE: known["before"], SOFTNN: known["after"], **row["errors"]}
            about = {k: row[k] for k in ("set", "group", "split", "label", "outside")}
            out.append({**about, "errors": errors})
    return out


def capped(value: float | None) -> float:
    """An error as it counts in a mean: `WORST` at most, and where there is none."""
    return WORST if value is None else min(float(value), WORST)


def plain(value: float | None) -> float:
    """An error as it is compared: infinite where there is none."""
    return np.inf if value is None else float(value)


def summary(rows: Sequence[Row], seed: int = 0) -> dict[str, dict[str, Any]]:
    """Of each method: median error, its ratio to softnn's, and how often it is better.

    `ratio` is the geometric mean of error over softnn's, with a 95 % bootstrap interval
    over the predictions. `ahead`: predictions in which it is better than softnn;
    `best`: in which it is better than all others of the table.
    """
    methods = list(rows[0]["errors"]) if rows else []
    table = np.array([[plain(r["errors"][m]) for m in methods] for r in rows])
    single = [i for i, m in enumerate(methods) if m not in (BEST_LAW, ANY)]
    winner = [single[int(np.argmin(line[single]))] for line in table]
    rng = np.random.default_rng(seed)
    pick = rng.integers(0, len(rows), (DRAWS, len(rows)))
    own = table[:, methods.index(SOFTNN)] if rows else np.zeros(0)
    out = {}
    for i, name in enumerate(methods):
        logs = np.log(np.minimum(table[:, i], WORST) / np.minimum(own, WORST))
        low, high = np.exp(np.quantile(logs[pick].mean(axis=1), [0.025, 0.975]))
        out[name] = {
            "median": float(np.median(table[:, i])),
            "ratio": float(np.exp(logs.mean())),
            "ratio_low": float(low),
            "ratio_high": float(high),
            "ratio_median": float(np.exp(np.median(logs))),
            "ahead": int(np.sum(table[:, i] < own)),
            "best": sum(w == i for w in winner),
            "failed": sum(r["errors"][name] is None for r in rows),
            "of": len(rows),
        }
    return out


def as_markdown(found: Mapping[str, Row], what: Mapping[str, str]) -> str:
    """The summary, a method a line."""
    heads = [
        "method",
        "median error",
        "error over softnn's",
        "95 % interval",
        "better than softnn",
        "best of all",
    ]
    lines = []
    for name, one in found.items():
        mine = name == SOFTNN
        lines.append(
            [
                what.get(name, name),
                percent(one["median"], 1),
                f"{one['ratio']:.2f}",
                None if mine else f"{one['ratio_low']:.2f} to {one['ratio_high']:.2f}",
                None if mine else f"{one['ahead']} of {one['of']}",
                None if name in (BEST_LAW, ANY) else f"{one['best']} of {one['of']}",
            ]
        )
    return markdown(heads, lines)


ABOUT = (
    "Error: NRMSE on recordings that no fit used. Error over softnn's: geometric mean, "
    "above 1 where softnn is better; with a 95 % bootstrap interval over the "
    f"predictions. An error above {100 * WORST:.0f} % (that of predicting no stress) "
    "counts as that in the mean, for softnn too."
)


def verdict(found: Mapping[str, Row], what: Mapping[str, str]) -> str:
    """Which rivals are ahead of softnn, or as good within the scatter."""
    rivals = {n: f for n, f in found.items() if n not in (SOFTNN, BASE)}
    ahead = [what.get(n, n) for n, f in rivals.items() if f["ratio"] < 1]
    near = [
        what.get(n, n)
        for n, f in rivals.items()
        if f["ratio"] >= 1 and f["ratio_low"] < 1
    ]
    parts = [
        f"Ahead of softnn by the geometric mean: {'; '.join(ahead)}."
        if ahead
        else "No rival is ahead of softnn by the geometric mean."
    ]
    if near:
        parts.append(f"Behind, but within the scatter: {'; '.join(near)}.")
    return " ".join(parts)
