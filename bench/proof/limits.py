"""The page's section on the smallest effect that softnn finds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bench.limits.reporting import curve, noise_table
from bench.reporting import share
from softnn.study.common import markdown, new_figure, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure
from bench.proof.page import Page, Result


def limits(page: Page, found: Result) -> None:
    head, grid = found["headline"], found["record"]["grid"]
    levels = ", ".join(str(percent(v, 1)) for v in grid["levels"])
    page.say(
        f"{found['record']['cases']} cases: {len(grid['effects'])} effects, strengths "
        f"{', '.join(f'{s:g}' for s in grid['strengths'])}, noise of {levels} of the "
        f"stress range, {', '.join(grid['colours'])}, in each cell "
        f"{grid['cases']}. The oracle is a likelihood-ratio test that knows the true "
        "law, the programme and the noise. Averaged over strengths softnn names "
        f"{head['power_ratio_mean']:.2f} of what the oracle sees; "
        f"{head['effects_at_bar']} of {head['effects']} effects are at "
        f"{head['power_ratio_bar']:g} or more."
        f"{lists_sentence(found['lists'])}"
    )
    page.figure("proof-limits", limits_figure(found["effects"]), "detection limits")
    page.say(limits_table(found["effects"]), cuts_table(found["effects"]))
    rows = [
        [
            colour,
            share(n["false_alarm"]),
            n["false_alarm"]["of"],
            percent(head["false_alarm_bar"], 0),
            "; ".join(f"{k} ({v})" for k, v in n["said"].items()) or None,
        ]
        for colour, n in found["nulls"].items()
    ]
    page.say(
        markdown(
            ["noise of nulls", "false alarms", "cases", "at most", "names"],
            rows,
        ),
        "The likelihood uses the noise that softnn estimates from the recordings:",
        noise_table(found["noise"]),
    )


def lists_sentence(lists: Result) -> str:
    """How long the lists of equivalents are; nothing, where nothing is named."""
    some = lists["with_a_list"]
    if not some["of"]:
        return ""
    return (
        " Each name comes with a list of effects that fit equally well. The list is "
        f"empty in {percent(1 - some['rate'], 0)} of {some['of']} cases and has "
        f"{lists['mean_length']:.2g} effects in the mean. An effect on the list does "
        "not count as named; the column *or listed* counts it."
    )


def limits_table(effects: Result) -> str:
    def short(value: float | None) -> str | None:
        return None if value is None else f"{value:.2g}"

    rows = []
    for name, e in effects.items():
        instead = list(e["visible_but_missed"].items())[:2]
        rows.append(
            [
                name,
                f"{e['ratio']:.2f} ({e['ratio_low']:.2f} to {e['ratio_high']:.2f})",
                f"{e['ratio_listed']:.2f}",
                short(e["smallest_strength"]),
                short(e["smallest_signal"]),
                short(e["oracle_smallest_signal"]),
                "; ".join(f"{what} ({n})" for what, n in instead) or None,
            ]
        )
    heads = ["effect", "named over the oracle", "or listed", "90 % from strength"]
    heads += ["from signal over noise", "the oracle's", "visible, but the answer was"]
    return markdown(heads, rows)


def cuts_table(effects: Result) -> str:
    """All effects together at each strength, and at each level and colour of noise."""
    cuts: dict[str, list[tuple[float, float]]] = {}
    for cell in (c for e in effects.values() for c in e["cells"]):
        noise = (f"noise of {percent(cell['level'], 1)}", f"{cell['colour']} noise")
        strengths = {k: v for k, v in cell.items() if isinstance(v, dict)}
        for strength, part in strengths.items():
            counted = part["named"]["rate"], part["oracle_power"]
            for cut in (f"strength {strength}", *noise):
                cuts.setdefault(cut, []).append(counted)
    kinds = ("strength", "noise of", "")  # the empty one is in all
    rows = []
    for cut in sorted(cuts, key=lambda c: [c.startswith(k) for k in kinds].index(True)):
        counts = cuts[cut]
        named, power = (sum(c) / len(counts) for c in zip(*counts, strict=True))
        rows.append([cut, percent(named, 0), percent(power, 0), f"{named / power:.2f}"])
    heads = ["all effects at", "named", "seen by the oracle", "one over the other"]
    return markdown(heads, rows)


def limits_figure(effects: Result) -> Figure:
    """A panel an effect: share named and the oracle's power against strength."""
    columns = 5
    count = -(-len(effects) // columns)
    figure = new_figure(9.0, 1.5 * count + 0.4)
    panels = figure.subplots(count, columns, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(effects) :]:
        axes.set_axis_off()
    for axes, (name, entry) in zip(panels.flat, effects.items(), strict=False):
        curve(axes, entry["strengths"])
        axes.set_title(name.replace("_", " "), fontsize=7)
        axes.tick_params(labelsize=6)
    handles, names = panels.flat[0].get_legend_handles_labels()
    if len(effects) < panels.size:
        panels.flat[-1].legend(handles, names, loc="center", fontsize=8)
    else:
        panels.flat[0].legend(handles, names, fontsize=6)
    figure.supxlabel("strength", fontsize=8)
    figure.supylabel("share of cases", fontsize=8)
    return figure
