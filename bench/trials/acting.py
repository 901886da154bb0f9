r"""Samples at which concealed effects act, in cases by other hands.

A truth states the material (spring and branches), which gives the stress without the
concealed effects. The recorded stress minus that stress is the contribution of the
effects, plus noise. They act where its mean over `WINDOW` samples exceeds `SIGMAS` of
the noise that the truth states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.hands.kernels import responses
from bench.trials.located import region_f1
from softnn.contracts import Array
from softnn.state import runs

SIGMAS = 2.0
WINDOW = 9  # samples: white noise is a third of itself in their mean
THINNEST = 0.02  # smallest stretch


def _bend(e: Array) -> Array:
    stretch = np.maximum(1 + e, THINNEST)
    return (stretch - stretch**-2) / 3


def _first(e: Array) -> Array:
    stretch = np.maximum(1 + e, THINNEST)
    return stretch**2 + 2 / stretch - 3


Spring = Callable[..., Array]
# Springs of unit modulus, by name and names of parameters. One that is in no line here
# is not known, and its case has no location.
SPRINGS: dict[tuple[str, ...], Spring] = {
    ("linear",): lambda e: e,
    ("neo_hooke",): _bend,
    ("fung", "b"): lambda e, b: np.sign(e) * np.expm1(b * np.abs(e)) / b,
    ("gent", "lim"): lambda e, lim: e / (1 - (e / lim) ** 2),
    ("foam", "d", "e0", "k"): lambda e, d, e0, k: (
        e0 * np.tanh(e / e0) + k * e + d * e**3
    ),
    ("yeoh", "c"): lambda e, c: _bend(e) * (1 + c * _first(e) / (1 + 0.15 * _first(e))),
    ("mooney", "c"): lambda e, c: (
        _bend(e) * (c + (1 - c) / np.maximum(1 + e, THINNEST))
    ),
}


def bare(truth: Mapping[str, Any], tables: Mapping[str, pd.DataFrame]) -> list[Array]:
    """Stress (n,) of each recording with nothing concealed, MPa; none where not known.

    `tables` are the recordings by name; samples without a strain have no stress.
    """
    about = truth.get("material", {})
    parameters = about.get("parameters", {})
    spring = SPRINGS.get((about.get("skeleton", ""), *sorted(parameters)))
    if spring is None:
        return []
    taus, moduli = np.array(about["taus_s"]), np.array(about["moduli_MPa"])
    names = [r["name"] for r in truth["recordings"]]
    strains, clocks = [], []
    for name in names:
        known = tables[name].dropna(subset=["strain"])
        strains.append(known["strain"].to_numpy(float))
        clocks.append(np.diff(known["time_s"], prepend=known["time_s"].iloc[0]))
    together = truth["history"] == "continued"
    parts = [strains] if together else [[e] for e in strains]
    times = [clocks] if together else [[c] for c in clocks]
    slow: list[Array] = []
    for some, clock in zip(parts, times, strict=True):
        steps = np.diff(np.concatenate(some), prepend=0.0)
        unit = responses(steps, np.concatenate(clock), taus)
        ends = np.cumsum([len(e) for e in some])[:-1]
        slow += np.split(unit @ moduli, ends)
    out = []
    for i, (name, e, branch) in enumerate(zip(names, strains, slow, strict=True)):
        stress = np.full(len(tables[name]), np.nan)
        known = np.isfinite(tables[name]["strain"].to_numpy(float))
        one = about["modulus_MPa"] * spring(e, **parameters) + branch
        stress[known] = one * truth["specimen_factors"][i]
        out.append(stress)
    return out


def acts(
    truth: Mapping[str, Any], tables: Mapping[str, pd.DataFrame]
) -> list[list[list[int]]]:
    """Spans of samples [first, end) of each recording; none where not known."""
    out = []
    for i, without in enumerate(bare(truth, tables)):
        name = truth["recordings"][i]["name"]
        beyond = tables[name]["stress_MPa"].to_numpy(float) - without
        mean = pd.Series(beyond).rolling(WINDOW, center=True, min_periods=3).mean()
        sigma = np.broadcast_to(truth["noise"]["sigma_MPa"], len(tables))[i]
        mask = np.nan_to_num(np.abs(mean.to_numpy())) > SIGMAS * float(sigma)
        out.append([[int(a), int(b)] for a, b in runs(mask)])
    return out


def f1(
    truth: Mapping[str, Any], diagnosis: Mapping[str, Any], case: Path
) -> float | None:
    """F1 of a diagnosis's regions over the samples of a case.

    None where the truth does not tell, and where nothing is concealed.
    """
    if truth.get("cls") == "null":
        return None
    names = [r["name"] for r in truth.get("recordings", [])]
    files = {n: case / "recordings" / f"{n}.csv" for n in names}
    if not files or not all(f.exists() for f in files.values()):
        return None
    tables = {n: pd.read_csv(f) for n, f in files.items()}
    spans = acts(truth, tables)
    if not spans:
        return None
    times = {n: t["time_s"].to_numpy(float) for n, t in tables.items()}
    answer = {"recordings": truth["recordings"], "acts": spans}
    return region_f1(answer, diagnosis, times)
