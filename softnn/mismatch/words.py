"""The answer in words; every sentence is made from diagnosis.json alone.

*Left out* and *missing* are said of physics. Data that the fit did not use are *new
specimens*, *recordings not used in the fit* or *parts not used in the fit*.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from softnn.effects import effect
from softnn.mismatch.compare import LIKELY, NAMED, SURE
from softnn.mismatch.decision import HELPS
from softnn.mismatch.prediction import BEAM
from softnn.report.page import UNUSED
from softnn.report.phrases import listed, number, opened, percent, plain, promise, sure

Result = Mapping[str, Any]

ORDINALS = ("first", "second", "third", "fourth", "fifth")
MOST = len(BEAM) + 1  # effects that a search adds
FEW = 2  # recordings that a sentence names; for more it gives their number
SAME = 1.02  # factor of an error within which another error counts as equal


def answer(result: Result) -> dict[str, Any]:
    """Return the sentences of the answer: `what`, `error`, `open` (a list), `next`.

    `what` names missing effects with their probability; `error` is the error before and
    after the correction; `open` is for questions that these recordings cannot decide;
    `next` is the next step.
    """
    return {
        "what": _what(result),
        "error": _error(result),
        "open": _open(result),
        "next": _next(result),
    }


def summary(told: Mapping[str, Any]) -> str:
    """Return the sentences of an answer in one line, without the next step."""
    return " ".join(s for s in (told["what"], told["error"], *told["open"]) if s)


def unused(result: Result) -> str:
    """Return the words for data that the fit did not use."""
    return UNUSED[result["fit"]["heldout_by"]]


# --- what -----------------------------------------------------------------------------


def _what(result: Result) -> str:
    enough = _enough(result)
    return f"{enough} {_missing(result)}".strip() if enough else _missing(result)


def _enough(result: Result) -> str:
    """Return that the simulation is good enough, and for what; "" if it is not."""
    if result["verdict"] != "good_enough":
        return ""
    before = percent(result["fit"]["before"]["heldout_nrmse"])
    return (
        f"The simulation is good enough: it predicts {unused(result)} to {before}"
        f"{_needed(result)}."
    )


def _needed(result: Result) -> str:
    """Return what the error is held against: what replicates differ by, or a need."""
    floor, need = result["floor"], percent(result["tolerance"])
    if floor and floor["high"] > result["tolerance"]:
        return f" ({floor['of']} differ by {percent(floor['nrmse'])})"
    return f" ({need} is good enough)"


def _missing(result: Result) -> str:
    nothing = result["probabilities"]["nothing"]
    if result["selected"] or result["classes"]:
        return _named(result)
    if result["shows"]["few"]:
        return "Too little was recorded to tell whether anything is missing."
    if result["shows"]["noise"]:
        return "The stress is hardly more than noise; nothing can be seen in it."
    if result["verdict"] == "nothing_missing":
        text = f"Nothing is missing ({sure(nothing)})"
        if result["shows"]["only_loading"]:
            return f"{text} in first loading; unloading was not recorded."
        return f"{text}."
    if result["verdict"] == "good_enough":
        if result["shows"]["only_loading"]:
            return "That is first loading alone; unloading was not recorded."
        return ""
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
        return f"Something is missing ({sure(1 - nothing)}), and several effects fit."
    return "These recordings cannot tell what is missing, or whether anything is."


def _named(result: Result) -> str:
    """Return a sentence with the effects left out, and the probability of each."""
    every = _probability(result)
    parts = {e["effect"]: _in(result, e["recordings"]) for e in _own(result)}

    def said(names: Sequence[str]) -> list[str]:
        return [f"{plain(n)}{parts.get(n, '')} ({sure(every[n])})" for n in names]

    within = {m for c in result["classes"] for m in c["members"]}
    names = sorted(result["selected"], key=lambda n: -every[n])
    certain = said([n for n in names if every[n] >= SURE])
    certain += [_class(c) for c in result["classes"]]
    likely = [n for n in names if every[n] < SURE and n not in within]
    if not certain:
        return f"Most likely {listed(said(likely))} {_were(likely)} left out."
    text = f"{opened(listed(certain))} {_were(certain)} left out"
    return f"{text}{f', and most likely {listed(said(likely))}' if likely else ''}."


def _class(one: Mapping[str, Any]) -> str:
    """Return laws that cannot be told apart here, and that one of them is there."""
    them = " or ".join(plain(m) for m in one["members"])
    chance = sure(one["probability"])
    if one["name"]:
        return f"{one['name']} ({them}: {chance})"
    return f"{them} ({chance})"


def _were(names: Sequence[str]) -> str:
    return "was" if len(names) == 1 else "were"


def _probability(result: Result) -> dict[str, float]:
    rows = result["candidates"]
    return {r["effect"]: r["probability"] for r in rows if r["effect"] is not None}


def _own(result: Result) -> list[dict[str, Any]]:
    """Return explanations by effects that have a value in each recording."""
    rows = result["explanations"]
    return [e for e in rows if effect(e["effect"], e["form"]).per_recording]


def _in(result: Result, names: Sequence[str]) -> str:
    """Return the recordings that have an effect, in words; "" if all have it."""
    count = len(result["recordings"])
    if len(names) in (0, count):
        return ""
    if len(names) > FEW:
        return f" in {len(names)} of {count} recordings"
    return f" in {listed(names)}"


# --- the error ------------------------------------------------------------------------


def _error(result: Result) -> str:
    fit, new = result["fit"], unused(result)
    before, after = (percent(fit[k]["heldout_nrmse"]) for k in ("before", "after"))
    whole = [percent(fit[k]["nrmse"]) for k in ("before", "after")]
    held = _against(result)
    by, names = result["corrected_by"], result["selected"]
    if result["verdict"] == "nothing_missing":
        return f"The simulation predicts {new} to {before}{held}."
    if names and all(effect(n).scatter for n in names):
        # Specimens have their own scale either way, so the error does not change.
        return f"But for that, {new} are predicted to {before}{held}."
    if not by:
        if result["verdict"] == "good_enough":
            return ""
        return f"The simulation predicts {new} to {before} only{held}."
    if not names:
        with_ = f"With {_listed(by)}"
    elif set(by) <= set(names):
        with_ = "With it" if len(names) == 1 else "With them"
    else:
        every = _probability(result)
        more = [f"{plain(n)} ({sure(every[n])})" for n in by if n not in names]
        with_ = f"With {listed(more)} as well, not certain"
    old, least = fit["before"]["heldout_nrmse"] ** 2, fit["noise_nrmse"] ** 2
    if names and old - fit["after"]["heldout_nrmse"] ** 2 < HELPS * (old - least):
        # A fault of single recordings does not help to predict others.
        return (
            f"{with_}, the error on all recordings is {whole[1]} instead of "
            f"{whole[0]}; {new} are predicted to {after} instead of {before}{held}."
        )
    return f"{with_}, {new} are predicted to {after} instead of {before}{held}."


def _against(result: Result) -> str:
    """Return what errors are held against: the noise, the floor, or the tolerance."""
    if result["judged_by"] == "likelihood":
        return f" (noise {percent(result['fit']['noise_nrmse'])})"
    if result["verdict"] == "good_enough":
        return ""  # said before
    return _needed(result)


# --- what stays open ------------------------------------------------------------------


def _open(result: Result) -> list[str]:
    names, near = result["selected"], result["nearest"]
    said, beside = _instead(result)
    if result["verdict"] == "unexplained" and near:
        said.append(
            f"The nearest known effect, {plain(near['effect'])}, accounts for "
            f"{percent(near['share'])} of the mismatch."
        )
    if result["verdict"] == "partly_explained":
        said += _remains(result)
        which = ORDINALS[min(len(names), len(ORDINALS) - 1)]
        maybe = f" (perhaps {listed(beside)})" if beside else ""
        said.append(
            f"Whether a {which} effect is there{maybe}, these recordings cannot tell."
        )
        # Gaps, zeros and scales of single recordings are not found by the search.
        own = {e["effect"] for e in _own(result)}
        if len(set(names) - own) == MOST:
            said.append(f"softnn looks for {MOST} such effects at most; more may act.")
    elif beside:
        is_ = "is" if len(beside) == 1 else "are"
        said.append(f"{opened(listed(beside))} {is_} possible as well.")
    return _factors(result) + said + _structure(result)


def _remains(result: Result) -> list[str]:
    """Return what is left beside the effects that are named."""
    if result["judged_by"] == "likelihood" or not result["corrected_by"]:
        return []
    left = percent(result["fit"]["after"]["heldout_nrmse"])
    return [f"{left} remain{_needed(result)}."]


def _factors(result: Result) -> list[str]:
    """Return the factors by which specimens are mis-scaled, if that is named."""
    said = []
    for told in result["explanations"]:
        law = effect(told["effect"], told["form"])
        for name in told["recordings"] if law.scatter else ():
            row = told["parameters"].get(f"{law.amplitude} of {name}")
            if row:
                said.append(
                    f"The stress of {name} is {1 + row['value']:.3g} times that of the "
                    "other specimens."
                )
    return said[:FEW]


def _instead(result: Result) -> tuple[list[str], list[str]]:
    """Return sentences on effects that may replace a named one; other likely ones."""
    names, every = set(result["selected"]), _probability(result)
    left = [n for n, p in every.items() if n not in names and p >= LIKELY]
    if not left or result["verdict"] == "unexplained":
        return [], []
    likely = [f"{plain(n)} ({sure(every[n])})" for n in left]
    if not names:
        return [f"Possible: {listed(likely)}."], []
    said, placed = list[str](), set[str]()
    for told in result["explanations"]:
        mine = [n for n in left if n in told["equivalent"] and n not in placed]
        placed |= set(mine)
        if mine:
            them = " or ".join(f"{plain(n)} ({sure(every[n])})" for n in mine)
            said.append(
                f"{opened(them)} would do nearly as well as {plain(told['effect'])}."
            )
    return said, [s for n, s in zip(left, likely, strict=True) if n not in placed]


def _structure(result: Result) -> list[str]:
    """Return sentences on what an unexplained mismatch depends on, and its period."""
    structure = result["structure"]
    if not structure:
        return []
    it = "What the correction leaves" if result["corrected_by"] else "The mismatch"
    said = []
    if structure["depends_on"]:
        said.append(
            f"{it} depends most on {plain(next(iter(structure['depends_on'])))}."
        )
    if period := structure["period"]:
        unit = "" if period["unit"] == "-" else f" {period['unit']}"
        said.append(
            f"{it} comes back every {period['period']:.3g}{unit} of {period['axis']}."
        )
    return said


# --- what to do -----------------------------------------------------------------------


def _next(result: Result) -> str:
    """Return what to do next, by the `action` of the decision."""
    action, advice = result["action"], result["next_recording"]
    mistakes = [e for e in result["explanations"] if effect(e["effect"]).scatter]
    if mistakes:
        them = listed(mistakes[0]["recordings"][:FEW])
        return f"Check cross-section and units of {them}."
    if action == "check_signal":
        return "Check the force channel: its range, its cable and its zero."
    if action == "use_simulation":
        return "Use the simulation as it is; its parameters are in base.json."
    said = []
    if action in ("use_corrected", "use_corrected_and_record"):
        said.append("Simulate with the corrected model, model.json.")
    if advice and (advice["expected"] is not None or action != "use_corrected"):
        said.append(record(advice, result))
    return " ".join(said)


def record(advice: Mapping[str, Any], result: Result) -> str:
    """Return the recording to make next, what it tells, and how sure that is."""
    if advice["programme"] is None:
        return f"{opened(advice['why'])}."
    asked = (
        f"record: {advice['strain_programme']}{_times(advice)} (next_recording.csv)."
    )
    if advice["expected"] is None:
        return opened(asked)
    text = opened(_purpose(advice["separates"], result) + asked)
    text += f" {promise(advice['expected']['sure'])}"
    if cheap := advice["cheap"]:
        chance = cheap["expected"]["sure"]
        odds = "" if chance is None else f", with {sure(chance)}"
        text += f" Cheaper{odds}: {cheap['strain_programme']}."
    return text


def _times(advice: Mapping[str, Any]) -> str:
    """Return on how many specimens a programme is to be run; "" for one."""
    return f", on {advice['specimens']} specimens" if advice["specimens"] > 1 else ""


def _purpose(names: Sequence[str], result: Result) -> str:
    """Return what a recording is for, up to the comma; "" for no effect in question."""
    if not names or not result["candidates"]:
        return ""
    every = _probability(result)
    others = [n for n, p in every.items() if p >= SURE and n not in names]
    if len(names) == 1:
        also = " as well" if others else ""
        return f"To see whether {plain(names[0])} is there{also}, "
    if len(names) == 2:
        return f"To tell {plain(names[0])} from {plain(names[1])}, "
    return f"To tell {listed([plain(n) for n in names[:MOST]])} apart, "


# --- reasons --------------------------------------------------------------------------


def reason(row: Mapping[str, Any], result: Result) -> str:
    """Return why an effect is or is not named, with the errors that decide it.

    `row` is one of `candidates`: `heldout_nrmse` is the error with the effect alone,
    `together` the best set with this effect and others.
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
        return (
            f"{alone or 'not fitted alone'}; the corrected model has it and predicts "
            "better so, but it is not certain enough to be named"
        )
    if result["shows"]["few"]:
        return "too little was recorded to tell"
    if result["shows"]["only_loading"] and not names:
        return "looks like others on first loading"
    if not (alone or together):
        return "gained too little to be fitted"
    if result["verdict"] == "nothing_missing":
        return (
            f"{alone or 'no gain'}; the simulation leaves {percent(before)} without it"
        )
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
    """Return the reason for a named effect: the error without it."""
    own = [e for e in result["explanations"] if e["effect"] == name]
    if not own:
        return "named"
    rows, count = own[0]["recordings"], len(result["recordings"])
    where = _in(result, rows) if 0 < len(rows) < count else ""
    without, with_ = (percent(e) for e in own[0]["nrmse_own"])
    return (
        f"named: the error{where or ' of the fit to all'} is {without} without it, "
        f"{with_} with it"
    )


def _beside(
    name: str, together: Mapping[str, Any], result: Result
) -> tuple[str, float]:
    """Return the words for an effect beside others or in place of some; its error."""
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
    """Return the largest log evidence of a single effect that is named, nats."""
    named = result["selected"]
    return max(
        (r["evidence"] for r in result["candidates"] if r["effect"] in named),
        default=0.0,
    )
