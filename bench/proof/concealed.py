"""The page's sections on the trials of the first forge, which is archived."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bench.hands.families import EFFECTS
from bench.reporting import ends, share
from bench.scoring import Rate
from bench.trials import reporting
from softnn.study.common import COLOURS, FAINT, made_with, markdown, new_figure, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure
from bench.proof.page import OTHER, Page, Result

# Unlisted kinds that a law in softnn.mismatch.strangers was written for, knowing them.
WITH_LAWS = (
    "creep_damage",
    "crystallisation",
    "leadscrew",
    "one_way_flow",
    "stiction",
    "thixotropy",
)


ARCHIVED = "5c3d323"  # the last commit that has the forge of these trials
KINDS = (
    "A *null* case has no concealed effect, a *single* case one, a *pair* two. An "
    "*alien* case has an effect that is not on softnn's list (in the tables: on no "
    "list). The *strength* scales the size of the effect. The *oracle* is a test "
    "that knows the true law: no method can see more."
)


def strength_of(trial: Result) -> float:
    return float(trial["record"]["strength"])


def trials_of(found: Result) -> list[Result]:
    """Trials of a file, the strongest first."""
    return sorted(found["trials"].values(), key=strength_of, reverse=True)


def concealed(page: Page, found: Result) -> None:
    trials = trials_of(found)
    page.say(
        "These trials were made by a first generator of cases, which shared families "
        f"of laws with its tests. It is archived: commit {ARCHIVED} has its code, and "
        "the trials are as they were published. Cases made by other people replace it: "
        + OTHER
    )
    for t in trials:
        record = t["record"]
        groups = t["all"]["naming"].items()
        counts = ", ".join(f"{g['of']} {name}" for name, g in groups)
        page.say(
            f"Strength {record['strength']:g}, seed {record['seed']}: "
            f"{record['cases']} cases ({counts}). SHA-256 of the key, filed before the "
            f"first diagnosis: `{record['key_sha256'][:16]}...`. "
            f"{made_with(record)}"
        )
    page.say(*dict.fromkeys(t["record"].get("note", "") for t in trials))
    page.say(KINDS, "### Shares found", bars_table(trials))
    for t in trials:
        page.say(hidden_sentence(t))
        page.say(strangers_sentence(t))
    page.figure("proof-concealed", concealed_figure(trials), "right and alone")
    page.say("### Misses and their causes")
    for t in trials:
        page.say(causes_table(t))


def bars_table(trials: Sequence[Result]) -> str:
    """Every bar, a column a strength."""
    keys = {b["key"]: b for t in reversed(trials) for b in t["bars"]}
    rows = []
    for key, about in keys.items():
        row = [about["what"]]
        for t in trials:
            bar = next((b for b in t["bars"] if b["key"] == key), None)
            if bar is None or bar.get("rate") is None:
                row += [None, None]
                continue
            value = share(bar) if "low" in bar else f"{bar['rate']:.3g}"
            row += [value, f"{bar['bar']:g}, {'met' if bar['met'] else 'missed'}"]
        rows.append(row)
    heads = [h for t in trials for h in (f"strength {strength_of(t):g}", "bar")]
    return markdown(["what", *heads], rows)


def hidden_sentence(trial: Result) -> str:
    hidden = trial.get("concealment")
    if not hidden or "single" not in hidden["groups"]:
        return ""
    one, limit = hidden["groups"]["single"], hidden["accepted_below_nrmse"]
    return (
        f"At strength {strength_of(trial):g} the refitted base is within "
        f"{percent(limit, 0)} of the recordings in {one['accepted']['right']} of "
        f"{one['accepted']['of']} cases with one effect, a fit that looks good by eye. "
        f"In those softnn named the effect in {share(one['named'])}, and nothing else "
        f"with it in {share(one['right'])}."
    )


def strangers_sentence(trial: Result) -> str:
    """Return the share of unlisted effects left unnamed, with and without a law."""
    kinds = trial.get("aliens", {})
    apart = []
    for known in (True, False):
        own = [k for name, k in kinds.items() if (name in WITH_LAWS) == known]
        apart.append(
            Rate(sum(k["right"] for k in own), sum(k["of"] for k in own)).entry()
        )
    if not all(a["of"] for a in apart):
        return ""
    with_law, without = (f"{share(a)} of {a['of']}" for a in apart)
    return (
        f"At strength {strength_of(trial):g}, an effect that is not on softnn's list "
        "should get no name. Some kinds are laws of softnn by now, or forms of one "
        f"({', '.join(WITH_LAWS)}). These got no name in {with_law} cases, the other "
        f"kinds in {without}."
    )


def concealed_figure(trials: Sequence[Result]) -> Figure:
    """Share of cases named right and alone, effect by effect, with intervals."""
    figure = new_figure(6.4, 4.4)
    axes = figure.subplots()
    for i, t in enumerate(trials):
        effects = t["all"]["effects"]
        entries = [(n, e) for n in EFFECTS if (e := effects.get(n)) and e["of"]]
        y = [EFFECTS.index(n) + 0.16 * (2 * i - len(trials) + 1) for n, _ in entries]
        x = [e["rate"] for _, e in entries]
        axes.errorbar(
            x,
            y,
            xerr=ends([e for _, e in entries]),
            fmt="o",
            ms=4,
            color=COLOURS[i % len(COLOURS)],
            elinewidth=0.8,
            label=f"strength {strength_of(t):g}",
        )
    axes.set_yticks(range(len(EFFECTS)), [n.replace("_", " ") for n in EFFECTS])
    axes.set_ylim(len(EFFECTS) - 0.5, -0.5)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("cases in which the effect was named, and nothing else")
    axes.grid(axis="x", color=FAINT, alpha=0.3, linewidth=0.6)
    figure.legend(loc="outside lower center", ncols=len(trials), fontsize=8)
    return figure


def causes_table(trial: Result) -> str:
    """Return a table of misses by concealed effect and cause, most frequent first."""
    strength = strength_of(trial)
    if not trial["misses"]:
        return f"At strength {strength:g} nothing was missed."
    return reporting.causes_table(trial["misses"], f"planted, strength {strength:g}")
