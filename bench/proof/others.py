"""The page's sections on real recordings and cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench.cost import cost_figure
from bench.proof.page import Page, Result
from bench.recordings import history
from bench.reporting import share
from softnn.models.units import BASES
from softnn.study.common import made_with, markdown, percent

BASE = "pl-wiechert"  # of the real recordings that are shown


def bases(found: Mapping[str, Mapping[str, Any]]) -> str:
    """What comes out with each base: median errors on unseen recordings; the commit."""
    keys = ("unseen_nrmse_before_median", "unseen_nrmse_after_median")
    rows = [
        [
            name,
            f"{one['groups_in_agreement']} of {one['groups_judged']}",
            f"{one['bars_met']} of {one['bars']}",
            *(None if one[k] is None else percent(one[k]) for k in keys),
            one["commit"],
        ]
        for name, one in sorted(found.items(), key=lambda kv: BASES.index(kv[0]))
    ]
    heads = ["base", "as the literature", "bars met", "base alone", "corrected"]
    return markdown([*heads, "commit"], rows)


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
    if found.get("history"):
        page.say(history.ABOUT, history.table(found["history"]))
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
            f"there. {made_with(faults)}",
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
