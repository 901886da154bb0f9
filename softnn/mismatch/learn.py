r"""What is on no list: a learned correction, and what it depends on.

The residual of the best simulation is learned over state features (strain, largest
strain so far, rate, time since the last reversal, travel so far, temperature, time) by
the project's own Bayesian-regularised network, which takes no more freedom than the
data give evidence for. Folds are whole recordings, so that what it claims it has
predicted. Which features carry it is asked by shuffling one at a time. A period, in
time or in strain, is the peak of a Lomb-Scargle periodogram (Scargle 1982,
doi:10.1086/160554), tested against the largest peak of shuffled whitened residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lombscargle

from softnn.contracts import Array, Chunk
from softnn.fit import Engine, Fit
from softnn.mismatch.locate import phases
from softnn.mismatch.verify import parts

FEATURES = (
    "strain",
    "largest_strain",
    "log_rate",
    "direction",
    "log_time_since_reversal",
    "travel",
    "log_time",
)
NEURONS = 6
MOST = 1500  # samples the network is trained on; the residual is smooth
MIXED = 8  # times the residual is shuffled, for what noise may show at one period


@dataclass(frozen=True)
class Learned:
    """A correction of the stress, MPa, over features; JSON-ready by `to_dict`."""

    network: Any
    features: tuple[str, ...]
    importance: dict[str, float]  # rise of the held-out error when shuffled, relative
    ratio: float  # held-out error with the correction over without
    period: dict[str, Any] | None

    def to_dict(self) -> dict[str, Any]:
        return {"features": list(self.features), "network": self.network.to_dict()}


def within(network: Any, x: Array) -> Array:
    """What a network says (n,) of features (n, d), within the ranges it has seen.

    A slower or longer recording than any it knows would have it extrapolate.
    """
    known = np.clip(x, network.inputs.low, network.inputs.high)
    return np.clip(network.predict(known), network.target.low, network.target.high)


def features(
    chunk: Chunk, names: tuple[str, ...] = FEATURES, *, warm: bool = False
) -> Array:
    """State features (n, features) of a recording."""
    if warm:
        names = (*names, "temperature_C")
    time, strain = chunk.time_s - chunk.time_s[0], chunk.strain
    step = np.maximum(np.diff(time, prepend=time[0]), 1e-9)
    step[0] = step[1] if len(step) > 1 else 1.0
    rate = np.diff(strain, prepend=strain[0]) / step
    if len(rate) > 1:
        rate[0] = rate[1]
    branch = phases(chunk).branch
    change = np.concatenate([[True], np.diff(branch) != 0])
    since = time - np.maximum.accumulate(np.where(change, time, 0.0))
    typical = np.median(np.abs(rate[rate != 0])) if (rate != 0).any() else 1.0
    table = {
        "strain": strain,
        "largest_strain": np.maximum.accumulate(np.abs(strain)),
        "log_rate": np.log10(np.abs(rate) + 1e-3 * typical),
        "direction": np.sign(np.where(np.abs(rate) > 1e-3 * typical, rate, 0.0)),
        "log_time_since_reversal": np.log10(since + 0.01 * (time[-1] + 1e-9) + 1e-9),
        "travel": np.cumsum(np.abs(np.diff(strain, prepend=strain[0]))),
        "log_time": np.log10(time + 0.01 * (time[-1] + 1e-9) + 1e-9),
    }
    if chunk.temperature_C is not None:
        degrees = chunk.temperature_C
        known = np.isfinite(degrees)
        table["temperature_C"] = (
            np.interp(time, time[known], degrees[known]) if known.any() else 0 * time
        )
    return np.stack([table[n] for n in names], axis=1)


def learn(engine: Engine, found: Fit, rng: np.random.Generator) -> Learned | None:
    """The correction, or None where it predicts nothing on recordings left out."""
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
    part = parts(engine)[index]
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
        after += _squares(one.network, x[test], y[test])
        for j in range(len(names)):
            mixed = x[test].copy()
            mixed[:, j] = rng.permutation(mixed[:, j])
            worse[j] += _squares(one.network, mixed, y[test])
    ratio = float(np.sqrt(after / np.sum(y**2)))
    found_period = period(engine, found.residual, rng)
    if not ratio < 0.97 and found_period is None:
        return None
    rise = np.maximum(worse / after - 1, 0.0)
    share = rise / (rise.sum() or 1.0)
    return Learned(
        whole.network,
        names,
        {
            names[j]: round(float(share[j]), 4)
            for j in np.argsort(-share, kind="stable")
        },
        ratio,
        found_period,
    )


def _squares(network: Any, x: Array, y: Array) -> float:
    return float(np.sum((y - within(network, x)) ** 2))


def period(
    engine: Engine, residual: Array, rng: np.random.Generator, level: float = 0.99
) -> dict[str, Any] | None:
    """A period of a residual in time or in strain, if noise does not explain it."""
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
    """Lomb-Scargle power (k,) at frequencies (k,) of z (n,), over its variance."""
    found = lombscargle(at, z - z.mean(), 2 * np.pi * frequency)
    return np.asarray(found / max(np.var(z), 1e-300))
