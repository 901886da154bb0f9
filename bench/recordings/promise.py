"""Was a recording worth what was promised of it? Recordings left out, put back.

A diagnosis without some recordings says how likely one more of their programme settles
what is in question (`softnn.mismatch.plan`). They were recorded, so the diagnosis of
all recordings shows whether it did.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from bench.recordings.rows import Row, rate
from bench.reporting import cell
from softnn.mismatch.case import Case, to_data
from softnn.mismatch.compare import LIKELY, SURE
from softnn.mismatch.diagnosis import Diagnosis
from softnn.mismatch.plan import MOST_SPECIMENS, Alternatives
from softnn.mismatch.programmes import Programme
from softnn.study.common import percent

PARTS = 3  # promises are compared with what came in so many parts


def promised(found: Diagnosis, left: Case) -> dict[str, Any]:
    """What is in question, and the promise of the recordings that were left out.

    The promise is that of the one with the largest gain, run on as many specimens.
    Empty if nothing is in question, if softnn promises nothing, or if recordings
    continue one another.
    """
    among = Alternatives.from_dict(found.result["alternatives"])
    asked = len(among.sets) > 1 and among.open and among.promises
    if not asked or among.known.continued:
        return {}
    data = to_data(left)
    count = min(len(data.chunks), MOST_SPECIMENS)
    every = [
        Programme(name, c.time_s - c.time_s[0], c.strain, c.temperature_C)
        for name, c in zip(data.names, data.chunks, strict=True)
    ]
    with np.errstate(all="ignore"):
        scores = [among.score(p) for p in every]
        best = max(range(len(every)), key=lambda i: scores[i].gain)
        score = among.score(every[best], count) if count > 1 else scores[best]
    return {"open": among.open, "sure": score.sure, "gain": score.gain}


def settled(whole: Row, asked: Sequence[str]) -> bool:
    """Whether an effect in question is sure with all recordings, or none is likely.

    A class of laws is no answer here, since none is promised.
    """
    sure = {n for n in whole.selected if whole.chance.get(n, 0.0) >= SURE}
    none = all(whole.chance.get(n, 0.0) < LIKELY for n in asked)
    return none or bool(sure & set(asked))


def promises(rows: Sequence[Row]) -> dict[str, Any]:
    """Promises and what came of them: all, and in parts."""
    whole = {(r.set, r.group, r.base): r for r in rows if r.kind == "all"}
    found = []
    for r in rows:
        all_ = whole.get((r.set, r.group, r.base))
        if r.promise and all_ is not None and not all_.error:
            found.append((r.promise["sure"], settled(all_, r.promise["open"])))
    return {"all": _share(found), "parts": in_parts(found)}


def in_parts(found: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    """Promises and whether they came true, in parts of equally many, least first."""
    order = sorted(found)
    cuts = [round(len(order) * k / PARTS) for k in range(PARTS + 1)]
    return [_share(order[a:b]) for a, b in pairwise(cuts) if b > a]


def table(told: Mapping[str, Any]) -> tuple[list[str], list[list[str | None]]]:
    """Heads and rows: promises in parts, then all."""
    every = [*told["parts"], told["all"]]
    rows = [[percent(p["promised"], 0), cell(p["came"])] for p in every]
    return ["promised", "settled"], rows


def _share(found: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    mean = float(np.mean([p for p, _ in found])) if found else None
    return {"promised": mean, "came": rate(sum(c for _, c in found), len(found))}
