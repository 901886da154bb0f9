r"""A learned correction for a cause outside softnn's list, and what it depends on.

The project's own Bayesian-regularised network learns the residual of the best
simulation over state features: strain, largest strain so far, rate, time since the last
reversal, travel so far, temperature, time. It uses no more freedom than the data give
evidence for. A fold holds all recordings of one rate and amplitude, or a
stretch of a single recording, so a correction counts only where it predicts what it did
not see. Shuffling one feature at a time shows which features matter. A
period, in time or in strain, is the peak of a Lomb-Scargle periodogram (Scargle 1982,
doi:10.1086/160554), tested against the largest peak of shuffled whitened residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array
from softnn.fit import Engine, Fit
from softnn.mismatch.verify import parts
from softnn.model_file import Correction
from softnn.state import FEATURES, features

NEURONS = 6
HELPS = 0.97  # of the held-out error; a correction must do better than this
MOST = 1500  # training samples of the network; the residual is smooth
ALIKE = 0.15  # of a logarithm, in amplitude and rate, within which kinds are the same
MIXED = 8  # shuffles of the residual, for the largest peak that noise shows


@dataclass(frozen=True)
class Learned:
    """A correction of the stress, and what it depends on."""

    correction: Correction | None  # None if no correction predicts better
    importance: dict[str, float]  # relative rise of the held-out error by shuffling
    ratio: float  # held-out error with the correction over without
    period: dict[str, Any] | None


def learn(engine: Engine, found: Fit, rng: np.random.Generator) -> Learned | None:
    """Return what the residual of a fit teaches; None if nothing can be learned."""
    from softnn.neural import Regularisation, train

    names: tuple[str, ...] = FEATURES
    warm = all(c.temperature_C is not None for c in engine.chunks)
    if warm and engine.data.scales().temperature_C > 0.5:
        names = (*FEATURES, "temperature_C")
    x = np.concatenate([features(c, names) for c in engine.chunks])[engine.valid]
    stride = max(len(x) // MOST, 1)
    index = np.arange(rng.integers(stride), len(x), stride)
    x, y = x[index], (engine.target - found.stress)[index]
    if len(index) < 30 or np.std(y) == 0:
        return None
    part = kinds(engine)[index]
    folds = [part == g for g in np.unique(part)]
    *trained, whole = train(
        x,
        y,
        neurons=[NEURONS] * (len(folds) + 1),
        train_mask=np.array([*(~f for f in folds), np.ones(len(index), bool)]),
        seeds=[int(s) for s in rng.integers(0, 2**31, len(folds) + 1)],
        regularisation=Regularisation.parse("bayesian"),
    )
    after, worse = 0.0, np.zeros(len(names))
    for test, one in zip(folds, trained, strict=True):
        foretold = Correction(names, one.network).at
        after += float(np.sum((y[test] - foretold(x[test])) ** 2))
        for j in range(len(names)):
            mixed = x[test].copy()
            mixed[:, j] = rng.permutation(mixed[:, j])
            worse[j] += np.sum((y[test] - foretold(mixed)) ** 2)
    ratio = float(np.sqrt(after / np.sum(y**2)))
    found_period = period(engine, found.residual, rng)
    if not ratio < HELPS and found_period is None:
        return None
    rise = np.maximum(worse / after - 1, 0.0)
    share = rise / (rise.sum() or 1.0)
    order = np.argsort(-share, kind="stable")
    importance = {names[j]: round(float(share[j]), 4) for j in order}
    # Stretches of one recording do not predict the next recording.
    holds = ratio < HELPS and len(engine.chunks) > 1
    correction = Correction(names, whole.network) if holds else None
    return Learned(correction, importance, ratio, found_period)


def kinds(engine: Engine) -> NDArray[np.integer]:
    """Return the kind (valid,) of recording of each sample: equal amplitude and rate.

    A network predicts a replicate of a training recording, but perhaps not a rate
    between two others. If all recordings are of one kind, each is its own kind.
    """
    reach = np.array([float(np.abs(c.strain).max()) for c in engine.chunks])
    time = np.array([float(np.ptp(c.time_s)) for c in engine.chunks])
    travel = np.array([float(np.abs(np.diff(c.strain)).sum()) for c in engine.chunks])
    told = np.log(np.maximum([reach, travel / np.maximum(time, 1e-300)], 1e-300))
    alike = (np.abs(told[:, :, None] - told[:, None, :]) < ALIKE).all(axis=0)
    first = alike.argmax(axis=1)  # the first recording of the same kind
    return first[engine.owner] if len(set(first)) > 1 else parts(engine)


def period(
    engine: Engine, residual: Array, rng: np.random.Generator, level: float = 0.99
) -> dict[str, Any] | None:
    """Return a period of a residual in time or strain, if noise does not explain it."""
    best: dict[str, Any] | None = None
    for axis, unit in (("time", "s"), ("strain", "-")):
        lines, tops = [], []
        for r, chunk in enumerate(engine.chunks):
            z = residual[engine.owner == r]
            at = chunk.time_s if axis == "time" else chunk.strain
            at = at[np.isfinite(engine.data.stress_MPa[r])]
            span = float(np.ptp(at))
            if len(z) < 40 or span <= 0:
                continue
            step = span / len(z) if axis == "time" else span / 200
            frequency = np.linspace(4 / span, 0.45 / step, 400)
            lines.append((frequency, _power(at, z, frequency)))
            mixed = (rng.permutation(z) for _ in range(MIXED))
            tops += [_power(at, one, frequency).max() for one in mixed]
        if not lines:
            continue
        limit = float(np.quantile(tops, level)) * 1.5
        for frequency, power in lines:
            j = int(np.argmax(power))
            if power[j] > limit and (best is None or power[j] > best["power"]):
                best = {
                    "axis": axis,
                    "period": float(1 / frequency[j]),
                    "unit": unit,
                    "power": float(power[j]),
                    "threshold": limit,
                }
    return best


def _power(at: Array, z: Array, frequency: Array) -> Array:
    """Return Lomb-Scargle power (k,) of z (n,) at frequencies (k,), over variance."""
    from scipy.signal import lombscargle  # half a second, and seldom needed

    found = lombscargle(at, z - z.mean(), 2 * np.pi * frequency)
    return np.asarray(found / max(np.var(z), 1e-300))
