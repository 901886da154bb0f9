"""Diagnoses against the key: rates with Wilson intervals, regions, confusion, misses.

A case without a diagnosis counts as wrong in every rate.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from studies.concealed.orders import NAMES

ACCEPTED = 0.05  # NRMSE of the base alone up to which a fit is accepted by eye
NOISE = 1.01  # times the noise, up to which nothing is left to tell anything by
CONFIDENT = 0.5  # a name given this probability or more is asserted
AND_MORE, SEVERAL = "it and more", "several"
VERDICTS = ("nothing_missing", "undetermined", "unexplained", "no diagnosis")
ABSENT: dict[str, Any] = {"verdict": "no diagnosis", "selected": [], "mismatch": []}


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


def confidently_named(diagnosis: Mapping[str, Any]) -> set[str]:
    """Effects that the diagnosis asserts: selected, and not with a low probability."""
    if diagnosis["verdict"] not in ("explained", "partly_explained"):
        return set()
    told = {
        e["effect"]: e.get("probability") for e in diagnosis.get("explanations", [])
    }
    chances = {n: told.get(n) for n in diagnosis["selected"]}
    return {n for n, p in chances.items() if p is None or p >= CONFIDENT}


def equivalents(diagnosis: Mapping[str, Any]) -> set[str]:
    """The choice and what the diagnosis could not tell from it."""
    found = set(diagnosis["selected"])
    for explanation in diagnosis.get("explanations", []):
        for other in explanation.get("equivalent", []):
            found.add(other["effect"] if isinstance(other, Mapping) else other)
    return found


def right(answer: Mapping[str, Any], diagnosis: Mapping[str, Any]) -> bool:
    """Whether a case of any group counts as right, by the bar of its group."""
    if diagnosis["verdict"] == "no diagnosis":
        return False
    if answer["group"] == "null":
        return diagnosis["verdict"] == "nothing_missing"
    if answer["group"] == "unlisted":
        return not confidently_named(diagnosis)
    named = diagnosis["verdict"] in ("explained", "partly_explained")
    return named and set(diagnosis["selected"]) == set(answer["effects"])


def column(answer: Mapping[str, Any], diagnosis: Mapping[str, Any]) -> str:
    """Where a diagnosis falls in the confusion matrix."""
    if diagnosis["verdict"] in VERDICTS:
        return str(diagnosis["verdict"])
    selected = diagnosis["selected"]
    if not selected:
        return "unexplained"
    if len(selected) == 1:
        return str(selected[0])
    one = answer["group"] == "single" and answer["effects"][0] in selected
    return AND_MORE if one else SEVERAL


def mask_of(spans: Sequence[Sequence[int]], samples: int) -> np.ndarray:
    mask = np.zeros(samples, dtype=bool)
    for start, end in spans:
        mask[start:end] = True
    return mask


def region_f1(
    answer: Mapping[str, Any],
    diagnosis: Mapping[str, Any],
    times_s: Mapping[str, np.ndarray],
    which: str = "acts",
) -> float | None:
    """F1 over the samples of a case; None where the effect never acts by two sigmas.

    `which` is "acts" (the effect moves the stress by more than two noise sigmas) or
    "left" (so does what a generous refit of the base leaves).
    """
    true_positive = false = missed = 0
    for recording, spans in zip(answer["recordings"], answer[which], strict=True):
        time = times_s[recording["name"]]
        truth = mask_of(spans, len(time))
        found = np.zeros(len(time), dtype=bool)
        for region in diagnosis["mismatch"]:
            if Path(region["recording"]).stem == recording["name"]:
                found |= (time >= region["start_s"]) & (time <= region["end_s"])
        true_positive += int(np.sum(truth & found))
        false += int(np.sum(~truth & found))
        missed += int(np.sum(truth & ~found))
    if true_positive + missed == 0:
        return None
    return 2 * true_positive / (2 * true_positive + false + missed)


def read_diagnoses(
    answers: Iterable[Mapping[str, Any]], folder: Path
) -> dict[str, dict[str, Any]]:
    """diagnosis.json by case; `ABSENT` where there is none."""
    found = {}
    for answer in answers:
        file = folder / answer["case"] / "diagnosis.json"
        found[answer["case"]] = (
            json.loads(file.read_text(encoding="utf-8")) if file.exists() else ABSENT
        )
    return found


def read_times(answer: Mapping[str, Any], cases: Path) -> dict[str, np.ndarray]:
    folder = cases / answer["case"] / "recordings"
    return {
        r["name"]: pd.read_csv(folder / f"{r['name']}.csv", usecols=["time_s"])[
            "time_s"
        ].to_numpy()
        for r in answer["recordings"]
    }


def median(values: Iterable[float | None]) -> float | None:
    kept = [v for v in values if v is not None and np.isfinite(v)]
    return float(np.median(kept)) if kept else None


def heldout_over_floor(
    answer: Mapping[str, Any], diagnosis: Mapping[str, Any]
) -> float | None:
    """Held-out NRMSE of the corrected model over that of the noise alone."""
    after = diagnosis.get("fit", {}).get("after", {}).get("heldout_nrmse")
    return None if after is None else float(after) / float(answer["noise_nrmse"])


def after_over_noise(
    answer: Mapping[str, Any], diagnosis: Mapping[str, Any]
) -> float | None:
    """Error of the corrected model on the recordings over that of the noise alone."""
    after = diagnosis.get("fit", {}).get("after", {}).get("nrmse")
    return None if after is None else float(after) / float(answer["noise_nrmse"])


def base_nrmse(answer: Mapping[str, Any], diagnosis: Mapping[str, Any]) -> float:
    """NRMSE of the base with nothing added: what a practitioner looks at.

    As the diagnosis found it: refitted, unless it was given as a simulation. Without a
    diagnosis, what the key's own refit leaves and the noise, added in squares.
    """
    found = diagnosis.get("fit", {}).get("before", {}).get("nrmse")
    if found is not None:
        return float(found)
    return float(np.hypot(answer["left_nrmse"], answer["noise_nrmse"]))


def concealment(table: pd.DataFrame) -> dict[str, Any]:
    """How much was found in the cases whose base would have been accepted by eye."""
    listed = table[table.group.isin(["single", "pair"])]
    single = table[table.group == "single"]
    return {
        "accepted_below_nrmse": ACCEPTED,
        "groups": {g: concealed_share(t) for g, t in table.groupby("group")},
        "effects": {e: concealed_share(t) for e, t in single.groupby("effects")},
        "cases": [
            {k: row[k] for k in ("case", "effects", "base_nrmse", "named", "right")}
            for row in listed.to_dict("records")
        ],
    }


def concealed_share(table: pd.DataFrame) -> dict[str, Any]:
    """Of some cases: how many were accepted by eye, and what was named in those."""
    accepted = table[table.accepted]
    return {
        "base_nrmse": median(table.base_nrmse),
        "accepted": Rate(len(accepted), len(table)).entry(),
        "named": Rate(int(accepted.named.sum()), len(accepted)).entry(),
        "right": rate(accepted),
    }


def unseen_over_floor(
    answer: Mapping[str, Any], simulated_MPa: np.ndarray | None
) -> float | None:
    """What a noisy recording of the unseen programme would show, over its noise.

    The corrected model's error on the clean stress and the noise of the case add in
    squares; 1 is a perfect prediction.
    """
    if answer["unseen"] is None or simulated_MPa is None:
        return None
    clean = np.asarray(answer["unseen"]["clean_MPa"])
    error = np.mean((simulated_MPa - clean) ** 2)
    return float(np.sqrt(1 + error / answer["noise"]["sigma_MPa"] ** 2))


def score(
    answers: Sequence[Mapping[str, Any]],
    diagnoses: Mapping[str, Mapping[str, Any]],
    times_s: Mapping[str, Mapping[str, np.ndarray]],
    simulated_MPa: Mapping[str, np.ndarray],
) -> dict[str, Any]:
    """Everything that the trial reports, JSON-ready.

    Times by case and recording; corrected models' stress for the unseen programmes by
    case, where there is one.
    """
    rows = []
    for answer in answers:
        d = diagnoses[answer["case"]]
        times = times_s[answer["case"]]
        nrmse = base_nrmse(answer, d)
        rows.append(
            {
                "case": answer["case"],
                "group": answer["group"],
                "effects": "+".join(answer["effects"]),
                "right": right(answer, d),
                "base_nrmse": nrmse,
                "accepted": nrmse < ACCEPTED,
                "named": bool(answer["effects"])
                and set(answer["effects"]) <= set(d["selected"]),
                "column": column(answer, d),
                "verdict": d["verdict"],
                "selected": list(d["selected"]),
                "equivalent": sorted(equivalents(d) - set(d["selected"])),
                "oracle": min(
                    [p["oracle_power"] for p in answer["planted"].values()], default=1.0
                ),
                "beside": {e: p["power_beside"] for e, p in answer["planted"].items()},
                "over_noise": after_over_noise(answer, d),
                "f1": region_f1(answer, d, times),
                "f1_left": region_f1(answer, d, times, "left"),
                "heldout": heldout_over_floor(answer, d),
                "unseen": unseen_over_floor(answer, simulated_MPa.get(answer["case"])),
                **{k: answer[k] for k in ("dirty", "simulated", "history")},
                "noise": answer["noise"]["kind"],
                "level": answer["noise"]["level"],
            }
        )
    table = pd.DataFrame(rows)
    listed = table[table.group.isin(["single", "pair"])]
    return {
        "groups": {g: rate(t) for g, t in table.groupby("group")},
        "effects": {
            e: {
                **rate(t),
                "oracle_power": float(t.oracle.mean()),
                "f1": median(t.f1),
                "heldout_over_floor": median(t.heldout),
                "unseen_over_floor": median(t.unseen),
            }
            for e, t in table[table.group == "single"].groupby("effects")
        },
        "unlisted": {
            e: rate(t) for e, t in table[table.group == "unlisted"].groupby("effects")
        },
        # Not wrong is not yet right: whether it was seen that something is there.
        "unlisted_noticed": noticed(table[table.group == "unlisted"]),
        "conditions": {
            f"{name} {value}": rate(t)
            for name in ("dirty", "simulated", "history", "noise", "level")
            for value, t in table.groupby(name)
        },
        "concealment": concealment(table),
        "power": power_against_oracle(table[table.group == "single"]),
        "region_f1": median(listed.f1),
        "region_f1_left": median(listed.f1_left),
        "region_f1_of": int(listed.f1.notna().sum()),
        "heldout_over_floor": median(listed.heldout),
        "unseen_over_floor": median(listed.unseen),
        "unseen_of": int(listed.unseen.notna().sum()),
        "confusion": confusion(table),
        "misses": [miss(r) for r in rows if not r["right"]],
    }


def rate(table: pd.DataFrame) -> dict[str, float | int]:
    return Rate(int(table.right.sum()), len(table)).entry()


def noticed(table: pd.DataFrame) -> dict[str, float | int]:
    seen = ~table.verdict.isin(["nothing_missing", "no diagnosis"])
    return Rate(int(seen.sum()), len(table)).entry()


def power_against_oracle(singles: pd.DataFrame) -> float | None:
    """Share of single effects found, over the oracle's mean power on the same cases."""
    if not len(singles) or singles.oracle.sum() == 0:
        return None
    found = [
        e in s for e, s in zip(singles["effects"], singles["selected"], strict=True)
    ]
    return float(np.mean(found) / singles.oracle.mean())


def confusion(table: pd.DataFrame) -> dict[str, dict[str, int]]:
    """Counts, row by truth (single effects, null, unlisted), column by diagnosis."""
    result: dict[str, dict[str, int]] = {}
    for name in (*NAMES, "null", "unlisted"):
        if name in ("null", "unlisted"):
            part = table[table.group == name]
        else:
            part = table[(table.group == "single") & (table["effects"] == name)]
        if len(part):
            result[name] = dict(Counter(part.column))
    return result


def miss(row: Mapping[str, Any]) -> dict[str, Any]:
    """A wrong case with its cause, as far as the key can tell it."""
    truth = set(row["effects"].split("+")) if row["effects"] else set()
    selected = set(row["selected"])
    if row["verdict"] == "no diagnosis":
        cause = "no diagnosis was written"
    elif row["group"] == "null":
        cause = "something named where nothing is missing"
        if not selected:
            cause = "nothing named, but nothing_missing not said"
    elif row["group"] == "unlisted":
        cause = "confident name for something on no list"
        if row["over_noise"] < NOISE:
            cause = "on no list, but what was named leaves no more than noise"
    elif row["oracle"] < 0.8:
        cause = "not visible in these recordings, the oracle's power is below 0.8"
    elif truth < selected:
        cause = "right, and more"
    elif truth <= selected | set(row["equivalent"]):
        cause = "listed as equivalent to what was named"
    elif selected & truth and max(row["beside"][e] for e in truth - selected) < 0.8:
        cause = "one of two, in whose forms the other is lost, says the oracle"
    elif selected & truth:
        cause = "one of two found"
    else:
        cause = "another effect named" if selected else "nothing named"
    keys = ("case", "group", "effects", "verdict", "selected", "equivalent", "noise")
    return {k: row[k] for k in keys} | {"oracle_power": row["oracle"], "cause": cause}
