"""A network of histories, trained on recordings and on a physical model of them.

The behaviour of a network in a controller depends on its training. Recordings are few,
slow, and of specimens that differ in stiffness; a corrected model knows the material
beyond them. `taught` trains `FFH7` on both: on recordings scaled to one specimen, and
on histories that the model simulates, faster, slower, farther and slack.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from softnn.contracts import Array, Chunk, InputError
from softnn.model_file import Stored
from softnn.neural import Seen, StoredNetwork, Trained, fit_samples, samples
from softnn.recording import Recording

INPUTS = "FFH7"
WIDER = 3.0  # times faster, and slower, than recorded: histories that are simulated
FURTHER = 1.2  # times farther than recorded: a controller pushes on where stress ends
RAMPS, RAMP = 12, 8  # of a simulated history, and samples of a ramp
LEAST = 0.02  # of the strain range: the smallest simulated history
UNLIKE = 2.0  # times stiffer or softer; no specimen is, so the model does not fit it


@dataclass(frozen=True)
class Span:
    """Ranges (low, high) of strains and of strain rates [1/s] for the simulation."""

    strains: tuple[float, float]
    rates: tuple[float, float]

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> Span:
        """Return the strains of recordings, and rates three times slower to faster."""
        strain = np.concatenate([r.strain for r in recordings])
        rate = np.concatenate([_moving(r) for r in recordings])
        if not len(rate):
            raise InputError("strain stands still in all recordings; nothing to learn")
        low, high = np.quantile(rate, [0.1, 0.9])
        ends = float(np.nanmin(strain)), float(np.nanmax(strain))
        return cls(ends, (float(low) / WIDER, float(high) * WIDER))

    @property
    def pulls(self) -> bool:
        """Whether the specimen is pulled; else it is pushed."""
        return sum(self.strains) > 0


def taught(
    recordings: Sequence[Recording],
    model: Stored,
    *,
    lag_s: float | None = None,
    neurons: int = 12,
    simulated: int = 120,
    starts: int = 3,
    seed: int = 0,
) -> StoredNetwork:
    """Return a network trained on cycles, changing rates and slack; see the module.

    recordings: cyclic ones, strain at every sample. Those with the same `specimen`
    share a specimen; those without have one each. model: `from_dict` of a diagnosis's
    model.json. lag_s: time of the shortest of five branches [s], by default a
    thousandth of the longest recording. Raises `InputError`.

    >>> from softnn.models.units import Units
    >>> time = np.linspace(0, 10, 101)
    >>> strain = 0.2 * (1 - np.abs(1 - time / 5))
    >>> pulls = [Recording(time, strain, c * strain, name=f"{c}") for c in (1.9, 2.1)]
    >>> spring = Stored(
    ...     Units("hooke", (0.0, 1.0)), np.array([2.0]), (), (), False, "virgin"
    ... )
    >>> network = taught(pulls, spring, neurons=3, simulated=5, starts=1)
    >>> (stress,) = network.stress([""], [Chunk(time, strain)], [None])
    >>> bool(np.abs(stress - 2 * strain).max() < 0.01)
    True
    """
    if not recordings:
        raise InputError("no recordings; at least one is needed")
    same, factor = alike(recordings, model)
    every = [*same, *histories(model, Span.of(recordings), simulated, seed, factor)]
    lag = lag_of(recordings) if lag_s is None else lag_s
    return network_of(every, lag, neurons, starts, seed)[0]


def network_of(
    every: Sequence[Recording], lag_s: float, neurons: int, starts: int, seed: int
) -> tuple[StoredNetwork, Trained]:
    """Return `FFH7` trained on all samples of recordings, and how its training went."""
    known = samples(every, INPUTS, lag_s)
    (one,) = fit_samples(
        known,
        INPUTS,
        neurons=[neurons],
        train_mask=np.ones((1, len(known.target)), bool),
        seeds=[seed],
        starts=starts,
        threads=1,
    )
    return StoredNetwork(one.network, INPUTS, lag_s, Seen.of(every, lag_s)), one


def lag_of(recordings: Sequence[Recording]) -> float:
    """Return the time of the shortest branch [s]; the longest exceeds recordings."""
    longest = max(float(np.ptp(r.time_s)) for r in recordings)
    return float(f"{longest / 1000:.1g}")


def alike(
    recordings: Sequence[Recording], model: Stored
) -> tuple[list[Recording], float]:
    """Return the recordings scaled to the mean specimen, and its factor to the model's.

    A network of histories would recognise specimens by their strains and learn their
    stiffnesses, which harms predictions of other specimens. So the stress of each
    specimen is divided by its factor to the model (least squares) and multiplied by the
    geometric mean of all factors.
    """
    made = simulated_by(model, recordings)
    sums: dict[str, Array] = {}
    owners = [r.specimen or r.name for r in recordings]
    for owner, r, stress in zip(owners, recordings, made, strict=True):
        good = np.isfinite(r.stress_MPa) & np.isfinite(stress)
        s, y = stress[good], r.stress_MPa[good]
        sums[owner] = sums.get(owner, np.zeros(2)) + (s @ y, s @ s)
    factor = {
        owner: float(np.clip(sy / max(ss, 1e-300), 1 / UNLIKE, UNLIKE))
        for owner, (sy, ss) in sums.items()
    }
    middle = float(np.exp(np.mean(np.log(list(factor.values())))))
    same = [
        replace(r, stress_MPa=r.stress_MPa * (middle / factor[owner]))
        for owner, r in zip(owners, recordings, strict=True)
    ]
    return same, middle


def simulated_by(model: Stored, recordings: Sequence[Recording]) -> list[Array]:
    """Return the stress (n,) of each recording by a model, for an unknown specimen."""
    names = [f"new {i}" for i in range(len(recordings))]
    chunks = []
    for r in recordings:
        if not np.isfinite(r.strain).all():
            raise InputError(f"{r.name!r} has no strain at some samples; fill them in")
        warm = r.temperature_C
        known = warm is not None and not np.isnan(warm).all()
        chunks.append(Chunk(r.time_s, r.strain, warm if known else None))
    return model.stress(names, chunks, [None] * len(recordings))


def histories(
    model: Stored, span: Span, count: int, seed: int, factor: float = 1.0
) -> list[Recording]:
    """Return recordings of a model, stress times `factor`, along histories of strain.

    There are as many small histories as large ones, up to a fifth beyond the strains of
    `span`: a network held within its training range gives no more torque for more
    strain, so a controller that wants more would pull without end. Some histories go
    below rest to the slack side, where a strip bears nothing.
    """
    rng = np.random.default_rng([seed, 28])
    low, high = span.strains
    beyond = 0.05 * (high - low)
    ends = (
        (min(low, -beyond), FURTHER * high)
        if span.pulls
        else (FURTHER * low, max(high, beyond))
    )
    out = []
    for i in range(count):
        size = float(np.exp(rng.uniform(np.log(LEAST), 0.0)))
        corners, strains = turns(
            rng, (ends[0] * size, ends[1] * size), span.rates, RAMPS
        )
        time = np.concatenate(
            [np.linspace(a, b, RAMP, endpoint=False) for a, b in pairwise(corners)]
            + [corners[-1:]]
        )
        strain = np.interp(time, corners, strains)
        (stress,) = model.stress([f"new {i}"], [Chunk(time, strain)], [None])
        stress = factor * stress
        if span.pulls:
            stress = np.where(strain < 0, 0.0, np.maximum(stress, 0.0))
        else:
            stress = np.where(strain > 0, 0.0, np.minimum(stress, 0.0))
        out.append(
            Recording(time, strain, stress, name=f"simulated {i}", test="cyclic")
        )
    return out


def turns(
    rng: np.random.Generator,
    strains: tuple[float, float],
    rates: tuple[float, float],
    count: int,
) -> tuple[Array, Array]:
    """Return times and strains (n,) of corners: ramps and holds, from rest at zero.

    One in ten is a hold, and one in three leads back to zero. Rates are uniform in
    their logarithm.
    """
    time, strain = [0.0], [0.0]
    for _ in range(count):
        kind, level = rng.random(), float(rng.uniform(*strains))
        rate = float(np.exp(rng.uniform(*np.log(rates))))
        if kind < 0.1:
            level, lasts = strain[-1], 0.2 * (strains[1] - strains[0]) / rate
        else:
            level = 0.0 if kind < 0.4 else level
            lasts = abs(level - strain[-1]) / rate
        if lasts > 0:
            time.append(time[-1] + lasts)
            strain.append(level)
    return np.array(time), np.array(strain)


def _moving(recording: Recording) -> Array:
    """Return the sizes of the strain rate [1/s] where the strain moves."""
    good = np.isfinite(recording.strain)
    step = np.diff(recording.time_s[good])
    rate = np.abs(np.diff(recording.strain[good])[step > 0] / step[step > 0])
    return rate[rate > 0.2 * np.quantile(rate, 0.9)] if len(rate) else rate
