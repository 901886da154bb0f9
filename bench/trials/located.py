"""Location and gain of cases by other hands, counted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.scoring import Row, median

# Faults of single recordings, which held recordings by other hands do not have.
OF_ONE_RECORDING = {
    "slack",
    "grip_slip",
    "zero_offset",
    "gain_error",
    "load_cell_drift",
}
HARMED = 1.1  # times the error of the base: a correction that does harm


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


def region_f1(
    answer: Mapping[str, Any],
    diagnosis: Mapping[str, Any],
    times_s: Mapping[str, np.ndarray],
) -> float | None:
    """F1 over the samples of a case; None where the effect never acts by two sigmas.

    `answer` has names of `recordings`, and in `acts` the samples [first, end) in which
    the effect moves the stress by more than two noise sigmas.
    """
    true_positive = false = missed = 0
    for recording, spans in zip(answer["recordings"], answer["acts"], strict=True):
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
