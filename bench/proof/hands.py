"""The page of the trial by other hands, and of every trial so far."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import TYPE_CHECKING, Any

from bench import ledger
from bench.reporting import ends, share
from bench.scoring import CLASSES, SEEN
from bench.trials import noise_check, reporting
from softnn.study.common import COLOURS, FAINT, INK, made_with, markdown, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bench.proof.page import Page

Result = Mapping[str, Any]
POOLED = 5  # draws of the families held out, shown together
MOST_NAMED = 3  # earlier openings that are listed; of more, number and dates
SAME, FALSE = 0.98, 0.02  # bars for recordings that are hardly changed, or quieter
LOCATED = (
    "Location and gain. F1 compares the samples in the regions of a diagnosis with "
    "those where the concealed effect moves the stress by more than two sigmas of the "
    "noise. The error is that on recordings without noise that no fit used. These have "
    "no faults of single recordings (slack, slip, zero, gain, drift)."
)
CLASS_NAMES = {
    "null": "nothing left out",
    "single": "one effect",
    "pair": "two effects",
    "alien": "on no list",
    "mixed": "one beside that",
    "bent": "wrong laws",
}


def hands(page: Page, found: Result) -> None:
    trials = found["trials"]
    page.say(
        "An effect is named if it is in `selected`, at any probability. An answer is "
        "right if it names exactly the effects that are there. It is also right if "
        "nothing is missing and it says `nothing_missing`, or if the effect is not on "
        "softnn's list and it gives no name. Bars are for visible cases: a refit of "
        f"the base leaves a whitened energy above {SEEN:g}, and so does each of two "
        "effects beside the other. The others are counted separately."
    )
    page.figure("proof-hands-naming", naming_figure(trials), "right, class by class")
    page.figure("proof-hands-reliability", reliability_figure(trials), "reliability")
    for label, t in trials.items():
        record = t["record"]
        counts = ", ".join(f"{n['of']} {c}" for c, n in t["all"]["naming"].items())
        seed = "" if record["seed"] is None else f", seed {record['seed']}"
        page.say(
            f"### {label}",
            f"{record['cases']} cases{seed} "
            f"({counts}); SHA-256 of the truths "
            f"`{record['key_sha256'][:16]}...`. {made_with(record)}",
            opened_before(record),
            reporting.bars_table(t["bars"]),
            reporting.parts_table(t),
            reporting.effects_table(t),
            "Names by their probability, in all cases:",
            reporting.calibration_table(t["all"]["calibration"]),
        )
        if "located" in t:
            page.say(LOCATED, reporting.located_table(t["located"]))
        if t.get("noise_check"):
            page.say(noise_check.table(t["noise_check"]))
        page.say(reporting.causes_table(t["misses"]))


def opened_before(record: Result) -> str:
    before = record.get("opened_before")
    if not before:
        return ""
    if len(before) > MOST_NAMED:
        days = sorted(one.partition(",")[0] for one in before)
        before = [f"{len(before)} times, {days[0]} to {days[-1]}"]
    return f"**Opened before** ({'; '.join(before)}): no fresh evidence."


def stability(page: Page, found: Result) -> None:
    rows = found["rows"]
    forged = sum(row["true"] is not None for row in rows)
    page.say(
        f"{forged} cases with a known truth and {len(rows) - forged} groups of real "
        "recordings are diagnosed twice: as they are, and after a small change. The "
        "table has the share with the same names, or undetermined both times (bar "
        f"{100 * SAME:.0f} %). With half the noise it has the share that loses a true "
        f"name (bar: none) or gains a false one (bar {100 * FALSE:.0f} %).",
        markdown(
            ["change", "of", "cases"],
            [[k, str(v["of"]), share(v)] for k, v in found["rates"].items()],
        ),
    )


def openings(page: Page, found: Result) -> None:
    rows = found["openings"]
    draws = ledger.draws(rows, POOLED)
    sums = ledger.together(draws)
    page.say(
        f"The {len(draws)} newest fresh draws of the families held out, each judged by "
        "the code of its time. All cases count, also hardly visible ones. Differences "
        "between draws of some fifty cases are mostly chance. No case of these draws "
        "was opened twice.",
        markdown(
            ["seed", "commit", *(CLASS_NAMES[c] for c in sums)],
            [
                *(
                    [str(r["seed"]), r.get("commit"), *map(r["right"].get, sums)]
                    for r in draws
                ),
                ["together", "", *(share(rate.entry()) for rate in sums.values())],
            ],
        ),
    )
    page.say(
        f"{len(rows)} openings, the newest first: right answers by class, by the rule "
        "of the time. For effects that are not on softnn's list, cases without a name "
        "count. Later changes of softnn were made with earlier results in sight.",
        ledger.table(rows),
    )


def naming_figure(trials: Result) -> Figure:
    """Share right of the cases to be seen, a group of bars a class, with intervals."""
    figure = new_figure(6.4, 3.2)
    axes = figure.subplots()
    width = 0.8 / max(len(trials), 1)
    for i, (label, t) in enumerate(trials.items()):
        naming = t["visible"]["naming"]
        shown = [c for c in CLASSES if c in naming]
        x = [list(CLASSES).index(c) + (i + 0.5) * width - 0.4 for c in shown]
        rates = [naming[c] for c in shown]
        axes.bar(
            x,
            [r["rate"] for r in rates],
            0.9 * width,
            color=COLOURS[i % len(COLOURS)],
            label=label,
        )
        axes.errorbar(
            x,
            [r["rate"] for r in rates],
            ends(rates),
            fmt="none",
            ecolor=INK,
            capsize=2,
        )
        for at, r in zip(x, rates, strict=True):
            count = f"{r['right']}\n{r['of']}"
            axes.text(at, 0.02, count, ha="center", color="white", fontsize=8)
    axes.set_xticks(range(len(CLASSES)), [fill(CLASS_NAMES[c], 11) for c in CLASSES])
    axes.set_ylim(0, 1.02)
    axes.set_ylabel("share of cases right")
    figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    return figure


def reliability_figure(trials: Result) -> Figure:
    """Of names at a probability, the share that is right: on the line is right."""
    figure = new_figure(4.4, 4.4)
    axes: Axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color=FAINT, linewidth=0.8)
    for i, (label, t) in enumerate(trials.items()):
        deciles = t["all"]["calibration"].get("deciles", [])
        colour = COLOURS[i % len(COLOURS)]
        x, y = [d["mean"] for d in deciles], [d["rate"] for d in deciles]
        axes.errorbar(
            x, y, ends(deciles), fmt="o-", ms=4, lw=0.8, color=colour, label=label
        )
        for d in deciles:
            axes.annotate(
                f"{d['of']}",
                (d["mean"], d["rate"]),
                xytext=(-4 if i % 2 else 4, -9 if i // 2 % 2 else 4),
                ha="right" if i % 2 else "left",
                textcoords="offset points",
                fontsize=7,
                color=colour,
            )
    axes.set_xlim(0, 1.05)
    axes.set_ylim(-0.02, 1.05)
    axes.set_xlabel("probability of a name (number of names at the points)")
    axes.set_ylabel("share of names right")
    figure.legend(loc="outside lower center", ncols=3, fontsize=8)
    return figure
