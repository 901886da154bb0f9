"""The decision: which effects are named, which candidate corrects, and the verdict.

Pure functions of a posterior, of errors on recordings left out, and of what these
recordings can show. They fit nothing; their results are frozen. The verdict and what to
do follow from one table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from softnn.effects import EFFECTS
from softnn.fit import Fit
from softnn.mismatch.compare import HARM, NAMED, SURE, Class
from softnn.mismatch.floor import Floor
from softnn.mismatch.posterior import Posterior, Tried
from softnn.mismatch.verify import Heldout

NEAR = 0.05  # misfit over noise, a sample, up to which only noise is left
HELPS = 1 / 3  # of the held-out misfit over the noise, that effects must remove
FEWEST = 30  # samples in all; with fewer no effect is named
TOLERANCE = 0.02  # error of prediction that is good enough, unless the user says
DROWNED = 0.5  # noise over stress, from which a recording shows nothing else


@dataclass(frozen=True)
class Shows:
    """What the recordings can show, whatever the candidates are."""

    few: bool  # too few samples to distinguish effects
    only_loading: bool  # first loading alone, on which most effects look alike
    noise: bool = False  # the stress is hardly more than noise


@dataclass(frozen=True)
class Need:
    """The error up to which a prediction is good enough, and why.

    `tolerance` is what the user needs; `floor` is what replicates differ by.
    """

    tolerance: float = TOLERANCE
    floor: Floor | None = None

    @property
    def limit(self) -> float:
        """The larger of both: no law predicts better than specimens repeat."""
        return max(self.tolerance, self.floor.high if self.floor else 0.0)


@dataclass(frozen=True)
class Decision:
    """The decision. `account` corrects the simulation: the base alone if none does.

    `classes` are laws that cannot be told apart here. `tellable`: whether these
    recordings can separate effects of the material. `helps`: whether the correcting
    candidate predicts left-out recordings clearly better than the base does.
    """

    names: tuple[str, ...]
    verdict: str
    account: Tried
    before: Heldout
    after: Heldout
    shows: Shows
    tellable: bool
    helps: bool
    need: Need = field(default_factory=Need)
    classes: tuple[Class, ...] = ()
    action: str = ""


@dataclass(frozen=True)
class Facts:
    """What the verdict depends on.

    `nothing`: most likely nothing is missing. `missing`: surely something is. `sure`: a
    name or a class of laws is. `helps`: some set of effects predicts better. `enough`
    and `corrected`: whether the error is within what is needed before and after the
    correction; `near`: within twice that.
    """

    few: bool = False
    noise: bool = False
    only_loading: bool = False
    nothing: bool = False
    missing: bool = False
    sure: bool = False
    helps: bool = False
    enough: bool = False
    corrected: bool = False
    near: bool = False


# The first row whose facts all hold gives the verdict and what to do.
TABLE: tuple[tuple[Mapping[str, bool], str, str], ...] = (
    ({"few": True}, "undetermined", "record_more"),
    ({"noise": True}, "undetermined", "check_signal"),
    ({"nothing": True, "only_loading": True}, "nothing_missing", "record_unloading"),
    ({"nothing": True}, "nothing_missing", "use_simulation"),
    ({"enough": True, "only_loading": True}, "good_enough", "record_unloading"),
    ({"enough": True}, "good_enough", "use_simulation"),
    ({"sure": True, "corrected": True}, "explained", "use_corrected"),
    ({"sure": True, "near": True}, "partly_explained", "use_corrected_and_record"),
    ({"sure": True}, "partly_explained", "record"),
    ({"only_loading": True}, "undetermined", "record_unloading"),
    ({"helps": False, "missing": True}, "unexplained", "record"),
    ({"corrected": True}, "undetermined", "use_corrected_and_record"),
    ({}, "undetermined", "record"),
)


def verdict(facts: Facts) -> tuple[str, str]:
    """Return the verdict and what to do: the first row of `TABLE` that holds."""
    for needed, word, action in TABLE:
        if all(getattr(facts, name) == value for name, value in needed.items()):
            return word, action
    raise AssertionError("the last row always holds")


def of_material(found: Fit) -> bool:
    """Return whether a fit has an effect of the material."""
    return any(
        p.effect.stage == "material" for p in found.guess.pieces if not p.nuisance
    )


def in_order(names: frozenset[str]) -> tuple[str, ...]:
    """Return effects in the order in which they act."""
    return tuple(e.id for e in EFFECTS if e.id in names)


def worse(before: Heldout, after: Heldout) -> bool:
    """Return whether a correction predicts worse than what it corrects."""
    return after.nrmse > (1 + HARM) * before.nrmse


def decide(
    posterior: Posterior,
    base: Tried,
    heldout: Callable[[Tried], Heldout],
    shows: Shows,
    judged_apart: Callable[[Tried], frozenset[str]],
    misfit: Callable[[Tried], float],
    need: Need | None = None,
) -> Decision:
    """Decide where some candidate may explain the recordings down to the noise.

    `heldout` returns the error of a candidate on recordings left out. `judged_apart`
    returns those of its effects that single recordings show without a model; these need
    not predict other recordings. `misfit` returns the misfit of a candidate in units of
    the noise: 1 is noise alone.
    """
    best, before = posterior.best, heldout(base)
    after, need = heldout(best), need or Need()
    tellable = not shows.few and not (of_material(best.fit) and shows.only_loading)

    def helps(account: Tried, after: Heldout) -> bool:
        # If the base leaves noise alone, or only faults of single recordings are
        # named, no prediction could become better; but none may become worse.
        void = before.misfit < 1 + NEAR or account.effects <= judged_apart(account)
        better = before.misfit - after.misfit > HELPS * (before.misfit - 1)
        return bool((void or better) and not worse(before, after))

    account, names = best, tuple[str, ...]()
    if best.effects == posterior.selected:
        names = in_order(best.effects)
        if not (tellable and helps(best, after)):
            names = ()
            alone = judged_apart(best)
            rest = [h.account for h in posterior.hypotheses if h.effects == alone]
            rest = [a for a in rest if judged_apart(a)]
            if rest and not shows.few and helps(rest[0], heldout(rest[0])):
                account, names = rest[0], in_order(rest[0].effects)
                after = heldout(account)
    chances = [posterior.effects[n] for n in names] or [0.0]
    sure, left = max(chances) >= SURE, misfit(account)
    at_noise = min(chances) >= SURE and posterior.other <= NAMED and left <= 1 + NEAR
    facts = Facts(
        few=shows.few,
        noise=shows.noise,
        nothing=not names and posterior.nothing >= NAMED,
        sure=sure,
    )
    if not (at_noise or facts.nothing):
        first = account, after
        account, after = _corrects(
            posterior, names, base, before, first, heldout, shows
        )
    elif not names:
        account, after = base, before
    good = helps(account, after)
    if not (account.effects and good):
        account, after = base, before
    known = bool(posterior.selected) and tellable  # and yet perhaps not named
    facts = replace(
        facts,
        only_loading=shows.only_loading,
        missing=posterior.nothing <= 1 - SURE,
        helps=bool(names) or not (known or posterior.nothing_named >= NAMED),
        enough=before.nrmse <= need.limit,
        corrected=at_noise or after.nrmse <= need.limit,
        near=after.nrmse <= 2 * need.limit,
    )
    word, action = verdict(facts)
    return Decision(
        names, word, account, before, after, shows, tellable, good, need, (), action
    )


def decide_by_prediction(
    posterior: Posterior,
    base: Tried,
    best: Tried,
    heldout: Callable[[Tried], Heldout],
    shows: Shows,
    need: Need | None = None,
    apart: frozenset[str] = frozenset(),
    unsteady: frozenset[str] = frozenset(),
    classes: Sequence[Class] = (),
) -> Decision:
    """Decide where no candidate explains the recordings down to the noise.

    `best` is the candidate that predicts best and nowhere worse than the `base`; it
    corrects the simulation, whatever is named. An effect is named if sets without it
    predict worse, with each fold left out as well: not if it is `unsteady`. Likely
    faults of single recordings (`apart`) are judged by themselves.
    """
    need = need or Need()
    before, after = heldout(base), heldout(best)
    tellable = not (shows.few or shows.only_loading)
    account = best if tellable and best.effects and not worse(before, after) else base
    if account is base:
        after = before
    helps = bool(account.effects - apart)
    laws = posterior.selected - apart - unsteady if helps else frozenset[str]()
    named = frozenset[str]() if shows.few else laws | apart
    names = in_order(named)
    classes = tuple(classes) if helps else ()
    sure = any(posterior.effects[n] >= SURE for n in names) or bool(classes)
    word, action = verdict(
        Facts(
            few=shows.few,
            noise=shows.noise,
            only_loading=shows.only_loading,
            missing=True,
            sure=sure,
            helps=helps,
            enough=before.nrmse <= need.limit,
            corrected=after.nrmse <= need.limit,
            near=after.nrmse <= 2 * need.limit,
        )
    )
    return Decision(
        names, word, account, before, after, shows, tellable, helps, need, classes,
        action,
    )  # fmt: skip


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
