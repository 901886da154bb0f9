"""What only the key of the forge can tell of a trial: regions, oracle, floors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.scoring import Rate, Row, Truth, median, rate, row

# Faults of single recordings, which held recordings by other hands do not have.
OF_ONE_RECORDING = {
    "slack",
    "grip_slip",
    "zero_offset",
    "gain_error",
    "load_cell_drift",
}
HARMED = 1.1  # times the error of the base: a correction that does harm
ACCEPTED = 0.05  # NRMSE of the base alone up to which a fit is accepted by eye


def hidden_in(answer: Mapping[str, Any], **more: Any) -> Truth:
    """What an answer of the key says was concealed, as any trial's truth."""
    alien = answer["group"] == "unlisted"
    cls, effects = ("alien", ()) if alien else (answer["group"], answer["effects"])
    return Truth(answer.get("case", ""), cls, tuple(effects), **more)


def truth_of(answer: Mapping[str, Any]) -> Truth:
    """The same, with what a refit leaves of it and the kind of noise."""
    energies = {e: float(p["energy"]) for e, p in answer["planted"].items()}
    return hidden_in(
        answer,
        energy=max(energies.values(), default=0.0),
        beyond=energies if answer["group"] == "pair" else {},
        noise=answer["noise"]["kind"],
    )


def row_of(
    answer: Mapping[str, Any],
    diagnosis: Mapping[str, Any],
    times_s: Mapping[str, np.ndarray],
    simulated_MPa: np.ndarray | None = None,
) -> Row:
    """What is counted of a case, with what the key knows beyond a truth.

    Times by recording; the corrected model's stress for the unseen programme.
    """
    planted = answer["planted"]
    nrmse = base_nrmse(answer, diagnosis)
    after = diagnosis.get("fit", {}).get("after", {}).get("nrmse")
    return {
        **row(truth_of(answer), diagnosis),
        "planted": "+".join(answer["effects"]),
        "base_nrmse": nrmse,
        "accepted": nrmse < ACCEPTED,
        "named": bool(planted) and set(planted) <= set(diagnosis["selected"]),
        "oracle": min([p["oracle_power"] for p in planted.values()], default=1.0),
        "beside": {e: p["power_beside"] for e, p in planted.items()},
        "over_noise": float(after or np.inf) / float(answer["noise_nrmse"]),
        "f1": region_f1(answer, diagnosis, times_s),
        "f1_left": region_f1(answer, diagnosis, times_s, "left"),
        "heldout": heldout_over_floor(answer, diagnosis),
        "unseen": unseen_over_floor(answer, simulated_MPa),
        **{k: answer[k] for k in ("dirty", "simulated", "history")},
        "level": answer["noise"]["level"],
    }


def details(rows: Sequence[Row]) -> dict[str, Any]:
    """What these rows show beyond `scoring.summary`, JSON-ready."""
    single = [r for r in rows if r["cls"] == "single"]
    listed = [r for r in rows if r["effects"]]
    aliens = [r for r in rows if r["cls"] == "alien"]
    return {
        "per_effect": {
            e: {
                "oracle_power": float(np.mean([r["oracle"] for r in some])),
                "f1": median(r["f1"] for r in some),
                "heldout_over_floor": median(r["heldout"] for r in some),
                "unseen_over_floor": median(r["unseen"] for r in some),
            }
            for e, some in grouped(single, "planted").items()
        },
        "aliens": {e: rate(some) for e, some in grouped(aliens, "planted").items()},
        # Not wrong is not yet right: whether it was seen that something is there.
        "aliens_noticed": rate(
            aliens, lambda r: r["verdict"] not in ("nothing_missing", "no diagnosis")
        ),
        "conditions": {
            f"{name} {value}": rate(some)
            for name in ("dirty", "simulated", "history", "level")
            for value, some in grouped(rows, name).items()
        },
        # How much was found in the cases whose base would have been accepted by eye.
        "concealment": {
            "accepted_below_nrmse": ACCEPTED,
            "groups": {c: concealed_share(t) for c, t in grouped(rows, "cls").items()},
        },
        "power": power_against_oracle(single),
        "region_f1": median(r["f1"] for r in listed),
        "region_f1_left": median(r["f1_left"] for r in listed),
        "region_f1_of": sum(r["f1"] is not None for r in listed),
        "heldout_over_floor": median(r["heldout"] for r in listed),
        "unseen_over_floor": median(r["unseen"] for r in listed),
        "unseen_of": sum(r["unseen"] is not None for r in listed),
    }


def located(rows: Sequence[Row]) -> dict[str, Any]:
    """Location and gain of cases by other hands, as far as their truths tell.

    `held_ratio` is the error of the corrected model over that of the base on noise-free
    recordings. Those leave out `OF_ONE_RECORDING`, so cases that conceal such a fault
    have less to gain there; `shared` are the others.
    """
    listed = [r for r in rows if r["effects"]]
    shared = [r for r in listed if not set(r["effects"]) & OF_ONE_RECORDING]
    apart = {"all": listed, "shared": shared} | {
        c: [r for r in rows if r["cls"] == c] for c in sorted({r["cls"] for r in rows})
    }
    return {
        "region_f1": median(r["f1"] for r in listed),
        "region_f1_of": sum(r["f1"] is not None for r in listed),
        "held_ratio": median(map(gain, listed)),
        "held_ratio_of": sum(gain(r) is not None for r in listed),
        "located": {
            name: {
                "f1": median(r["f1"] for r in some),
                "f1_of": sum(r["f1"] is not None for r in some),
                "held_ratio": median(map(gain, some)),
                "held_harmed": sum((gain(r) or 0) > HARMED for r in some),
                "held_of": sum(gain(r) is not None for r in some),
            }
            for name, some in apart.items()
        },
    }


def gain(row: Row) -> float | None:
    """Error of the corrected model over that of the base on held recordings."""
    held = row["held"]
    return None if held is None else held["after"] / max(held["before"], 1e-12)


def grouped(rows: Sequence[Row], key: str) -> dict[Any, list[Row]]:
    return {v: [r for r in rows if r[key] == v] for v in sorted({r[key] for r in rows})}


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
        truth, found = np.zeros((2, len(time)), dtype=bool)
        for start, end in spans:
            truth[start:end] = True
        for region in diagnosis["mismatch"]:
            if Path(region["recording"]).stem == recording["name"]:
                found |= (time >= region["start_s"]) & (time <= region["end_s"])
        true_positive += int(np.sum(truth & found))
        false += int(np.sum(~truth & found))
        missed += int(np.sum(truth & ~found))
    if true_positive + missed == 0:
        return None
    return 2 * true_positive / (2 * true_positive + false + missed)


def read_times(answer: Mapping[str, Any], cases: Path) -> dict[str, np.ndarray]:
    folder = cases / answer["case"] / "recordings"
    return {
        r["name"]: pd.read_csv(folder / f"{r['name']}.csv", usecols=["time_s"])[
            "time_s"
        ].to_numpy()
        for r in answer["recordings"]
    }


def heldout_over_floor(
    answer: Mapping[str, Any], diagnosis: Mapping[str, Any]
) -> float | None:
    """Held-out NRMSE of the corrected model over that of the noise alone."""
    after = diagnosis.get("fit", {}).get("after", {}).get("heldout_nrmse")
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


def concealed_share(rows: Sequence[Row]) -> dict[str, Any]:
    """Of some cases: how many were accepted by eye, and what was named in those."""
    accepted = [r for r in rows if r["accepted"]]
    return {
        "base_nrmse": median(r["base_nrmse"] for r in rows),
        "accepted": Rate(len(accepted), len(rows)).entry(),
        "named": rate(accepted, "named"),
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


def power_against_oracle(singles: Sequence[Row]) -> float | None:
    """Share of single effects found, over the oracle's mean power on the same cases."""
    power = sum(r["oracle"] for r in singles)
    return sum(r["named"] for r in singles) / power if power else None
