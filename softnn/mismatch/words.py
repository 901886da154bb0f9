"""What is said of a diagnosis: in words that carry how sure it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softnn.effects import effect
from softnn.mismatch import locate
from softnn.mismatch.posterior import SURE

if TYPE_CHECKING:
    from softnn.mismatch.diagnosis import Told


def plain(name: str) -> str:
    """The name of an effect as one would say it."""
    return name.replace("_", " ")


def listed(names: list[str], word: str = "and") -> str:
    """Names in a row.

    >>> listed(["slack", "grip_slip", "inertia"])
    'slack, grip slip and inertia'
    """
    *others, last = map(plain, names)
    return f"{', '.join(others)} {word} {last}" if others else last


def percent(x: float) -> str:
    return f"{100 * x:.2g} %"


def summary(result: dict[str, Any], told: Told) -> str:
    """The answer in a sentence or two."""
    fit = result["fit"]
    before, noise = fit["before"]["heldout_nrmse"], fit["noise_nrmse"]
    several = len(told.engine.chunks) > 1
    unseen = "on recordings not used" if several else "on parts left out of it"
    if told.names:
        chance = min(told.probable.effects[n] for n in told.names)
        named = listed(told.names)
        verb = "was" if len(told.names) == 1 else "were"
        said = (
            f"{named[0].upper()}{named[1:]} {verb} left out ({100 * chance:.0f} %), "
            f"{effect(told.names[0]).where}."
            if chance >= SURE
            else f"Most likely {named} ({100 * chance:.0f} %)."
        )
        after = fit["after"]["heldout_nrmse"]
        said += (
            f" With {'it' if len(told.names) == 1 else 'them'} the error {unseen} goes "
            f"from {percent(before)} to {percent(after)} (noise {percent(noise)})."
        )
        if told.verdict == "partly_explained":
            said += " Part of the mismatch stays unexplained."
        return said + _otherwise(told)
    if told.verdict == "nothing_missing":
        return (
            f"Nothing is missing ({100 * told.probable.nothing:.0f} %): what is left "
            f"of {percent(before)} is noise ({percent(noise)})."
        )
    if told.verdict == "unexplained":
        return (
            "Something is missing that is on no list "
            f"({100 * told.probable.nothing_named:.0f} %): the error {unseen} is "
            f"{percent(before)}, the noise {percent(noise)}.{_structure(result)}"
            f"{_nearest(told)}"
        )
    if locate.only_loading(told.engine) and not told.few:
        return (
            f"The simulation misses {percent(before)} of what was recorded (noise "
            f"{percent(noise)}), but first loading alone does not tell what: "
            "softening, set, friction and others look alike there. Record the way "
            "back, and cycles."
        )
    if not told.tellable:
        return "Too little was recorded to tell whether anything is missing."
    return (
        "It cannot be told what is missing, or whether anything is: the error "
        f"{unseen} is {percent(before)}, the noise {percent(noise)}.{_otherwise(told)}"
    )


def _otherwise(told: Told) -> str:
    """The other readings that share the probability."""
    ways = [(s, p) for s, p in told.probable.ways() if s != frozenset(told.names)][:3]
    if not ways or told.probable.ways()[0][1] >= SURE:
        return ""
    said = [
        f"{listed(sorted(s)) if s else 'nothing that has a name'} ({100 * p:.0f} %)"
        for s, p in ways
    ]
    return f" {'Or' if told.names else 'Possible:'} {', or '.join(said)}."


def _structure(result: dict[str, Any]) -> str:
    structure = result["structure"]
    if not structure:
        return ""
    said = ""
    if structure["depends_on"]:
        said = f" It depends on {plain(next(iter(structure['depends_on'])))} most."
    if period := structure["period"]:
        said += (
            f" It comes back every {period['period']:.3g} {period['unit']} of "
            f"{period['axis']}."
        )
    return said


def _nearest(told: Told) -> str:
    """The known effect that comes nearest, with the share it accounts for."""
    for name in told.probable.effects:
        own = [a for a in told.found.accounts if a.effects == {name}]
        if own:
            n = len(told.engine.target)
            chi2 = min(a.fit.chi2 for a in own)
            old = max(told.base.fit.chi2 - n, 1e-9)
            share = min(max((told.base.fit.chi2 - chi2) / old, 0.0), 1.0)
            return (
                f" The nearest known effect, {plain(name)}, accounts for "
                f"{100 * share:.0f} % of it."
            )
    return ""


def next_recording(told: Told) -> dict[str, Any] | None:
    """The recording that would tell the likeliest readings apart."""
    if not told.names and locate.only_loading(told.engine):
        return {
            "strain_programme": "cycles to growing strain, each amplitude twice, and a "
            "hold",
            "separates": list(told.probable.effects)[:3],
            "why": "they look alike on first loading, and part on the way back",
        }
    names = list(told.probable.effects)
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
