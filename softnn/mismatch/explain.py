r"""Which physics was left out: score tests, joint refits, one effect and several.

A score test asks how much of the residual an effect would take up that the base, with
everything it may still change, cannot (an atom: the change of stress the effect makes,
less what the columns of the base absorb). It is cheap, so all effects are asked from
several starts; those that pass are refitted jointly with the base, and compete.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softnn.contracts import Array, Effect
from softnn.effects import EFFECTS
from softnn.fit import Engine, Fit, Guess, Piece, fit
from softnn.mismatch.base import Baseline, weigh
from softnn.mismatch.verify import intervals
from softnn.noise import Noise

ENTRY = 15.0  # of chi2, below which a recording does not enter an effect of its own
MOST_EFFECTS = 3
FAR = 8.0  # excess of misfit over noise, a sample, that no form here comes near
LATER_SHARE = 0.25  # of the first effect's gain, below which a later one is its form
CLEAN = 0.3  # the same for one whose gain is small beside that of the first
LATER_LEFT = 0.65  # of what the earlier effects left, which a later one must get under

# What a base has of its own, so that it cannot be missing from it.
INCLUDED = {
    "hooke": (),
    "sls": (),
    "wiechert": ("relaxation_branch",),
    "pl-sls": ("nonlinear_elasticity",),
    "pl-wiechert": ("relaxation_branch", "nonlinear_elasticity"),
}


@dataclass(frozen=True)
class Lead:
    """An effect that the score test points to, with where to start its fit."""

    piece: Piece
    gain: float  # of chi2, linearised


def candidates(engine: Engine, base: str, fixed: bool) -> list[Effect]:
    """Effects that these recordings and this base could show."""
    scales = engine.data.scales()
    out = []
    for effect in EFFECTS:
        if effect.needs_temperature and not scales.temperature_C > 0.5:
            continue
        if not fixed and effect.id in INCLUDED.get(base, ()):
            continue
        if effect.id == "gain_error" and not fixed and len(engine.chunks) < 2:
            continue
        out.append(effect)
    return out


def start_pieces(engine: Engine, effect: Effect) -> list[Piece]:
    """A piece for each start of an effect: core parameters free, all recordings on."""
    r = len(engine.chunks)
    out = []
    fixed = effect.defaults()
    for start in effect.starts(engine.data.scales()):
        values: dict[str, Any] = fixed | dict(start)
        for p in effect.parameters:
            inside = np.clip(values[p.name], p.low, p.high)
            if p.name in effect.per_recording:
                values[p.name] = np.broadcast_to(inside, (r,)).astype(float)
            else:
                values[p.name] = float(inside)
        free = tuple(p.name for p in effect.parameters if p.name not in effect.shape)
        groups = tuple((i,) for i in range(r)) if effect.per_recording else ()
        out.append(Piece(effect, values, free, groups))
    return out


class Screen:
    """Score tests at one fit: the residual, and what the fit can still absorb."""

    def __init__(self, engine: Engine, base: Fit) -> None:
        self.engine, self.base = engine, base
        k = len(base.guess.stiffness)
        live = np.concatenate(
            [
                (base.guess.stiffness > 0) & (not base.fixed_base),
                np.ones(len(base.slots), bool),
            ]
        )
        columns = base.jacobian[:, live]
        norm = np.linalg.norm(columns, axis=0)
        columns = columns[:, norm > 0] / norm[norm > 0]
        self.q = _range(columns)
        self.residual = base.residual - self.q @ (self.q.T @ base.residual)
        self.k = k

    def project(self, atoms: Array) -> Array:
        return atoms - self.q @ (self.q.T @ atoms)

    def atoms(self, piece: Piece) -> Array:
        """Whitened, absorbed-free change of stress (valid, groups or 1) of a piece."""
        guess = self.base.guess
        with_it = replace(guess, pieces=guess.pieces + (piece,))
        changed, _ = self.engine.run(with_it, False)
        plain, _ = self.engine.run(guess, False)
        change = changed - plain
        if not piece.groups:
            return self.project(self.engine.whiten(change[:, None]))
        parts = np.stack(
            [
                np.where(np.isin(self.engine.owner, g), change, 0.0)
                for g in piece.groups
            ],
            axis=1,
        )
        return self.project(self.engine.whiten(parts))

    def lead(self, effect: Effect, threshold: float) -> tuple[list[Lead], list[Array]]:
        """Leads of an effect from each of its starts; and all atoms, for the null."""
        pieces = start_pieces(self.engine, effect)
        atoms = [self.atoms(p) for p in pieces]
        if not effect.per_recording:
            leads = []
            for piece, atom in zip(pieces, atoms, strict=True):
                c, gain = _signed(piece, atom[:, 0], self.residual)
                if gain > 0:
                    leads.append(Lead(_scaled(piece, [c]), gain))
            return leads, atoms
        return self._greedy(pieces, atoms, threshold), atoms

    def _greedy(
        self, pieces: list[Piece], atoms: list[Array], threshold: float
    ) -> list[Lead]:
        """Recordings one after the other, each from the start that suits it best."""
        residual = self.residual
        basis = np.zeros((len(residual), 0))
        chosen: dict[int, tuple[int, float]] = {}
        total = 0.0
        # A mistake in some recordings is one only beside others that are right.
        limit = len(pieces[0].groups) - int(pieces[0].effect.some)
        for _ in range(len(pieces[0].groups)):
            best = (0.0, -1, -1, 0.0)
            for s, (piece, atom) in enumerate(zip(pieces, atoms, strict=True)):
                left = atom - basis @ (basis.T @ atom)
                # What is absorbed by what is in already tells nothing new.
                share = (left**2).sum(axis=0) / np.maximum(
                    (atom**2).sum(axis=0), 1e-300
                )
                for g in range(len(piece.groups)):
                    if g in chosen or share[g] < 0.02:
                        continue
                    c, gain = _signed(piece, left[:, g], residual)
                    if gain > best[0]:
                        best = (gain, s, g, c)
            gain, s, g, c = best
            if g < 0 or gain < threshold or len(chosen) >= limit:
                break
            left = atoms[s][:, g] - basis @ (basis.T @ atoms[s][:, g])
            unit = left / np.linalg.norm(left)
            basis = np.concatenate([basis, unit[:, None]], axis=1)
            residual = residual - unit * (unit @ residual)
            chosen[g] = (s, c)
            total += gain
        if not chosen:
            return []
        effect = pieces[0].effect
        values = {
            k: np.array(v) if np.ndim(v) else v for k, v in pieces[0].values.items()
        }
        for name, off in effect.off.items():
            if name in effect.per_recording:
                values[name] = np.full(len(self.engine.chunks), off)
        for g, (s, c) in chosen.items():
            for name in effect.per_recording:
                own = float(pieces[s].values[name][g])
                values[name][g] = own * c if name == effect.amplitude else own
        values = _clipped(effect, values)
        groups = tuple(pieces[0].groups[g] for g in sorted(chosen))
        return [Lead(Piece(effect, values, pieces[0].free, groups), total)]


def _range(columns: Array) -> Array:
    """Orthonormal basis of the columns, those that depend on others left out."""
    if columns.shape[1] == 0:
        return columns
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > 1e-7 * s[0]]


def _bounds(piece: Piece) -> tuple[float, float]:
    """Multiples of the start's amplitude that the parameter's range allows, up to 4."""
    effect = piece.effect
    p = next(p for p in effect.parameters if p.name == effect.amplitude)
    value = float(np.max(np.abs(piece.values[effect.amplitude])))
    if effect.off.get(effect.amplitude) != 0.0:
        return 0.0, 1.5
    return max(p.low / value, -4.0), min(p.high / value, 4.0)


def _signed(piece: Piece, atom: Array, residual: Array) -> tuple[float, float]:
    """Best multiple of an atom within its range, and the gain of chi2."""
    size = float(atom @ atom)
    if size < 1e-12:
        return 0.0, 0.0
    dot = float(atom @ residual)
    low, high = _bounds(piece)
    c = float(np.clip(dot / size, low, high))
    return c, c * (2 * dot - c * size)


def _scaled(piece: Piece, c: Sequence[float]) -> Piece:
    effect = piece.effect
    values = dict(piece.values)
    if effect.off.get(effect.amplitude) == 0.0:
        factor = c[0] if abs(c[0]) > 0.05 else np.copysign(0.05, c[0])
        values[effect.amplitude] = values[effect.amplitude] * factor
    return replace(piece, values=_clipped(effect, values))


def _clipped(effect: Effect, values: dict[str, Any]) -> dict[str, Any]:
    out = dict(values)
    for p in effect.parameters:
        out[p.name] = np.clip(out[p.name], p.low, p.high)
        if np.ndim(out[p.name]) == 0:
            out[p.name] = float(out[p.name])
    return out


def null_threshold(
    screen: Screen,
    atoms: Sequence[Array],
    rng: np.random.Generator,
    level: float = 0.99,
) -> float:
    """Quantile of the largest score of any atom when nothing but noise is left.

    The bootstrap draws whitened noise, refits the base to it (the projection), and
    takes the largest gain over all effects and starts.
    """
    s = np.concatenate(atoms, axis=1)
    norm = np.linalg.norm(s, axis=0)
    s = s[:, norm > 1e-6] / norm[norm > 1e-6]
    if s.shape[1] == 0:
        return 10.0
    largest = []
    for _ in range(8):
        noise = rng.standard_normal((s.shape[0], 25))
        largest.append(((s.T @ screen.project(noise)) ** 2).max(axis=0))
    return float(np.quantile(np.concatenate(largest), level))


def refine(engine: Engine, base: Fit, piece: Piece, iterations: int = 10) -> Fit:
    """The joint refit with one more piece, recordings it does not touch taken out."""
    order = [e.id for e in EFFECTS]
    pieces = sorted(
        base.guess.pieces + (piece,), key=lambda p: order.index(p.effect.id)
    )
    guess = Guess(base.guess.units, base.guess.stiffness, tuple(pieces))
    found = fit(engine, guess, fixed_base=base.fixed_base, iterations=iterations)
    return prune(engine, found)


def prune(engine: Engine, found: Fit) -> Fit:
    """The fit without recordings in which an effect is off within its error."""
    limits = intervals(found)
    pieces, changed = [], False
    for i, piece in enumerate(found.guess.pieces):
        law = piece.effect
        if piece.nuisance or law.amplitude not in law.per_recording:
            pieces.append(piece)
            continue
        off = law.off[law.amplitude]
        values = dict(piece.values)
        kept = []
        for group in piece.groups:
            low, high = limits.get((i, law.amplitude, group), (-np.inf, np.inf))
            middle = float(values[law.amplitude][group[0]])
            sd = max((high - low) / 3.92, 1e-300)
            if abs(middle - off) > 3.5 * sd:
                kept.append(group)
        if kept and len(kept) < len(piece.groups):
            array = np.array(values[law.amplitude], float)
            gone = [r for g in piece.groups if g not in kept for r in g]
            array[gone] = off
            values[law.amplitude] = array
            changed = True
            piece = replace(piece, values=values, groups=tuple(kept))
        pieces.append(piece)
    if not changed:
        return found
    guess = replace(found.guess, pieces=tuple(pieces))
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=4)


def release(
    engine: Engine, found: Fit, index: int, inside: bool, iterations: int = 10
) -> Fit:
    """The same with the shape parameters of piece `index` freed.

    `inside`: they start a little inside their range; at its end some laws do not move.
    """
    pieces = list(found.guess.pieces)
    piece = pieces[index]
    values = dict(piece.values)
    for p in piece.effect.parameters:
        if inside and p.name in piece.effect.shape and p.scale == "linear":
            width = 0.03 * (p.high - p.low)
            values[p.name] = float(
                np.clip(values[p.name], p.low + width, p.high - width)
            )
    names = tuple(p.name for p in piece.effect.parameters)
    pieces[index] = replace(piece, values=values, free=names)
    guess = replace(found.guess, pieces=tuple(pieces))
    return fit(engine, guess, fixed_base=found.fixed_base, iterations=iterations)


@dataclass
class Rival:
    """An effect tried on top of a fit, at its best form."""

    effect: str
    fit: Fit
    seconds: float


def rivals(
    engine: Engine,
    base: Fit,
    pool: Sequence[Effect],
    rng: np.random.Generator,
    most: int = 8,
) -> tuple[list[Rival], float]:
    """Effects of the pool that pass the score test, refitted, best first; threshold.

    Core parameters first; the few that come near the best then get their second forms
    and their shape parameters.
    """
    screen = Screen(engine, base)
    leads: dict[str, Lead] = {}
    atoms: list[Array] = []
    for effect in pool:
        if any(p.effect.id == effect.id and not p.nuisance for p in base.guess.pieces):
            continue
        for law in (effect, *effect.second_forms):
            own, seen = screen.lead(law, ENTRY)
            atoms += seen
            for lead in own:
                key = f"{effect.id}/{law.form}"
                if key not in leads or lead.gain > leads[key].gain:
                    leads[key] = lead
    if not atoms:
        return [], ENTRY
    threshold = null_threshold(screen, atoms, rng)
    passed = sorted(leads.items(), key=lambda kv: -kv[1].gain)
    passed = [kv for kv in passed if kv[1].gain > threshold]
    if not passed:
        return [], threshold
    top = passed[0][1].gain
    found: list[Rival] = []
    tried: dict[str, int] = {}
    for key, lead in passed:
        name = key.split("/")[0]
        if lead.gain < 0.05 * top or (name not in tried and len(tried) >= most):
            continue
        tried[name] = tried.get(name, 0) + 1
        clock = time.perf_counter()
        trial = refine(engine, base, lead.piece, 6)
        found.append(Rival(name, trial, time.perf_counter() - clock))
    found.sort(key=lambda r: r.fit.chi2)
    best = found[0].fit.chi2
    out: dict[str, Rival] = {}
    for rank, rival in enumerate(found):
        # Within reach of the best: half the way from the base, or among the first.
        near = rival.fit.chi2 < base.chi2 - 0.5 * (base.chi2 - best)
        if rank < 3 or near:
            clock = time.perf_counter()
            index = next(
                i
                for i, p in enumerate(rival.fit.guess.pieces)
                if p.effect.id == rival.effect and not p.nuisance
            )
            for inside in (False, True) if rank < 3 else (False,):
                better = release(engine, rival.fit, index, inside)
                if better.chi2 < rival.fit.chi2:
                    rival.fit = better
            rival.seconds += time.perf_counter() - clock
        if rival.effect not in out or score(rival.fit) < score(out[rival.effect].fit):
            out[rival.effect] = rival
    return sorted(out.values(), key=lambda r: score(r.fit)), threshold


def score(found: Fit) -> float:
    """Whitened misfit and a price for each parameter (Schwarz); less is better."""
    n = len(found.residual)
    return n * np.log(found.chi2 / n) + found.parameters * np.log(n)


@dataclass
class Step:
    """One effect taken in: its rivals then, what it gained, the fit with it."""

    rivals: list[Rival]
    gain: float  # of `score`
    fit: Fit


@dataclass
class Explanation:
    """What was found: the effects taken in, and how much is left."""

    base: Baseline
    steps: list[Step]
    final: Fit
    noise: list[Noise]
    threshold: float
    excess_before: float  # whitened misfit over the noise, a sample: base
    excess_after: float  # the same with the effects
    first: list[Rival]  # all rivals for the first effect, best first

    @property
    def selected(self) -> list[str]:
        return [p.effect.id for p in self.final.guess.pieces if not p.nuisance]

    @property
    def left(self) -> float:
        """Share of the excess that the effects do not explain."""
        return max(self.excess_after, 0.0) / max(self.excess_before, 1e-9)


def explain(base: Baseline, rng: np.random.Generator) -> Explanation:
    """Effects that account for what the base misses; none, one or several.

    Where the best account stays far above the noise, no form here is close, and the
    noise is not what to weigh by: the search is done again with all samples alike.
    """
    found = search(base, rng)
    engine = base.engine
    if found.excess_after > FAR and not engine.body:
        engine.body = True
        base.noise = weigh(engine, found.final)
        base.fit = fit(engine, base.fit.guess, fixed_base=base.fixed)
        found = search(base, rng)
    return found


def search(base: Baseline, rng: np.random.Generator) -> Explanation:
    """Forward from the base, one effect at a time, then swaps and backward."""
    engine, noise = base.engine, base.noise
    pool = candidates(engine, base.name, base.fixed)
    current = base.fit
    steps: list[Step] = []
    first: list[Rival] = []
    threshold = ENTRY
    while len(steps) < MOST_EFFECTS:
        found, limit = rivals(engine, current, pool, rng)
        if not steps:
            first, threshold = found, limit
        elif len(steps) == 1 and not mostly(base.fit, current):
            found = beam(engine, base.fit, first, found, pool, rng)
        found = simplest(current, found)
        if not found or not enough(
            engine, base.fit, current, found[0].fit, steps, limit
        ):
            break
        gain = score(current) - score(found[0].fit)
        steps.append(Step(found, gain, found[0].fit))
        current = found[0].fit
        if len(steps) == 2:
            current = swap(engine, base.fit, steps)
        elif len(steps) == 3:
            current = exchange(engine, current, pool, rng)
        # Better explained is better weighed: the noise is read off what is left.
        noise = weigh(engine, current)
        current = fit(engine, current.guess, fixed_base=base.fixed, iterations=4)
        steps[-1].fit = current
        base.fit = fit(engine, base.fit.guess, fixed_base=base.fixed, iterations=4)
    current = backward(engine, base.fit, current)
    n = len(engine.target)
    return Explanation(
        base,
        steps,
        current,
        noise,
        threshold,
        base.fit.chi2 / n - 1,
        current.chi2 / n - 1,
        first,
    )


def enough(
    engine: Engine,
    base: Fit,
    before: Fit,
    after: Fit,
    steps: list[Step],
    threshold: float,
) -> bool:
    """Whether an effect says enough to be named.

    The first must gain well over what noise gives. A later one must besides take a good
    part of what the earlier ones left: no formula is the true one, and what its form
    misses looks like a little of something else.
    """
    gain = score(before) - score(after)
    raw = before.chi2 - after.chi2
    if raw < 2.5 * threshold or gain < 20:
        return False
    if not steps:
        return True
    if sponge(engine, after, steps):
        return False
    # All gains by the weights of now: they change with what is left.
    so_far = (score(base) - score(before)) / len(steps)
    much, clean = adds(before, after, so_far)
    if len(steps) == 1:
        return much or clean
    # By the third, two forms have had their say; it must be as large as they were.
    large = gain > 0.5 * so_far
    return much and clean and large


def adds(before: Fit, after: Fit, first: float) -> tuple[bool, bool]:
    """Whether a later effect gains much beside the first, and whether it cleans up."""
    n = len(before.residual)
    gain = score(before) - score(after)
    left, then = before.chi2 / n - 1, after.chi2 / n - 1
    much = gain > max(80.0, LATER_SHARE * first) and then < LATER_LEFT * left
    # A small one must then leave next to nothing of what was left.
    return much, gain > 200.0 and max(then, 0.0) < CLEAN * left


def sponge(engine: Engine, found: Fit, steps: list[Step]) -> bool:
    """Whether the latest effect has a value of its own in most recordings.

    An error of mounting or zeroing is there in some recordings; what takes a little of
    all of them makes up for the form of another effect.
    """
    before = {p.effect.id for p in steps[-1].fit.guess.pieces}
    new = [p for p in found.guess.pieces if p.effect.id not in before]
    return any(p.effect.some and len(p.groups) > 0.6 * len(engine.chunks) for p in new)


def simplest(before: Fit, found: list[Rival]) -> list[Rival]:
    """The rivals with the simpler law first where a richer one is hardly better.

    A law that contains another (a flow law a linear dashpot) fits what the other makes
    at least as well, and better still whatever else is there.
    """
    for i, rival in enumerate(found[1:3], start=1):
        best = found[0]
        price = 0.01 * (score(before) - score(best.fit))
        fewer = rival.fit.parameters < best.fit.parameters
        if fewer and score(rival.fit) < score(best.fit) + price:
            return [rival, *found[:i], *found[i + 1 :]]
    return found


def swap(engine: Engine, base: Fit, steps: list[Step]) -> Fit:
    """The last pair, or a rival of the earlier effect with the later one, if better."""
    best = steps[-1].fit
    later = steps[-1].rivals[0].effect
    own = next(p for p in best.guess.pieces if p.effect.id == later and not p.nuisance)
    earlier = steps[-2]
    for rival in earlier.rivals[1:4]:
        if rival.effect == later or rival.fit.chi2 > base.chi2:
            continue
        trial = refine(engine, rival.fit, own, 10)
        # A simpler law may stand for a richer one at a small price: no form is true.
        price = 0.01 * steps[-1].gain if trial.parameters < best.parameters else -6.0
        if score(trial) < score(best) + price:
            best = trial
    return best


def mostly(base: Fit, found: Fit) -> bool:
    """Whether next to nothing is left of what the base missed."""
    n = len(base.residual)
    return found.chi2 / n - 1 < 0.1 * (base.chi2 / n - 1)


def beam(
    engine: Engine,
    base: Fit,
    first: list[Rival],
    found: list[Rival],
    pool: Sequence[Effect],
    rng: np.random.Generator,
) -> list[Rival]:
    """Later effects on top of the next best first ones, where those lead further.

    Two effects together can look like a third, which then comes first alone.
    """
    best = found
    top = score(base) - score(first[0].fit)
    for rival in first[1:3]:
        if score(base) - score(rival.fit) < 0.3 * top:
            break
        other, _ = rivals(engine, rival.fit, pool, rng, most=5)
        if other and (not best or score(other[0].fit) < score(best[0].fit) - 20):
            best = other
    return best


def exchange(
    engine: Engine, found: Fit, pool: Sequence[Effect], rng: np.random.Generator
) -> Fit:
    """Three effects with each in turn given up for what would then come instead."""
    best = found
    for name in [p.effect.id for p in found.guess.pieces if not p.nuisance]:
        kept = tuple(p for p in best.guess.pieces if p.effect.id != name or p.nuisance)
        if len(kept) == len(best.guess.pieces):
            continue
        guess = Guess(best.guess.units, best.guess.stiffness, kept)
        rest = fit(engine, guess, fixed_base=best.fixed_base, iterations=6)
        other, _ = rivals(engine, rest, pool, rng, most=4)
        if other and score(other[0].fit) < score(best) - 20:
            best = other[0].fit
    return best


def backward(engine: Engine, base: Fit, found: Fit) -> Fit:
    """The fit without the effects whose removal costs nothing."""
    names = [p.effect.id for p in found.guess.pieces if not p.nuisance]
    if len(names) < 2:
        return found
    for name in names:
        kept = tuple(p for p in found.guess.pieces if p.effect.id != name or p.nuisance)
        without = fit(
            engine,
            Guess(found.guess.units, found.guess.stiffness, kept),
            fixed_base=found.fixed_base,
            iterations=8,
        )
        if not any(adds(without, found, score(base) - score(without))):
            return backward(engine, base, without)
    return found
