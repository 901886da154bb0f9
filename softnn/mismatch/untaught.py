"""Stretches of recordings outside the training domain of a network.

A network trained on tensile tests has not seen unloading, holds, or rates between the
training rates. Its stress there is made up, so no effect can be named from it. The
diagnosis of a recording therefore ends at the first such stretch; later samples have a
history outside the domain as well. The result lists the stretches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.contracts import Array
from softnn.mismatch.case import Case, to_data
from softnn.report.phrases import listed
from softnn.state import BRANCHES, phases, runs

if TYPE_CHECKING:
    from softnn.neural import Seen

FEWEST = 4  # samples that a stretch has at least, and that a recording keeps
NEAR = 0.15  # relative difference within which two rates are equal


@dataclass(frozen=True)
class Stretch:
    """Samples [first, last) of a recording outside the training domain, and why."""

    recording: int
    first: int
    last: int
    start_s: float
    end_s: float
    rate_per_s: float
    what: str


def stretches(case: Case, seen: Seen) -> list[Stretch]:
    """Return the stretches outside the training domain, one a branch, in time order."""
    out = []
    for i, chunk in enumerate(to_data(case).chunks):
        time, strain = chunk.time_s, np.asarray(chunk.strain)
        ph = phases(chunk)
        for a, b in runs(np.ones(len(time), bool), ph.branch, ph.cycle):
            lapse = time[b - 1] - time[a]
            if b - a < FEWEST or not lapse > 0:
                continue
            rate = float((strain[b - 1] - strain[a]) / lapse)
            what = _never(BRANCHES[int(ph.branch[a])], rate, strain[a:b], seen)
            if what:
                ends = float(time[a]), float(time[b - 1])
                out.append(Stretch(i, a, b, *ends, rate, what))
    return out


def _never(branch: str, rate: float, strain: Array, seen: Seen) -> str:
    """Return why a stretch is outside the training domain; "" if it is inside."""
    if seen.rate_per_s is not None:
        low, high = seen.rate_per_s
        if branch == "hold":
            return "" if low <= 0 <= high else "holds"
        if (rate < 0 <= low) or (rate > 0 >= high):
            return "unloading" if branch == "unloading" else "the other direction"
        slow, fast = sorted((abs(low), abs(high)))
        if low * high > 0 and abs(rate) < (1 - NEAR) * slow:
            return "slower rates"
        if abs(rate) > (1 + NEAR) * fast:
            return "faster rates"
    size = 0.01 * (seen.strain[1] - seen.strain[0])
    if strain.min() < seen.strain[0] - size or strain.max() > seen.strain[1] + size:
        return "strain beyond that shown"
    if seen.rates is not None and not any(
        a - NEAR * abs(a) <= rate <= b + NEAR * abs(b) for a, b in seen.rates
    ):
        return "rates between those shown"
    return ""


def taught(case: Case, found: Sequence[Stretch]) -> Case:
    """Return the case, each recording cut at its first stretch outside the domain."""
    recordings, simulated = list(case.recordings), list(case.simulated_MPa or ())
    firsts = {s.recording: s for s in reversed(found)}  # first stretch of each
    for s in firsts.values():
        i, keep = s.recording, slice(0, max(s.first, FEWEST))
        cut = case.recordings[i].take(keep)
        if np.isfinite(cut.stress_MPa).any() and np.isfinite(cut.strain).any():
            recordings[i] = cut.with_step("taught")
            simulated[i : i + 1] = [v[keep] for v in simulated[i : i + 1]]
    return replace(
        case, recordings=tuple(recordings), simulated_MPa=tuple(simulated) or None
    )


def tell(result: dict[str, Any], case: Case, found: Sequence[Stretch]) -> None:
    """Add the stretches to a diagnosis.json, and a sentence to its summary."""
    names = [r.name for r in case.recordings]
    result["untaught"] = [
        {
            "recording": names[s.recording],
            "start_s": s.start_s,
            "end_s": s.end_s,
            "rate_per_s": s.rate_per_s,
            "what": s.what,
        }
        for s in found
    ]
    if not found:
        return
    total = sum(len(r) for r in case.recordings)
    told = []
    for what in dict.fromkeys(s.what for s in found):
        one, *more = (s for s in found if s.what == what)
        share = 100 * sum(s.last - s.first for s in (one, *more)) / total
        told.append(
            f"{what} ({share:.0f} % of the samples: {names[one.recording]} from "
            f"{one.start_s:.4g} to {one.end_s:.4g} s"
            + (f" and {len(more)} more)" if more else ")")
        )
    said = (
        f"The network was never shown {listed(told)}; what it misses there is no "
        "physics of the material."
    )
    result["answer"]["open"].append(said)
    result["summary"] += f" {said}"
