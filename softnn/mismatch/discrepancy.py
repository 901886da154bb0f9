"""Smooth functions of the state, for form errors of laws and for discrepancies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Engine, Fit
from softnn.models.unit_kernel import maxwell
from softnn.state import features

OWN = 5  # smooth functions of the time of one recording
LENGTH = 1.0  # of the functions of the state, in standard deviations
GAP, MOST_GAPS = 6.0, 3  # length in typical intervals; the longest few of a recording
FADING = 4  # rates at which the memory of unknown strain fades


def states(engine: Engine) -> Array:
    """Return the state of each sample (valid, features), standardised (mean 0, sd 1).

    The features are strain and its history, rate and times as in `softnn.state`,
    temperature, and the index of the recording.
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
    """Return random smooth functions (n, count) of states; their sum has variance one.

    Each function depends on one or two features. Errors of laws depend on few features
    at a time, and a few functions of all features would not cover the space (Duvenaud,
    Nickisch and Rasmussen 2011, additive Gaussian processes).
    """
    wave = rng.standard_normal((x.shape[1], count)) / LENGTH
    of = np.zeros(wave.shape, bool)
    for j in range(count):
        of[rng.permutation(x.shape[1])[: 1 + j % 2], j] = True
    phase = rng.uniform(0, 2 * np.pi, count)
    return np.cos(x @ (wave * of) + phase) * np.sqrt(2 / count)


def by_recording(engine: Engine) -> Array:
    """Return smooth functions (valid, k) of the time of each recording, else zero.

    None is constant: a constant is an offset, and that is an effect with a name.
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
    """Return the memory of strain that nobody recorded, as columns (valid, k).

    The strain during a gap of time is unknown, and so is the strain before a recording
    that goes on from another. Its stress fades at the rates of the branches of the
    base.
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
        # The memory continues through the recordings that follow.
        own = engine.owner >= r if engine.data.continued else engine.owner == r
        for begin in begins:
            since = (clock - begin)[:, None]
            fading = np.exp(-np.maximum(since, 0.0) / paces)
            out.append(fading * ((since >= 0) & own[:, None]))
    return np.concatenate(out, axis=1)


def trailing(x: Array, time: Array, owner: NDArray[np.integer], lag_s: float) -> Array:
    """Return x (valid,) low-passed within each recording, at its typical interval."""
    out = np.empty_like(x)
    for r in np.unique(owner):
        own = owner == r
        step = float(np.median(np.diff(time[own]))) if own.sum() > 1 else lag_s
        keep = float(np.exp(-max(step, 1e-12) / max(lag_s, 1e-12)))
        decay, one = np.full((own.sum(), 1), keep), np.empty((own.sum(), 1))
        maxwell(decay, 1 - decay, x[own], x[own][:1], one)
        out[own] = one[:, 0]
    return out
