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
from softnn.mismatch.compare import NAMED, SURE
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
    chance: dict[str, float] = field(default_factory=dict)  # of every effect tried
    equivalent: list[str] = field(default_factory=list)
    where: dict[str, str] = field(default_factory=dict)
    parameters: dict[str, dict[str, float]] = field(default_factory=dict)
    heldout: list[float] = field(default_factory=list)
    ratio: list[float] = field(default_factory=list)
    noise_nrmse: float | None = None
    # Laws that cannot be told apart: name, members and probability of each class.
    classes: list[dict[str, Any]] = field(default_factory=list)
    floor: dict[str, Any] = field(default_factory=dict)  # what replicates differ by
    tolerance: float | None = None
    good_enough: bool | None = None
    action: str = ""
    model: dict[str, Any] = field(default_factory=dict)  # corrected; not published
    oracle: dict[str, Any] = field(default_factory=dict)  # `oracle.Gain` of a copy
    promise: dict[str, Any] = field(default_factory=dict)  # `promise.promised`
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
        tried = ((c["effect"], c["probability"]) for c in result["candidates"])
        self.chance = {name: p for name, p in tried if name}
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
        self.classes = list(result.get("classes") or [])
        self.floor = dict(result.get("floor") or {})
        self.tolerance = result.get("tolerance")
        self.good_enough = result.get("good_enough")
        self.action = result.get("action") or ""

    def said(self, least: float = NAMED) -> list[frozenset[str]]:
        """What is named with such a probability: effects, and classes of laws.

        A class says that one of its members is there.
        """
        names = [
            n
            for n in self.selected
            if least <= NAMED or self.probability.get(n, 0) >= least
        ]
        likely = [c["members"] for c in self.classes if c["probability"] >= least]
        return [frozenset({n}) for n in names] + [frozenset(m) for m in likely]

    def published(self) -> dict[str, Any]:
        """The row as a result file has it."""
        return {k: v for k, v in asdict(self).items() if k != "model"}

    def line(self) -> str:
        what = " ".join(filter(None, [self.kind, self.split, self.label, self.fault]))
        head = f"{self.set} {self.group} [{self.base}] {what}: "
        if self.error:
            return head + f"not diagnosed: {self.error}"
        if self.kind == "oracle":
            gain = self.oracle.get("gain", 0.0)
            seen = "seen" if self.oracle.get("seen") else "not seen"
            return head + f"{seen}, {gain:.3f} of a logarithm ({self.seconds:.0f} s)"
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


def new(copy: Row, original: Row, least: float = NAMED) -> list[frozenset[str]]:
    """What a copy says with such a probability and the original does not even suspect.

    A name is no news beside a class that has it, nor a class beside one of its names.
    """
    before = original.said()
    return [one for one in copy.said(least) if not any(one & had for had in before)]


def fault_scores(rows: Sequence[Row]) -> dict[str, Any]:
    """Faults found on top of what is named in the copy without one.

    A class of laws counts as a name, and is right if the fault is one of its members.
    Faults that a fit which knows them does not see (`oracle`) are counted apart. How
    often a name is new where there is no fault is told by copies that lack a recording.
    """
    originals = {(r.set, r.group): r for r in rows if not r.fault}
    told: list[dict[str, Any]] = []
    control: dict[float, list[bool]] = {NAMED: [], SURE: []}
    for r in rows:
        base = originals.get((r.set, r.group))
        if base is None or r.error or base.error:
            continue
        if r.fault == CONTROL:
            for least, news in control.items():
                news.append(bool(new(r, base, least)))
        elif r.expected:
            told.append(_told(r, base))
    counted = [t for t in told if not t["there_before"]]
    seen = [t for t in counted if t["seen"]]
    known = [t for t in counted if t["seen"] is not None]
    close = [t for t in counted if t["left"] is not None and t["left"] < CLOSE]

    def share(key: str, of: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        return rate(sum(bool(t[key]) for t in of), len(of))

    names = dict.fromkeys(t["fault"] for t in counted)

    def each(key: str, of: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        return {n: share(key, [t for t in of if t["fault"] == n]) for n in names}

    return {
        **made_of(rows),
        "close": CLOSE,
        "found_where_close": share("found", close),
        "found": share("found", counted),
        "seen_by_oracle": share("seen", known),
        "found_of_seen": share("found", seen),
        "with_a_false_name": share("false", counted),
        "with_a_sure_false_name": share("surely_false", counted),
        "new_without_a_fault": rate(sum(control[NAMED]), len(control[NAMED])),
        "surely_new_without_a_fault": rate(sum(control[SURE]), len(control[SURE])),
        "by_fault": each("found", counted),
        "by_fault_seen": each("seen", known),
        "by_fault_found_of_seen": each("found", seen),
        "copies": told,
        "originals": {" ".join(k): sorted(r.selected) for k, r in originals.items()},
    }


def _told(copy: Row, base: Row) -> dict[str, Any]:
    """What a copy with a made fault says, against its original."""
    false = {
        least: [one for one in new(copy, base, least) if copy.expected not in one]
        for least in (NAMED, SURE)
    }
    has = any(copy.expected in one for one in copy.said())
    return {
        "set": copy.set,
        "group": copy.group,
        "fault": copy.fault,
        # What the original has already cannot be new.
        "there_before": any(copy.expected in one for one in base.said()),
        "found": not false[NAMED] if copy.expected == UNLISTED else has,
        "seen": copy.oracle.get("seen"),
        "oracle": copy.oracle,
        "equivalent": copy.expected in copy.equivalent,
        "said": [_words(one) for one in copy.said()] or [copy.verdict],
        # What the account of the original misses, beside which it must be seen.
        "left": next(reversed(base.heldout), None),
        "false": sorted(map(_words, false[NAMED])),
        "surely_false": sorted(map(_words, false[SURE])),
        "lost": sorted(_words(one) for one in new(base, copy)),
    }


def _words(said: frozenset[str]) -> str:
    return " or ".join(sorted(said))


def rate(right: int, of: int) -> dict[str, float | int | None]:
    """A share with its 95 % interval, None where there is no case."""
    found: dict[str, float | int | None] = plain(Rate(right, of).entry())
    return found
