"""From a fitted base to the answer: search, posterior, decision.

The search asks one question first: can any candidate explain the recordings down to the
noise? If so, the likelihood decides. If not, prediction does (`prediction`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from softnn import progress
from softnn.fit import Engine, Fit, Piece, fit
from softnn.mismatch import faults, locate, prediction, replicates, verify, zeros
from softnn.mismatch.accounts import Search, search
from softnn.mismatch.base import Baseline, each_apart, weigh, weigh_by
from softnn.mismatch.candidates import so_far
from softnn.mismatch.compare import NAMED, SURE
from softnn.mismatch.decision import (
    DROWNED,
    FEWEST,
    TOLERANCE,
    Decision,
    Need,
    Shows,
    decide,
    decide_by_prediction,
)
from softnn.mismatch.evidence import Weigher
from softnn.mismatch.floor import floor
from softnn.mismatch.mistakes import likeliest, mistaken, with_mistakes
from softnn.mismatch.posterior import Posterior, Tried, posterior
from softnn.mismatch.prediction import Candidate
from softnn.mismatch.replicates import Replicates, are_specimens
from softnn.noise import Noise, quantum, white

# Nats a sample that a discrepancy gains beside a sketch. The concealed cases of another
# hand stay below 1.4, nearly all real recordings lie beyond 3 (up to 5,000); below it
# the search decides.
FAR = 3.0


@dataclass(frozen=True)
class Judgement:
    """All candidates, the decision, and the simulations before and after correction.

    `engine` has the samples of the search, `fine` those of the report. `before` and
    `after` are fits to the latter, without and with the correction. `judged_by` is
    "likelihood", or "prediction" if no candidate reaches the noise.
    """

    base: Baseline
    noise: list[Noise]
    candidates: Sequence[Tried]  # the first is the base alone
    posterior: Posterior
    decision: Decision
    fine: Engine
    before: Fit
    after: Fit
    judged_by: str

    @property
    def engine(self) -> Engine:
        return self.base.engine

    @property
    def names(self) -> list[str]:
        """Ids of the effects named, in the order in which they act."""
        return list(self.decision.names)

    @property
    def verdict(self) -> str:
        return self.decision.verdict

    @property
    def noise_MPa(self) -> float:
        """Root mean square of the noise over the samples of the search."""
        every = zip(self.noise, self.engine.data.stress_MPa, strict=True)
        square = [n.sigma(s[np.isfinite(s)]) ** 2 for n, s in every]
        return float(np.sqrt(np.concatenate(square).mean()))

    def heldout(self, account: Tried) -> verify.Heldout:
        """Return the error of a candidate on recordings left out."""
        if isinstance(account, Candidate):
            return account.heldout
        return verify.heldout(self.engine, account.fit)

    def log_odds(self, account: Tried) -> float:
        """Return the log odds of a candidate over the base, without priors, nats."""
        return account.log_odds - self.candidates[0].log_odds


def judge(base: Baseline, tolerance: float = TOLERANCE) -> Judgement:
    """Search, weigh and decide for the best fit of a base; return the judgement.

    `tolerance` is the error of prediction that the user finds good enough.
    """
    so_far(base.engine, base.fit)
    progress.part("how far from the noise", 0)
    if not far_from_noise(base, prediction.sketch(base, every=True)):
        found = search(base)
        if found.reaches_noise:
            return by_likelihood(found, tolerance)
        base = found.base
    return by_prediction(base, tolerance)


def far_from_noise(base: Baseline, first: Fit) -> bool:
    """Return whether no search could explain the recordings down to the noise.

    `first` is a sketch with two effects. What it misses is compared with the noise that
    differences of neighbouring samples allow. If a smooth function of the state gains
    more than `FAR` nats a sample beside it, the laws are wrong, and their likelihoods
    say nothing.
    """
    engine, fixed = base.engine.under(None, None), base.fixed
    for _ in range(2):
        weigh(engine, first)
        first = fit(engine, first.guess, fixed_base=fixed, iterations=2)
    evidence = Weigher(engine, first).weigh(first)
    return (evidence.beside - evidence.bare) / len(first.residual) > FAR


def _shows(engine: Engine) -> Shows:
    noise = np.array([white(s) for s in engine.fine.data.stress_MPa])
    size = [float(np.sqrt(np.nanmean(s**2))) for s in engine.fine.data.stress_MPa]
    drowned = bool((noise > DROWNED * np.array(size)).all())
    few = len(engine.target) < FEWEST
    return Shows(few, locate.only_loading(engine), drowned)


def _need(base: Baseline, found: Fit, tolerance: float) -> Need:
    specimens = base.said or are_specimens(base.engine)
    return Need(tolerance, floor(base.engine, found.guess, specimens))


def by_likelihood(found: Search, tolerance: float = TOLERANCE) -> Judgement:
    """Judge where some candidate explains the recordings down to the noise."""
    base, engine = found.base, found.base.engine
    progress.part("recordings left out", 0)
    probable = with_mistakes(posterior(found.accounts), engine)
    own = replicates.stand_out(engine, probable.best.fit) + zeros.at_rest(engine)
    for fault in own:
        probable = faults.asked(probable, fault, engine)

    def judged_apart(account: Tried) -> frozenset[str]:
        return mistaken(account.fit) | faults.named(own, account.fit)

    decision = decide(
        probable,
        found.accounts[0],
        lambda account: verify.heldout(engine, account.fit),
        _shows(engine),
        judged_apart,
        lambda account: account.fit.chi2 / len(engine.target),
        _need(base, probable.best.fit, tolerance),
    )
    fine = engine.fine
    weigh_by(fine, found.noise)
    before, after = _fits(fine, base, decision)
    return Judgement(
        base,
        found.noise,
        found.accounts,
        probable,
        decision,
        fine,
        before,
        after,
        "likelihood",
    )


def by_prediction(base: Baseline, tolerance: float = TOLERANCE) -> Judgement:
    """Judge where no candidate explains the recordings down to the noise.

    Without labels, replicates whose stress differs by a factor each are different
    specimens. Faults of single recordings come next: every candidate has the likely
    ones. The comparison of replicates is repeated beside the best candidate.
    """
    engine = prediction.alike(base.engine)
    if not base.said and are_specimens(engine):
        base = _each_of_its_own(base)
    own = {f.effect: f for f in zeros.at_rest(engine) + faults.at_limit(engine)}

    def pieces() -> list[Piece]:
        return [f.piece for f in own.values() if f.likely]

    def ask(found: Fit) -> bool:
        """Return whether replicates show another likely fault that predicts better."""
        new = [
            fault
            for fault in replicates.stand_out(engine, found)
            if fault.effect not in own or not own[fault.effect].likely
        ]
        new = [
            fault
            for fault in new
            if not fault.likely or prediction.worth_it(engine, found, fault.piece)
        ]
        own.update({f.effect: f for f in new})
        return any(f.likely for f in new)

    if Replicates(engine).groups:
        ask(prediction.sketch(base, pieces()))
    given = pieces()
    found = prediction.search(base, given)
    known = dict(own)
    if ask(prediction.best(found).fit):
        again = prediction.search(base, pieces())
        pair = prediction.best(found).fit, prediction.best(again).fit
        new = [f.piece for k, f in own.items() if f.likely and f is not known.get(k)]
        if all(prediction.better(engine, *pair, piece) for piece in new):
            given, found = pieces(), again
        else:
            own = known
    progress.part("the decision", 0)
    bare = prediction.alone(base, found)
    need = _need(base, prediction.best(found).fit, tolerance)
    apart = {f.effect: f.chance for f in own.values()}
    if mistake := likeliest(found[0].fit, engine):
        apart["gain_error"] = max(mistake[0], apart.get("gain_error", 0.0))
    enough = bare.heldout.nrmse <= need.limit
    probable, names = prediction.posterior(found, apart, enough)
    steady = {n for n, p in names.least.items() if p >= NAMED}
    sure = frozenset(n for n in steady if names.probability[n] >= SURE)
    best = prediction.best(found, sure, base.coarse)
    likely = frozenset(n for n, p in apart.items() if p >= NAMED)
    if "gain_error" in likely - best.given and (wrong := likeliest(best.fit, engine)):
        best = replace(best, fit=wrong[1])
    decision = decide_by_prediction(
        probable,
        bare,
        replace(best, given=frozenset()),
        lambda one: cast(Candidate, one).heldout,
        _shows(engine),
        need,
        likely,
        probable.selected - steady,
        names.classes,
    )
    noise, left = _noise_left(engine.fine, best.fit)
    fine = prediction.alike(engine.fine, max(left / engine.level, 1e-9))
    before, after = _fits(fine, base, decision)
    return Judgement(
        replace(base, engine=engine),
        noise,
        [bare, *(replace(c, given=frozenset()) for c in found)],
        probable,
        decision,
        fine,
        before,
        after,
        "prediction",
    )


def _each_of_its_own(base: Baseline) -> Baseline:
    """Return the base with a scale for each recording, as a specimen of its own."""
    pieces = (*base.fit.guess.pieces, each_apart(base.engine.data))
    guess = replace(base.fit.guess, pieces=pieces)
    return replace(base, fit=fit(base.engine, guess, fixed_base=base.fixed))


def _fits(fine: Engine, base: Baseline, decision: Decision) -> tuple[Fit, Fit]:
    before = fit(fine, base.fit.guess, fixed_base=base.fixed, iterations=2)
    if not decision.account.effects:
        return before, before
    guess = decision.account.fit.guess
    return before, fit(fine, guess, fixed_base=base.fixed, iterations=3)


def _noise_left(fine: Engine, best: Fit) -> tuple[list[Noise], float]:
    """Return the white noise of each recording, and the RMS of the best residual, MPa.

    No candidate reaches the noise, so the residual cannot show it. Differences between
    neighbouring samples of the stress show it; the RMS of the residual is its limit.
    """
    miss = fine.target - fine.run(best.guess, False)[0]
    left = float(np.sqrt(fine.share @ miss**2 / fine.share.sum()))
    return [
        Noise(min(white(s), left), 0.0, quantum(s)) for s in fine.data.stress_MPa
    ], left
