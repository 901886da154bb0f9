"""One rule for every trial: what is named, against what is true.

An effect is named when it is in `selected`, whatever its probability; that holds for
cases of every class. Right is: of one effect or two, those and nothing else; of none,
`nothing_missing` and no name; of what is on no list ("alien"), no name; of one effect
beside that ("mixed"), its name alone; of effects whose laws are wrong ("bent"), those
and nothing else. A case without a diagnosis is wrong. What nobody could see is counted
apart (`Truth.seen`).
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import rankdata

from bench.hands.families import EFFECTS

SEEN = 40.0  # whitened energy beyond the refitted base; below it nothing is to be seen
SURE = 0.9  # a name given this probability or more is asserted
CLIP = 1e-3  # a probability of 0 that comes true would cost an infinite log score
NOISE = 1.01  # times the noise, up to which nothing is left to tell anything by
# Effects of each; of what is bent, one to three.
CLASSES = {"null": 0, "single": 1, "pair": 2, "alien": 0, "mixed": 1, "bent": None}
APART = ("mixed", "bent")  # beside the bars
AND_MORE, SEVERAL = "it and more", "several"
ABSENT: dict[str, Any] = {"verdict": "no diagnosis", "selected": [], "mismatch": []}

Row = dict[str, Any]


@dataclass(frozen=True)
class Rate:
    """`right` of `of`, with the Wilson interval of 95 %."""

    right: int
    of: int

    @property
    def value(self) -> float:
        return self.right / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        return wilson(self.right, self.of)

    def entry(self) -> dict[str, float | int]:
        low, high = self.interval
        return {
            "rate": self.value,
            "low": low,
            "high": high,
            "right": self.right,
            "of": self.of,
        }


def wilson(right: int, of: int, z: float = 1.959964) -> tuple[float, float]:
    """Score interval of a proportion (Wilson 1927, doi:10.1080/01621459.1927.10502953).

    >>> [round(v, 4) for v in wilson(0, 10)]
    [0.0, 0.2775]
    """
    if of == 0:
        return float("nan"), float("nan")
    p, n = right / of, of
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    # Rounding must not push the interval off 0 or 1 where it ends there exactly.
    low = 0.0 if right == 0 else middle - half
    high = 1.0 if right == of else middle + half
    return float(low), float(high)


@dataclass(frozen=True)
class Truth:
    """What was concealed in a case; energies are whitened sums of squares.

    `energy` is what the base leaves at its best; `beyond` what each of two effects adds
    beside the other.
    """

    case: str
    cls: str
    effects: tuple[str, ...] = ()
    energy: float = 0.0
    beyond: Mapping[str, float] = field(default_factory=dict)
    noise: str = ""  # its kind

    @property
    def seen(self) -> bool:
        """Whether there is something to see; a null hides nothing and always counts."""
        if self.cls == "null":
            return True
        return self.energy > SEEN and all(v > SEEN for v in self.beyond.values())


def right(truth: Truth, diagnosis: Mapping[str, Any]) -> bool:
    """Whether a diagnosis names what is there and nothing else."""
    if diagnosis["verdict"] == ABSENT["verdict"]:
        return False
    if truth.cls == "null" and diagnosis["verdict"] != "nothing_missing":
        return False
    return set(diagnosis["selected"]) == set(truth.effects)


def chances(diagnosis: Mapping[str, Any]) -> dict[str, float]:
    """The probability of each effect that has one; an explanation's own counts."""
    told = [*diagnosis.get("candidates", []), *diagnosis.get("explanations", [])]
    return {
        t["effect"]: float(t["probability"])
        for t in told
        if t.get("effect") and t.get("probability") is not None
    }


def row(truth: Truth, diagnosis: Mapping[str, Any]) -> Row:
    """What is counted of a case."""
    told = chances(diagnosis)
    ranked = [c["effect"] for c in diagnosis.get("candidates", []) if c.get("effect")]
    return {
        "case": truth.case,
        "cls": truth.cls,
        "effects": list(truth.effects),
        "noise": truth.noise,
        "seen": truth.seen,
        "verdict": diagnosis["verdict"],
        "selected": list(diagnosis["selected"]),
        "equivalent": sorted(equivalents(diagnosis) - set(diagnosis["selected"])),
        "first": ranked[0] if ranked else None,
        "right": right(truth, diagnosis),
        "unsure": max(told.values(), default=0.0) < SURE
        and diagnosis["verdict"] != ABSENT["verdict"],
        "names": [[n, p, n in truth.effects] for n, p in sorted(told.items())],
    }


def rate(rows: Iterable[Row], hit: Callable[[Row], bool] | str = "right") -> Row:
    """Share of rows that `hit`, a test or a key; JSON-ready."""
    flags = [bool(r[hit] if isinstance(hit, str) else hit(r)) for r in rows]
    return Rate(sum(flags), len(flags)).entry()


def leads(row: Row) -> bool:
    """Whether a true effect is first among the candidates."""
    return row["first"] in row["effects"]


def by_class(rows: Sequence[Row], count: Callable[[list[Row]], Any]) -> dict[str, Any]:
    parts = {c: [r for r in rows if r["cls"] == c] for c in CLASSES}
    return {c: count(part) for c, part in parts.items() if part}


def part(rows: Sequence[Row]) -> dict[str, Any]:
    """Ranking, naming, verdicts and calibration of some cases."""
    listed = [r for r in rows if r["effects"]]
    return {
        "ranking": {
            **by_class(listed, lambda some: rate(some, leads)),
            "all": rate([r for r in listed if r["cls"] not in APART], leads),
        },
        "naming": by_class(rows, rate),
        "unsure": by_class(rows, lambda some: rate(some, "unsure")),
        "verdict": by_class(
            rows, lambda some: dict(Counter(r["verdict"] for r in some))
        ),
        "calibration": calibration([(p, ok) for r in rows for _, p, ok in r["names"]]),
        "noise": {
            kind: by_class([r for r in rows if r["noise"] == kind], rate)
            for kind in sorted({r["noise"] for r in rows})
        },
        "effects": {
            e: of_effect(e, listed)
            for e in EFFECTS
            if any(e in r["effects"] for r in rows)
        },
    }


def of_effect(effect: str, rows: Sequence[Row]) -> dict[str, Any]:
    """An effect alone: right, first; and whether it is named, beside another too."""
    single = [r for r in rows if r["cls"] == "single" and r["effects"] == [effect]]
    some = [r for r in rows if effect in r["effects"]]
    return {
        **rate(single),
        "first": rate(single, leads),
        "named": rate(some, lambda r: effect in r["selected"]),
    }


def calibration(told: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """How far probabilities can be believed, from (probability, whether right).

    `log_score` is the mean logarithm of the probability given to what was so: 0 at
    best; `gap` the mean distance of a decile's share from its mean probability.
    """
    p = np.array([p for p, _ in told], float)
    ok = np.array([ok for _, ok in told], bool)
    if not len(p):
        return {"of": 0}
    place = np.minimum((10 * p + 1e-9).astype(int), 9)
    deciles = [
        {
            "from": i / 10,
            "mean": float(p[place == i].mean()),
            **Rate(int(ok[place == i].sum()), int((place == i).sum())).entry(),
        }
        for i in np.unique(place)
    ]
    given = np.clip(np.where(ok, p, 1 - p), CLIP, 1)
    return {
        "of": len(p),
        "deciles": deciles,
        "sure": Rate(int(ok[p >= SURE].sum()), int((p >= SURE).sum())).entry(),
        "log_score": float(np.log(given).mean()),
        "brier": float(np.mean((p - ok) ** 2)),
        "auc": auc(p[ok], p[~ok]),
        "gap": sum(d["of"] * abs(d["rate"] - d["mean"]) for d in deciles) / len(p),
    }


def auc(right: Sequence[float] | np.ndarray, wrong: Sequence[float] | np.ndarray):
    """Chance that a right one is given more than a wrong one, a tie counting half.

    Hanley and McNeil 1982, doi:10.1148/radiology.143.1.7063747.

    >>> auc([0.9, 0.4], [0.4, 0.1])
    0.875
    """
    n, m = len(right), len(wrong)
    if not n or not m:
        return None
    ranks = rankdata(np.concatenate([right, wrong]))[:n].sum()
    return float((ranks - n * (n + 1) / 2) / (n * m))


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """Everything that any trial reports: all cases, those to be seen, the others."""
    return {
        "all": part(rows),
        "visible": part([r for r in rows if r["seen"]]),
        "others": part([r for r in rows if not r["seen"]]),
        "confusion": confusion(rows),
        "misses": [miss(r) for r in rows if not r["right"]],
    }


def confusion(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """Counts, row by truth (single effects, null, alien), column by what is named."""
    result: dict[str, Counter[str]] = {
        n: Counter() for n in (*EFFECTS, "null", "alien")
    }
    for r in rows:
        if r["cls"] not in ("pair", *APART):
            result["+".join(r["effects"]) or r["cls"]][column(r)] += 1
    return {name: dict(counts) for name, counts in result.items() if counts}


def column(row: Row) -> str:
    """Where a case falls in the confusion matrix: by its name, or else its verdict."""
    selected = row["selected"]
    if len(selected) > 1:
        return AND_MORE if set(row["effects"]) & set(selected) else SEVERAL
    return str(selected[0] if selected else row["verdict"])


def miss(row: Row) -> Row:
    keys = ("case", "cls", "effects", "verdict", "selected", "equivalent", "noise")
    return {k: row[k] for k in keys} | {"cause": cause(row)}


def cause(row: Row) -> str:
    """Why a case is wrong, as far as its truth tells.

    Only some truths know the `oracle`'s power, that of each of two effects `beside` the
    forms of the other, and how far what is left lies `over_noise`.
    """
    truth, selected = set(row["effects"]), set(row["selected"])
    if row["verdict"] == ABSENT["verdict"]:
        return "no diagnosis was written"
    if row["cls"] == "null":
        if selected:
            return "something named where nothing is missing"
        return "nothing named, but nothing_missing not said"
    if row["cls"] == "alien":
        if row.get("over_noise", NOISE) < NOISE:
            return "on no list, but what was named leaves no more than noise"
        return "a name for something on no list"
    if not row["seen"] or row.get("oracle", 1.0) < 0.8:
        return "hardly visible in these recordings after a refit"
    if truth < selected:
        return "right, and more"
    if truth <= selected | set(row["equivalent"]):
        return "listed as equivalent to what was named"
    if selected & truth:
        beside = row.get("beside", {})
        if max(beside.get(e, 1.0) for e in truth - selected) < 0.8:
            return "one of two, in whose forms the other is lost, says the oracle"
        return "one of two found" + ", and more" * bool(selected - truth)
    if not selected:
        return "nothing named" + ", though it leads" * leads(row)
    return "another effect named" + ", though it leads" * leads(row)


def equivalents(diagnosis: Mapping[str, Any]) -> set[str]:
    """The choice and what the diagnosis could not tell from it."""
    found = set(diagnosis["selected"])
    for explanation in diagnosis.get("explanations", []):
        for other in explanation.get("equivalent", []):
            found.add(other["effect"] if isinstance(other, Mapping) else other)
    return found


def median(values: Iterable[float | None]) -> float | None:
    kept = [v for v in values if v is not None and np.isfinite(v)]
    return float(np.median(kept)) if kept else None


def read_diagnoses(names: Iterable[str], folder: Path) -> dict[str, dict[str, Any]]:
    """diagnosis.json by case; `ABSENT` where there is none."""
    found = {}
    for name in names:
        file = folder / name / "diagnosis.json"
        found[name] = json.loads(file.read_text("utf-8")) if file.exists() else ABSENT
    return found
