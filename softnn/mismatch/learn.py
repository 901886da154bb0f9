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

from softnn.contracts import Array, Chunk
from softnn.fit import Engine, Fit
from softnn.mismatch.locate import phases

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

    def predict(self, chunk: Chunk) -> Array:
        """Stress to be added (n,), MPa."""
        return within(self.network, features(chunk, self.features))

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
    warm = [c.temperature_C is not None for c in engine.chunks]
    if all(warm) and engine.data.scales().temperature_C > 0.5:
        names = FEATURES + ("temperature_C",)
    x = np.concatenate([features(c, names) for c in engine.chunks])[engine.valid]
    y = engine.target - found.stress
    stride = max(len(y) // MOST, 1)
    index = np.arange(rng.integers(stride), len(y), stride)
    x_few, y_few, owner = x[index], y[index], engine.owner[index]
    if len(index) < 30 or np.std(y_few) == 0:
        return None
    groups = np.unique(owner)
    if len(groups) > 1:
        masks = [owner != g for g in groups] + [np.ones(len(index), bool)]
    else:
        block = np.arange(len(index)) * 5 // len(index)
        masks = [block != b for b in range(5)] + [np.ones(len(index), bool)]
    trained = train(
        x_few,
        y_few,
        neurons=[NEURONS] * len(masks),
        train_mask=np.array(masks),
        seeds=[int(s) for s in rng.integers(0, 2**31, len(masks))],
        regularisation=Regularisation.parse("bayesian"),
    )
    before = after = 0.0
    worse = dict.fromkeys(names, 0.0)
    for mask, one in zip(masks[:-1], trained[:-1], strict=True):
        test = ~mask
        before += float(np.sum(y_few[test] ** 2))
        after += float(np.sum((y_few[test] - within(one.network, x_few[test])) ** 2))
        for j, name in enumerate(names):
            mixed = x_few[test].copy()
            mixed[:, j] = rng.permutation(mixed[:, j])
            worse[name] += float(
                np.sum((y_few[test] - within(one.network, mixed)) ** 2)
            )
    ratio = float(np.sqrt(after / before))
    found_period = period(engine, found.residual, rng)
    if not ratio < 0.97 and found_period is None:
        return None
    rise = {n: max(v / after - 1, 0.0) for n, v in worse.items()}
    total = sum(rise.values()) or 1.0
    return Learned(
        trained[-1].network,
        names,
        {n: round(v / total, 4) for n, v in sorted(rise.items(), key=lambda i: -i[1])},
        ratio,
        found_period,
    )


def period(
    engine: Engine, residual: Array, rng: np.random.Generator, level: float = 0.99
) -> dict[str, Any] | None:
    """A period of a residual in time or in strain, if noise does not explain it."""
    best: dict[str, Any] | None = None
    for axis, unit in (("time", "s"), ("strain", "-")):
        lines, tops = [], []
        for r, chunk in enumerate(engine.chunks):
            own = engine.owner == r
            at = (chunk.time_s if axis == "time" else chunk.strain)[
                np.isfinite(engine.data.stress_MPa[r])
            ]
            span = float(np.ptp(at))
            if own.sum() < 40 or span <= 0:
                continue
            step = span / own.sum() if axis == "time" else span / 200
            frequency = np.linspace(4 / span, 0.45 / step, 400)
            z = residual[own]
            mixed = [rng.permutation(z) for _ in range(MIXED)]
            power = _power(at, np.stack([z, *mixed]), frequency)
            lines.append((frequency, power[0]))
            tops += list(power[1:].max(axis=1))
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
    """Normalised Lomb-Scargle power (rows, k) at frequencies (k,), of z (rows, n)."""
    z = z - z.mean(axis=1, keepdims=True)
    angle = 2 * np.pi * np.outer(at, frequency)
    c, s = np.cos(angle), np.sin(angle)
    power = (z @ c) ** 2 / (c**2).sum(axis=0) + (z @ s) ** 2 / (s**2).sum(axis=0)
    return power / (2 * np.maximum(z.var(axis=1, keepdims=True), 1e-300))
