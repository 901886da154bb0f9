"""What was concealed, what was found, what was not, and why: a page or two.

`python -m studies.proof` writes docs/proof.md, docs/proof-hands.md of the trial by
other hands, and their figures, from the JSON files in studies/results alone; what has
not been run is said to be so.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.concealed import reporting
from bench.concealed.orders import NAMES
from bench.cost import cost_figure
from bench.limits.reporting import curve, noise_table
from bench.proof import hands as proof_hands
from bench.rivals import table
from bench.scoring import Rate
from softnn.models.units import BASES
from softnn.study.common import (
    COLOURS,
    FAINT,
    RESULTS,
    RUNS,
    guarded,
    markdown,
    new_figure,
    parser,
    percent,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parents[2] / "docs"
COMMANDS = {  # of the result files the page is made of
    "concealed": "python -m studies.concealed",
    "hands": "python -m studies.concealed --hands held-out",
    "ledger": "python -m studies.concealed",
    "limits": "python -m studies.limits",
    "rivals": "python -m studies.rivals",
    "recordings": "python -m studies.recordings",
    "cost": "python -m studies.cost",
}
BASE = "pl-wiechert"  # of the real recordings that are shown
# Kinds on no list that softnn.mismatch.strangers has a law for, written knowing them.
WITH_LAWS = (
    "creep_damage",
    "crystallisation",
    "leadscrew",
    "one_way_flow",
    "stiction",
    "thixotropy",
)
MADE = (
    "Made by `python -m studies.proof` from `studies/results`; no number here is "
    "typed. In brackets are 95 % intervals (Wilson for shares)."
)
OTHER = "[the proof by other hands](proof-hands.md)."
DPI = 100  # small files: the figures lie in the repository

Result = Mapping[str, Any]


class Page:
    """Text and figures of the page, in their order."""

    def __init__(self, results: Path, folder: Path) -> None:
        self.results, self.folder = results, folder
        self.parts: list[str] = []

    def result(self, name: str) -> Result | None:
        file = self.results / f"{name}.json"
        return json.loads(file.read_text(encoding="utf-8")) if file.exists() else None

    def say(self, *paragraphs: str) -> None:
        self.parts += [p for p in paragraphs if p]

    def figure(self, name: str, figure: Figure, about: str) -> None:
        place = self.folder / "figures"
        place.mkdir(parents=True, exist_ok=True)
        figure.savefig(place / f"{name}.png", dpi=DPI)
        self.say(f"![{about}](figures/{name}.png)")

    def section(
        self, title: str, name: str, write: Callable[[Page, Result], None]
    ) -> None:
        """A section from one result, or that there is none."""
        self.say(f"## {title}")
        found = self.result(name)
        if found is None:
            self.say(f"Not run: `{COMMANDS[name]}`.")
        else:
            write(self, found)

    def write(self, name: str = "proof.md") -> Path:
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / name
        path.write_text("\n\n".join(self.parts) + "\n", encoding="utf-8")
        return path


def share(entry: Mapping[str, Any] | None) -> str | None:
    """A rate with its interval.

    >>> share({"rate": 0.5, "low": 0.25, "high": 0.75, "of": 8})
    '50 % (25 to 75)'

    One miss in many is not none.

    >>> share({"rate": 0.995, "low": 0.972, "high": 0.9991, "of": 200})
    '99.5 % (97 to 99.9)'
    """
    if not entry or entry.get("rate") is None or not entry.get("of"):
        return None
    # All or none needs no tenth.
    ends = entry["rate"] in (0, 1)
    rate, low, high = (
        f"{100 * v:.{int(not ends and (0 < v < 0.01 or 0.99 < v < 1))}f}"
        for v in (entry["rate"], entry["low"], entry["high"])
    )
    return f"{rate} % ({low} to {high})"


def strength_of(trial: Result) -> float:
    return float(trial["record"]["strength"])


def trials_of(found: Result) -> list[Result]:
    """Trials of a file, the strongest first."""
    return sorted(found["trials"].values(), key=strength_of, reverse=True)


# --- concealed cases ------------------------------------------------------------------


def concealed(page: Page, found: Result) -> None:
    trials = trials_of(found)
    for t in trials:
        record = t["record"]
        groups = t["all"]["naming"].items()
        counts = ", ".join(f"{g['of']} {name}" for name, g in groups)
        page.say(
            f"Strength {record['strength']:g}, seed {record['seed']}: "
            f"{record['cases']} cases ({counts}); SHA-256 of the key, on file before "
            f"anything was diagnosed: `{record['key_sha256'][:16]}...`."
        )
    page.say(*dict.fromkeys(t["record"].get("note", "") for t in trials))
    page.say("### What was found", bars_table(trials))
    for t in trials:
        page.say(hidden_sentence(t))
        page.say(strangers_sentence(t))
    page.figure("proof-concealed", concealed_figure(trials), "right and alone")
    page.say("### What was not found, and why")
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
        f"At strength {strength_of(trial):g} the base alone, refitted, is within "
        f"{percent(limit, 0)} of the recordings in {one['accepted']['right']} of "
        f"{one['accepted']['of']} cases with one effect: a fit that would be accepted "
        f"by eye. In those the effect was named in {share(one['named'])}, and nothing "
        f"else with it in {share(one['right'])}."
    )


def strangers_sentence(trial: Result) -> str:
    """What is on no list, with and without a law that was written for it."""
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
        f"At strength {strength_of(trial):g}, of what is on no list, the kinds that "
        f"softnn has a law for by now ({', '.join(WITH_LAWS)}) got no name "
        f"in {with_law}; the others in {without}."
    )


def concealed_figure(trials: Sequence[Result]) -> Figure:
    """Share of cases named right and alone, effect by effect, with intervals."""
    figure = new_figure(6.4, 4.4)
    axes = figure.subplots()
    for i, t in enumerate(trials):
        effects = t["all"]["effects"]
        entries = [(n, e) for n in NAMES if (e := effects.get(n)) and e["of"]]
        y = [NAMES.index(n) + 0.16 * (2 * i - len(trials) + 1) for n, _ in entries]
        x = [e["rate"] for _, e in entries]
        bars = [
            [e["rate"] - e["low"] for _, e in entries],
            [e["high"] - e["rate"] for _, e in entries],
        ]
        axes.errorbar(
            x,
            y,
            xerr=bars,
            fmt="o",
            ms=4,
            color=COLOURS[i % len(COLOURS)],
            elinewidth=0.8,
            label=f"strength {strength_of(t):g}",
        )
    axes.set_yticks(range(len(NAMES)), [n.replace("_", " ") for n in NAMES])
    axes.set_ylim(len(NAMES) - 0.5, -0.5)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("cases in which the effect was named, and nothing else")
    axes.grid(axis="x", color=FAINT, alpha=0.3, linewidth=0.6)
    figure.legend(loc="outside lower center", ncols=len(trials), fontsize=8)
    return figure


def causes_table(trial: Result) -> str:
    """Misses by what was planted and why, the most frequent first."""
    strength = strength_of(trial)
    if not trial["misses"]:
        return f"At strength {strength:g} nothing was missed."
    return reporting.causes_table(trial["misses"], f"planted, strength {strength:g}")


# --- detection limits -----------------------------------------------------------------


def limits(page: Page, found: Result) -> None:
    head, grid = found["headline"], found["record"]["grid"]
    levels = ", ".join(str(percent(v, 1)) for v in grid["levels"])
    page.say(
        f"{found['record']['cases']} cases: {len(grid['effects'])} effects, strengths "
        f"{', '.join(f'{s:g}' for s in grid['strengths'])}, noise of {levels} of the "
        f"stress range, {', '.join(grid['colours'])}, in each cell "
        f"{grid['cases']}. The oracle is the likelihood-ratio test that is told the "
        "true form, the programme and the noise. Averaged over strengths softnn names "
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
            ["noise of nulls", "false alarms", "cases", "at most", "what was said"],
            rows,
        ),
        "Everything is weighed by the noise as it is read off the recordings:",
        noise_table(found["noise"]),
    )


def lists_sentence(lists: Result) -> str:
    """How long the lists of equivalents are; nothing, where nothing is named."""
    some = lists["with_a_list"]
    if not some["of"]:
        return ""
    return (
        " What is named comes with a list of effects that could not be told from it "
        f"there, empty in {percent(1 - some['rate'], 0)} of {some['of']} cases, of "
        f"{lists['mean_length']:.2g} effects in the mean; to be on it is not counted "
        "as named, but shown beside."
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
    heads += ["from signal over noise", "the oracle's", "visible, yet said"]
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


# --- the others -----------------------------------------------------------------------


def rivals(page: Page, found: Result) -> None:
    """What every method made of the same cases, and where softnn is beaten."""
    heads = {
        "right": "right and alone",
        "accepted": "the same, base accepted by eye",
        "alarms": "false alarms",
        "wrong": "wrong name",
        "heldout_nrmse": "held-out NRMSE",
        "seconds": "s a case",
    }
    for t in trials_of(found):
        rows = []
        for name, row in t["table"].items():
            cells: list[str | None] = [name]
            for key in heads:
                entry = row.get(key)
                if isinstance(entry, Mapping):
                    cells.append(share(entry))
                elif entry is None:
                    cells.append(None)
                elif key == "heldout_nrmse":
                    cells.append(percent(entry))
                else:
                    cells.append(f"{entry:.2g}")
            rows.append([*cells, table.versus(row)])
        head = [f"strength {strength_of(t):g}", *heads.values(), table.VERSUS]
        page.say(
            markdown(head, rows),
            beaten(t.get("wins", []), heads),
            t["record"].get("note", ""),
        )


def beaten(wins: Sequence[Mapping[str, Any]], heads: Mapping[str, str]) -> str:
    if not wins:
        return "No rival is better in any column."
    parts = [
        f"{w['rival']} ({heads.get(w['column'], w['column'])}, "
        f"{w['rival_value']:.3g} against {w['softnn_value']:.3g}"
        + (", within the intervals)" if w["apart"] is False else ")")
        for w in wins
    ]
    return "Better than softnn: " + "; ".join(parts) + "."


def bases(found: Mapping[str, Mapping[str, Any]]) -> str:
    """What comes out with each base: median errors on unseen recordings; which code."""
    keys = ("unseen_nrmse_before_median", "unseen_nrmse_after_median")
    rows = [
        [
            name,
            f"{one['groups_in_agreement']} of {one['groups_judged']}",
            f"{one['bars_met']} of {one['bars']}",
            *(None if one[k] is None else percent(one[k]) for k in keys),
            ", ".join(one["code"]),
        ]
        for name, one in sorted(found.items(), key=lambda kv: BASES.index(kv[0]))
    ]
    heads = ["base", "as the literature", "bars met", "base alone", "corrected"]
    return markdown([*heads, "hash of softnn's code"], rows)


def recordings(page: Page, found: Result) -> None:
    """Predictions of what was not used, against the literature; and made faults."""
    head = found["headline"]
    medians = [
        percent(head[f"cycles_from_first_loading_nrmse_{when}_median"])
        for when in ("before", "after")
    ]
    page.say(
        f"Of {head['groups']} groups of recordings {head['groups_judged']} are of "
        "materials of which the literature says what is in them; the names agree with "
        f"it in {head['groups_in_agreement']}. Of {head['bars']} predictions with a "
        f"bar {head['bars_met']} meet it. What comes after first loading, predicted "
        f"from first loading alone, is missed by {medians[0] or '-'} by the base and "
        f"by {medians[1] or '-'} with what was named (medians)."
    )
    if len(found.get("bases", {})) > 1:
        page.say("Each base leaves other physics out:", bases(found["bases"]))
    rows = []
    bars = {(m["set"], m["group"]): m["bars"] for m in found["literature"]}
    for r in found["rows"]:
        if r["kind"] != "split" or r["base"] != BASE or not r["unseen"]:
            continue
        wrong = [f"no {m}" for m in r["missed"]]
        wrong += [f"not {n}" for n in r["named_though_absent"]]
        agrees = {True: "yes", False: "no: " + ", ".join(wrong), None: None}
        rows.append(
            [
                f"{r['set']} {r['group']}".strip(),
                f"{r['split']} {r['label']}".strip() + " *" * r["outside"],
                ", ".join(r["selected"]) or r["verdict"],
                percent(r["unseen"]["before"]),
                percent(r["unseen"]["after"]),
                judged(bars.get((r["set"], r["group"]), {}), r["bars_met"]),
                agrees[r["agrees"]],
            ]
        )
    heads = ["recordings", "predicted", "named", "base alone", "corrected", "bar"]
    if rows:
        page.say(
            markdown([*heads, "as the literature"], rows),
            "\\* beyond all that was fitted. A bar is the largest error allowed.",
        )
    faults = found.get("faults")
    if faults:
        entries = [*faults["by_fault"].items(), ("all", faults["found"])]
        entries.append(("a false name", faults["with_a_false_name"]))
        entries.append(("a new name, nothing made", faults["new_without_a_fault"]))
        cells = [[name, share(e), e["of"]] for name, e in entries]
        page.say(
            "Faults made on copies of real recordings, to be found on top of what is "
            f"there (hash of softnn's code {', '.join(faults['code'])}):",
            markdown(["fault", "found", "copies"], cells),
            "A false name is one that the original has not. In the last row the copy "
            "has no fault but lacks a recording: names may come anyhow.",
        )
        missed(page, faults)


def judged(bars: Mapping[str, float], met: bool | None) -> str | None:
    """A bar and whether it is met; None where there is none."""
    if met is None or not bars:
        return None
    parts = [f"{percent(bars['nrmse'], 1)}"] if "nrmse" in bars else []
    parts += [f"{percent(bars['ratio'], 0)} of the base's"] if "ratio" in bars else []
    return f"{' and '.join(parts)}, {'met' if met else 'missed'}"


def missed(page: Page, faults: Mapping[str, Any]) -> None:
    """Made faults that were not found, beside what of the original is not explained."""
    close = faults["found_where_close"]
    lost: dict[tuple[str, str, float | None], list[Mapping[str, Any]]] = {}
    page.say(
        "Where what softnn makes of the original foretells recordings left out within "
        f"{percent(faults['close'], 0)} of their range, {share(close) or '-'} of "
        f"{close['of']} were found. Those that were not:"
    )
    for c in faults["copies"]:
        if not (c["found"] or c["there_before"]):
            lost.setdefault((c["set"], c["group"], c["left"]), []).append(c)
    rows = [
        [
            f"{name} {group}".strip(),
            percent(left),
            "; ".join(f"{c['fault']}: {', '.join(c['said'])}" for c in copies),
        ]
        for (name, group, left), copies in sorted(
            lost.items(), key=lambda kv: -(kv[0][2] or 0)
        )
    ]
    heads = ["recordings", "missed without a fault", "fault: what was said"]
    page.say(markdown(heads, rows) if rows else "")


def cost(page: Page, found: Result) -> None:
    head = found["headline"]

    def short(key: str, digits: int = 2) -> str:
        return "-" if head.get(key) is None else f"{head[key]:.{digits}f}"

    page.say(
        "A case of 7 recordings of 1000 samples takes "
        f"{short('seconds_of_7_by_1000', 1)} s ({found['machine']}). On log-log axes "
        f"the seconds grow with a slope of {short('slope_samples')} with samples, "
        f"{short('slope_samples_unthinned')} when every sample is used, and "
        f"{short('slope_effects')} with the effects to choose from. The search looks "
        f"at no more than {head['search_samples']} samples a recording, figures and "
        f"errors at no more than {head['report_samples']}."
    )
    page.figure("proof-cost", cost_figure(dict(found["curves"])), "seconds a case")


# --- the command ----------------------------------------------------------------------


def make(results: Path, folder: Path) -> Path:
    """Write the pages from the results; the path of the first."""
    other = Page(results, folder)
    other.say("# The proof by other hands", MADE)
    other.section("Cases by other hands", "hands", proof_hands.hands)
    other.section("All that was ever opened", "ledger", proof_hands.openings)
    other.write("proof-hands.md")
    page = Page(results, folder)
    page.say("# The proof", MADE)
    page.say("Cases made by other hands, and all that was ever opened: " + OTHER)
    page.section("What was concealed", "concealed", concealed)
    page.section("How small it may be", "limits", limits)
    page.section("Other methods on the same cases", "rivals", rivals)
    page.section("Real recordings", "recordings", recordings)
    page.section("What it costs", "cost", cost)
    return page.write()


def make_parser() -> argparse.ArgumentParser:
    p = parser("proof", __doc__)
    p.add_argument("--results", type=Path, default=RESULTS, help="where the JSON lies")
    p.add_argument("--out", type=Path, help="folder of the page (docs)")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.proof`; returns the exit code."""
    a = make_parser().parse_args(argv)
    folder = a.out or (RUNS / "smoke" / "docs" if a.smoke else DOCS)
    return guarded(lambda: print(f"written to {make(a.results, folder)}"))
