"""The page's section on the closed loop: does the recording asked for settle it?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from bench.hands.families import SIDES
from bench.reporting import ends, share
from softnn.study.common import COLOURS, INK, markdown, new_figure, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bench.proof.page import Page

Result = Mapping[str, Any]
ARMS = {
    "asked": "the recording asked for",
    "telltale": "the likeliest effect's own programme",
    "repeat": "the longest recording again",
    "random": "a random programme as long",
}


def loop(page: Page, found: Result) -> None:
    """Write what each added recording settled, and what was promised beside it."""
    told = found["told"]
    left = Counter(
        row["left_out"].replace("_", " ")
        for row in found["rows"]
        if row["of"] in SIDES and "left_out" in row
    )
    page.say(
        f"{told['cases']} cases by other hands with two effects, or with laws that are "
        f"slightly wrong, were diagnosed. {told['open']} of them are open: the verdict "
        "is undetermined, and a recording is asked for. "
        "The others: "
        + "; ".join(f"{why} ({n})" for why, n in left.most_common())
        + ". For each open case its machine makes the recording that softnn asks for, "
        "with the same hidden truth, a fresh specimen and fresh noise, and the case is "
        "diagnosed again. Other recordings take its place in turn. *Settled*: an "
        "effect in question, or a class with one, has 90 % or more, or all have less "
        "than 10 %. *Wrong*: some name or class of 90 % or more is false."
    )
    if not told["arms"]:
        return
    rows = [
        [ARMS[arm], *(share(one[k]) for k in ("settled", "right", "wrong"))]
        for arm, one in told["arms"].items()
    ]
    page.say(markdown(["recording added", "settled", "rightly", "wrongly"], rows))
    page.figure("proof-loop", figure(told), "settled by each recording")
    promised = [
        f"{percent(part['promised'], 0)} promised, {share(part['came'])} came"
        for part in told["promised"]
    ]
    if promised:
        page.say("By thirds of the promise to settle: " + "; ".join(promised) + ".")


def figure(told: Result) -> Figure:
    """Shares settled rightly and wrongly by arm."""
    drawn = new_figure(7.2, 3.0)
    bars = drawn.subplots()
    arms = list(told["arms"])[::-1]
    for i, (kind, colour) in enumerate((("right", COLOURS[2]), ("wrong", COLOURS[1]))):
        rates = [told["arms"][arm][kind] for arm in arms]
        at = [k + 0.2 - 0.4 * i for k in range(len(arms))]
        widths = [r["rate"] for r in rates]
        bars.barh(at, widths, 0.36, color=colour, label=f"settled, {kind}")
        bars.errorbar(widths, at, xerr=ends(rates), fmt="none", ecolor=INK, capsize=2)
    bars.set_yticks(range(len(arms)), [ARMS[arm] for arm in arms])
    bars.set_xlim(0, 1)
    bars.set_xlabel("share of open cases")
    drawn.legend(loc="outside lower center", ncols=2, fontsize=8)
    return drawn
