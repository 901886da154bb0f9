"""Detection limits of many cases: shares with intervals, beside the oracle's power."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from bench.scoring import Rate

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
