"""Where a simulation and the recordings differ, in the words of the field.

There are two kinds of regions. If effects are named, a region is where they change the
stress by more than two noise sigmas. If not, a scan takes means of the whitened
residual over windows of several lengths. Its threshold is the largest mean in noise
alone: noise is drawn, the base is refitted to each draw, and all windows are compared.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.axes import Axes
from softnn.contracts import Array, Chunk
from softnn.fit import Engine, Fit, span
from softnn.state import BRANCHES, phases, runs

WINDOWS = (8, 16, 32, 64, 128, 256)
DRAWS = 60  # draws of noise, for the largest window mean
SIGMAS = 2.0  # noise sigmas; a larger change of stress counts as a region
RESTING = 0.05  # of the largest strain; below it a specimen is unloaded
BACK = 0.1  # of the largest strain; a smaller return is no unloading
LOADING = 0.85  # of the time under strain; a machine dwells before it turns


def only_loading(engine: Engine) -> bool:
    """Return whether the recordings contain first loading alone: no return, no hold.

    A wait before it at nearly zero strain, or a short dwell at its end, is no hold.
    """
    return all(_loading(chunk) > LOADING for chunk in engine.chunks)


def _loading(chunk: Chunk) -> float:
    """Return the share of the time under strain that is spent in first loading."""
    size = np.abs(chunk.strain)
    if len(size) < 2:
        return 1.0
    lasting = np.gradient(chunk.time_s) * (size >= RESTING * size.max())
    first = phases(chunk).branch == BRANCHES.index("first loading")
    return float(np.sum(lasting[first]) / max(np.sum(lasting), 1e-300))


def held_only(engine: Engine) -> bool:
    """Return whether strain is held, and never returns far from its largest value."""
    largest, back = 0.0, 0.0
    for chunk in engine.chunks:
        size = np.abs(chunk.strain)
        carried = largest if engine.data.continued else 0.0
        so_far = np.maximum(np.maximum.accumulate(size), carried)
        back = max(back, float((so_far - size).max()) / float(max(so_far.max(), 1e-12)))
        largest = float(so_far[-1])
    return back < BACK and not only_loading(engine)


def action(engine: Engine, found: Fit) -> Array:
    """Return the change of stress (valid,), MPa, by all effects of a fit."""
    bare = tuple(p for p in found.guess.pieces if p.nuisance)
    without, _ = engine.run(replace(found.guess, pieces=bare), False)
    return found.stress - without


def scan(
    engine: Engine, found: Fit, rng: np.random.Generator, level: float = 0.95
) -> NDArray[np.bool]:
    """Return the samples (valid,) in windows that noise does not explain."""
    q = span(found.free_columns)
    noise = rng.standard_normal((DRAWS, len(found.residual)))
    noise -= noise @ q @ q.T
    residual = found.residual - q @ (q.T @ found.residual)
    # Noise estimated slightly too low must not count as a mismatch.
    residual /= np.sqrt(max(np.median(residual**2) / 0.4549, 1.0))
    windows = _windows(engine.owner)
    largest = [np.abs(_means(e, windows)).max(initial=0) for e in noise]
    mask = np.zeros(len(residual), bool)
    beyond = np.abs(_means(residual, windows)) > np.quantile(largest, level)
    for first, last in windows[beyond]:
        mask[first:last] = True
    return mask


def _windows(owner: NDArray[np.integer]) -> NDArray[np.integer]:
    """Return half-overlapping windows (k, 2) of each length, within recordings."""
    rows = [np.zeros((0, 2), int)]
    for r in np.unique(owner):
        first, last = np.searchsorted(owner, [r, r + 1])
        for n in WINDOWS:
            start = np.arange(first, last - n + 1, n // 2)
            rows.append(np.stack([start, start + n], axis=1))
    return np.concatenate(rows)


def _means(x: Array, windows: NDArray[np.integer]) -> Array:
    """Return means over windows, of variance one if x is noise of variance one."""
    first, last = windows.T
    total = np.concatenate([[0.0], np.cumsum(x)])
    return (total[last] - total[first]) / np.sqrt(last - first)


def regions(
    engine: Engine, mask: NDArray[np.bool], moved: Array, axes: Axes
) -> list[dict[str, Any]]:
    """Return the regions of the mask (valid,), one for each branch of the history.

    They are dicts as in diagnosis.json. `moved` (valid,), MPa, is the change by the
    effects, or the error of the simulation; the share of a region is its share of the
    square of `moved`. Strains are in the unit of `axes`.
    """
    out: list[dict[str, Any]] = []
    total = float(np.sum(moved[mask] ** 2)) or 1.0
    position = np.flatnonzero(engine.valid)
    for r, chunk in enumerate(engine.chunks):
        own = engine.owner == r
        local, by = position[own] - engine.data.starts[r], moved[own]
        ph = phases(chunk)
        time, strain = engine.data.chunks[r].time_s, chunk.strain
        for a, b in runs(mask[own], ph.branch[local], ph.cycle[local]):
            i, j = local[a], local[b - 1]
            lapse = np.maximum(np.diff(time[i : j + 1]), 1e-12)
            rate = np.diff(strain[i : j + 1]) / lapse
            # Simulated stress farther from zero than measured: too stiff.
            side = float(np.sum(by[a:b] * np.sign(strain[local[a:b]] + 1e-300)))
            region = {
                "recording": engine.data.names[r],
                "start_s": float(time[i]),
                "end_s": float(time[j]),
                "branch": BRANCHES[int(ph.branch[i])],
                "cycle": int(ph.cycle[i]),
                axes.strain.column: _ends(strain[i : j + 1] * axes.strain.one),
                axes.rate_key: _ends(rate * axes.strain.one),
                "sign": "simulation too stiff" if side < 0 else "simulation too soft",
                "share": float(np.sum(by[a:b] ** 2) / total),
            }
            warm = chunk.temperature_C
            if warm is not None and np.isfinite(warm[i : j + 1]).any():
                region["temperature_C"] = _ends(warm[i : j + 1])
            out.append(region)
    return out


def _ends(x: Array) -> list[float]:
    return [float(np.nanmin(x)), float(np.nanmax(x))] if len(x) else [0.0, 0.0]
