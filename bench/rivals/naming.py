"""What a rival found in a case, and the rule that makes names of it.

A rival hands back shares: how much of what it explains is carried by which effect. The
rule has three thresholds, tuned on development seeds for each rival alone: it may say
that nothing is missing, and it may say that it does not know.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

UNMAPPED = "unmapped"  # what no effect is known to look like
FOREIGN = 0.5  # share of it from which the whole counts as something unlisted


@dataclass(frozen=True)
class Found:
    """Before the rule: shares by effect id, and how far to believe them.

    `gain` is the share of the base's held-out squared error that is gone, or a
    probability that something is missing; `explained` is the share of the excess over
    the noise that is gone, or the probability of the name.
    """

    shares: Mapping[str, float] = field(default_factory=dict)
    gain: float = 0.0
    explained: float = 0.0
    heldout_nrmse: float | None = None
    note: str = ""

    def entry(self) -> dict[str, Any]:
        return asdict(self) | {"shares": dict(self.shares)}


@dataclass(frozen=True)
class Rule:
    """`share` to be named, `least` gain to say anything, `enough` explained to name."""

    share: float = 0.2
    least: float = 0.05
    enough: float = 0.5

    def verdict(self, found: Found) -> tuple[str, list[str]]:
        if not found.gain > self.least:
            return "nothing_missing", []
        names = [
            n for n, s in found.shares.items() if n != UNMAPPED and s >= self.share
        ]
        foreign = found.shares.get(UNMAPPED, 0.0) >= FOREIGN
        if foreign or not names or found.explained < self.enough:
            return "unexplained", []
        return "explained", names


def diagnosis(
    found: Found, rule: Rule, before: float, seconds: float, names: bool = True
) -> dict[str, Any]:
    """An answer in the form of diagnosis.json, as far as the scorer reads it."""
    verdict, selected = rule.verdict(found) if names else ("undetermined", [])
    after = found.heldout_nrmse
    if verdict == "nothing_missing" and after is not None:
        after = before
    return {
        "verdict": verdict,
        "selected": selected,
        "explanations": [],
        "mismatch": [],
        "fit": {
            "before": {"heldout_nrmse": before},
            "after": {"heldout_nrmse": after},
        },
        "seconds": seconds,
        "found": found.entry(),
    }
