"""The decision: which effects are named, which candidate corrects, and the verdict.

`decide` is a pure function of a posterior, of errors on recordings left out, and of
what these recordings can show. It fits nothing; its result is frozen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from softnn.effects import EFFECTS
from softnn.fit import Fit
from softnn.mismatch.posterior import NAMED, SURE, Posterior, Tried
from softnn.mismatch.verify import Heldout

NEAR = 0.05  # misfit over noise, a sample, up to which only noise is left
HELPS = 1 / 3  # of the held-out misfit over the noise, that effects must remove
FEWEST = 30  # samples in all; with fewer no effect is named


@dataclass(frozen=True)
class Shows:
    """What the recordings can show, whatever the candidates are."""

    few: bool  # too few samples to distinguish effects
    only_loading: bool  # first loading alone, on which most effects look alike


@dataclass(frozen=True)
class Decision:
    """The decision. `account` corrects the simulation: the base alone if none does.

    `tellable`: whether these recordings can separate effects of the material. `helps`:
    whether the correcting candidate predicts left-out recordings clearly better than
    the base does.
    """

    names: tuple[str, ...]
    verdict: str
    account: Tried
    before: Heldout
    after: Heldout
    shows: Shows
    tellable: bool
    helps: bool


def of_material(found: Fit) -> bool:
    """Return whether a fit has an effect of the material."""
    return any(
        p.effect.stage == "material" for p in found.guess.pieces if not p.nuisance
    )


def named_in_order(account: Tried) -> tuple[str, ...]:
    """Return the effects of a candidate in the order in which they act."""
    return tuple(p.effect.id for p in account.fit.guess.pieces if not p.nuisance)


def decide(
    posterior: Posterior,
    base: Tried,
    heldout: Callable[[Tried], Heldout],
    shows: Shows,
    judged_apart: Callable[[Tried], frozenset[str]],
    misfit: Callable[[Tried], float],
) -> Decision:
    """Decide where some candidate may explain the recordings down to the noise.

    `heldout` returns the error of a candidate on recordings left out. `judged_apart`
    returns those of its effects that single recordings show without a model; these need
    not predict other recordings. `misfit` returns the misfit of a candidate in units of
    the noise: 1 is noise alone.
    """
    best, before = posterior.best, heldout(base)
    after = heldout(best)
    tellable = not shows.few and not (of_material(best.fit) and shows.only_loading)

    def helps(account: Tried, after: Heldout) -> bool:
        # If the base leaves noise alone, or only faults of single recordings are
        # named, no prediction could become better.
        void = before.misfit < 1 + NEAR or account.effects <= judged_apart(account)
        return bool(void or before.misfit - after.misfit > HELPS * (before.misfit - 1))

    account, names = best, tuple[str, ...]()
    if best.effects == posterior.selected:
        names = named_in_order(best)
        if not (tellable and helps(best, after)):
            names = ()
            alone = judged_apart(best)
            rest = [h.account for h in posterior.hypotheses if h.effects == alone]
            rest = [a for a in rest if judged_apart(a)]
            if rest and not shows.few:
                account, names = rest[0], named_in_order(rest[0])
                after = heldout(account)
    verdict = _verdict(posterior, names, shows, tellable, misfit(account))
    first = account, after
    if verdict not in ("explained", "nothing_missing"):
        account, after = _corrects(
            posterior, names, base, before, first, heldout, shows
        )
    elif not names:
        account, after = base, before
    good = helps(account, after)
    decision = Decision(names, verdict, account, before, after, shows, tellable, good)
    if not (account.effects and good):
        return replace(decision, account=base, after=before)
    return decision


def decide_by_prediction(
    posterior: Posterior,
    base: Tried,
    best: Tried,
    heldout: Callable[[Tried], Heldout],
    shows: Shows,
    judged_apart: Callable[[Tried], frozenset[str]],
) -> Decision:
    """Decide where no candidate explains the recordings down to the noise.

    `best` is the candidate that predicts best and nowhere worse than the base; it
    corrects the simulation, whatever is named. An effect is named if every set without
    it predicts worse (`prediction.posterior`). If the base predicts as well as any
    candidate, only faults of single recordings may be named.
    """
    apart = frozenset[str]().union(
        *(judged_apart(h.account) for h in posterior.hypotheses)
    )
    apart = apart & posterior.selected
    tellable = not (shows.few or shows.only_loading)
    helps = bool(best.effects - apart) and tellable
    wanted = posterior.selected if helps else apart
    if shows.few:
        wanted = frozenset()
    # The correction of these recordings includes their own faults.
    whole = best.effects | (apart if not shows.few else frozenset())
    same = [h.account for h in posterior.hypotheses if h.effects == whole]
    account = same[0] if same and tellable else best
    if not tellable:
        account = base
    order = {name: i for i, name in enumerate(e.id for e in EFFECTS)}
    names = tuple(sorted(wanted, key=order.__getitem__))
    if shows.few:
        verdict = "undetermined"
    elif names:
        sure = min(posterior.effects[n] for n in names) >= SURE
        verdict = "partly_explained" if sure else "undetermined"
    else:
        lost = (not helps and tellable) or posterior.nothing_named >= NAMED
        verdict = "unexplained" if lost else "undetermined"
    before = heldout(base)
    after = heldout(account) if account.effects else before
    return Decision(names, verdict, account, before, after, shows, tellable, helps)


def _corrects(
    posterior: Posterior,
    names: tuple[str, ...],
    base: Tried,
    before: Heldout,
    named: tuple[Tried, Heldout],
    heldout: Callable[[Tried], Heldout],
    shows: Shows,
) -> tuple[Tried, Heldout]:
    """Return the best predicting of the likely sets that hold all names, and its error;
    the base where nothing is named and no set predicts better."""
    first = named if names else (base, before)
    tried = [first]
    # Beyond first loading anything may be missing; candidates differ there.
    for account in () if shows.few or shows.only_loading else posterior.readings():
        if account.effects > set(names):
            left = heldout(account)
            # The misfit is linearised; nonlinear laws may fit worse than it says.
            tried += [(account, left)] * (left.nrmse <= first[1].nrmse)
    return min(tried, key=lambda t: t[1].misfit)


def _verdict(
    posterior: Posterior,
    names: tuple[str, ...],
    shows: Shows,
    tellable: bool,
    misfit: float,
) -> str:
    if shows.few:
        return "undetermined"
    if names:
        if min(posterior.effects[n] for n in names) < SURE:
            return "undetermined"
        beside = posterior.other > NAMED or misfit > 1 + NEAR
        return "partly_explained" if beside else "explained"
    if posterior.nothing >= NAMED:
        return "nothing_missing"
    known = posterior.selected and tellable  # and yet perhaps not named
    unexplained = known or posterior.nothing_named >= NAMED
    missing = posterior.nothing <= 1 - SURE  # said only if it is sure
    return "unexplained" if missing and unexplained else "undetermined"
