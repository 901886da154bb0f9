"""What a diagnosis of recordings said, held against the literature and made faults."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from bench.recordings.faults import CONTROL, UNLISTED
from bench.recordings.groups import Group
from bench.recordings.sets import Material
from bench.scoring import Rate
from softnn.json_file import plain
from softnn.mismatch.posterior import SURE
from softnn.study.common import percent, provenance_of

MAIN = "pl-wiechert"  # the base that bars and faults are about

CLOSE = 0.05  # held-out NRMSE that the account of an original leaves: accepted by eye


@dataclass
class Row:
    """What one diagnosis said; fractions, MPa, s."""

    set: str
    group: str
    kind: str
    base: str
    split: str = ""
    label: str = ""
    outside: bool = False
    fault: str = ""
    expected: str = ""
    verdict: str = ""
    selected: list[str] = field(default_factory=list)
    probability: dict[str, float] = field(default_factory=dict)  # of what is selected
    equivalent: list[str] = field(default_factory=list)
    where: dict[str, str] = field(default_factory=dict)
    parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    heldout: list[float] = field(default_factory=list)
    ratio: list[float] = field(default_factory=list)
    noise_nrmse: float | None = None
    unseen: dict[str, Any] = field(default_factory=dict)
    error: str = ""
    seconds: float = 0.0
    made: str = ""  # the date, version and commit: see `provenance`
    softnn: str = ""
    commit: str = ""

    @classmethod
    def of(cls, kept: Mapping[str, Any]) -> Row:
        """A row as a store or a result file has it, whatever else that has."""
        names = {f.name for f in fields(cls)}
        return cls(**{k: v for k, v in kept.items() if k in names})

    def take(self, result: Mapping[str, Any]) -> None:
        """What a diagnosis.json says, names of single recordings left out."""
        self.verdict = result["verdict"]
        self.selected = list(result["selected"])
        for told in result["explanations"]:
            self.equivalent += told["equivalent"]
            self.probability[told["effect"]] = told["probability"]
            self.where[told["effect"]] = told["where"]
            self.parameters[told["effect"]] = {
                k: v["value"] for k, v in told["parameters"].items() if " of " not in k
            }
        fit = result["fit"]
        self.heldout = [fit[k]["heldout_nrmse"] for k in ("before", "after")]
        self.ratio = [fit["heldout_ratio"], *fit["heldout_ratio_95"]]
        self.noise_nrmse = fit["noise_nrmse"]

    def line(self) -> str:
        what = " ".join(filter(None, [self.kind, self.split, self.label, self.fault]))
        head = f"{self.set} {self.group} [{self.base}] {what}: "
        if self.error:
            return head + f"not diagnosed: {self.error}"
        names = ", ".join(self.selected) or self.verdict
        errors = self.unseen or dict(
            zip(("before", "after"), self.heldout, strict=True)
        )
        return head + (
            f"{names}; {percent(errors['before'])} -> {percent(errors['after'])} "
            f"({self.seconds:.0f} s)"
        )


def made_of(rows: Sequence[Row]) -> dict[str, str]:
    """Version and last date of rows, and every commit that made one of them."""
    commits = sorted({r.commit for r in rows} - {""})
    last = max(rows, key=lambda r: r.made, default=None)
    return {**provenance_of(asdict(last) if last else {}), "commit": ", ".join(commits)}


def kept(file: Path, bases: Sequence[str], groups: Sequence[Group]) -> dict[str, Any]:
    """Rows of other bases than `bases`, made faults and history of an earlier result.

    They state their own commits.
    """
    if not file.exists():
        return {"rows": [], "faults": None, "history": []}
    told = json.loads(file.read_text(encoding="utf-8"))
    here = {(g.set, g.name) for g in groups}
    rows = [
        Row.of(provenance_of(told) | r)
        for r in told["rows"]
        if r["base"] not in bases and (r["set"], r["group"]) in here
    ]
    faults = told["faults"] and {**provenance_of(told), **told["faults"]}
    return {"rows": rows, "faults": faults, "history": told.get("history", [])}


def agreement(row: Row, material: Material) -> dict[str, Any]:
    """The names of a row against what the literature says is in the material."""
    found = set(row.selected)
    missed = [" or ".join(any_) for any_ in material.contains if not found & set(any_)]
    wrong = sorted(found & set(material.absent))
    expected = {name for any_ in material.contains for name in any_}
    return {
        "missed": missed,
        "named_though_absent": wrong,
        "sure": sorted(n for n, p in row.probability.items() if p >= SURE),
        "beyond": sorted(found - expected - set(material.absent)),
        # Fitted to first loading alone nothing need be seen: that is the trial.
        "agrees": None
        if row.kind == "monotonic" or not (material.contains or material.absent)
        else not missed and not wrong,
    }  # fmt: skip


def met(row: Row, material: Material) -> bool | None:
    """Whether the bars of the material are met by a row of unseen recordings."""
    if not material.bars or not row.unseen:
        return None
    return bool(
        row.unseen["after"] <= material.bars.get("nrmse", np.inf)
        and row.unseen["ratio"] <= material.bars.get("ratio", np.inf)
    )


def fault_scores(rows: Sequence[Row]) -> dict[str, Any]:
    """Faults found on top of what is named in the copy without one.

    How often a name is new where there is no fault is told by copies that lack a
    recording.
    """
    originals = {(r.set, r.group): r for r in rows if not r.fault}
    plain = {key: set(r.selected) for key, r in originals.items()}
    told: list[dict[str, Any]] = []
    control = [
        set(r.selected) - plain[r.set, r.group]
        for r in rows
        if r.fault == CONTROL and (r.set, r.group) in plain and not r.error
    ]
    for r in rows:
        base = plain.get((r.set, r.group))
        if not r.expected or base is None or r.error:
            continue
        new = set(r.selected) - base
        told.append(
            {
                "set": r.set,
                "group": r.group,
                "fault": r.fault,
                # What the original has already cannot be new.
                "there_before": r.expected in base,
                "found": not new if r.expected == UNLISTED else r.expected in new,
                "equivalent": r.expected in r.equivalent,
                "said": r.selected or [r.verdict],
                # What the account of the original misses, beside which it must be seen.
                "left": next(reversed(originals[r.set, r.group].heldout), None),
                "false": sorted(new - {r.expected}),
                "lost": sorted(base - set(r.selected)),
            }
        )
    counted = [t for t in told if not t["there_before"]]
    by = {
        name: rate(sum(t["found"] for t in mine), len(mine))
        for name in dict.fromkeys(t["fault"] for t in counted)
        if (mine := [t for t in counted if t["fault"] == name])
    }
    close = [t for t in counted if t["left"] is not None and t["left"] < CLOSE]
    return {
        **made_of(rows),
        "close": CLOSE,
        "found_where_close": rate(sum(t["found"] for t in close), len(close)),
        "found": rate(sum(t["found"] for t in counted), len(counted)),
        "with_a_false_name": rate(sum(bool(t["false"]) for t in counted), len(counted)),
        "new_without_a_fault": rate(sum(map(bool, control)), len(control)),
        "by_fault": by,
        "copies": told,
        "originals": {" ".join(k): sorted(v) for k, v in plain.items()},
    }


def rate(right: int, of: int) -> dict[str, float | int | None]:
    """A share with its 95 % interval, None where there is no case."""
    found: dict[str, float | int | None] = plain(Rate(right, of).entry())
    return found
