"""The page's sections on real recordings and cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bench.cost import cost_figure
from bench.proof.page import Page, Result
from bench.recordings import history, promise
from bench.recordings.reporting import FAULT_HEADS, fault_rows
from bench.reporting import share
from softnn.models.bases import BASES
from softnn.study.common import made_with, markdown, percent

BASE = "pl-wiechert"  # of the real recordings that are shown


def bases(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a table of the results by base: median errors on unseen recordings."""
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
    """Write predictions of unused recordings, names and literature, and made faults."""
    head = found["headline"]
    medians = [
        percent(head[f"cycles_from_first_loading_nrmse_{when}_median"])
        for when in ("before", "after")
    ]
    page.say(
        f"For {head['groups_judged']} of {head['groups']} groups of recordings the "
        "literature names the effects of the material. The names agree with it in "
        f"{head['groups_in_agreement']} of them. Of {head['bars']} predictions with a "
        f"bar (the largest error allowed) {head['bars_met']} meet it. Fitted to first "
        "loading alone, the base "
        f"predicts the later cycles with an error of {medians[0] or '-'}; with the "
        f"named effects it is {medians[1] or '-'} (medians)."
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
            "\\* beyond the fitted range. A bar is the largest error allowed.",
        )
    promised = found.get("promises")
    if promised and promised["all"]["came"]["of"]:
        page.say(
            "Some recordings are left out, and softnn says how likely recordings of "
            "their programme settle the question. Then they are put back. In three "
            "parts by that promise, then all together:",
            markdown(*promise.table(promised)),
        )
    faults = found.get("faults")
    if faults:
        page.say(
            "Faults were added to copies of real recordings; softnn should find them "
            f"beside the effects of the material. {made_with(faults)}",
            markdown(FAULT_HEADS, fault_rows(faults)),
            "A false name is a name that the diagnosis of the original does not have. "
            "In the copies with one recording less nothing was made.",
            "An oracle knows the law of a fault and its recordings. It sees the fault "
            "if this law, beside the effects of the original, predicts better than the "
            "scatter of the folds; what it does not see, nobody can find."
            if "seen_by_oracle" in faults
            else "",
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
    """Write the faults not found, with the error of the original's correction."""
    close = faults["found_where_close"]
    lost: dict[tuple[str, str, float | None], list[Mapping[str, Any]]] = {}
    page.say(
        "In some sets the corrected model of the original predicts left-out recordings "
        f"within {percent(faults['close'], 0)} of their range. There "
        f"{share(close) or '-'} of {close['of']} faults were found. All faults that "
        "were missed (* where no oracle sees them):"
    )
    for c in faults["copies"]:
        if not (c["found"] or c["there_before"]):
            lost.setdefault((c["set"], c["group"], c["left"]), []).append(c)
    rows = [
        [
            f"{name} {group}".strip(),
            percent(left),
            "; ".join(map(told, copies)),
        ]
        for (name, group, left), copies in sorted(
            lost.items(), key=lambda kv: -(kv[0][2] or 0)
        )
    ]
    heads = ["recordings", "error without a fault", "fault: names or verdict"]
    page.say(markdown(heads, rows) if rows else "")


def told(copy: Mapping[str, Any]) -> str:
    """A fault that was missed and what was said; * where an oracle misses it too."""
    mark = " *" if copy.get("seen") is False else ""
    return f"{copy['fault']}{mark}: {', '.join(copy['said'])}"


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
