r"""The next recording, computed: which programme separates the models that are left.

Several sets of effects may share the probability after a diagnosis. Each is a model
that was fitted to all recordings, so each predicts any other programme. A programme is
worth recording if the predictions lie apart by more than the models are wrong (Hunter
and Reiner 1965, doi:10.1080/00401706.1965.10490265).

*Distances.* Z_i is the prediction of model i over the RMS stress of the programme,
with the weights of samples that errors have (`metrics.weights`). A new specimen has a
scale of its own, so all predictions are first scaled to one another.

*Error.* A model misses a new recording by about its error on recordings left out, which
includes the uncertainty of its parameters, but not by less than replicates differ. Nor
is it nearer to the truth than the models are to one another (their RMS distance): so it
was with real recordings that were left out, whatever their programme. This error is
smooth, not white: it counts as `INDEPENDENT` samples, however many were recorded. Its
size varies between recordings as it did between those left out.

*Posterior.* For each model i in turn, errors :math:`\epsilon` are drawn as if it were
right; model j then shows the relative error :math:`|\epsilon + Z_i - Z_j|`. Where
prediction decides, this is one more fold, and the probabilities follow by the rule of
the diagnosis (`compare.shares`). Where the likelihood decides, they are

.. math:: P'(j) \propto P(j)\, |\epsilon + Z_i - Z_j|^{-K}

the likelihood of an error of unknown size, with K log odds for each unit of its
logarithm.

*Choice.* The programme is best by which the entropy of the posterior is expected to
fall most (Lindley 1956, doi:10.1214/aoms/1177728069; Box and Hill 1967,
doi:10.1080/00401706.1967.10490441; Atkinson and Fedorov 1975,
doi:10.1093/biomet/62.1.57). Its promise is the share of draws after which an effect in
question has 0.9 or more, and 0.5 without each of the new recordings, or all have less
than 0.1. If one recording promises less than `ENOUGH_SURE`, two or three specimens are
asked for.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softnn.axes import Axes
from softnn.contracts import Array, InputError
from softnn.mismatch.compare import FLOOR, LIKELY, NAMED, SURE, shares
from softnn.mismatch.prediction import ENOUGH, Candidate
from softnn.mismatch.programmes import (
    NONE_FITS,
    Library,
    Limits,
    Programme,
    Recorded,
    recorded,
)
from softnn.model_file import Stored, from_dict, in_units, to_dict
from softnn.report.phrases import listed, number, percent, plain
from softnn.state import BRANCHES, phases

if TYPE_CHECKING:
    from softnn.mismatch.judgement import Judgement

MOST, LEAST = 8, 0.02  # models compared at most; a less likely one is left out
INDEPENDENT = 8  # samples that a smooth error counts: one to two for each ramp
SCATTER = 0.3  # of a logarithm, by which errors differ between recordings, if unknown
WORTH = 4.0  # K: odds of the likelihood grow far more slowly than with each sample
ZEROED = 2e-3  # of the usual stress: error of a load cell without a load
DRAWS = 300  # errors drawn for each model
MOST_SPECIMENS = 3  # specimens that one programme is asked for
ENOUGH_SURE = 0.8  # promise from which no further specimen is asked for
MORE = 0.1  # least gain in the promise by a further specimen
UNSEEN = ("record_more", "record_unloading")  # actions: too little was shown
CLEAR = 3.0  # times the error, from which more distance makes no clearer picture
ALIKE = 0.05  # of the best gain, within which the shorter programme is taken
BEYOND = 1e3  # an error; a model that is off by more says nothing
FILE, DONE = "next_recording.csv", "diagnosis.json"
DRAWN = 300  # samples of a programme that are kept for figures


@dataclass(frozen=True)
class Alternative:
    """A set of effects, its probability, and its model fitted to all recordings.

    `nrmse` is its error on recordings that the fit did not use; `folds` (folds,) are
    these errors one by one, if prediction decided, else there are none.
    """

    effects: frozenset[str]
    probability: float
    nrmse: float
    model: Stored
    folds: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Score:
    """What a programme is worth: gain in nats, and probabilities after it.

    `sure`: an effect in question has 0.9 or more, or all have less than 0.1; `right`:
    and that is true.
    `apart` (models, models) is the RMS difference of two predictions over the RMS
    stress, `stress` (models, n) what the models predict, `error` the usual error (RMS
    over the RMS stress).
    """

    gain: float
    sure: float
    right: float
    apart: Array
    stress: Array
    error: float


@dataclass(frozen=True)
class Plan:
    """The programme to record next, or None if none is likely to settle the question.

    Without a programme, a score is that of the best one; without that, all alternatives
    predict alike. A programme has no score if no models are left to separate; then it
    covers all loadings.
    `cheap` is the best of those that take no new programme. The programme is to be run
    on this number of `specimens`, and the score is that of all of them.
    """

    among: Alternatives
    programme: Programme | None
    score: Score | None
    cheap: tuple[Programme, Score] | None = None
    specimens: int = 1

    def __repr__(self) -> str:
        if self.programme is None:
            return f"<Plan: {self._nothing()}>"
        known = self.score is not None and self.among.promises
        chance = f"; settles {percent(self.score.sure)}" if known and self.score else ""
        return f"<Plan: {self.programme.label}{chance}>"

    @property
    def time_s(self) -> Array:
        """Time of the programme (n,), s, from 0; empty if there is none."""
        p = self.programme
        return np.zeros(0) if p is None else p.time_s[p.scored :] - p.time_s[p.scored]

    @property
    def strain(self) -> Array:
        """Strain (n,), or the unit of a component; empty if there is no programme."""
        p = self.programme
        return np.zeros(0) if p is None else p.strain[p.scored :]

    @property
    def separates(self) -> list[str]:
        """The effects in question, the likeliest first."""
        return self.among.open

    def to_dict(self) -> dict[str, Any]:
        """Return `next_recording` of diagnosis.json."""
        p, score = self.programme, self.score
        out: dict[str, Any] = {
            "strain_programme": "no recording within these limits",
            "separates": self.separates,
            "why": self._nothing(),
            "programme": None,
            "differ": None,
            "expected": None,
            "predictions": [],
            "cheap": self._cheap(),
            "specimens": self.specimens,
        }
        if p is None:
            return out
        keep = np.unique(np.linspace(0, len(self.time_s) - 1, DRAWN).astype(int))
        out |= {
            "strain_programme": p.label,
            "programme": {
                "time_s": self.time_s[keep].tolist(),
                "strain": self.strain[keep].tolist(),
                **(
                    {}
                    if p.degC is None
                    else {"temperature_C": p.degC[p.scored :][keep].tolist()}
                ),
            },
            "why": "it shows first loading, unloading, reloading and relaxation of one "
            "specimen, where effects differ",
        }
        if score is None:
            return out
        shown = self._shown(score)
        return out | {
            "why": self._why(*shown[:2]),
            "differ": float(score.apart[shown[0], shown[1]]),
            "expected": self._expected(score),
            "predictions": [
                {
                    "if": self.among.named(i, shown),
                    "effects": sorted(self.among.sets[i].effects),
                    "probability": self.among.probability[i],
                    "stress": score.stress[i, keep].tolist(),
                }
                for i in shown
            ],
        }

    def _nothing(self) -> str:
        """Return why no programme is asked for."""
        if self.score is None:
            return (
                "the models that are left predict the same stress everywhere in this "
                "range, so any of them serves"
            )
        best = f" ({percent(self.score.sure)} at best)" if self.among.promises else ""
        names = [plain(n) for n in self.separates]
        what = f"{listed(names)} apart" if names[1:] else f"whether {names[0]} is there"
        return (
            f"no recording within these limits is likely to tell {what}{best}; larger "
            "strains, other rates or more time may (softnn plan)"
        )

    def _shown(self, score: Score) -> list[int]:
        """Return the likeliest model and two likely ones that differ most from it."""
        p = np.array(self.among.probability)
        first = int(p.argmax())
        worth = p * np.minimum(score.apart[first] / max(score.error, FLOOR), CLEAR)
        others = [int(i) for i in np.argsort(-worth, kind="stable") if i != first]
        return [first, *others[:2]]

    def _cheap(self) -> dict[str, Any] | None:
        if self.cheap is None:
            return None
        programme, score = self.cheap
        return {
            "strain_programme": programme.label,
            "kind": programme.kind,
            "expected": self._expected(score),
        }

    def _expected(self, score: Score) -> dict[str, float | None]:
        sure = score.sure if self.among.promises else None
        return {"sure": sure, "gain": score.gain, "error": score.error}

    def _why(self, a: int, b: int) -> str:
        """Return where two predictions lie farthest apart, with both stresses."""
        assert self.programme is not None
        assert self.score is not None
        chunk, first = self.programme.chunk, self.programme.scored
        branch = phases(chunk).branch[first:]
        stress = self.score.stress
        off = np.abs(stress[a] - stress[b])
        worst = max(
            range(len(BRANCHES)),
            key=lambda k: float(np.sum(off[branch == k] ** 2)),
        )
        k = int(np.where(branch == worst, off, -1.0).argmax())
        axes, library = self.among.axes, self.among.allowed()
        unit = axes.stress.unit
        return (
            f"{_on(BRANCHES[worst])}, at {library.level(float(self.strain[k]))} after "
            f"{number(float(self.time_s[k]))} s, the {axes.stress.name} is "
            f"{stress[a, k]:.4g} {unit} {self.among.named(a, (a, b))} and "
            f"{stress[b, k]:.4g} {unit} {self.among.named(b, (a, b))}"
        )


def _on(branch: str) -> str:
    return "during the hold" if branch == "hold" else f"on {branch}"


@dataclass(frozen=True)
class Alternatives:
    """The models that share the probability, and the limits of the recordings.

    `noise` and `floor` are over the RMS stress: the noise from sample to sample, and
    the difference between replicates (0 if it is not known). `action` is what to do, of
    `decision.TABLE`.
    """

    sets: tuple[Alternative, ...]
    known: Recorded
    axes: Axes
    noise: float
    floor: float = 0.0
    action: str = ""

    @cached_property
    def probability(self) -> list[float]:
        """Probabilities (models,) that sum to one."""
        total = sum(a.probability for a in self.sets)
        return [a.probability / total for a in self.sets]

    @cached_property
    def effects(self) -> list[str]:
        """Ids of all effects in any set, the likeliest first."""
        chance: dict[str, float] = {}
        for one, p in zip(self.sets, self.probability, strict=True):
            for name in one.effects:
                chance[name] = chance.get(name, 0.0) + p
        return sorted(chance, key=lambda n: (-chance[n], n))

    @cached_property
    def _has(self) -> Array:
        """Return 1 (models, effects) where a set has an effect, else 0."""
        table = [[n in a.effects for n in self.effects] for a in self.sets]
        return np.array(table, float).reshape(len(self.sets), len(self.effects))

    @property
    def open(self) -> list[str]:
        """Effects that are neither sure nor unlikely, the likeliest first."""
        chance = np.array(self.probability) @ self._has
        every = zip(self.effects, chance, strict=True)
        return [n for n, p in every if LIKELY <= p < SURE]

    @property
    def promises(self) -> bool:
        """Whether it can be said how likely a recording settles the question.

        Where the likelihood decides it cannot: fitted anew, a model that is wrong comes
        nearer to the recording than it does here, and what was promised did not come.
        """
        return self.sets[0].folds.size > 0

    def named(self, index: int, among: Sequence[int]) -> str:
        """Return what sets a model apart from others (indices), as "if slack"."""
        others = [self.sets[i].effects for i in among if i != index]
        shared = frozenset.intersection(*others) if others else frozenset[str]()
        mine = self.sets[index].effects
        own = [n for n in self.effects if n in mine - shared]
        lacks = [n for n in self.effects if n in shared - mine]
        if own:
            return f"if {listed([plain(n) for n in own])}"
        if lacks:
            return f"without {listed([plain(n) for n in lacks])}"
        return "if nothing more" if mine else "if nothing is missing"

    def allowed(self, limits: Limits | None = None) -> Library:
        """Return the programmes within these limits."""
        return Library(self.known, limits or Limits(), self.axes)

    # -- predictions -------------------------------------------------------------------

    def stress(self, programme: Programme) -> Array:
        """Return the stress (models, n) that each model predicts."""
        blank = programme.kind == "blank"
        out = []
        for one in self.sets:
            model = _without_specimen(one.model) if blank else one.model
            (whole,) = model.stress([""], [programme.chunk], [None], False)
            out.append(whole[programme.scored :])
        return np.array(out)

    def score(self, programme: Programme, specimens: int = 1) -> Score:
        """Return the worth of a programme run on this number of specimens.

        The draws are the same for all programmes.
        """
        stress, blank = self.stress(programme), programme.kind == "blank"
        root = np.sqrt(programme.weights / stress.shape[1])
        error, swing = self._errors(stress.shape[1])
        if blank:
            # Without a specimen a load cell reads zero, whatever the laws are.
            loaded = root * self.stress(replace(programme, kind="repeat"))
            place, size = root * stress, float(np.linalg.norm(loaded.mean(axis=0)))
            error = np.full(len(error), max(self.noise, ZEROED))
        else:
            place, size = self._scaled(root * stress)
        z = (place - place.mean(axis=0)) / max(size, 1e-300)
        if not np.isfinite(z).all():
            return Score(0.0, 0.0, 0.0, np.zeros((len(z),) * 2), stress, 0.0)
        turn, width, _ = np.linalg.svd(z, full_matrices=False)
        apart = np.linalg.norm(z[:, None] - z[None], axis=2)
        p = np.array(self.probability)
        mean = 0.0 if blank else float(np.sqrt(p @ apart**2 @ p))
        drawn = np.hypot(error, mean)
        after, *fewer = self._after(turn * width, drawn, swing, specimens)
        return Score(
            float(_entropy(p) - p @ _entropy(after).mean(axis=1)),
            float(p @ self.settled(after, fewer).mean(axis=1)),
            float(p @ self._right(after, fewer).mean(axis=1)),
            apart,
            stress,
            float(p @ error),
        )

    def _errors(self, samples: int) -> tuple[Array, Array]:
        """Return the usual error (models,) of each model and its spread, in logarithms.

        White noise averages out; errors of laws and differences of specimens stay.
        """
        error = np.array([a.nrmse for a in self.sets])
        swing = np.full(len(error), SCATTER)
        if self.sets[0].folds.size:
            log = np.log(np.array([a.folds for a in self.sets]) + FLOOR)
            return np.maximum(np.exp(log.mean(axis=1)), self.floor), log.std(axis=1)
        smooth = np.sqrt(np.maximum(error**2 - self.noise**2, 0.0))
        white = self.noise * np.sqrt(INDEPENDENT / samples)
        least = max(white, self.floor, FLOOR)
        return np.maximum(smooth, least), swing

    def _scaled(self, stress: Array) -> tuple[Array, float]:
        """Return predictions (models, n) at the scale of their mean, and its norm."""
        mean = np.array(self.probability) @ stress
        square = float(mean @ mean)
        dot = stress @ mean
        by = np.where(dot > 0.1 * square, square / np.where(dot > 0, dot, 1.0), 1.0)
        return by[:, None] * stress, float(np.sqrt(square))

    def _after(
        self, place: Array, error: Array, swing: Array, specimens: int = 1
    ) -> list[Array]:
        """Return probabilities (truth, draws, models) after recordings of each truth.

        Where prediction decides, those without each of the new recordings follow: a
        name has to stay there (`compare.Names.least`).
        `place` (models, k) are the predictions, `error` (models,) their errors, both
        over the RMS stress; `swing` is the spread of the errors, in logarithms.
        """
        count, wide = place.shape
        rng, many = np.random.default_rng(0), (DRAWS, specimens)
        unit = rng.standard_normal(many)
        inside = rng.standard_normal((*many, wide)) / np.sqrt(INDEPENDENT)
        rest = max(INDEPENDENT - count + 1, 1)
        outside = rng.chisquare(rest, many) / INDEPENDENT
        folds = np.array([a.folds for a in self.sets])
        sizes = np.array([len(a.effects) for a in self.sets])
        log, parts = np.log(np.array(self.probability)), self.known.count + specimens
        out = np.empty((1 + specimens * bool(folds.size), count, DRAWS, count))
        for i in range(count):
            size = error[i] * np.exp(swing[i] * unit)  # (draws, specimens)
            miss = (size[..., None] * inside)[:, None] + (place[i] - place)[:, None]
            new = (miss**2).sum(axis=-1) + (size**2 * outside)[:, None]
            new = np.sqrt(new)  # (draws, models, specimens)
            if folds.size:
                known = np.broadcast_to(folds, (DRAWS, *folds.shape))
                every = np.concatenate([known, new], axis=2)
                out[0, i] = shares(every, sizes, 1 / (parts - 1))
                for k in range(specimens):
                    fewer = np.delete(new, k, axis=2)
                    left = np.concatenate([known, fewer], axis=2)
                    out[1 + k, i] = shares(left, sizes, 1 / max(parts - 2, 1))
                continue
            odds = log - WORTH * np.log(new + FLOOR).sum(axis=-1)
            weight = np.exp(odds - odds.max(axis=1, keepdims=True))
            out[0, i] = weight / weight.sum(axis=1, keepdims=True)
        return list(out)

    def _chance(self, probability: Array, specimens: int) -> Array:
        """Return the probability (..., open) of each effect in question, afterwards."""
        has = self._has[:, [self.effects.index(n) for n in self.open]]
        few = self.known.count + specimens if self.sets[0].folds.size else ENOUGH
        spare = 1 / (few + 2) if few < ENOUGH else 0.0
        return np.asarray(probability @ has * (1 - spare))

    def _sure(self, after: Array, fewer: Sequence[Array]) -> NDArray[np.bool]:
        """Return whether (..., open) effects in question are sure, and stay named."""
        new = max(len(fewer), 1)
        sure = self._chance(after, new) >= SURE
        for less in fewer:
            sure &= self._chance(less, new) >= NAMED
        return sure

    def settled(self, after: Array, fewer: Sequence[Array] = ()) -> NDArray[np.bool]:
        """Return whether probabilities (..., models) after recordings settle anything.

        An effect in question is then sure, or none of them is likely. `fewer` are the
        probabilities without each of the new recordings.
        """
        none = self._chance(after, max(len(fewer), 1)) < LIKELY
        return np.asarray(self._sure(after, fewer).any(axis=-1) | none.all(axis=-1))

    def _right(self, after: Array, fewer: Sequence[Array]) -> NDArray[np.bool]:
        """Return (truth, draws): settled, and the sure effects are true."""
        has = self._has[:, [self.effects.index(n) for n in self.open]] > 0
        false = (self._sure(after, fewer) & ~has[:, None]).any(axis=-1)
        none = self._chance(after, max(len(fewer), 1)) < LIKELY
        lost = none.all(axis=-1) & np.any(has, axis=1, keepdims=True)
        return np.asarray(self.settled(after, fewer) & ~false & ~lost)

    # -- the plan ----------------------------------------------------------------------

    def plan(self, limits: Limits | None = None) -> Plan | None:
        """Return the best programme within the limits; None if nothing is in question.

        Raises `InputError` if no programme fits into them.
        """
        library = self.allowed(limits)
        unknown = len(self.sets) < 2 or not self.open
        if self.action in UNSEEN or (unknown and "record" in self.action):
            return Plan(self, library.covering(), None)
        if unknown:
            return None
        every = library.programmes()
        # Far beyond the recordings a model may run away; its prediction says nothing.
        with np.errstate(all="ignore"):
            scored = [(p, self.score(p)) for p in every]
        scored = [(p, s) for p, s in scored if np.isfinite(s.gain)]
        own = [(p, s) for p, s in scored if p.kind == "programme"]
        if not own and every:
            return Plan(self, library.covering(), None)
        if not own:
            raise InputError(NONE_FITS)
        cheap = max(
            ((p, s) for p, s in scored if p.kind != "programme" and s.sure >= LIKELY),
            key=lambda f: f[1].gain,
            default=None,
        )
        if all(self._alike(s) for _, s in scored):
            missing = self.action == "record"  # the error is too large for any use
            return Plan(self, library.covering() if missing else None, None)
        most = max(s.gain for _, s in own)
        near = [(p, s) for p, s in own if s.gain >= most - ALIKE * abs(most)]
        programme, score = min(near, key=lambda f: f[0].seconds)
        specimens = 1
        while score.sure < ENOUGH_SURE and specimens < MOST_SPECIMENS:
            more = self.score(programme, specimens + 1)
            if self.known.continued or more.sure < score.sure + MORE:
                break
            specimens, score = specimens + 1, more
        if score.sure >= LIKELY:
            return Plan(self, programme, score, cheap, specimens)
        # The one that tells most of all may still not settle it; another may.
        others = [*own, *([cheap] if cheap else [])]
        programme, score = max(others, key=lambda f: f[1].sure)
        return Plan(self, programme if score.sure >= LIKELY else None, score)

    def _alike(self, score: Score) -> bool:
        """Return whether the predictions of all sets in question agree."""
        return bool(score.apart.max() <= score.error)

    # -- storing -----------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready; `from_dict` takes it back."""
        return {
            "recorded": self.known.to_dict(),
            "noise": self.noise,
            "floor": self.floor,
            "action": self.action,
            "sets": [
                {
                    "effects": sorted(a.effects),
                    "probability": a.probability,
                    "nrmse": a.nrmse,
                    "folds": a.folds.tolist(),
                    "model": a.model.source,
                }
                for a in self.sets
            ],
        }

    @classmethod
    def from_dict(cls, given: Any) -> Alternatives:
        """Raise `InputError` for what holds no alternatives."""
        try:
            sets = []
            for one in given["sets"]:
                model = from_dict(one["model"])
                if not isinstance(model, Stored):
                    raise InputError("alternatives hold a network; a model is needed")
                effects = frozenset(p.effect.id for p in model.pieces)
                sets.append(
                    Alternative(
                        effects & frozenset(map(str, one["effects"])),
                        _share(one["probability"]),
                        _share(one["nrmse"]),
                        replace(model, needs_simulated=False, simulation=None),
                        np.array([_share(x) for x in one["folds"]], float),
                    )
                )
            noise, floor = _share(given["noise"]), _share(given["floor"])
            known = Recorded.from_dict(given["recorded"])
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"alternatives cannot be read: {error!r}") from None
        if len({len(a.folds) for a in sets}) > 1:
            raise InputError("alternatives hold different numbers of folds")
        if not sets or len(sets) > MOST or not sum(a.probability for a in sets) > 0:
            raise InputError(
                f"alternatives hold {len(sets)} sets; allowed are 1 to {MOST}"
            )
        return cls(
            tuple(sets),
            known,
            sets[0].model.axes,
            noise,
            floor,
            str(given["action"]),
        )


def _share(value: Any) -> float:
    x = float(value)
    if not 0 <= x < 1e6:
        raise InputError(f"alternatives hold {x}; allowed is a number from 0")
    return x


def _entropy(p: Array) -> Array:
    """Return the entropy of probabilities (..., models), nats."""
    return np.asarray(-(p * np.log(np.maximum(p, 1e-300))).sum(axis=-1))


def _without_specimen(model: Stored) -> Stored:
    """Return what the machine reads without a specimen: its own force and drift."""
    kept = [
        (p, own)
        for p, own in zip(model.pieces, model.own, strict=True)
        if p.effect.stage != "material"
    ]
    pieces, own = zip(*kept, strict=True) if kept else ((), ())
    return replace(
        model,
        stiffness=np.zeros_like(model.stiffness),
        pieces=pieces,
        own=own,
        learned=None,
    )


def alternatives(told: Judgement, history: str, axes: Axes) -> Alternatives:
    """Return the sets of effects that share the probability of a judgement.

    By likelihood a cause that is not on the list is not among them, since it has no
    model. `history` is that of the case.
    """
    best: dict[frozenset[str], tuple[float, Any]] = {}
    total: dict[frozenset[str], float] = {}
    every = zip(told.posterior.hypotheses, told.posterior.probability, strict=True)
    for one, p in every:
        if one.other and told.judged_by == "likelihood":
            continue
        total[one.effects] = total.get(one.effects, 0.0) + float(p)
        if one.effects not in best or p > best[one.effects][0]:
            best[one.effects] = float(p), one.account
    ranked = sorted(total, key=lambda s: -total[s])[:MOST]
    ranked = [s for s in ranked if total[s] >= LEAST] or ranked[:1]
    data, sets, need = told.engine.data, [], told.decision.need
    for effects in ranked:
        account = best[effects][1]
        guess, own = in_units(account.fit.guess, axes)
        stored = from_dict(to_dict(guess, data.names, history, False, axes=own))
        assert isinstance(stored, Stored)
        folds = account.nrmse if isinstance(account, Candidate) else np.zeros(0)
        folds, error = (
            np.minimum(np.nan_to_num(x, nan=BEYOND), BEYOND)
            for x in (folds, told.heldout(account).nrmse)
        )
        sets.append(Alternative(effects, total[effects], float(error), stored, folds))
    known = recorded(
        data.names, data.chunks, data.stress_MPa, data.continued, axes.strain.one
    )
    rms = float(np.sqrt(np.mean(told.engine.target**2)))
    return Alternatives(
        tuple(sets),
        known,
        own,
        told.noise_MPa / max(rms, 1e-300),
        need.floor.nrmse if need.floor else 0.0,
        told.decision.action,
    )


def write(plan: Plan | None, folder: Path) -> Path | None:
    """Write next_recording.csv into `folder`; return it, or None without a plan."""
    from softnn.readers.tidy import write_table

    path = folder / FILE
    if plan is None or plan.programme is None:
        return None
    columns: dict[str, Any] = {
        "time_s": plan.time_s,
        plan.among.axes.strain.column: plan.strain,
    }
    if plan.programme.degC is not None:
        columns["temperature_C"] = plan.programme.degC[plan.programme.scored :]
    write_table(path, columns)
    return path


def read(folder: Path) -> tuple[Path, dict[str, Any]]:
    """Return the folder and content of a diagnosis.json in `folder`, or one below it.

    Raises `InputError` where there is none, or where several are.
    """
    found = [folder] if (folder / DONE).is_file() else []
    if not found and folder.is_dir():
        found = sorted(p.parent for p in folder.glob(f"*/{DONE}"))
    if not found:
        raise InputError(
            f"no {DONE} in it; name the folder that softnn diagnose wrote (--out)",
            file=folder,
        )
    if len(found) > 1:
        raise InputError(
            f"holds {len(found)} diagnoses; name one, as {found[0]}", file=folder
        )
    path = found[0] / DONE
    try:
        result = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"not a JSON file: {error}", file=path) from None
    if not isinstance(result, dict) or not isinstance(result.get("alternatives"), dict):
        raise InputError(
            "holds no alternatives; it is of an earlier softnn: diagnose again",
            file=path,
        )
    return found[0], result
