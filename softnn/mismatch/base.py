"""The simulation to be judged: a base fitted to the recordings, or a stored simulation.

A base of springs and branches is refitted to all the data it may use, so the mismatch
is the part that it cannot absorb. A simulation from elsewhere (a column
`simulated_MPa`, a network) stays as it is. Springs and branches fitted to it stand in
for its inner workings: some effects need to know the stress at another strain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from softnn.contracts import Array, InputError
from softnn.effects import EFFECTS
from softnn.fit import Data, Engine, Fit, Guess, Piece, fit
from softnn.mismatch.case import Case, mask_failure, mask_gaps, sparse, thin, to_data
from softnn.mismatch.specimens import besides_middle
from softnn.models.base import Base
from softnn.models.bases import build
from softnn.noise import Noise, estimate, white
from softnn.noise.windows import WINDOW

COARSE = 300  # samples of a recording on which sets of effects grow, by prediction
SEARCH = 1000  # samples of a recording used in the search
REPORT = 6000  # samples of a recording used for regions, figures and errors
DEFAULT = STAND_IN = "pl-wiechert"
CLASS = 0.02  # of the stress: largest error of a machine of class 2, ISO 7500-1
SHOWN = 1.5  # times the white noise of the samples, which memory may hide in part
STILL = 1e-9  # of the largest stress; a channel that varies less is not live


@dataclass
class Baseline:
    """The best fit of the base, the engine that simulates it, and the noise.

    `engine.fine` has more samples of the same recordings. `said`: whether they have
    labels of specimens.
    """

    engine: Engine
    fit: Fit
    noise: list[Noise]
    name: str  # the base, or "simulated"
    fixed: bool
    said: bool = False
    fewer: Engine | None = None
    notes: tuple[str, ...] = ()  # on the choice of the base, and on its stability

    @property
    def coarse(self) -> Engine:
        """An engine with few samples of each recording."""
        return self.fewer or self.engine

    @property
    def has(self) -> frozenset[str]:
        """Ids of effects that the base has; of a stored simulation nobody knows."""
        return frozenset() if self.fixed else self.fit.guess.units.has


def usable(case: Case, samples: int) -> Case:
    """Return the usable part of a case, at most about `samples` a recording."""
    return thin(mask_failure(mask_gaps(case)), samples)


def start(case: Case, model: str | Base | None = None) -> Baseline:
    """Return the best fit of the base of a case, from which a search starts."""
    good, fine = mask_failure(mask_gaps(case)), to_data(usable(case, REPORT))
    data, few = (to_data(sparse(good, n)) for n in (SEARCH, COARSE))
    if sum(int(np.isfinite(s).sum()) for s in data.stress_MPa) < 4:
        raise InputError(f"{case.name}: fewer than four stresses in all; record more")
    model = model or case.model
    if data.simulated_MPa is not None and model is None:
        found = given(data, data.simulated_MPa, case.groups(), fine, few)
    else:
        found = baseline(data, model or DEFAULT, case.groups(), fine, few)
    return replace(found, said=bool(case.specimen) or case.history == "continued")


def units_for(name: str, data: Data, segments: int = 16) -> Base:
    """Return the base for recordings, on grids of their strains and of their times.

    `data` are all of their samples: the shortest time is that of the clock.
    """
    low = min(float(c.strain.min()) for c in data.chunks)
    high = max(float(c.strain.max()) for c in data.chunks)
    scales = data.scales()
    if not scales.strain > 0:
        raise InputError("the strain never leaves zero; there is nothing to simulate")
    duration = float(scales.duration_s.max())
    # The finest clock sets the shortest time; the usual interval may be far longer.
    steps = [np.diff(c.time_s) for c in data.chunks]
    usual = [float(np.median(s[s > 0])) for s in steps if (s > 0).any()]
    interval = min(usual, default=scales.interval_s)
    return build(name, low, high, interval, duration, segments)


def nuisance(data: Data, groups: Sequence[tuple[int, ...]]) -> tuple[Piece, ...]:
    """Return a scale for each specimen but that in the middle; nothing for only one."""
    if len(groups) < 2:
        return ()
    return (scatter(len(data.chunks), besides_middle(data, groups)),)


def each_apart(data: Data, unsaid: bool = False) -> Piece:
    """Return specimen scales that take each recording as a specimen of its own."""
    count = len(data.chunks)
    groups = besides_middle(data, [(r,) for r in range(count)])
    return scatter(count, groups, unsaid)


def scatter(
    recordings: int, groups: Sequence[tuple[int, ...]], unsaid: bool = False
) -> Piece:
    """Return specimen scales: one value for each of the groups of recordings."""
    law = next(e for e in EFFECTS if e.scatter)
    off = {k: np.full(recordings, v) for k, v in law.off.items()}
    return Piece(law, off, tuple(off), tuple(groups), nuisance=True, unsaid=unsaid)


def weigh(engine: Engine, found: Fit, long: bool = False) -> list[Noise]:
    """Estimate the noise from the residual of a fit, and weigh by it from now on.

    The noise is estimated from all samples, though the search may use fewer: between
    samples far apart the specimen moves, so noise cannot be separated from motion.
    `long` allows noise with a memory of any length. Only a candidate that misses little
    can separate such noise from model error.
    """
    fine = engine.fine
    stress = found.stress if fine is engine else fine.run(found.guess, False)[0]
    data = fine.data
    noise = estimate(
        live(fine.by_recording(fine.target - stress), engine.level),
        data.stress_MPa,
        [c.time_s for c in data.chunks],
        long,
    )
    if not long:  # noise of any memory is judged as a whole: `accounts.believed`
        noise = possible(noise, data.stress_MPa)
    weigh_by(engine, noise)
    return noise


def possible(noise: Sequence[Noise], stress_MPa: Sequence[Array]) -> list[Noise]:
    """Return the noise of each recording, no larger than a machine can have.

    The limit is the error of a machine of class 2, or white noise that differences of
    neighbouring samples show. What is larger and slow is model error: with few samples
    a recording the residual of a wrong law looks like slow noise.
    """
    every = np.concatenate([s[np.isfinite(s)] for s in stress_MPa])
    most = CLASS * float(np.ptp(every))
    out = []
    for one, s in zip(noise, stress_MPa, strict=True):
        level = float(np.sqrt(np.nanmean(one.sigma(s) ** 2)))
        limit = max(most, SHOWN * white(s))
        by = min(limit / max(level, 1e-300), 1.0)
        if 0 < by < 1:
            one = replace(one, floor_MPa=one.floor_MPa * by, share=one.share * by)
        out.append(one)
    return out


def live(residuals: Sequence[Array], level: float) -> list[Array]:
    """Return residuals (n,) each, NaN where the channel stands still and has no noise.

    Examples are a slack strip and a load cell that is cut off at zero. A channel that
    stands still from end to end stays as it is.
    """
    out = []
    for x in residuals:
        rough = np.nan_to_num(np.abs(np.diff(x, 3)), nan=np.inf)
        if len(rough) > WINDOW:
            dead = maximum_filter1d(rough, WINDOW) < STILL * level
            dead = np.concatenate([dead[:1], dead, dead[-2:]])
            x = x if dead.all() else np.where(dead, np.nan, x)
        out.append(x)
    return out


def weigh_by(engine: Engine, noise: Sequence[Noise]) -> None:
    """Weigh the samples of an engine by a given noise."""
    sigma = [n.sigma(s) for n, s in zip(noise, engine.data.stress_MPa, strict=True)]
    engine.set_noise(sigma, [n.memory for n in noise])


def baseline(
    data: Data,
    name: str | Base,
    groups: Sequence[tuple[int, ...]] = (),
    fine: Data | None = None,
    few: Data | None = None,
) -> Baseline:
    """Return a base refitted to the data; noise from `fine` if it is given."""
    engine = Engine(data, fine=None if fine is None else Engine(fine))
    units = units_for(name, fine or data) if isinstance(name, str) else name
    pieces = nuisance(data, groups)
    every = dict.fromkeys(units.starts())  # the first may be among the others
    starts = (Guess(u, np.zeros(u.columns), pieces) for u in every)
    found = min((fit(engine, one) for one in starts), key=lambda f: f.chi2)
    noise: list[Noise] = []
    for _ in range(2):
        noise = weigh(engine, found)
        found = fit(engine, found.guess)
    less = None if few is None else Engine(few)
    notes = found.guess.units.remarks()
    said = name if isinstance(name, str) else name.name
    return Baseline(engine, found, noise, said, False, fewer=less, notes=notes)


def given(
    data: Data,
    simulated: Sequence[Array],
    groups: Sequence[tuple[int, ...]] = (),
    fine: Data | None = None,
    few: Data | None = None,
) -> Baseline:
    """Return a simulation from elsewhere as the base: unchanged, with a stand-in."""
    # The stand-in sees the simulation without noise, at the samples of the recording.
    copy = replace(data, stress_MPa=tuple(simulated), simulated_MPa=None)
    units = units_for(STAND_IN, fine or data)
    inner = fit(Engine(copy), Guess(units, np.zeros(units.columns)))
    more, less = (
        None if d is None else beyond(d, d.simulated_MPa or (), inner.guess)
        for d in (fine, few)
    )
    engine = beyond(data, simulated, inner.guess, more)
    guess = Guess(units, inner.guess.stiffness, nuisance(data, groups))
    found = fit(engine, guess, fixed_base=True)
    noise: list[Noise] = []
    for _ in range(2):
        noise = weigh(engine, found)
        found = fit(engine, found.guess, fixed_base=True)
    return Baseline(engine, found, noise, "simulated", True, fewer=less)


def beyond(
    data: Data,
    simulated: Sequence[Array],
    stand_in: Guess,
    fine: Engine | None = None,
) -> Engine:
    """Return an engine that adds the part of a simulation that its stand-in lacks."""
    # The simulation counts at every sample, also where no stress was measured.
    whole = tuple(np.nan_to_num(s) for s in data.stress_MPa)
    plain = Engine(replace(data, stress_MPa=whole))
    stress, _ = plain.run(replace(stand_in, pieces=()), False)
    by = np.split(stress, data.starts[1:-1])
    rest = [s - m for s, m in zip(simulated, by, strict=True)]
    return Engine(data, remainder=rest, fine=fine)
