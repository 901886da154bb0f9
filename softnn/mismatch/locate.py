"""Where a simulation and the recordings differ, in the words of the field.

Two ways to a region. Where the physics is known, a region is where the effects move the
stress by more than two noise sigmas. Where it is not, a scan: means of the whitened
residual over windows of several lengths, the largest of which in noise alone (drawn,
and the base refitted to each draw) sets the threshold for all of them together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Chunk
from softnn.fit import Engine, Fit, span

WINDOWS = (8, 16, 32, 64, 128, 256)
SIGMAS = 2.0  # beyond which an effect is said to act
RESTING = 0.05  # of the largest strain, below which a specimen is not strained yet
BACK = 0.1  # of the largest strain: less is no way back
LOADING = 0.85  # of the time under strain: a machine dwells a little before it turns


@dataclass(frozen=True)
class Phases:
    """What each sample (n,) of a recording belongs to."""

    branch: Array  # index into BRANCHES
    cycle: Array  # counts from 1


BRANCHES = ("hold", "first loading", "reloading", "unloading")


def phases(chunk: Chunk, band: float = 0.02) -> Phases:
    """Branch and cycle of each sample; `band` of the range back is a reversal."""
    strain, time = chunk.strain, chunk.time_s
    span = float(strain.max() - strain.min())
    n = len(strain)
    turn = turns(strain, band * span)
    direction = np.zeros(n)
    cycle = np.ones(n, int)
    count = 1
    for i, (a, b) in enumerate(pairwise(turn)):
        up = strain[b] > strain[a]
        direction[a:b] = 1 if up else -1
        if i > 0 and up:
            count += 1
        cycle[a:b] = count
    direction[turn[-1] :] = direction[turn[-1] - 1] if turn[-1] > 0 else 0
    cycle[turn[-1] :] = count
    # A hold: over a stretch the strain moves by far less than it does elsewhere.
    reach = max(n // 200, 2)
    step = np.abs(strain[np.minimum(np.arange(n) + reach, n - 1)] - strain)
    step = np.minimum(
        step, np.abs(strain - strain[np.maximum(np.arange(n) - reach, 0)])
    )
    length = np.maximum(time[np.minimum(np.arange(n) + reach, n - 1)] - time, 1e-12)
    rate = step / length
    took = np.diff(time)  # time stamps may repeat
    moving = np.abs(np.diff(strain))[took > 0] / took[took > 0]
    typical = np.median(moving[moving > 0]) if (moving > 0).any() else 0.0
    hold = rate < min(0.02 * typical, 1.0) if typical > 0 else np.ones(n, bool)
    hold |= (step < 1e-4 * span) & (rate < 0.1 * typical)
    # Outward from zero is loading, in tension and in compression.
    outward = direction * np.where(strain >= 0, 1, -1) > 0
    size = np.abs(strain)
    largest = np.maximum.accumulate(size)
    fresh = size >= largest - 1e-3 * span
    branch = np.where(outward, np.where(fresh, 1, 2), 3)
    return Phases(np.where(hold, 0, branch), cycle)


def turns(x: Array, band: float) -> Array:
    """Indices of turning points that matter, with the first and last sample."""
    out = [0]
    low = high = 0
    direction = 0
    for i in range(1, len(x)):
        if direction >= 0 and x[i] > x[high]:
            high = i
        if direction <= 0 and x[i] < x[low]:
            low = i
        if direction >= 0 and x[high] - x[i] > band:
            if high != out[-1]:
                out.append(high)
            direction, low = -1, i
        elif direction <= 0 and x[i] - x[low] > band:
            if low != out[-1]:
                out.append(low)
            direction, high = 1, i
    if out[-1] != len(x) - 1:
        out.append(len(x) - 1)
    return np.array(out)


def only_loading(engine: Engine) -> bool:
    """Whether no recording comes back or holds: nothing but first loading was seen.

    A wait before it, at next to no strain, is no hold, nor is a short dwell at its end.
    """
    return all(_loading(chunk) > LOADING for chunk in engine.chunks)


def _loading(chunk: Chunk) -> float:
    """Share of the time under strain that is spent in first loading."""
    size = np.abs(chunk.strain)
    if len(size) < 2:
        return 1.0
    lasting = np.gradient(chunk.time_s) * (size >= RESTING * size.max())
    first = phases(chunk).branch == BRANCHES.index("first loading")
    return float(np.sum(lasting[first]) / max(np.sum(lasting), 1e-300))


def held_only(engine: Engine) -> bool:
    """Whether strain is held, and never comes back by much from the largest before."""
    largest, back = 0.0, 0.0
    for chunk in engine.chunks:
        size = np.abs(chunk.strain)
        carried = largest if engine.data.continued else 0.0
        so_far = np.maximum(np.maximum.accumulate(size), carried)
        back = max(back, float((so_far - size).max()) / float(max(so_far.max(), 1e-12)))
        largest = float(so_far[-1])
    return back < BACK and not only_loading(engine)


def action(engine: Engine, found: Fit) -> Array:
    """Change of stress (valid,), MPa, that the effects of a fit make."""
    bare = tuple(p for p in found.guess.pieces if p.nuisance)
    without, _ = engine.run(replace(found.guess, pieces=bare), False)
    return found.stress - without


def scan(
    engine: Engine, found: Fit, rng: np.random.Generator, level: float = 0.95
) -> tuple[NDArray[np.bool], float, float]:
    """Samples (valid,) in windows that noise does not explain; statistic; threshold."""
    q = span(found.free_columns)
    residual = found.residual - q @ (q.T @ found.residual)
    sets = _windows(engine.owner)
    if not sets:  # too few samples for any
        return np.zeros(len(found.residual), bool), 0.0, 0.0
    # Noise estimated a little too low must not read as a mismatch.
    scale = np.sqrt(max(np.median(residual**2) / 0.4549, 1.0))
    largest = []
    for _ in range(60):
        e = rng.standard_normal(len(found.residual))
        e -= q @ (q.T @ e)
        largest.append(
            max(float(np.max(np.abs(_means(e, s)), initial=0)) for s in sets)
        )
    threshold = float(np.quantile(largest, level))
    mask = np.zeros(len(found.residual), bool)
    top = 0.0
    for s in sets:
        z = _means(residual / scale, s)
        top = max(top, float(np.max(np.abs(z), initial=0)))
        for (a, b), value in zip(s, z, strict=True):
            if abs(value) > threshold:
                mask[a:b] = True
    return mask, top, threshold


def _windows(owner: NDArray[np.integer]) -> list[Array]:
    """Half-overlapping windows (count, 2) of each length, within recordings."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(owner)) + 1, [len(owner)]])
    out = []
    for length in WINDOWS:
        rows = [
            (a, a + length)
            for start, end in pairwise(edges)
            for a in range(start, end - length + 1, max(length // 2, 1))
        ]
        if rows:
            out.append(np.array(rows))
    return out


def _means(x: Array, windows: Array) -> Array:
    total = np.concatenate([[0.0], np.cumsum(x)])
    length = windows[:, 1] - windows[:, 0]
    return (total[windows[:, 1]] - total[windows[:, 0]]) / np.sqrt(length)


def regions(
    engine: Engine, mask: NDArray[np.bool], excess: Array, residual_MPa: Array
) -> list[dict[str, Any]]:
    """Regions of the mask (valid,), one a branch, as diagnosis.json tells them.

    excess (valid,) is what a region's share is counted in (squared residual or squared
    action); residual_MPa is measured minus simulated.
    """
    out: list[dict[str, Any]] = []
    total = float(excess[mask].sum()) or 1.0
    position = np.flatnonzero(engine.valid)
    for r, chunk in enumerate(engine.chunks):
        own = engine.owner == r
        if not (mask & own).any():
            continue
        time, strain = engine.data.chunks[r].time_s, chunk.strain
        ph = phases(chunk)
        local = position[own] - engine.data.starts[r]
        inside, heavy, miss = mask[own], excess[own], residual_MPa[own]
        for a, b in runs(inside, ph.branch[local], ph.cycle[local]):
            i, j = local[a], local[b - 1]
            rate = np.diff(strain[i : j + 1]) / np.maximum(
                np.diff(time[i : j + 1]), 1e-12
            )
            near = strain[i : j + 1]
            # Measured below the simulation, counted away from zero stress: too stiff.
            side = float(np.sum(miss[a:b] * np.sign(near[local[a:b] - i] + 1e-300)))
            region = {
                "recording": engine.data.names[r],
                "start_s": float(time[i]),
                "end_s": float(time[j]),
                "branch": BRANCHES[int(ph.branch[local[a]])],
                "cycle": int(ph.cycle[local[a]]),
                "strain": [float(near.min()), float(near.max())],
                "rate_per_s": [float(rate.min()), float(rate.max())]
                if len(rate)
                else [0.0, 0.0],
                "sign": "simulation too stiff" if side < 0 else "simulation too soft",
                "share": float(heavy[a:b].sum() / total),
            }
            warm = chunk.temperature_C
            if warm is not None and np.isfinite(warm[i : j + 1]).any():
                region["temperature_C"] = [
                    float(np.nanmin(warm[i : j + 1])),
                    float(np.nanmax(warm[i : j + 1])),
                ]
            out.append(region)
    return out


def runs(mask: Array, *labels: Array) -> Sequence[tuple[int, int]]:
    """Runs [a, b) of True in which all labels stay the same."""
    if not mask.any():
        return []
    change = np.diff(mask.astype(int)) != 0
    for label in labels:
        change |= (np.diff(label) != 0) & mask[1:] & mask[:-1]
    edges = np.concatenate([[0], np.flatnonzero(change) + 1, [len(mask)]])
    return [(int(a), int(b)) for a, b in pairwise(edges) if mask[a]]
