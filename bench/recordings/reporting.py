"""Tables, result file, figures and MLflow of the study of real recordings."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.recordings import promise
from bench.recordings.faults import CONTROL
from bench.recordings.groups import Group
from bench.recordings.history import entry, extended
from bench.recordings.rows import (
    MAIN,
    Row,
    agreement,
    fault_scores,
    kept,
    made_of,
    met,
)
from bench.recordings.sets import Material
from bench.reporting import cell, tracked
from softnn.study.common import (
    COLOURS,
    database,
    fingerprint,
    markdown,
    new_figure,
    percent,
    results_folder,
    runs_folder,
    save_figure,
    write_result,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def report(
    rows: Sequence[Row],
    groups: Sequence[Group],
    left_out: Mapping[str, str],
    a: argparse.Namespace,
    digest: str,
    main: str,
) -> None:
    """Print, write and track what came out."""
    material = {(g.set, g.name): g.material for g in groups}
    partial = bool(a.sets or a.groups or a.only_faults)
    home = runs_folder(a.smoke)
    folder = a.out or (
        home / "results" if partial else results_folder(a.smoke, a.publish)
    )
    untouched = [r for r in rows if r.kind != "fault"]
    copies = [r for r in rows if r.kind == "fault"]
    faults = fault_scores(copies) if copies else None
    history: list[Any] = []
    if not partial and not a.smoke:
        before = kept(folder / "recordings.json", a.bases, groups)
        untouched += before["rows"]
        faults = faults or before["faults"]
        main = MAIN if any(r.base == MAIN for r in untouched) else main
        mine = [r for r in untouched if r.base == main]
        history = extended(before["history"], entry(mine, material, made_of(mine)))
    promised = promise.promises(rows)
    written = tables(untouched, material, faults, main)
    if promised["all"]["came"]["of"]:
        written += ["**Recordings put back**", markdown(*promise.table(promised))]
    note = "\n\n".join(written)
    print(note)
    # Made faults of an earlier run are no headline of this one.
    head = headline(untouched, material, faults if copies else None, main)
    body = {
        "left_out": left_out,
        "literature": [
            {"set": g.set, "group": g.name, "recordings": len(g.recordings),
             **asdict(g.material)}
            for g in groups
        ],
        "rows": [
            {**r.published(), **agreement(r, material[r.set, r.group]),
             "bars_met": met(r, material[r.set, r.group])}
            for r in untouched
        ],
        "bases": by_base(untouched, material),
        "faults": faults,
        "promises": promised,
        "history": history,
    }  # fmt: skip
    path = write_result(
        "recordings", head, body, seed=a.seed, data={"all": digest}, folder=folder
    )
    figures = []
    if any(r.unseen for r in untouched):
        figures = save_figure(figure(untouched, main), "recordings", folder)
    print(f"\nresult: {path}")
    track(a, head, note, [path, *figures[:1]], digest)


def headline(
    rows: Sequence[Row],
    material: Mapping[tuple[str, str], Material],
    faults: Mapping[str, Any] | None,
    main: str,
) -> dict[str, float | int | None]:
    """Flat figures: agreement, bars, medians; shares of faults, if found just now."""
    out: dict[str, float | int | None] = {}
    mine = [r for r in rows if r.base == main and not r.error]
    whole = [agreement(r, material[r.set, r.group]) for r in mine if r.kind == "all"]
    judged = [w for w in whole if w["agrees"] is not None]
    out["groups"] = len(whole)
    out["groups_judged"] = len(judged)
    out["groups_in_agreement"] = sum(w["agrees"] for w in judged)
    # Names of groups of which the literature says what is there, and what is not.
    sure = [(n, n in w["named_though_absent"]) for w in judged for n in w["sure"]]
    out["sure_names"], out["sure_names_excluded"] = len(sure), sum(x for _, x in sure)
    split = [r for r in mine if r.kind == "split"]
    bars = [m for r in split if (m := met(r, material[r.set, r.group])) is not None]
    out["bars"], out["bars_met"] = len(bars), sum(bars)
    for kind, name in (("split", "unseen"), ("monotonic", "cycles_from_first_loading")):
        for key in ("before", "after"):
            values = [r.unseen[key] for r in mine if r.kind == kind and r.unseen]
            out[f"{name}_nrmse_{key}_median"] = (
                float(np.median(values)) if values else None
            )
    if faults is not None:
        out["faults"] = faults["found"]["of"]
        out["faults_found"] = faults["found"]["rate"]
        out["faults_with_a_false_name"] = faults["with_a_false_name"]["rate"]
        for key in ("seen_by_oracle", "found_of_seen", "with_a_sure_false_name"):
            out[f"faults_{key}"] = faults.get(key, {}).get("rate")
    return out


def by_base(
    rows: Sequence[Row], material: Mapping[tuple[str, str], Material]
) -> dict[str, dict[str, Any]]:
    """`headline` of each base, and the commits that made its rows."""
    return {
        base: {
            **headline(rows, material, None, base),
            **made_of([r for r in rows if r.base == base]),
        }
        for base in dict.fromkeys(r.base for r in rows)
    }


def tables(
    rows: Sequence[Row],
    material: Mapping[tuple[str, str], Material],
    faults: Mapping[str, Any] | None,
    main: str,
) -> list[str]:
    out = []
    for kind, title in (
        ("all", "All recordings of a group; held out one recording at a time"),
        ("split", "Specimens, rates or amplitudes that were not used"),
        ("monotonic", "First loading alone; what comes after it predicted"),
    ):
        mine = [r for r in rows if r.kind == kind]
        if mine:
            out.append(f"**{title}**")
            out.append(_table(mine, material))
    if faults is not None:
        out.append(f"**Made faults** ({main})")
        out.append(
            markdown(
                FAULT_HEADS,
                fault_rows(faults),
            )
        )
    return out


FAULT_HEADS = ("fault", "found", "an oracle sees", "found of these")


def fault_rows(faults: Mapping[str, Any]) -> list[list[str | None]]:
    """Made faults one by one, then all, then false names with and without a fault.

    An older result has no oracle and no sure names.
    """
    kinds = ("by_fault", "by_fault_seen", "by_fault_found_of_seen")
    rows = [
        [name, *(cell(faults.get(kind, {}).get(name)) for kind in kinds)]
        for name in faults["by_fault"]
    ]
    whole = ("found", "seen_by_oracle", "found_of_seen")
    rows.append(["all", *(cell(faults.get(key)) for key in whole)])
    for words, key in (
        ("a false name", "with_a_false_name"),
        ("... at 90 % or more", "with_a_sure_false_name"),
        (f"a new name, {CONTROL}", "new_without_a_fault"),
        ("... at 90 % or more", "surely_new_without_a_fault"),
    ):
        if key in faults:
            rows.append([words, cell(faults[key]), None, None])
    return rows


def _table(rows: Sequence[Row], material: Mapping[tuple[str, str], Material]) -> str:
    def cells(r: Row) -> list[Any]:
        said = agreement(r, material[r.set, r.group])
        if r.error:
            return [r.set, r.group, r.base, r.label, r.error[:40], *[None] * 5]
        before, after = (
            (r.unseen["before"], r.unseen["after"]) if r.unseen else r.heldout
        )
        wide = r.unseen.get("after_95")
        ratio = r.unseen.get("ratio", r.ratio[0])
        words = {True: "yes", False: "no"}
        miss = [f"no {m}" for m in said["missed"]]
        miss += [f"not {w}" for w in said["named_though_absent"]]
        return [
            r.set,
            r.group,
            r.base,
            f"{r.split} {r.label}".strip() + (" (outside)" if r.outside else ""),
            ", ".join(r.selected) or r.verdict,
            percent(before),
            percent(after),
            _range(*wide) if wide else None,
            f"{ratio:.2f}",
            words[said["agrees"]] + (": " + "; ".join(miss) if miss else "")
            if said["agrees"] is not None
            else None,
        ]

    header = ["set", "group", "base", "held out", "named", "before", "after"]
    return markdown([*header, "95 %", "ratio", "agrees"], [cells(r) for r in rows])


def _range(low: float | None, high: float | None) -> str | None:
    return None if low is None or high is None else f"{percent(low)} to {percent(high)}"


def figure(rows: Sequence[Row], main: str) -> Figure:
    """Error on what was not used, before and after: numbers, no curve of anybody's."""
    mine = [r for r in rows if r.kind == "split" and r.base == main and r.unseen]
    mine = mine or [r for r in rows if r.unseen]
    plot = new_figure(7.2, 1.2 + 0.22 * len(mine))
    axes = plot.subplots()
    for i, r in enumerate(mine):
        for key, colour in (("before", COLOURS[1]), ("after", COLOURS[0])):
            value = 100 * r.unseen[key]
            low, high = (100 * x for x in r.unseen[f"{key}_95"])
            axes.plot([low, high], [i, i], color=colour, lw=1)
            axes.plot(value, i, "o", color=colour, ms=4, label=key if i == 0 else None)
    names = [" ".join(filter(None, [r.set, r.group, r.label])) for r in mine]
    axes.set_yticks(range(len(mine)), names, fontsize=6)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlabel("NRMSE on recordings not used, %, with 95 % interval")
    axes.legend(fontsize=7)
    return plot


def track(
    a: argparse.Namespace,
    head: Mapping[str, float | int | None],
    note: str,
    files: Sequence[Path],
    digest: str,
) -> None:
    """One MLflow run, with its tables and figures of numbers."""
    settings = {
        k: getattr(a, k) for k in ("sets", "groups", "bases", "samples", "seed", "size")
    }
    tracked(
        "recordings",
        head,
        database(a.tracking, a.smoke),
        study="recordings",
        identity=fingerprint([settings, digest, note]),
        name="real recordings",
        parameters=settings,
        data=("recordings", digest),
        note=note,
        files=files,
    )
