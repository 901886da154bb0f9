"""Smooth functions of the state that laws are bent by, and that stand for all else."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Engine, Fit
from softnn.models.unit_kernel import maxwell
from softnn.state import features

OWN = 5  # functions of the time of a recording
LENGTH = 1.0  # of the functions of the state, in standard deviations of it
GAP, MOST_GAPS = 6.0, 3  # typical intervals; of a recording, the longest
FADING = 4  # paces at which what was not written down is forgotten


def states(engine: Engine) -> Array:
    """State of each sample (valid, features), each of mean 0 and deviation 1.

    Strain and its history, rate and times as `softnn.state` has them; temperature; and
    the place of the recording among all.
    """
    count = len(engine.chunks)
    warm = all(c.temperature_C is not None for c in engine.chunks)
    rows = []
    for r, chunk in enumerate(engine.chunks):
        own = features(chunk, warm=warm)
        rows.append(np.column_stack([own, np.full(len(own), r / count)]))
    x = np.concatenate(rows)[engine.valid]
    spread = x.std(axis=0)
    live = spread > 1e-9 * (np.abs(x).max(axis=0) + 1e-300)
    return (x[:, live] - x[:, live].mean(axis=0)) / spread[live]


def fourier(x: Array, count: int, rng: np.random.Generator) -> Array:
    """Random smooth functions (n, count) of states; sums of them have variance one.

    Each is of one feature of the state, or of two: laws bend by few things at a time,
    and functions of all at once are too many to be met by a few (Duvenaud, Nickisch and
    Rasmussen 2011, additive Gaussian processes).
    """
    wave = rng.standard_normal((x.shape[1], count)) / LENGTH
    of = np.zeros(wave.shape, bool)
    for j in range(count):
        of[rng.permutation(x.shape[1])[: 1 + j % 2], j] = True
    phase = rng.uniform(0, 2 * np.pi, count)
    return np.cos(x @ (wave * of) + phase) * np.sqrt(2 / count)


def by_recording(engine: Engine) -> Array:
    """Smooth functions (valid, k) of the time of each recording, the others zero.

    None is constant: that is an offset, which has a name.
    """
    out = np.zeros((len(engine.target), OWN * len(engine.chunks)))
    for r, chunk in enumerate(engine.chunks):
        known = np.isfinite(engine.data.stress_MPa[r])
        time = chunk.time_s[known] - chunk.time_s[0]
        share = time / max(float(np.ptp(chunk.time_s)), 1e-300)
        half = 1 + np.arange(OWN)  # periods
        waves = np.cos(np.pi * np.outer(share, half))
        rows = engine.owner == r
        out[rows, OWN * r : OWN * (r + 1)] = waves / (1 + half)
    return out


def unwritten(engine: Engine, base: Fit) -> Array:
    """What nobody wrote down (valid, k): any memory of branches after a gap or a pause.

    What strain a specimen saw in a gap of time, or before a recording that goes on from
    another, is not known; what it left fades at the paces of the branches of the base.
    """
    units = base.guess.units
    live = base.guess.stiffness[units.segments :] > 0
    paces = np.array(units.relaxation_times)[live]
    if len(paces) > FADING:
        paces = paces[np.linspace(0, len(paces) - 1, FADING).round().astype(int)]
    clock = np.concatenate([c.time_s for c in engine.chunks])[engine.valid]
    out = [np.zeros((len(clock), 0))]
    for r, chunk in enumerate(engine.chunks):
        time = chunk.time_s
        step = np.diff(time)
        gaps = np.flatnonzero(step > GAP * np.median(step)) + 1
        begins = list(time[gaps[np.argsort(-step[gaps - 1])][:MOST_GAPS]])
        begins += [time[0]] if engine.data.continued and r else []
        # What is carried on is carried through the recordings that follow, too.
        own = engine.owner >= r if engine.data.continued else engine.owner == r
        for begin in begins:
            since = (clock - begin)[:, None]
            fading = np.exp(-np.maximum(since, 0.0) / paces)
            out.append(fading * ((since >= 0) & own[:, None]))
    return np.concatenate(out, axis=1)


def trailing(x: Array, time: Array, owner: NDArray[np.integer], lag_s: float) -> Array:
    """x (valid,) low-passed within each recording, at its typical interval."""
    out = np.empty_like(x)
    for r in np.unique(owner):
        own = owner == r
        step = float(np.median(np.diff(time[own]))) if own.sum() > 1 else lag_s
        keep = float(np.exp(-max(step, 1e-12) / max(lag_s, 1e-12)))
        decay, one = np.full((own.sum(), 1), keep), np.empty((own.sum(), 1))
        maxwell(decay, 1 - decay, x[own], x[own][:1], one)
        out[own] = one[:, 0]
    return out
