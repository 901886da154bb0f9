"""What may be said of a search: which effects are named, and the verdict."""

from __future__ import annotations

from softnn.fit import Fit, fit
from softnn.mismatch import locate, replicates, verify, zeros
from softnn.mismatch.accounts import Search
from softnn.mismatch.base import weigh_by
from softnn.mismatch.mistakes import mistaken, with_mistakes
from softnn.mismatch.posterior import NAMED, SURE, posterior

NEAR = 0.05  # of misfit over noise, a sample, up to which nothing more is seen
HELPS = 1 / 3  # of the held-out misfit over the noise, that an explanation takes away
FEWEST = 30  # samples in all, below which nothing is told apart


class Told:
    """Verdict and names, and the simulations before and after they are corrected.

    `account` is what corrects the simulation: what is named; where that is not all, of
    the readings that hold it and share the probability the one that foretells
    recordings left out best; else the base alone. `engine` has the samples of the
    search, `fine` those of the report; `before` and `after` are fits to the latter.
    """

    def __init__(self, found: Search) -> None:
        self.found, self.base, self.engine = found, found.base, found.base.engine
        probable = with_mistakes(posterior(found.accounts), self.engine)
        own = replicates.apart(self.engine, probable), zeros.apart(self.engine)
        for one in own:
            probable = one.asked(probable)
        self.own, self.probable = own, probable
        self.account = self.probable.best
        base = self.base.fit
        self.heldout_before = verify.heldout(self.engine, base)
        self.heldout_after = verify.heldout(self.engine, self.account.fit)
        self.names = self._names()
        self.verdict = self._verdict()
        if not (self._corrected() and self.helps):
            self.account, self.heldout_after = found.accounts[0], self.heldout_before
        self.final = self.account.fit
        self.fine, fixed = self.engine.fine or self.engine, self.base.fixed
        weigh_by(self.fine, found.noise)
        self.before = fit(self.fine, base.guess, fixed_base=fixed, iterations=2)
        self.after = self.before
        if self.account.effects:
            guess = self.final.guess
            self.after = fit(self.fine, guess, fixed_base=fixed, iterations=3)

    def _names(self) -> list[str]:
        """The selected effects in the order in which they act, if they may be named.

        What is said of one recording, whatever laws are, stands where others do not.
        """
        if self.account.effects != self.probable.selected:
            return []
        if not (self.tellable and self.helps):
            alone = self._apart(self.account.fit)
            every = [h.account for h in self.probable.hypotheses if h.effects == alone]
            every = [a for a in every if self._apart(a.fit)]
            if self.few or not every:
                return []
            self.account = every[0]
            self.heldout_after = verify.heldout(self.engine, self.account.fit)
        pieces = self.account.fit.guess.pieces
        return [p.effect.id for p in pieces if not p.nuisance]

    def _apart(self, found: Fit) -> frozenset[str]:
        """Ids of what a fit says that no law of the material has a part in."""
        return mistaken(found).union(*(one.said(found) for one in self.own))

    def _corrected(self) -> bool:
        """Whether there is a correction; `account` becomes the best there is."""
        if self.verdict in ("explained", "nothing_missing"):
            return bool(self.names)
        first = self.account, self.heldout_after
        if not self.names:  # a correction that foretells worse than none is none
            first = self.found.accounts[0], self.heldout_before
        tried = [first]
        # What first loadings leave out may be anything, and each goes on its own way.
        dark = self.few or locate.only_loading(self.engine)
        for account in () if dark else self.probable.readings():
            if account.effects > set(self.names):
                left = verify.heldout(self.engine, account.fit)
                # Laws that bend may foretell well along their tangents alone.
                tried += [(account, left)] * (left.nrmse <= first[1].nrmse)
        self.account, self.heldout_after = min(tried, key=lambda t: t[1].misfit)
        return bool(self.account.effects)

    @property
    def few(self) -> bool:
        """Whether there are too few samples to tell anything apart."""
        return len(self.engine.target) < FEWEST

    @property
    def tellable(self) -> bool:
        """Whether these recordings can show what was selected.

        On first loading most physics looks alike: softening, set and friction are a
        spring there. What a rig or a channel does can still be told.
        """
        pieces = [p for p in self.probable.best.fit.guess.pieces if not p.nuisance]
        material = any(p.effect.stage == "material" for p in pieces)
        return not self.few and not (material and locate.only_loading(self.engine))

    @property
    def helps(self) -> bool:
        """Whether recordings left out are foretold better, by more than a little.

        As noise and what is not known of the others count it. Where their misfit is
        the noise, or only a specimen is said to be wrong, whose scale was free before,
        or a zero or what one recording has apart, nothing could be taken from it.
        """
        old, new = self.heldout_before.misfit, self.heldout_after.misfit
        void = old < 1 + NEAR or self.account.effects <= self._apart(self.account.fit)
        return bool(void or old - new > HELPS * (old - 1))

    def _verdict(self) -> str:
        probable = self.probable
        if self.few:
            return "undetermined"
        if self.names:
            if min(probable.effects[n] for n in self.names) < SURE:
                return "undetermined"
            left = self.account.fit.chi2 / len(self.engine.target) - 1
            beside = probable.other > NAMED or left > NEAR
            return "partly_explained" if beside else "explained"
        if probable.nothing >= NAMED:
            return "nothing_missing"
        known = probable.selected and self.tellable  # and yet it may not be named
        unexplained = known or probable.nothing_named >= NAMED
        missing = probable.nothing <= 1 - SURE  # is said only where it is sure
        return "unexplained" if missing and unexplained else "undetermined"
