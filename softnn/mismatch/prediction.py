"""Search by prediction: fits in stress, judged on recordings that were left out.

Where no candidate model explains the recordings down to the noise, the likelihood says
little (the M-open case: Bernardo and Smith 1994). All candidates are wrong by far more
than the noise, and their evidence compares errors that nobody models. Which candidate
predicts best can still be measured. So all samples weigh alike (least squares in
stress: Tuo and Wu 2015, doi:10.1214/15-AOS1314), and candidates are ranked by their
error on recordings that the fit did not see. The fit learns nothing from those but the
scale of a new specimen, which every candidate gets alike.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softnn import progress
from softnn.contracts import Array, Chunk
from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Guess, Piece, fit
from softnn.mismatch.base import Baseline
from softnn.mismatch.candidates import (
    FIRST,
    LATER,
    SIZES,
    candidates,
    expand,
    names,
    refine,
    so_far,
)
from softnn.mismatch.compare import FLOOR, HARM, LIKELY, Names, shares
from softnn.mismatch.compare import names as names_of
from softnn.mismatch.posterior import Hypothesis, Posterior
from softnn.mismatch.specimens import by_stiffness
from softnn.mismatch.verify import Heldout, without_rows
from softnn.state import BRANCHES, phases

LEVEL = 0.01  # of the largest stress: the deviation of every sample
ALIKE = 0.15  # of a logarithm, within which rates or amplitudes form one level
MOST_FOLDS = (
    6  # folds of single recordings; of more recordings, several are left out at once
)
IGNORED = 1e6  # times the usual deviation: hides a sample from the fit
LEAST = 1e-3  # of the usual weight of a sample, in fits
SHAPES = 2  # forms kept of a single effect; errors of prediction hardly tell more
BEAM = (3, 2)  # beam width: candidates of one and of two effects that get one more
FINALISTS = 5  # candidates of each size that are refitted without each fold
REFITTED = 3  # iterations of such a refit
ENOUGH = 3  # specimens or recordings to leave out in turn; fewer count less
SAME = 0.01  # of a logarithm; the least gain of a further effect in a correction
SKETCHED = 2  # effects in the first model for a comparison of replicates
AGAIN = 0.3  # of the largest strain; a smaller rise is no reloading
SINGLE = ("specimen", "recording", "stretch")  # folds in which each sample is once
RESCALED = 4  # steps to the scale of a new specimen
SLOWER, LARGER = 5.0, 1.5  # rates and strains beyond the recordings
NEAR = 0.5  # of the largest share, from which a candidate predicts about as well
CRUSHED = -0.9  # largest compression that is asked for
APART = 1.0  # of the stress: the most that two models are said to lie apart
MOVING, HELD = 0.3, 0.05  # of the usual speed: moving above, held below


@dataclass(frozen=True)
class Fold:
    """Samples left out of a fit: recordings, or a stretch of a single recording."""

    by: str  # "specimen", "recording", "rate", "amplitude", "programme" or "stretch"
    rows: NDArray[np.bool]  # (valid,)
    recordings: tuple[int, ...]  # left out as a whole; empty for a stretch


@dataclass(frozen=True)
class Folds:
    """All folds, and the squares (folds,) of the measured stress in each, MPa^2."""

    every: tuple[Fold, ...]
    squares: Array

    @property
    def unseen(self) -> float:
        """Samples left out over samples fitted, the mean of all folds."""
        out = np.array([f.rows.mean() for f in self.every])
        return float(np.mean(out / (1 - out)))

    @property
    def chance(self) -> float:
        """Probability that what these recordings need, the next one does not.

        Fewer than `ENOUGH` recordings: the rule of succession (Laplace), so one or two
        never make a name sure. Zero for more.
        """
        recordings = len({r for f in self.every for r in f.recordings}) or 1
        return 1 / (recordings + 2) if recordings < ENOUGH else 0.0


@dataclass(frozen=True)
class Candidate:
    """A set of effects, its best fit to all recordings, and its error in each fold.

    `errors` (folds,) are sums of squares, MPa^2. They come from refits without each
    fold if `refitted`, else from one Gauss-Newton step from the fit to all recordings.
    `given` are the faults that all candidates have.
    """

    fit: Fit
    errors: Array
    folds: Folds
    refitted: bool = False
    seconds: float = 0.0
    given: frozenset[str] = frozenset()

    @property
    def effects(self) -> frozenset[str]:
        """Ids of the effects, without the faults that all candidates have."""
        return frozenset(names(self.fit)) - self.given

    @property
    def nrmse(self) -> Array:
        """NRMSE (folds,) in each fold."""
        return np.sqrt(self.errors / self.folds.squares)

    @property
    def score(self) -> float:
        """Logarithm of the NRMSE: mean of that of all folds together and of each.

        Large stresses dominate all folds together; by itself each fold counts alike.
        """
        each = np.mean(np.log(self.nrmse**2 + FLOOR**2))
        whole = self.errors.sum() / self.folds.squares.sum()
        return 0.25 * float(each + np.log(whole + FLOOR**2))

    @property
    def log_odds(self) -> float:
        """How far the error lies below that of the base but for a constant: `score`."""
        return -self.score

    @property
    def heldout(self) -> Heldout:
        """Return the error on all recordings, each predicted without having seen it."""
        worst = int(self.nrmse.argmax())
        single = np.array([f.by in SINGLE for f in self.folds.every])
        return Heldout(
            self.errors[single],
            self.folds.squares[single],
            float("nan"),
            (self.folds.every[worst].by, float(self.nrmse[worst])),
        )


def harms(one: Candidate, base: Candidate) -> str | None:
    """Return the kind of fold where the base is better beyond chance; None if none."""
    behind = np.log((one.nrmse + FLOOR) / (base.nrmse + FLOOR))
    kinds = np.array([f.by for f in one.folds.every])
    for by in dict.fromkeys(kinds):
        own = behind[kinds == by]
        error = own.std(ddof=1) / np.sqrt(len(own)) if len(own) > 1 else 0.0
        if own.mean() > max(HARM, error):
            return str(by)
    return None


def best(
    found: Sequence[Candidate],
    sure: frozenset[str] = frozenset(),
    engine: Engine | None = None,
) -> Candidate:
    """Return the candidate that predicts best and nowhere worse than the base.

    `found[0]` is the base; it is returned if no candidate beats it beyond chance.
    Candidates with all effects that are `sure` come first. Of those that predict the
    recordings about as well, the most `central` one beyond those of `engine` is taken.
    """
    base = found[0]
    safe = [c for c in found if harms(c, base) is None]
    safe = [c for c in safe if sure <= c.effects] or safe
    one = min(safe, key=lambda c: c.score + SAME * len(c.effects))
    if base.score - one.score <= HARM:
        return base
    if engine is None:
        return one
    return central(one, [c for c in safe if c.effects], engine)


def central(one: Candidate, every: Sequence[Candidate], engine: Engine) -> Candidate:
    """Return the candidate that other likely ones agree with on other programmes.

    Candidates predict the recordings alike, `one` best, but may lie far apart at other
    rates and strains. Errors tell none of these apart. So the one is taken to which the
    distance from the others, weighed by their shares, is smallest. It has half of the
    share of the best, or more.
    """
    errors = np.array([c.nrmse for c in every])
    # Here counts how alike they predict these folds, not what other folds would say.
    share = shares(errors, np.array([len(c.effects) for c in every]), unseen=0.0)
    likely = np.flatnonzero(share >= LIKELY * share.max()).tolist()
    near, share = [every[i] for i in likely], share[likely]
    if all(c is not one for c in near):
        return one
    off = np.zeros(len(near))
    for other in elsewhere(engine):
        stress = np.array([other.run(c.fit.guess, False)[0] for c in near])
        size = np.sqrt(other.share @ np.median(stress, axis=0) ** 2)
        miss = stress[:, None] - stress
        apart = np.sqrt(miss**2 @ other.share) / max(float(size), 1e-300)
        off += np.nan_to_num(np.minimum(apart, APART), nan=APART) @ share
    return near[int(np.where(share >= NEAR * share.max(), off, np.inf).argmin())]


def elsewhere(engine: Engine) -> list[Engine]:
    """Return engines with the same recordings at other rates and at larger strain."""
    data = engine.data

    def run(chunk: Chunk, slower: float, larger: float) -> Chunk:
        time = chunk.time_s[0] + slower * (chunk.time_s - chunk.time_s[0])
        return replace(chunk, time_s=time, strain=larger * chunk.strain)

    lowest = min(float(c.strain.min()) for c in data.chunks)
    most = min(LARGER, CRUSHED / lowest) if lowest < 0 else LARGER
    ways = [(SLOWER, 1.0), (1 / SLOWER, 1.0), (1.0, max(most, 1.0))]
    return [
        Engine(replace(data, chunks=tuple(run(c, *way) for c in data.chunks)))
        for way in ways
    ]


# --- folds ----------------------------------------------------------------------------


def folds(engine: Engine, specimens: Sequence[tuple[int, ...]]) -> list[Fold]:
    """Return folds by specimen or recording, by rate, by amplitude and by programme.

    `specimens` are the recordings of each labelled specimen. Folds by rate, amplitude
    and programme hold half of the recordings at most. A single recording is split into
    five stretches.
    """
    count = len(engine.chunks)
    if count < 2:
        n = len(engine.target)
        which = np.minimum(np.arange(n) * 5 // max(n, 1), 4)
        return [Fold("stretch", which == k, ()) for k in np.unique(which)]
    told = len(specimens) > 1
    single = list(specimens) if told else [(r,) for r in range(count)]
    if len(single) > MOST_FOLDS:
        single = by_stiffness(engine.data, single)
        single = [sum(single[k::MOST_FOLDS], ()) for k in range(MOST_FOLDS)]
    sets = {tuple(sorted(one)): "specimen" if told else "recording" for one in single}
    reach, rate, held = zip(*map(_programme, engine.chunks), strict=True)
    for by, values in (("amplitude", reach), ("rate", rate), ("programme", held)):
        groups = levels(values)
        for one in groups if len(groups) > 1 else ():
            if 2 * len(one) <= count:
                sets.setdefault(one, by)
    found = [Fold(by, engine.within(of), of) for of, by in sets.items()]
    return [f for f in found if f.rows.any() and not f.rows.all()]


def _programme(chunk: Chunk) -> tuple[float, float, float]:
    """Return largest strain, usual rate [1/s], and 2 if strain is mostly held."""
    reach = max(float(np.abs(chunk.strain).max()), 1e-12)
    step = np.maximum(np.diff(chunk.time_s), 1e-12)
    travel = np.abs(np.diff(chunk.strain))
    speed = travel / step
    usual = float(np.quantile(speed, 0.9)) if len(speed) else 0.0
    moving = speed > MOVING * usual
    rate = travel[moving].sum() / max(step[moving].sum(), 1e-12)
    held = step[speed < HELD * usual].sum() > 0.5 * step.sum()
    return reach, max(float(rate), 1e-12), 1.0 + held


def levels(values: Sequence[float]) -> list[tuple[int, ...]]:
    """Return groups of indices whose values agree within `ALIKE`, in rising order.

    >>> levels([1.0, 0.1, 1.05, 10.0])
    [(1,), (0, 2), (3,)]
    """
    out: list[list[int]] = []
    for i in np.argsort(values, kind="stable"):
        if out and np.log(values[i] / values[out[-1][0]]) < ALIKE:
            out[-1].append(int(i))
        else:
            out.append([int(i)])
    return [tuple(sorted(group)) for group in out]


def specimens_of(guess: Guess, count: int) -> list[tuple[int, ...]]:
    """Return the recordings of each specimen that has a scale in this guess."""
    for piece in guess.pieces:
        if piece.nuisance:
            mine = {r for group in piece.groups for r in group}
            first = tuple(r for r in range(count) if r not in mine)
            return [first, *piece.groups]
    return []


# --- fits that do without it ----------------------------------------------------------


def alike(engine: Engine, level: float = LEVEL) -> Engine:
    """Return the engine with samples weighed as in an error (`metrics.weights`).

    The usual deviation is `level` of the largest stress.
    """
    return hiding(engine, np.zeros(len(engine.target), bool), level)


def hiding(engine: Engine, rows: NDArray[np.bool], level: float = LEVEL) -> Engine:
    """Return the engine weighed likewise, to which samples (valid,) are hidden."""
    share = np.concatenate(engine.data.weights)
    sigma = level * engine.level / np.sqrt(np.maximum(share, LEAST))
    sigma[np.flatnonzero(engine.valid)[rows]] *= IGNORED
    return engine.under(np.split(sigma, engine.data.starts[1:-1].astype(int)), None)


def unmet(guess: Guess, fold: Fold, known: Mapping[str, Piece]) -> Guess:
    """Return the guess for recordings in the fold, as if the fit had not seen them.

    Parameters of these recordings become those of the same specimen elsewhere, or the
    mean of the other recordings, and are fixed. Faults are as in `known`, so no
    candidate learns anything else from the fold.
    """
    gone = set(fold.recordings)
    if not gone:
        return guess
    pieces = []
    for piece in guess.pieces:
        values, groups = dict(piece.values), piece.groups
        if piece.nuisance:  # the specimen to which scales refer has no value of its own
            groups = tuple(specimens_of(guess, len(values[piece.effect.amplitude])))
        for name in piece.effect.per_recording:
            array = np.array(values[name], float)
            rest = [r for r in range(len(array)) if r not in gone]
            for r in gone:
                if not piece.nuisance and piece.effect.id in known:
                    array[r] = known[piece.effect.id].values[name][r]
                    continue
                same = [q for g in groups if r in g for q in g if q not in gone]
                array[r] = array[same or rest].mean()
            values[name] = array
        kept = (tuple(r for r in g if r not in gone) for g in piece.groups)
        free = tuple(g for g in kept if g)
        pieces.append(replace(piece, values=values, groups=free))
    return replace(guess, pieces=tuple(pieces))


def missed(
    engine: Engine, guess: Guess, fold: Fold, specimens: Sequence[tuple[int, ...]]
) -> float:
    """Return the sum of squared errors, MPa^2, of a guess in a fold.

    A new specimen gets the scale that suits it best, since nothing else could give it.
    """
    gone = set(fold.recordings)
    new = [one for one in specimens if set(one) <= gone]
    if new and not all(map(scales, guess.pieces)):
        guess, new = rescaled(engine, guess, new), []
    stress, free = engine.run(guess, False)[0], {r for one in new for r in one}
    total = 0.0
    for r in np.unique(engine.owner[fold.rows]):
        rows = fold.rows & (engine.owner == r)
        s, y, share = stress[rows], engine.target[rows], engine.share[rows]
        if r in free:
            s = s * (float(share * s @ y) / max(float(share * s @ s), 1e-300))
        total += float(share @ (y - s) ** 2)
    return total


def scales(piece: Piece) -> bool:
    """Return whether the stress after an effect is proportional to the stress before.

    A drift counts as proportional: a wrong cross-section scales the drift, too.
    """
    return piece.effect.id not in ("zero_offset", "load_cell_saturation")


def rescaled(engine: Engine, guess: Guess, new: Sequence[tuple[int, ...]]) -> Guess:
    """Return the guess with the best scales for specimens that it has not seen."""
    place = next(i for i, p in enumerate(guess.pieces) if p.nuisance)
    piece = guess.pieces[place]
    name = piece.effect.amplitude
    start = 1.0 + np.array(piece.values[name], float)

    def scaled(scale: Array) -> Guess:
        pieces = list(guess.pieces)
        pieces[place] = replace(piece, values=piece.values | {name: scale - 1.0})
        return replace(guess, pieces=tuple(pieces))

    scale = start
    for _ in range(RESCALED):
        stress = engine.run(scaled(scale), False)[0]
        near = scale * np.where(np.isin(np.arange(len(scale)), sum(new, ())), 1.01, 1.0)
        slope = (engine.run(scaled(near), False)[0] - stress) / 0.01
        scale = scale.copy()
        for one in new:
            rows = np.isin(engine.owner, one)
            d, miss = slope[rows], (engine.target - stress)[rows]
            d_ = engine.share[rows] * d
            step = float(d_ @ miss) / max(float(d_ @ d), 1e-300)
            scale[list(one)] *= 1 + np.clip(step, -0.5, 1.0)
    return scaled(scale)


class Judge:
    """Computes errors of fits on recordings they did not see, but for `spare`."""

    def __init__(
        self,
        engine: Engine,
        base: Guess,
        given: frozenset[str] = frozenset(),
        spare: frozenset[int] = frozenset(),
    ) -> None:
        self.engine, self.given = engine, given
        self.specimens = specimens_of(base, len(engine.chunks))
        every = folds(engine, self.specimens)
        if spare:
            rows = ~engine.within(sorted(spare))
            every = [replace(f, rows=f.rows & rows) for f in every]
            every = [f for f in every if f.rows.any()]
        whole = engine.share * engine.target**2
        squares = [float(np.sum(whole[f.rows])) for f in every]
        self.folds = Folds(tuple(every), np.maximum(squares, 1e-300))

    def judged(self, found: Fit, refit: bool = False) -> Candidate:
        """Return errors of a fit by one step without each fold, or by a real refit."""
        clock, engine = time.perf_counter(), self.engine
        errors = []
        pieces = found.guess.pieces
        known = {p.effect.id: p for p in pieces if p.effect.id in self.given}
        for fold in self.folds.every:
            guess = unmet(without_rows(engine, found, fold.rows), fold, known)
            if refit:
                again = fit(
                    hiding(engine, fold.rows),
                    guess,
                    fixed_base=found.fixed_base,
                    iterations=REFITTED,
                )
                guess = unmet(again.guess, fold, known)
            errors.append(missed(engine, guess, fold, self.specimens))
        seconds = time.perf_counter() - clock
        given = self.given & frozenset(known)
        return Candidate(found, np.array(errors), self.folds, refit, seconds, given)


def ranked(every: Iterable[Candidate]) -> list[Candidate]:
    """Return the best candidate of each set of effects, the best of all first."""
    found: dict[frozenset[str], Candidate] = {}
    for one in sorted(every, key=lambda c: c.score):
        found.setdefault(one.effects, one)
    return list(found.values())


# --- the search -----------------------------------------------------------------------


def sketch(base: Baseline, given: Sequence[Piece] = (), every: bool = False) -> Fit:
    """Return the base with faults `given` and the two best effects, added in turn.

    It is good enough to compare replicates, since laws are wrong alike in all of them.
    With `every` effect tried, those of single recordings too.
    """
    engine, coarse = alike(base.engine), alike(base.coarse)
    found = fit(coarse, base.fit.guess, fixed_base=base.fixed)
    for piece in given:
        found = refine(coarse, found, piece)
    out = frozenset[str]() if every else _own_forms(base)
    pool = candidates(engine, base.has, out)
    for _ in range(SKETCHED):
        more = expand(coarse, found, pool, LATER)
        found = min([found, *more], key=lambda f: f.chi2)
    return fit(engine, found.guess, fixed_base=base.fixed, iterations=REFITTED)


def worth_it(engine: Engine, found: Fit, fault: Piece) -> bool:
    """Return whether a fit predicts better with a fault of single recordings."""
    rest = tuple(
        p for p in found.guess.pieces if p.nuisance or p.effect.id != fault.effect.id
    )
    guess = replace(found.guess, pieces=rest)
    less = fit(engine, guess, fixed_base=found.fixed_base)
    return better(engine, found, refine(engine, less, fault), fault)


def better(engine: Engine, without: Fit, has: Fit, fault: Piece) -> bool:
    """Return whether the fit that `has` a fault predicts better than the one `without`.

    Recordings without the fault decide. In the others its size is known only to the
    fit that has it, and nobody knows it for a new recording.
    """
    size = np.abs(fault.values[fault.effect.amplitude])
    spare = frozenset(np.flatnonzero(size > size.min()).tolist())
    given = frozenset({fault.effect.id})
    old, new = (
        Judge(engine, one.guess, known, spare).judged(one).score
        for one, known in ((without, frozenset[str]()), (has, given))
    )
    return new < old


def search(base: Baseline, given: Sequence[Piece] = ()) -> list[Candidate]:
    """Return the sets of effects that predict best, refitted; the base alone first.

    All candidates, the base too, have the faults `given`. Other effects of single
    recordings take no part, because they predict no other recording. Slack
    (`carries_over`) does, as all strips are mounted alike. Sets grow on few samples of
    each recording; the best of each size are refitted to more.
    """
    engine, coarse = alike(base.engine), alike(base.coarse)
    start = fit(coarse, base.fit.guess, fixed_base=base.fixed)
    for piece in given:
        start = refine(coarse, start, piece)
    own = frozenset(p.effect.id for p in given)
    judge = Judge(coarse, start.guess, own)
    pool = candidates(engine, base.has, _own_forms(base))
    found = [judge.judged(start)]

    def grown(parents: Sequence[Candidate], most: int, forms: int) -> list[Candidate]:
        size = len(parents[0].effects - own) if parents else 0
        progress.part(f"{SIZES[size]}, by prediction", len(parents))
        fits = []
        for parent in parents:
            fits += expand(coarse, parent.fit, pool, most, forms)
            progress.piece()
        mine = [judge.judged(one) for one in fits]
        found.extend(mine)
        so_far(coarse, ranked(found)[0].fit)
        return ranked(mine)

    one = grown(found[:1], FIRST, SHAPES)
    two = grown(one[: BEAM[0]], LATER + 1, 1)
    grown(two[: BEAM[1]], LATER, 1)
    order = ranked(found)
    finalists = [c for c in order if not c.effects]
    for size in range(1, len(BEAM) + 2):
        finalists += [c for c in order if len(c.effects) == size][:FINALISTS]
    progress.part("recordings left out", len(finalists))
    judge, judged = Judge(engine, start.guess, own), []
    for one_ in finalists:
        guess = one_.fit.guess
        again = fit(engine, guess, fixed_base=base.fixed, iterations=REFITTED)
        judged.append(judge.judged(again, refit=True))
        progress.piece()
    return judged


def alone(base: Baseline, found: Sequence[Candidate]) -> Candidate:
    """Return the base without any fault."""
    if not found[0].given:
        return found[0]
    engine = alike(base.engine)
    bare = fit(engine, base.fit.guess, fixed_base=base.fixed)
    return Judge(engine, bare.guess).judged(bare, refit=True)


def _own_forms(base: Baseline) -> frozenset[str]:
    """Return forms of laws that predict nothing on recordings left out.

    These are faults of single recordings; a limit that no reading reaches; and
    softening on reloading if nothing is reloaded, since viscosity widens a single loop
    as well.
    """
    data = base.engine.fine.data
    reloaded = any(_reloads(chunk) for chunk in base.engine.chunks)
    out = set()
    for law in EFFECTS:
        own = bool(law.per_recording) and not law.carries_over
        if law.id == "load_cell_saturation":  # no reading stays at a limit
            own = law.shown(data.chunks, data.stress_MPa) is None
        if law.on_reloading and not reloaded:
            own = True
        for form in law.forms:
            if own or (form.per_recording and not form.carries_over):
                out.add(form.form)
    return frozenset(out)


def _reloads(chunk: Chunk) -> bool:
    """Return whether strain rises again by `AGAIN` of its largest value or more."""
    size = np.abs(chunk.strain)
    again = phases(chunk).branch == BRANCHES.index("reloading")
    steps = np.diff(size, prepend=size[0])
    return bool(steps[again & (steps > 0)].sum() > AGAIN * max(size.max(), 1e-12))


def posterior(
    found: Sequence[Candidate], apart: Mapping[str, float], enough: bool
) -> tuple[Posterior, Names]:
    """Return the probability of each set of effects, by how well it predicts.

    `found[0]` is the base: if that is `enough`, nothing is missing, else something that
    is not on the list. `apart` are the probabilities of faults judged by themselves.
    """
    chance, unseen = found[0].folds.chance, found[0].folds.unseen
    errors = np.array([c.nrmse for c in found])
    sets = [c.effects for c in found]
    share = shares(errors, np.array([len(s) for s in sets]), unseen) * (1 - chance)
    first = share[0] + chance
    hypotheses = [Hypothesis(found[0], other) for other in (False, True)]
    hypotheses += [Hypothesis(c) for c in found[1:]]
    split = [first * enough, first * (not enough), *share[1:]]
    none = np.zeros(len(hypotheses))
    told = Posterior(tuple(hypotheses), np.array(split), none, apart)
    return told, names_of(sets, errors, unseen, chance)
