"""The answer in words: every sentence is made of diagnosis.json alone.

*Left out* and *missing* are said of physics. Data that the fit did not use are *new
specimens*, *recordings not used in the fit* or *parts not used in the fit*.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from softnn.effects import effect
from softnn.mismatch.decision import HELPS
from softnn.mismatch.posterior import LIKELY, NAMED, SURE
from softnn.report.phrases import listed, number, opened, percent, plain, sure

Result = Mapping[str, Any]

UNUSED = {
    "specimen": "new specimens",
    "recording": "recordings not used in the fit",
    "stretch": "parts not used in the fit",
}
ORDINALS = ("first", "second", "third", "fourth", "fifth")
FEW = 2  # recordings that a sentence names; of more it says how many
SAME = 1.02  # of an error, within which another is as good


def answer(result: Result) -> dict[str, Any]:
    """The answer, sentence by sentence: `what`, `error`, `open` (a list) and `next`.

    `what` is missing and how sure that is; `error` before and after the correction;
    `open` is what these recordings cannot tell; `next` is what to do.
    """
    return {
        "what": _what(result),
        "error": _error(result),
        "open": _open(result),
        "next": _next(result),
    }


def summary(told: Mapping[str, Any]) -> str:
    """The sentences of an answer in a line, without what to do next."""
    return " ".join(s for s in (told["what"], told["error"], *told["open"]) if s)


def unused(result: Result) -> str:
    """Data that the fit did not use, as a sentence calls them."""
    return UNUSED[result["fit"]["heldout_by"]]


# --- what -----------------------------------------------------------------------------


def _what(result: Result) -> str:
    nothing = result["probabilities"]["nothing"]
    if result["selected"]:
        return _named(result)
    if result["verdict"] == "nothing_missing":
        return f"Nothing is missing ({sure(nothing)})."
    if result["shows"]["few"]:
        return "Too little was recorded to tell whether anything is missing."
    if result["verdict"] == "unexplained":
        chance = result["probabilities"]["on_no_list"]
        if chance >= NAMED:
            return (
                "Something is missing that is not on softnn's list of effects "
                f"({sure(chance)})."
            )
        return (
            f"Something is missing ({sure(1 - nothing)}), and no effect known to "
            "softnn explains it."
        )
    if result["shows"]["only_loading"]:
        return (
            "First loading alone does not tell what is missing: softening, set, "
            "friction and others look alike there."
        )
    if nothing <= 1 - SURE:
        return (
            f"Something is missing ({sure(1 - nothing)}), but these recordings cannot "
            "tell what."
        )
    return "These recordings cannot tell what is missing, or whether anything is."


def _named(result: Result) -> str:
    """The effects that were left out, with the probability of each."""
    every = _probability(result)
    parts = {e["effect"]: _in(result, e["recordings"]) for e in _own(result)}

    def said(names: Sequence[str]) -> str:
        return listed([f"{plain(n)}{parts.get(n, '')} ({sure(every[n])})" for n in names])

    names = sorted(result["selected"], key=lambda n: -every[n])
    certain = [n for n in names if every[n] >= SURE]
    likely = [n for n in names if every[n] >= LIKELY]
    open_ = [
        (first, second)
        for i, first in enumerate(likely)
        for second in likely[i + 1 :]
        if every[second] < SURE
    ]
    # Of two that are named one rarely stands for the other: these come last.
    open_.sort(key=lambda pair: set(pair) <= set(result["selected"]))
    for first, second in open_:
        text = effect(first).twins.get(second) or effect(second).twins.get(first)
        if text:
            return {
                "strain_programme": text,
                "separates": [first, second],
                "why": "one of them does not show there",
            }
    return None


# --- reasons --------------------------------------------------------------------------


def reason(row: Mapping[str, Any], result: Result) -> str:
    """Why an effect is named, or is not, with the errors that decide it.

    `row` is one of `candidates`: `heldout_nrmse` is the error with the effect alone,
    `together` the best set of it and others.
    """
    name, error, together = row["effect"], row["heldout_nrmse"], row["together"]
    names, by = result["selected"], result["corrected_by"]
    before, after = (result["fit"][k]["heldout_nrmse"] for k in ("before", "after"))
    if name is None:
        enough = result["verdict"] == "nothing_missing"
        return "enough by itself" if enough else f"leaves {percent(before)}"
    if name in names:
        return _why_named(name, result)
    alone = f"leaves {percent(error)} alone" if row["alone"] else ""
    if name in by:
        return f"{alone or 'not fitted alone'}; in the corrected model, perhaps by chance"
    if result["shows"]["few"]:
        return "too little was recorded to tell"
    if result["shows"]["only_loading"] and not names:
        return "looks like others on first loading"
    if not (alone or together):
        return "gained too little to be fitted"
    if result["verdict"] == "nothing_missing":
        return f"{alone or 'no gain'}; the simulation leaves {percent(before)} without it"
    beside, least = _beside(name, together, result) if together else ("", error)
    text = "; ".join(s for s in (alone, beside) if s)
    best = min(error, least) if row["alone"] else least
    if not by:
        if best > before / SAME:
            return f"{text}; the simulation leaves {percent(before)} without it"
        if result["verdict"] == "unexplained":
            noise = percent(result["fit"]["noise_nrmse"])
            return f"{text}, far above the noise ({noise})"
        return f"{text}, and others do as well"
    if beside:
        return text
    whole = f"{_listed(by)} {'leave' if len(by) > 1 else 'leaves'} {percent(after)}"
    lost = _evidence(result) - row["evidence"]
    if best <= SAME * after and lost > 0 and result["judged_by"] == "likelihood":
        return f"{text} as {whole}, but its log evidence is lower by {number(lost)}"
    return f"{text}; {whole}"


def _why_named(name: str, result: Result) -> str:
    """What the error is without an effect that is named."""
    own = [e for e in result["explanations"] if e["effect"] == name]
    if not own:
        return "named"
    without, after = own[0]["nrmse_without"], result["fit"]["after"]["nrmse"]
    return (
        f"named: on all recordings the error is {percent(without)} without it, "
        f"{percent(after)} with it"
    )


def _beside(
    name: str, together: Mapping[str, Any], result: Result
) -> tuple[str, float]:
    """What an effect does beside others, or in the place of some; that error."""
    by, new = set(result["corrected_by"]), set(together["effects"])
    error, after = together["heldout_nrmse"], result["fit"]["after"]["heldout_nrmse"]
    gone, more = sorted(by - new), sorted(new - by - {name})
    others = f" with {_listed(more)}" if more else ""
    now, old = percent(error), percent(after)
    if not by:
        return f"leaves {now}{others}", error
    if gone:
        place = f"in place of {_listed(gone)}{others} it leaves {now}"
        return place + (" as well" if now == old else f", not {old}"), error
    place = f"added to {_listed(sorted(by))}{others} it leaves {now}"
    return place + (f" instead of {old}" if now != old else ", no less"), error


def _listed(names: Sequence[str], but: str = "") -> str:
    return listed([plain(n) for n in names if n != but])


def _evidence(result: Result) -> float:
    """The largest log evidence of a single effect that is named."""
    named = result["selected"]
    return max((r["evidence"] for r in result["candidates"] if r["effect"] in named), default=0.0)
