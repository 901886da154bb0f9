"""Cases on disk: what may be seen in `cases/`, the answers sealed beside them."""

from __future__ import annotations

import gzip
import hashlib
import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.concealed.forge import forge_case
from bench.concealed.orders import NAMES, Order
from bench.scoring import CLASSES, Truth


def write_case(order: Order, cases: Path) -> dict[str, Any]:
    """Forge one case, write what may be seen, hand back the answer."""
    forged = forge_case(order)
    folder = cases / order.name / "recordings"
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in forged.tables.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    (cases / order.name / "case.toml").write_text(forged.toml)
    return forged.answer


def write_cases(orders: Sequence[Order], directory: Path, jobs: int = 1) -> str:
    """Write `directory`/cases and the sealed key beside it; the key's SHA-256.

    `directory`/seal.json holds the hash and what was ordered in numbers only.
    """
    cases = directory / "cases"
    cases.mkdir(parents=True, exist_ok=True)
    if any(cases.iterdir()):
        raise FileExistsError(f"{cases} is not empty; forge into a new folder")
    folders = [cases] * len(orders)
    if jobs > 1:
        with ProcessPoolExecutor(jobs) as pool:
            answers = list(pool.map(write_case, orders, folders, chunksize=4))
    else:
        answers = [write_case(o, f) for o, f in zip(orders, folders, strict=True)]
    key = gzip.compress(json.dumps(answers, default=plain).encode(), mtime=0)
    sealed = directory / "sealed"
    sealed.mkdir(exist_ok=True)
    (sealed / "key.json.gz").write_bytes(key)
    digest = hashlib.sha256(key).hexdigest()
    seal = {"key_sha256": digest, "cases": len(orders)}
    (directory / "seal.json").write_text(json.dumps(seal, indent=1) + "\n")
    return digest


def open_key(directory: Path) -> list[dict[str, Any]]:
    """Answers of a forged folder; refused when the key is not the one sealed."""
    data = (directory / "sealed" / "key.json.gz").read_bytes()
    stated = json.loads((directory / "seal.json").read_text())["key_sha256"]
    found = hashlib.sha256(data).hexdigest()
    if found != stated:
        raise ValueError(f"the key has SHA-256 {found}, sealed was {stated}")
    return json.loads(gzip.decompress(data))


def plain(value: Any) -> Any:
    """NumPy scalars and arrays for JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not for JSON")


# --- cases that came from elsewhere, each with truth/NAME/truth.json ------------------


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
    if count not in (None, len(effects)) or not set(effects) <= set(NAMES):
        each = ["any" if n is None else str(n) for n in CLASSES.values()]
        raise ValueError(
            f"truth of {case}: cls {told.get('cls')!r} with effects {effects}; a "
            f"{', '.join(CLASSES)} has {', '.join(each)} effects, of {', '.join(NAMES)}"
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
