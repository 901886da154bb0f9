"""Truths on disk: sealed before a diagnosis is made, opened after the last one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench.hands.families import EFFECTS
from bench.scoring import CLASSES, Truth

FIRST_TRIAL_SEED = 10_000  # below: development


def truths_in(folder: Path) -> dict[str, bytes]:
    """What lies in the truths of all cases of a folder, by name, unread."""
    if not (folder / "cases").is_dir():
        raise FileNotFoundError(f"{folder} holds no folder cases/")
    names = sorted(c.name for c in (folder / "cases").iterdir() if c.is_dir())
    if not names:
        raise FileNotFoundError(f"{folder / 'cases'} holds no case")
    return {n: (folder / "truth" / n / "truth.json").read_bytes() for n in names}


def seal_of(data: Mapping[str, bytes]) -> str:
    """SHA-256 over all truths, their names too."""
    digest = hashlib.sha256()
    for name, content in sorted(data.items()):
        digest.update(f"{name} {len(content)} ".encode() + content)
    return digest.hexdigest()


def open_truths(folder: Path, stated: str) -> list[Truth]:
    """Truths of a folder; refused when they are not those that were sealed."""
    data = truths_in(folder)
    if seal_of(data) != stated:
        raise ValueError(f"truths have SHA-256 {seal_of(data)}, sealed was {stated}")
    return [read_truth(name, json.loads(content)) for name, content in data.items()]


def read_truth(case: str, told: Mapping[str, Any]) -> Truth:
    """A truth.json; without an energy a case is taken for one that can be seen."""
    effects = told.get("effects", [])
    count = CLASSES.get(told.get("cls", ""), -1)
    if count not in (None, len(effects)) or not set(effects) <= set(EFFECTS):
        each = ["any" if n is None else str(n) for n in CLASSES.values()]
        raise ValueError(
            f"truth of {case}: cls {told.get('cls')!r} with effects {effects}; a "
            f"{', '.join(CLASSES)} has {', '.join(each)} effects, of "
            f"{', '.join(EFFECTS)}"
        )
    energy = told.get("energy_after_refit")
    return Truth(
        case,
        told["cls"],
        tuple(effects),
        float("inf") if energy is None else float(energy),
        told.get("energy_beyond_the_other") or {},
        told.get("noise", {}).get("kind", ""),
    )
