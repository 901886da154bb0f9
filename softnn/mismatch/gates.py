"""What an effect must gain to be taken in: over noise, a finer base and the others.

The first must gain well over what noise gives and what a finer base takes up. A later
one must explain what the earlier ones, in any form, could not (`forms`).
"""

from __future__ import annotations

import numpy as np

from softnn.fit import Engine, Fit
from softnn.mismatch.contest import (
    Rival,
    ended,
    lookalikes,
    names,
    score,
    sponge,
    without_form,
)
from softnn.mismatch.forms import finer, remembered, unforgotten
from softnn.mismatch.verify import heldout, ratio_interval

CLEAR = 1.5  # times the threshold of noise, which a later effect must gain
PLAINLY = 4.0  # the same where as little is left as noise leaves
# What the first effect must gain: times the threshold of noise, and of score. More of
# one that seeks a moment in each recording: noise has many for it to find.
SURE = {False: (1.0, 4.0), True: (1.5, 20.0)}
BLOCK = 32  # samples, beside which noise forgets at once if its memory is known
DOUBT = 0.25  # excess that may still be the noise, taken for too little
# What a later effect must win beyond the forms of the earlier ones: shares of what they
# leave and of what they gained. One that is small beside them must leave little; and
# less still where it has a value of its own in each recording, which fits anything.
LARGE = ((0.5, 0.02), (0.25, 0.15))
THIRD = (0.5, 0.05)
SMALL = {False: (0.6, 0.003), True: (0.8, 0.006)}
COMPLETE = 0.1  # of the excess, at most, that one which completes the account leaves
NOISE = 0.05  # excess, up to which an account may be complete
TOLD = (12.0, 0.015)  # thresholds, and share of the first, that a law in all must gain
MISSING = 0.1  # excess that earlier effects must leave for there to be one
LITTLE = 0.3  # of what earlier effects gained, which anything scattered can take
PLAIN = 0.5  # of the size that SMALL asks, beside effects of the measuring chain alone
BESIDE = 0.0015  # of what the first gained, by which two beat any form of it
INSIDE = 5.0  # times that for a law that contains the first
MEASURED = 0.2  # times that beside effects of the measuring chain alone
OF_FORM = 0.05  # of what the first gained, up to which a lookalike may be its form
SCATTERED = 9.0  # times the threshold, for one of single recordings that is small
SLIGHT = 0.1  # of the largest error, up to which one counts for nothing beside it
VAGUE = (0.1, 0.6)  # of the first's gain, and of that of the best of a third rival
FEW = 20.0  # thresholds, up to which several that gain nearly the same are none
LEFT = 0.65  # of the excess, which a later effect must get under where no form is near
WORTH = 0.75  # of the misfit, for a second by which others are foretold better
SEVERAL = 4  # recordings, from which that can be told
DISTORTED = 0.15  # of what effects gained, at most, their distortions may gain on top
KNOWN = 0.01  # excess to which the level of noise is known


def enough(engine: Engine, before: Fit, after: Fit, threshold: float) -> bool:
    """Whether the first effect gains well over noise, and over a finer base."""
    laws = [p.effect for p in after.guess.pieces if not p.nuisance]
    times, worth = SURE[any(len(law.per_recording) > 1 for law in laws)]
    needed = times * threshold
    if before.chi2 - after.chi2 < needed or score(before) - score(after) < worth:
        return False
    # Of its own numbers: what of the base it sets free, the finer base has as well.
    price = (len(after.slots) - len(before.slots)) * np.log(len(before.residual))
    gain = over_finer(engine, before, after)
    return bool(gain > max(needed, price) and gain > needed * slow(engine, after))


def slow(engine: Engine, found: Fit) -> float:
    """Power of what is left at low frequencies, over that of white noise; at least 1.

    Noise whose memory was taken for too short is not white where it is weighed. Effects
    are slow, and gain of such noise by as much more. Where what is left is more than
    noise may be, it is something missing and says nothing of the noise.
    """
    if found.chi2 > (1 + DOUBT) * len(found.residual):
        return 1.0
    left, _ = unforgotten(engine, finer(engine, found))
    sums = []
    for r in range(len(engine.chunks)):
        own = left[engine.owner == r]
        whole = own[: len(own) // BLOCK * BLOCK].reshape(-1, BLOCK)
        sums.append(whole.sum(axis=1))
    power = np.concatenate(sums) ** 2 / BLOCK
    if not len(power):
        return 1.0
    chance = 2 * np.sqrt(2 / len(power))  # two standard deviations of white noise
    return float(power.mean()) if power.mean() > 1 + chance else 1.0


def over_finer(engine: Engine, before: Fit, after: Fit) -> float:
    """What is gained of chi2 where a finer base takes up what the grid misses."""
    left = remembered(engine, finer(engine, before))
    return left - remembered(engine, finer(engine, after))


def admitted(
    engine: Engine, base: Fit, before: Fit, found: list[Rival], threshold: float
) -> list[Rival]:
    """The rivals, the first of them that adds to what there is in front; maybe none.

    None where several gain nearly the same, and little beside noise and what is there:
    each of them makes up for the form of that.
    """
    gains = sorted((score(before) - score(r.fit) for r in found), reverse=True)
    little = min(FEW * threshold, VAGUE[0] * (score(base) - score(before)))
    if len(gains) > 2 and gains[0] < little and gains[2] > VAGUE[1] * gains[0]:
        return []
    for i, rival in enumerate(found):
        if adds(engine, base, before, rival.fit, threshold) and not of_grid(
            engine, before, rival.fit, threshold
        ):
            return [rival, *found[:i], *found[i + 1 :]]
    return []


def foretold(engine: Engine, before: Fit, after: Fit) -> bool:
    """Whether recordings left out are foretold better with an effect, for certain.

    Where no account is near the noise, noise is no measure of what an effect gains.
    """
    if len(engine.chunks) < SEVERAL:
        return False
    old, _ = heldout(engine, before)
    new, _ = heldout(engine, after)
    return ratio_interval(old, new, np.random.default_rng(0))[2] < 1


def of_grid(engine: Engine, before: Fit, after: Fit, threshold: float) -> bool:
    """Whether the little that a later effect gains is what the base's grid misses."""
    if engine.body or before.chi2 - after.chi2 > FEW * threshold:
        return False
    return over_finer(engine, before, after) < CLEAR * threshold


def adds(
    engine: Engine,
    base: Fit,
    before: Fit,
    after: Fit,
    threshold: float,
    ease: float = 1.0,
) -> bool:
    """Whether a later effect explains what the earlier ones, in any form, could not.

    No formula is the true one, and what its form misses looks like a little of
    something else. `ease`: of the shares asked for, what is enough.
    """
    n = len(before.residual)
    earlier = set(names(before))
    new = [
        p for p in after.guess.pieces if not p.nuisance and p.effect.id not in earlier
    ]
    if engine.body:
        own = any(p.effect.per_recording for p in new)
        much = after.chi2 - n < LEFT * (before.chi2 - n)
        if len(earlier) > 1 and own:
            return much and foretold(engine, before, after)
        some = len(earlier) < 2 and not own and after.chi2 < WORTH * before.chi2
        return bool(much or (some and foretold(engine, before, after)))
    # A form that is wrong by much is not the form of what is there.
    first = max(base.chi2 - before.chi2, 1.0)
    # What one is mistaken for, at an end of what it can be, is a form of that one.
    form_of = any(ended(p) and earlier & lookalikes(p.effect.id) for p in new)
    if form_of and before.chi2 - after.chi2 < OF_FORM * first:
        return False
    any_form = without_form(engine, before, earlier, True)
    left = max(any_form, before.chi2 - DISTORTED * first)
    gain = left - without_form(engine, after, earlier, True)
    # Where the laws as they stand come down to the noise, no other form is needed.
    # (Another form of the first would be that other form.)
    kept = {p.effect.form for p in before.guess.pieces}
    own = any(p.effect.per_recording for p in new)
    plain = before.chi2 - after.chi2
    # Nor is another form the better account where two as they are leave noise and less
    # than one does in any form.
    sure = (SCATTERED if own else PLAINLY) * threshold
    # What an amplifier does is known; what a material does is not.
    laws = [p.effect for p in before.guess.pieces if not p.nuisance]
    chain = all(law.stage == "sensor" for law in laws)
    inside = any(earlier & set(p.effect.contains) for p in new)
    beside = BESIDE * (MEASURED if chain else 1) * (INSIDE if inside else 1) * first
    beats = ease * max(sure, beside)
    complete = (after.chi2 < (1 + NOISE) * n and any_form - after.chi2 > beats) or (
        len(earlier) < 2
        and plain > ease * beside
        and kept <= {p.effect.form for p in after.guess.pieces}
        and (
            (
                before.chi2 > (1 + MISSING) * n
                and after.chi2 - n < COMPLETE * (before.chi2 - n)
            )
            # A law for all recordings has little to fit the form of another with.
            or (
                not own
                and after.chi2 < (1 + NOISE) * n
                and plain > ease * max(TOLD[0] * threshold, TOLD[1] * first)
            )
        )
    )
    if complete:
        gain = plain
    # Two that fit better with fewer numbers than one need no other form of it.
    fewer = len(new) > 1 or len(after.slots) < len(before.slots)
    if fewer and after.parameters <= before.parameters:
        return bool(plain > CLEAR * threshold)
    price = (len(after.slots) - len(before.slots)) * np.log(n)
    if gain < max(CLEAR * threshold, price) or score(after) > score(before):
        return False
    if gain < LITTLE * first and any(sponge(engine, p, SLIGHT) for p in new):
        return False
    if complete:
        return True
    if len(earlier) > 1 and left < n:
        return False
    share, first = gain / max(left - n, KNOWN * n) / ease, first * ease
    large = any(
        share > much and gain > size * first
        for much, size in (LARGE if len(earlier) < 2 else [THIRD])
    )
    missing = left > (1 + KNOWN) * n  # or is it the level of noise?
    if own and gain < SCATTERED * threshold and (gain < 0.15 * first or not missing):
        return False
    clean, small = SMALL[own]
    if chain:
        small *= PLAIN
    return bool(
        large
        # By the third, two forms have had their say; a small one is theirs.
        or (
            len(earlier) < 2
            and share > clean
            and gain > small * first
            and (missing or gain > PLAINLY * threshold)
        )
    )
