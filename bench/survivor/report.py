"""The table, the figure and the page of `studies.survivor`, from its result alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bench.checking import moved
from softnn.contracts import InputError
from softnn.study import common
from softnn.taught import INPUTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parents[2] / "docs"
BARS = {"nrmse": 0.03, "over_ffrd4": 5.0, "over_corrected": 1.5}
BARS |= {"step_ns": 1000.0, "corrected_ns": 300.0, "python_s": 50e-6}
BARS |= {"difference": 1e-9, "times_real_time": 20.0}
Result = Mapping[str, Any]


def headline_of(body: Result) -> dict[str, Any]:
    """Return the figures that texts quote, in a flat dict."""
    out: dict[str, Any] = {}
    for row in body["problems"]:
        short = row["name"].replace(", ", " ").replace(" ", "_")
        for key in (INPUTS, "corrected model", "FFRD4"):
            out[f"{short}_{key.replace(' ', '_')}_nrmse"] = row["nrmse"][key]
        out[f"{short}_over_corrected"] = (
            row["nrmse"][INPUTS] / row["nrmse"]["corrected model"]
        )
        out[f"{short}_wrong_sign"] = row["wrong_sign"][INPUTS]
    if "sines" not in body:
        return out
    mine = [row["models"][INPUTS] for row in body["sines"]]
    out["sines_negative"] = sum(m["networks_negative"] for m in mine)
    errors = [m["nrmse"] for m in mine if m["nrmse"] is not None]
    out["sines_largest_nrmse"] = max(errors)
    fast = body["real_time"]
    out |= {k: v for k, v in fast.items() if not isinstance(v, Mapping)}
    for name, taken in fast["step_ns"].items():
        out |= {f"{name}_step_{k}_ns": v for k, v in taken.items()}
    return out | {"walking_rms_error": fast["walking"]["rms_error"]}


def report(body: Result) -> str:
    """NRMSE of every model on every problem, a row each."""
    names = max((list(row["nrmse"]) for row in body["problems"]), key=len)
    rows = [
        [row["name"], *(common.percent(row["nrmse"].get(n), 1) for n in names)]
        for row in body["problems"]
    ]
    return common.markdown(["unseen recordings", *names], rows)


def bars(body: Result) -> list[list[str]]:
    """Return a row for each bar: name, figure, bar, and whether it is met."""
    rows: list[list[str]] = []

    def one(what: str, found: str, bar: str, met: bool) -> None:
        rows.append([what, found, bar, "yes" if met else "no"])

    for row in body["problems"]:
        error, base = row["nrmse"]["FFH7"], row["nrmse"]["corrected model"]
        if row["name"].startswith("virtual"):
            found = common.percent(error, 2) or "-"
            one("NRMSE, " + row["name"], found, "3 %", error < BARS["nrmse"])
            for other in ("FFRD4 as published", "FFRD4"):
                times = row["nrmse"][other] / error
                met = times >= BARS["over_ffrd4"]
                one(f"better than {other}, times", f"{times:.3g}", "5", met)
        else:
            ratio = error / base
            met = ratio <= BARS["over_corrected"]
            what = f"{row['name']}: error over that of the corrected model"
            one(what, f"{ratio:.3g}", "1.5", met)
        share = row["wrong_sign"]["FFH7"]
        one(f"{row['name']}: wrong sign", f"{100 * share:.3g} %", "none", share == 0)
    if "sines" in body:
        mine = [row["models"]["FFH7"] for row in body["sines"]]
        bad = sum(m["networks_negative"] for m in mine)
        one("sines of 7.3 with negative stress", f"{bad} of {len(mine)}", "0", not bad)
        for row, found in zip(body["sines"], mine, strict=True):
            if (error := found["nrmse"]) is not None:
                what = f"NRMSE, sine ({row['scenario']}) {row['place']}"
                met = error < BARS["nrmse"]
                one(what, common.percent(error, 1) or "-", "3 %", met)
        fast, steps = body["real_time"], body["real_time"]["step_ns"]
        for name, key in (("network", "step_ns"), ("corrected", "corrected_ns")):
            mean = steps[name]["mean"]
            bar = BARS[key]
            what = {"network": "FFH7", "corrected": "corrected model"}[name]
            one(f"step in C, {what}, ns", f"{mean:.3g}", f"{bar:g}", mean < bar)
        step = fast["step_from_python_s"]
        one("a step from Python, s", f"{step:.2g}", "5e-05", step < BARS["python_s"])
        off = fast["largest_difference"]
        met = off < BARS["difference"]
        one("C against Python, relative", f"{off:.2g}", "1e-09", met)
        pace = fast["times_real_time"]
        met = pace >= BARS["times_real_time"]
        one("walking, times real time", f"{pace:.3g}", "20", met)
    return rows


def write_page(results: Path, docs: Path = DOCS) -> Path:
    """docs/survivor.md and its figure, from survivor.json; `InputError` without it."""
    file = results / "survivor.json"
    if not file.exists():
        raise InputError("no result; python -m studies.survivor makes it", file=file)
    body = json.loads(file.read_text(encoding="utf-8"))
    parts = [
        "# A network for controllers, tested on unseen recordings",
        "This page is for those who want a network for a controller. It tests the "
        "network of [`softnn.taught`](controllers.md) on recordings that it has not "
        "seen.",
        "Made by `python -m studies.survivor` from `studies/results/survivor.json`; no "
        f"number here is typed. {made(body)}",
        *filter(None, [moved(results, "survivor")]),
        "`FFH7` is one layer of tanh neurons with Bayesian regularisation. Its inputs "
        "are the strain, the largest strain so far, and the strain of the springs of "
        "five Maxwell branches a decade apart; it needs no derivative. Inputs are "
        "held within the training range. The stress has one sign, as a slack strip "
        "bears nothing.",
        "It learns from cyclic recordings and from "
        f"{body['size']['simulated']} simulated histories (`softnn.taught`). The "
        "recordings are scaled to the corrected physical model, specimen by specimen. "
        "The same model simulates the histories, also beyond rest, to a fifth more "
        "strain and at other rates.",
        f"A recurrent network (GRU of {body['size']['units']} units) and "
        f"{body['size']['gaussians']} Gaussian units learn from the same data. FFRD4 "
        "and FFRI1-3 ([defined here](architectures.md)) learn from the scaled "
        "recordings alone. All are judged on unseen recordings of other specimens; "
        "for the virtual material, of the mean specimen.",
        common.markdown(["figure", "result", "limit", "kept"], bars(body)),
    ]
    if "sines" in body:
        place = docs / "figures"
        place.mkdir(parents=True, exist_ok=True)
        draw(body).savefig(place / "survivor.png", dpi=100)
        parts.append("![sines of section 7.3, and errors](figures/survivor.png)")
    parts += [
        "## NRMSE on unseen recordings",
        report(body),
        "Effects of the corrected model, beside PL-Wiechert:",
        "\n".join(
            f"- {row['name']}: {', '.join(row['selected']) or 'none'}"
            for row in body["problems"]
        ),
    ]
    if "sines" in body:
        parts += ["## The sines of section 7.3", sine_table(body), real_time(body)]
    docs.mkdir(parents=True, exist_ok=True)
    path = docs / "survivor.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def made(body: Result) -> str:
    """Version, commit and date; those of problems that are of another commit."""
    whole = common.made_with(body)
    apart = [
        f"{row['name']}: {own}"
        for row in body["problems"]
        if "made" in row and (own := common.made_with(row)) != whole
    ]
    return " ".join([whole, *apart])


def sine_table(body: Result) -> str:
    rows = []
    for row in body["sines"]:
        for name, found in row["models"].items():
            rows.append(
                [
                    f"({row['scenario']}) {row['mm_per_min']:g} mm/min, {row['place']}",
                    name,
                    common.percent(found["nrmse"], 1),
                    common.percent(found["negative"], 0),
                    common.percent(found["flagged"], 0),
                ]
            )
    header = ["input", "network", "NRMSE", "negative", "flagged by the guard"]
    return common.markdown(header, rows)


def real_time(body: Result) -> str:
    fast = body["real_time"]
    net, base = (fast["step_ns"][k] for k in ("network", "corrected"))
    return (
        f"Time of a step in C, mean of {fast['steps']:g} steps: FFH7 "
        f"{net['mean']:.0f} ns, a corrected model (PL-Wiechert of 8 branches with "
        f"softening and set) {base['mean']:.0f} ns, on {body['machine']}, in double "
        "precision. No microcontroller was measured; one without a unit for doubles "
        "is far slower. In the slowest thousand in a row: "
        f"{net['slowest_1000']:.0f} and {base['slowest_1000']:.0f} ns (wall clock, "
        "interruptions included). In a simulated walk that relies on the estimate of "
        "the network, the torque is off by "
        f"{100 * fast['walking']['rms_error']:.2f} % of 15 Nm (rms). The error of the "
        f"estimate alone is {100 * fast['walking']['rms_of_estimate']:.2f} %."
    )


def draw(body: Result) -> Figure:
    """Two sines by the published and the mended network; errors of all models."""
    figure = common.new_figure(7.2, 5.2)
    panels = figure.subplot_mosaic([["a", "b"], ["errors", "errors"]])
    published, mended = common.COLOURS[1], common.COLOURS[0]
    for name in "ab":
        row = next(
            r
            for r in body["sines"]
            if (r["scenario"], r["place"]) == (name, "from zero")
        )
        axes, t = panels[name], row["time_s"]
        for model, colour in (("FFRD4 as published", published), ("FFH7", mended)):
            out = row["models"][model]["stress_MPa"]
            axes.plot(t, out, color=colour, linewidth=1, label=model)
        axes.plot(t, row["law_MPa"], "--", color=common.INK, linewidth=1, label="law")
        axes.axhline(0, color=common.FAINT, linewidth=0.6)
        axes.set(title=f"({name}) {row['mm_per_min']:g} mm/min", xlabel="time [s]")
        axes.set_ylabel("stress [MPa]")
    panels["b"].legend(fontsize=7, loc="center left", bbox_to_anchor=(1, 0.5))
    axes = panels["errors"]
    shown = ["FFH7", "FFRD4", "corrected model", "Gaussian units", "recurrent", "FFRI1"]
    marks = "sov^Dx"
    places = np.arange(len(body["problems"]))
    for name, mark, colour in zip(shown, marks, common.COLOURS, strict=True):
        errors = [100 * row["nrmse"][name] for row in body["problems"]]
        axes.plot(errors, places, mark, color=colour, label=name, markersize=5)
    axes.set_yticks(places, [row["name"] for row in body["problems"]], fontsize=7)
    axes.invert_yaxis()
    axes.set(xscale="log", xlabel="NRMSE on what was not learned from [%]")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1, 0.5))
    return figure
