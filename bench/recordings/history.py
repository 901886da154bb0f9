"""How predictions of real recordings changed from one published run to the next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bench.recordings.rows import Row, agreement
from bench.recordings.sets import Material
from softnn.study.common import markdown, percent

WORSE = 1.1  # times the error of the base: a correction that does harm
Entry = Mapping[str, Any]


def entry(
    rows: Sequence[Row], material: Mapping[tuple[str, str], Material], made: Entry
) -> dict[str, Any]:
    """One published run: its errors on unseen recordings, and agreement of names.

    `made` is the provenance of the run. `errors` maps each prediction to the NRMSE of
    the base and of the corrected model.
    """
    judged = [
        agreement(r, material[r.set, r.group])["agrees"]
        for r in rows
        if r.kind == "all" and not r.error
    ]
    errors = {
        " ".join(filter(None, [r.set, r.group, r.split, r.label])): [
            r.unseen["before"],
            r.unseen["after"],
        ]
        for r in rows
        if r.kind == "split" and r.unseen
    }
    return {
        **made,
        "groups_judged": sum(a is not None for a in judged),
        "groups_in_agreement": sum(bool(a) for a in judged),
        "errors": errors,
    }


def extended(history: Sequence[Entry], new: Entry) -> list[Entry]:
    """The history with a new run in place of an earlier one of the same commit."""
    return [h for h in history if h.get("commit") != new.get("commit")] + [new]


def table(history: Sequence[Entry]) -> str:
    """The runs by date: medians of all their predictions, and of those they share."""
    shared = set.intersection(*(set(h["errors"]) for h in history))
    rows = []
    for h in history:
        every = np.array(list(h["errors"].values()))
        same = np.array([h["errors"][k] for k in sorted(shared)])
        rows.append(
            [
                f"{h['made']}, {h['commit']}",
                len(every),
                percent(float(np.median(every[:, 0])), 1),
                percent(float(np.median(every[:, 1])), 1),
                percent(float(np.median(same[:, 1])), 1),
                int(np.sum(every[:, 1] > WORSE * every[:, 0])),
                f"{h['groups_in_agreement']} of {h['groups_judged']}",
            ]
        )
    heads = ["run", "predictions", "base", "corrected", f"the same {len(shared)}"]
    return markdown([*heads, "harmed", "names as the literature"], rows)


ABOUT = (
    "Errors are the NRMSE on recordings that no fit used, in the median. A correction "
    "does harm where its error is more than 1.1 times that of the base. What weighs in "
    "an error has changed between runs, as the changelog says, so not all of them can "
    "be compared."
)
