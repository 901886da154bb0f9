"""The ledger: every seed and every batch of cases whose truths were ever opened.

What was opened is no fresh evidence when it is opened again. That is not forbidden, but
the ledger knows, and the trial says so.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from filelock import FileLock

from bench.scoring import Rate
from softnn import json_file
from softnn.study.common import markdown

Row = dict[str, Any]
HEADS = (
    "opened",
    "generator",
    "side",
    "seed",
    "what",
    "cases",
    "right",
    "commit",
    "new",
)


def read(folder: Path) -> list[Row]:
    file = folder / "ledger.json"
    return json.loads(file.read_text("utf-8"))["openings"] if file.exists() else []


def enter(row: Mapping[str, Any], folder: Path, beside: Sequence[Path] = ()) -> Row:
    """Enter an opening, or what came of it once it is scored; the row as it stands.

    A row with the same `trial` is the same opening. `opened_before` tells which others
    had the same seed of the same generator and side, or a truth in common: in the
    ledger of this folder, or of those `beside`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with FileLock(folder / ".ledger.lock"):
        rows = read(folder)
        others = [r for r in rows if r["trial"] != row["trial"]]
        mine = next((r for r in rows if r not in others), None)
        aside = [r for place in beside if place != folder for r in read(place)]
        known = {r["trial"]: r for r in [*aside, *others] if r["trial"] != row["trial"]}
        before = [
            f"{r['opened']}, {r['what']}" for r in known.values() if shared(row, r)
        ]
        whole = {**row, "opened_before": mine["opened_before"] if mine else before}
        whole["opened"] = mine["opened"] if mine else row["opened"]
        kept = [whole if r is mine else r for r in rows] + [whole] * (mine is None)
        again = sum(bool(r["opened_before"]) for r in kept)
        head = {"openings": len(kept), "opened_before": again}
        content = {"study": "ledger", "headline": head, "openings": kept}
        json_file.write(folder / "ledger.json", content)
    return whole


def shared(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two openings are of the same cases, or of some of the same."""
    if set(one.get("truths", ())) & set(other.get("truths", ())):
        return True
    keys = ("generator", "side", "seed")
    return one["seed"] is not None and all(one[k] == other[k] for k in keys)


def draws(rows: Sequence[Mapping[str, Any]], most: int) -> list[Mapping[str, Any]]:
    """The newest fresh draws of the families held out, each diagnosed whole."""
    fresh = [
        r
        for r in rows
        if (r["generator"], r["side"]) == ("hands", "held-out")
        and not (r["opened_before"] or r.get("undiagnosed"))
        and r["right"]
    ]
    return sorted(fresh, key=lambda r: (r["opened"], r["seed"]))[-most:]


def together(rows: Sequence[Mapping[str, Any]]) -> dict[str, Rate]:
    """Of all cases of these openings, those that were right, a class each."""
    out: dict[str, Rate] = {}
    for row in rows:
        for name, text in row["right"].items():
            right, of = map(int, text.split(" of "))
            before = out.get(name, Rate(0, 0))
            out[name] = Rate(before.right + right, before.of + of)
    return out


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """All openings as Markdown, the newest first."""
    return markdown(
        HEADS,
        [
            [
                r["opened"],
                r["generator"],
                r["side"],
                r["seed"],
                r["what"],
                sum(r["counts"].values()) or None,
                ", ".join(f"{k} {v}" for k, v in r["right"].items()) or None,
                r.get("commit"),
                "opened before" if r["opened_before"] else "new",
            ]
            for r in sorted(reversed(rows), key=lambda r: r["opened"], reverse=True)
        ],
    )
