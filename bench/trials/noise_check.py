"""How good is the noise as softnn reads it, given the exact truth?

Where truths have `clean/*.csv`, what a recording has beyond them is noise and nothing
else. Whitened by the estimate its mean square is 1; more, and noise would pass for
physics; less, and physics for noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.linalg import cholesky, solve_triangular

from bench.scoring import Truth
from softnn.noise import estimate
from softnn.study.common import markdown

Array = np.ndarray


def whitened(
    noise: Sequence[Array], clean_MPa: Sequence[Array], time_s: Sequence[Array]
) -> list[float]:
    """Mean square of each recording's noise, whitened as softnn estimates it."""
    found = []
    measured = [c + n for c, n in zip(clean_MPa, noise, strict=True)]
    estimates = estimate(noise, measured, time_s, whole=True)
    for one, z, clean, time in zip(estimates, noise, clean_MPa, time_s, strict=True):
        apart = np.abs(time[:, np.newaxis] - time)
        correlation = np.diag(np.full(len(time), 1 - sum(w for w, _ in one.memory)))
        for share, tau in one.memory:
            correlation += share * np.exp(-apart / tau)
        low = cholesky(correlation + 1e-12 * np.eye(len(time)), lower=True)
        unit = solve_triangular(low, z / one.sigma(clean), lower=True)
        found.append(float(np.mean(unit**2)))
    return found


def misfits(case: Path, truth: Path) -> list[float] | None:
    """Of each recording of a case; None where its truth has no clean stress."""
    parts = []
    for file in sorted((case / "recordings").glob("*.csv")):
        if not (truth / "clean" / file.name).exists():
            return None
        both = pd.read_csv(file, usecols=["time_s", "stress_MPa"]).merge(
            pd.read_csv(truth / "clean" / file.name), "inner", "time_s"
        )
        both = both.dropna()
        measured, clean = (both[f"stress_MPa_{k}"].to_numpy() for k in "xy")
        parts.append((measured - clean, clean, both["time_s"].to_numpy()))
    return whitened(*zip(*parts, strict=True)) if parts else None


def check(folder: Path, truths: Iterable[Truth]) -> dict[str, Any]:
    """Median and 10-90 % range over cases of the whitened misfit by kind of noise."""
    kinds: dict[str, list[float]] = {}
    for t in truths:
        found = misfits(folder / "cases" / t.case, folder / "truth" / t.case) or []
        for kind in (t.noise, "all") if found else ():
            kinds.setdefault(kind, []).append(float(np.mean(found)))
    return {
        kind: {f"q{q}": float(np.percentile(v, q)) for q in (10, 50, 90)}
        | {"of": len(v)}
        for kind, v in sorted(kinds.items())
    }


def table(found: dict[str, Any]) -> str:
    if not found:
        return "No truth has the clean stress: the noise cannot be checked."
    heads = ["noise", "whitened misfit of the truth, median", "10 to 90 % of cases"]
    cells = [
        [k, f"{v['q50']:.2f}", f"{v['q10']:.2f} to {v['q90']:.2f}", v["of"]]
        for k, v in found.items()
    ]
    return markdown([*heads, "cases"], cells)
