"""What is said of a diagnosis: in words that carry how sure it is."""

from __future__ import annotations

from typing import Any

from softnn.effects import effect
from softnn.mismatch import locate
from softnn.mismatch.decision import HELPS
from softnn.mismatch.judgement import Judgement
from softnn.mismatch.mistakes import mistaken
from softnn.mismatch.posterior import NAMED, SURE
from softnn.report.phrases import listed, opened, percent, plain


def summary(result: dict[str, Any], told: Judgement) -> str:
    """The answer in a few sentences; `result` is what diagnosis.json holds so far."""
    said = _answer(result, told)
    if told.judged_by == "prediction":
        noise = percent(result["fit"]["noise_nrmse"])
        said += (
            " No known effect explains these recordings down to the noise "
            f"({noise} at most); sets of effects were compared by their predictions."
        )
    return said


def _answer(result: dict[str, Any], told: Judgement) -> str:
    fit, probable = result["fit"], told.posterior
    noise = percent(fit["noise_nrmse"])
    before = percent(fit["before"]["heldout_nrmse"])
    several = len(told.engine.chunks) > 1
    unseen = "on recordings not used" if several else "on parts left out of it"
    missed = f"the error {unseen} is {before}, the noise {noise}."
    if told.names:
        return _named(result, told, f"the error {unseen} goes from {before}", noise)
    if told.verdict == "nothing_missing":
        return (
            f"Nothing is missing ({_sure(probable.nothing)}): what is left of {before} "
            f"is noise ({noise})."
        )
    if told.verdict == "unexplained":
        chance, which = probable.nothing_named, "that is on no list"
        if chance < NAMED:  # an effect leads, and takes away too little to be it
            chance, which = 1 - probable.nothing, "that no effect known here explains"
        return (
            f"Something is missing {which} ({_sure(chance)}): {missed}"
            f"{_nearest(told)}{_corrected(result, told)}{_structure(result, told)}"
        )
    if locate.only_loading(told.engine) and not told.decision.shows.few:
        return (
            f"The simulation misses {before} of what was recorded (noise {noise}), but "
            "first loading alone does not tell what: softening, set, friction and "
            "others look alike there. Record the way back, and cycles."
        )
    if not told.decision.tellable:
        return "Too little was recorded to tell whether anything is missing."
    said = "It cannot be told what is missing, or whether anything is"
    if probable.nothing <= 1 - SURE:
        sure = _sure(1 - probable.nothing)
        said = f"Something is missing ({sure}), but it cannot be told what"
    return f"{said}: {missed}{_otherwise(told)}{_corrected(result, told)}"


def _sure(probability: float) -> str:
    return f"{100 * probability:.0f} %"


def _effects(names: list[str]) -> str:
    return listed([plain(n) for n in names])


def _named(result: dict[str, Any], told: Judgement, falls: str, noise: str) -> str:
    """What was left out, or most likely was, and what it takes from the error."""
    chance = min(told.posterior.effects[n] for n in told.names)
    named, one = _effects(told.names), len(told.names) == 1
    apart = _apart(told)
    if apart and one:  # its scale was free before, so that no error changes
        before = percent(result["fit"]["before"]["heldout_nrmse"])
        likely = named if chance >= SURE else f"most likely {named}"
        said = f"{likely} ({_sure(chance)}).{apart} Otherwise the error is {before}"
        more = " Part of that stays unexplained." * (told.verdict == "partly_explained")
        return f"{opened(said)} (noise {noise}).{more}{_otherwise(told)}"
    said = f"Most likely {named} ({_sure(chance)})."
    if chance >= SURE:
        said = f"{opened(named)} {'was' if one else 'were'} left out ({_sure(chance)})"
        said += f", {effect(told.names[0]).where}." if one else "."
    fit, it = result["fit"], "it" if one else "them"
    if told.decision.account.effects > set(told.names):  # of readings with it the best
        it = _effects(sorted(told.decision.account.effects))
    after = fit["after"]["heldout_nrmse"]
    said += f" With {it} {falls} to {percent(after)} (noise {noise})."
    old, least = fit["before"]["heldout_nrmse"] ** 2, fit["noise_nrmse"] ** 2
    if old - after**2 < HELPS * (old - least):
        whole = (percent(fit[when]["nrmse"]) for when in ("before", "after"))
        said += (
            " What others show does not settle it there; on all together the error "
            f"goes from {' to '.join(whole)}."
        )
    if told.verdict == "partly_explained":
        said += " Part of the mismatch stays unexplained."
    return said + apart + _otherwise(told)


def _apart(told: Judgement) -> str:
    """By what factor a specimen is off, where one is named as a mistake."""
    said, named = "", mistaken(told.after) & set(told.names)
    for piece in told.after.guess.pieces:
        if piece.effect.id in named and not piece.nuisance:
            mine = piece.groups[0]
            names = listed([told.engine.data.names[r] for r in mine])
            factor = 1 + float(piece.values[piece.effect.amplitude][mine[0]])
            said += (
                f" The stress of {names} is {factor:.3g} times what other specimens "
                "have: a cross-section or a unit typed wrong?"
            )
    return said


def _otherwise(told: Judgement) -> str:
    """The other readings that share the probability."""
    ways = told.posterior.ways()
    others = [(s, p) for s, p in ways if s != frozenset(told.names)][:3]
    if not others or ways[0][1] >= SURE:
        return ""
    said = [
        f"{_effects(sorted(s)) if s else 'nothing that has a name'} ({_sure(p)})"
        for s, p in others
    ]
    return f" {'Or' if told.names else 'Possible:'} {', or '.join(said)}."


def _corrected(result: dict[str, Any], told: Judgement) -> str:
    """By what the simulation is corrected, where nothing is named."""
    if not told.decision.account.effects:
        return ""
    after = percent(result["fit"]["after"]["heldout_nrmse"])
    effects = _effects(sorted(told.decision.account.effects))
    return (
        f" The corrected model has {effects}: it predicts best what was left out "
        f"({after})."
    )


def _structure(result: dict[str, Any], told: Judgement) -> str:
    """On what that depends which no effect explains, and when it comes back."""
    structure = result["structure"]
    if not structure:
        return ""
    said, it = "", "What that leaves" if told.decision.account.effects else "It"
    if structure["depends_on"]:
        said = f" {it} depends on {plain(next(iter(structure['depends_on'])))} most."
    if period := structure["period"]:
        said += (
            f" {it} comes back every {period['period']:.3g} {period['unit']} of "
            f"{period['axis']}."
        )
    return said


def _nearest(told: Judgement) -> str:
    """The known effect that comes nearest, with the share it accounts for."""
    for name in told.posterior.effects:
        own = [a.fit.chi2 for a in told.candidates if a.effects == {name}]
        if own:
            old = told.base.fit.chi2
            missed = max(old - len(told.engine.target), 1e-9)
            share = min(max((old - min(own)) / missed, 0.0), 1.0)
            return (
                f" The nearest known effect, {plain(name)}, accounts for "
                f"{_sure(share)} of it."
            )
    return ""


def next_recording(told: Judgement) -> dict[str, Any] | None:
    """The recording that would tell the likeliest readings apart."""
    names = list(told.posterior.effects)
    if not told.names and locate.only_loading(told.engine):
        return {
            "strain_programme": "cycles to growing strain, each amplitude twice, and a "
            "hold",
            "separates": names[:3],
            "why": "they look alike on first loading, and part on the way back",
        }
    for first in names[:3]:
        for second in names[:6]:
            if first == second or (first in told.names and second in told.names):
                continue
            text = effect(first).twins.get(second) or effect(second).twins.get(first)
            if text:
                return {
                    "strain_programme": text,
                    "separates": [first, second],
                    "why": f"{plain(second)} comes near {plain(first)} here; they part "
                    "where one of them does not show",
                }
    return None
