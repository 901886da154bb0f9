"""What a fit gains that knows which fault was made, and in what recordings.

Nobody can find a fault whose true law predicts no better than the same effects without
it. So for each copy with a made fault two fits are compared: the effects that the
diagnosis of the original has, refitted to the copy, and the same with the true law,
started from the true values. Both predict samples that they have not seen, and the
folds are compared in pairs (Student 1908, doi:10.1093/biomet/6.1.1). Some laws gain
where nothing was made, because they take up what other laws miss; so what the same law
gains in the original is subtracted. Where the rest lies within the scatter of both, the
fault is counted apart.

A fault that all recordings have is predicted on recordings that were left out. Of one
in a few recordings nothing is known elsewhere: there stretches of these recordings are
left out, from its moment on. A wrong cross-section hides in the scale of a specimen; it
is compared with the scales of its siblings. Readings that stay at one limit need no law
to be seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.stats import t as student

from bench.recordings.faults import UNLISTED, Fault, Made
from softnn.contracts import Array, Effect, Parameter
from softnn.effects import EFFECTS, effect
from softnn.fit import Engine, Guess, Piece, fit
from softnn.mismatch import base as bases
from softnn.mismatch import prediction
from softnn.mismatch.case import Case
from softnn.mismatch.diagnosis import counted
from softnn.model_file import Stored, from_dict

SAMPLES = 300  # of a recording; enough for errors, and cheap
FEWEST = 3  # recordings to leave out in turn; of fewer, stretches are left out
STRETCHES = 5  # of a recording
CHANCE = 0.05  # one-sided: a gain as large comes as often from scatter alone
FLAT = 5  # neighbouring samples at one limit, which no noise brings about
LEAST = 0.02  # of a logarithm: a fiftieth of the error is no gain, however steady


class Drying(Effect):
    """The law of the fault that softnn does not know: stiffer at a steady rate."""

    stage = "sensor"
    ports = ("stress",)
    parameters = (Parameter("rate_per_s", "1/s", -1e3, 1e3, 1e-3, meaning="rate"),)
    off = MappingProxyType({"rate_per_s": 0.0})
    amplitude = "rate_per_s"

    def after(self, p, signal, state):
        since = (signal.time_s - signal.begun_s)[:, None]
        return signal.having(stress=signal.stress * (1 + p["rate_per_s"] * since)), None

    def starts(self, scales):
        return [{"rate_per_s": 0.25 / float(np.max(scales.duration_s))}]

    def telltale(self):
        return effect("load_cell_drift").telltale()


@dataclass(frozen=True)
class Gain:
    """By how much the true law predicts better, against the scatter of the folds.

    `gain` is the mean difference of the logarithm of the error, less `plain`, that of
    the original; `scatter` is the standard error of both. `chance` is the probability
    of such a gain from scatter alone, and `log_likelihood` the log ratio of the
    likelihoods of this mean and of none (normal differences of unknown spread).
    `before` and `after` are NRMSE over all folds; scales of specimens have none.
    """

    gain: float
    scatter: float
    folds: int
    plain: float = 0.0
    before: float | None = None
    after: float | None = None

    @property
    def t(self) -> float:
        return self.gain / max(self.scatter, 1e-12)

    @property
    def chance(self) -> float:
        return float(student.sf(self.t, self.folds - 1)) if self.folds > 1 else 1.0

    @property
    def log_likelihood(self) -> float:
        more = self.t**2 / max(self.folds - 1, 1)
        return 0.5 * self.folds * float(np.log1p(more)) if self.folds > 1 else 0.0

    @property
    def seen(self) -> bool:
        return self.chance < CHANCE and self.gain > LEAST

    def beyond(self, plain: Gain) -> Gain:
        """The gain beyond that of a law where it has nothing to take up."""
        usual = max(plain.gain, 0.0)  # a law can be off
        scatter = float(np.hypot(self.scatter, plain.scatter))
        return replace(self, gain=self.gain - usual, scatter=scatter, plain=usual)

    def entry(self) -> dict[str, Any]:
        """As it stands in a result file."""
        more = ("chance", "log_likelihood", "seen")
        return asdict(self) | {k: getattr(self, k) for k in more}


def asked(
    made: Made, fault: Fault, base: str, model: Mapping[str, Any]
) -> dict[str, Any]:
    """The gain of the true law in a faulty case; `model` is that of the original.

    Empty where the model of the original has the effect already.
    """
    stored = from_dict(dict(model))
    assert isinstance(stored, Stored)
    if any(p.effect.id == fault.effect for p in stored.pieces) and not fault.among:
        return {}
    if fault.among:
        engine, guess = _start(made.case, base, stored)
        return scales(engine, guess, made.recordings[0]).entry()
    law = Drying() if fault.effect == UNLISTED else effect(fault.effect)
    x, y = stored.axes.strain.one, stored.axes.stress.one
    piece = true_piece(law, made, len(made.case.recordings), x, y)
    copy, plain = (
        compared(*_start(case, base, stored), piece, made)
        for case in (made.case, made.original)
    )
    told = copy.beyond(plain).entry()
    if fault.flat and flat(made.case) >= FLAT > flat(made.original):
        told["seen"] = True
    return told


def flat(case: Case) -> int:
    """Most neighbouring samples of a recording that all read its largest stress."""
    most = 0
    for recording in case.recordings:
        size = np.abs(recording.stress_MPa)
        full = np.r_[0, size == np.nanmax(size), 0].astype(int)
        runs = np.flatnonzero(np.diff(full))
        most = max(most, int((runs[1::2] - runs[::2]).max(initial=0)))
    return most


def _start(case: Case, base: str, stored: Stored) -> tuple[Engine, Guess]:
    """The base with the effects of a stored model, to be fitted to a case."""
    case = counted(bases.usable(case, SAMPLES), stored.axes)
    start = bases.start(case, base)
    known = _pieces(stored, [r.name for r in case.recordings])
    each = any(p.nuisance for p in known)
    inside = [p for p in start.fit.guess.pieces if p.nuisance and not each]
    return start.engine, replace(start.fit.guess, pieces=(*inside, *known))


def true_piece(
    law: Effect, made: Made, count: int, strain: float, stress: float
) -> Piece:
    """The law with the values that it has, those of recordings where it was made.

    `strain` and `stress` count as 1 in the units of the fit.
    """
    values: dict[str, Any] = law.defaults()
    values |= {p.name: p.default for p in law.parameters if p.name in law.shape}
    unit = {"gap": strain, "slip": strain}
    unit |= dict.fromkeys(("offset_MPa", "limit_MPa", "drift_MPa_per_s"), stress)
    for name in law.per_recording:
        values[name] = np.full(count, float(values[name]))
    for recording, told in zip(made.recordings, made.values, strict=True):
        for name, value in told.items():
            value = value / unit.get(name, 1.0)
            if name in law.per_recording:
                values[name][recording] = value
            else:
                values[name] = value
    free = tuple(p.name for p in law.parameters if p.name not in law.shape)
    groups = tuple((r,) for r in made.recordings) if law.per_recording else ()
    return Piece(law, values, free, groups)


def compared(engine: Engine, guess: Guess, piece: Piece, made: Made) -> Gain:
    """Errors of a guess without and with the piece on what each has not seen."""
    rig = piece.effect.stage == "rig"
    # The machine's strain comes first, and what it reads comes last.
    pieces = (piece, *guess.pieces) if rig else (*guess.pieces, piece)
    both = guess, replace(guess, pieces=pieces)
    # Only some recordings have it: nothing is known of it in the others.
    those = made.recordings if piece.groups else ()
    values = {r: dict(v) for r, v in zip(made.recordings, made.values, strict=True)}
    since = {r: v.get("moment_s", 0.0) for r, v in values.items()}
    before, after = (errors(engine, one, those, since) for one in both)
    return paired(before, after)


def errors(
    engine: Engine,
    guess: Guess,
    those: Sequence[int],
    since: Mapping[int, float],
) -> Array:
    """Errors (folds, 2) of a guess that is refitted without each fold.

    Columns are sums of squares of error and of stress. All of softnn's judging by
    prediction that this study needs is in here.
    """
    engine = prediction.alike(engine)
    found = fit(engine, guess)
    judge = prediction.Judge(engine, found.guess)
    many = len(judge.folds.every) >= FEWEST and len(engine.chunks) > 1
    if those or not many:
        cut = stretches(engine, those or range(len(engine.chunks)), since)
        every = tuple(prediction.Fold("stretch", rows, ()) for rows in cut)
        whole = engine.share * engine.target**2
        squares = np.array([np.sum(whole[rows]) for rows in cut])
        judge.folds = prediction.Folds(every, np.maximum(squares, 1e-300))
    told = judge.judged(found, refit=True)
    return np.column_stack([told.errors, told.folds.squares])


def stretches(
    engine: Engine, those: Sequence[int], since: Mapping[int, float]
) -> list[Any]:
    """Masks (valid,) of stretches of recordings, each from its moment on."""
    out = []
    time = np.concatenate([c.time_s - c.time_s[0] for c in engine.chunks])
    time = time[engine.valid]
    for r in those:
        mine = engine.owner == r
        later = np.flatnonzero(mine & (time >= since.get(r, 0.0)))
        for part in np.array_split(later, STRETCHES):
            rows = np.zeros(len(time), bool)
            rows[part] = True
            if len(part):
                out.append(rows)
    return out


def paired(before: Array, after: Array) -> Gain:
    """Compare errors (folds, 2) in pairs, in logarithms of the NRMSE."""
    nrmse = [np.sqrt(e[:, 0] / e[:, 1]) for e in (before, after)]
    log = [np.log(n + prediction.FLOOR) for n in nrmse]
    apart = log[0] - log[1]
    n = len(apart)
    spread = float(apart.std(ddof=1)) / np.sqrt(n) if n > 1 else float("inf")
    a, b = (float(np.sqrt(e[:, 0].sum() / e[:, 1].sum())) for e in (before, after))
    return Gain(float(apart.mean()), spread, n, before=a, after=b)


def scales(engine: Engine, guess: Guess, odd: int) -> Gain:
    """How far the scale of one specimen lies from those of its siblings.

    In logarithms; the scatter is that of a new sibling about their mean.
    """
    found = fit(prediction.alike(engine), guess).guess
    piece = next(p for p in found.pieces if p.nuisance)
    log = np.log1p(np.asarray(piece.values[piece.effect.amplitude], float))
    rest = np.delete(log, odd)
    spread = float(rest.std(ddof=1)) * np.sqrt(1 + 1 / len(rest))
    away = abs(float(log[odd] - rest.mean()))
    return Gain(away, spread, len(rest))


def _pieces(stored: Stored, names: Sequence[str]) -> list[Piece]:
    """The effects of a stored model for these recordings, all parameters free."""
    out = []
    for piece, own in zip(stored.pieces, stored.own, strict=True):
        law, values = piece.effect, dict(piece.values)
        groups: tuple[tuple[int, ...], ...] = ()
        for name in law.per_recording:
            mine = own.get(name, {})
            values[name] = np.array([mine.get(n, values[name]) for n in names], float)
        if law.per_recording:
            off = law.off[law.amplitude]
            on = np.flatnonzero(values[law.amplitude] != off)
            groups = tuple((int(r),) for r in on)
        # Scales of all specimens but the first are no fault.
        each = law.scatter and len(groups) >= len(names) - 1 > 0
        free = tuple(p.name for p in law.parameters)
        out.append(
            replace(piece, values=values, free=free, groups=groups, nuisance=each)
        )
    return sorted(out, key=lambda p: [e.id for e in EFFECTS].index(p.effect.id))
