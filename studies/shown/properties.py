"""Figures of `studies.properties`, in the manner of Figs 4.6 to 4.18 of the thesis."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn import prepare
from softnn.materials import SPEEDS, material
from softnn.properties import BEND, OFFSET, Elastic, Properties
from softnn.recording import Recording
from softnn.study import common, property_sets
from softnn.study.common import COLOURS, FAINT, INK, new_figure
from softnn.study.virtual_properties import BENDS, LISTED, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BY_SPEED = dict(zip(SPEEDS, COLOURS, strict=False))
INITIAL = 0.3  # strain shown in the inset


def virtual_figures(drawn: Mapping[str, Any]) -> dict[str, Figure]:
    """Mean curves, offset yield, relaxation; `drawn` maps a material to its results."""
    found = {name: tensile for name, (tensile, _) in drawn.items()}
    tests = {name: held for name, (_, held) in drawn.items()}
    return {
        "curves": curves(found),
        "yield": offset_yield(found),
        "relaxation": relaxation(tests),
    }


def curves(found: Mapping[str, Sequence[Properties]]) -> Figure:
    """Figs 4.6 to 4.9: mean curve of each speed, whole and its initial part."""
    columns = 2 * min(2, len(found))
    rows = -(-2 * len(found) // columns)
    figure = new_figure(2.6 * columns, 2.1 * rows + 0.3)
    for i, (name, group) in enumerate(found.items()):
        whole = figure.add_subplot(rows, columns, 2 * i + 1)
        initial = figure.add_subplot(rows, columns, 2 * i + 2)
        for p in group:
            speed = _speed(name, p)
            colour = BY_SPEED[speed]
            label = f"{speed} mm/min, {p.specimens}"
            first = p.mean.strain <= INITIAL
            for axes, part in ((whole, slice(None)), (initial, first)):
                x, y = p.mean.strain[part], p.mean.stress_MPa[part]
                axes.plot(x, y, color=colour, label=label)
        whole.set_title(name)
        initial.set_title(f"{name}, initial part")
        whole.legend(fontsize=7, loc="upper left", labelspacing=0.2)
        whole.set_xlim(left=0)
        whole.set_ylim(0, 1.25 * whole.get_ylim()[1])
        initial.set_xlim(0, INITIAL)
        initial.set_ylim(bottom=0)
        if 2 * i % columns == 0:
            whole.set_ylabel("stress [MPa]")
        if 2 * i >= 2 * len(found) - columns:
            whole.set_xlabel("strain")
            initial.set_xlabel("strain")
    _title(figure, "Virtual specimens: mean curves; speed, number of specimens")
    return figure


def offset_yield(found: Mapping[str, Sequence[Properties]]) -> Figure:
    """Figs 4.10 to 4.16: line of E_small, offset line, yield point, line of E_large."""
    groups = [(name, p) for name, group in found.items() for p in group]
    columns = min(5, len(groups))
    rows = -(-len(groups) // columns)
    figure = new_figure(2.5 * columns, 2.2 * rows + 0.4)
    for i, (name, p) in enumerate(groups):
        axes = figure.add_subplot(rows, columns, i + 1)
        _yield_panel(axes, p.mean, p.curve)
        axes.set_title(f"{name}, {_speed(name, p)} mm/min")
        if i % columns == 0:
            axes.set_ylabel("stress [MPa]")
        if i >= len(groups) - columns:
            axes.set_xlabel("strain")
    _title(figure, f"Virtual specimens: {KEY}")
    return figure


KEY = (
    "E_small (orange), the same offset by 0.2 (dashed), yield (dot), E_large (green), "
    "each over its own range in bold"
)


def set_figure(drawn: Sequence[tuple[Recording, Elastic]]) -> Figure:
    """The same of real recordings, a panel each."""
    columns = min(5, len(drawn))
    rows = -(-len(drawn) // columns)
    figure = new_figure(2.5 * columns, 2.2 * rows + 0.4)
    for i, (recording, e) in enumerate(drawn):
        axes = figure.add_subplot(rows, columns, i + 1)
        _yield_panel(axes, recording, e)
        axes.set_title(recording.name.replace("_", " "), fontsize=8)
        if i % columns == 0:
            axes.set_ylabel("stress [MPa]")
        if i >= len(drawn) - columns:
            axes.set_xlabel("strain")
    _title(figure, KEY)
    return figure


def _yield_panel(axes: Axes, recording: Recording, e: Elastic) -> None:
    x, y, _ = prepare.rising(recording)
    top = 1.08 * y.max()
    axes.plot(x, y, color=COLOURS[0], linewidth=1.6)
    reach = np.array([0, (top - e.intercept_MPa) / e.E_small_MPa])
    line = e.intercept_MPa + e.E_small_MPa * reach
    axes.plot(reach, line, color=COLOURS[1], linewidth=0.8)
    axes.plot(reach + OFFSET, line, color=COLOURS[1], linewidth=0.8, linestyle="--")
    small = np.array(e.small)
    bold: dict[str, Any] = {"linewidth": 2.6, "alpha": 0.9, "solid_capstyle": "butt"}
    axes.plot(small, e.intercept_MPa + e.E_small_MPa * small, color=COLOURS[1], **bold)
    if np.isfinite(e.E_large_MPa):
        large = np.array(e.large)
        inside = (x >= large[0]) & (x <= large[1])
        middle, level = x[inside].mean(), y[inside].mean()
        axes.plot(
            large, level + e.E_large_MPa * (large - middle), color=COLOURS[2], **bold
        )
    if np.isfinite(e.yield_strain):
        axes.plot(e.yield_strain, e.yield_stress_MPa, "o", color=INK, markersize=4)
    axes.set_xlim(0, x[-1])
    axes.set_ylim(0, top)


def relaxation(
    tests: Mapping[str, Sequence[tuple[list[Recording], list[Any]]]],
) -> Figure:
    """Figs 4.17 and 4.18: stress in the hold, 180 and 15 minutes, over log time."""
    apart = [[n] for n in tests if n in ("PR", "NatR")]  # much softer, much longer
    together = [n for n in tests if [n] not in apart]
    groups = [g for g in [together, *apart] if g]
    figure = new_figure(7.6, 2.2 * len(groups) + 0.9)
    heights = [1.7 if len(g) > 1 else 1.0 for g in groups]
    panels = figure.subplots(
        len(groups), 2, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    for row, names in zip(panels, groups, strict=True):
        for axes, long in zip(row, (True, False), strict=True):
            for name, colour in zip(names, COLOURS, strict=False):
                for recordings, results in tests[name]:
                    if (results[0].hold_s > 3600) == long:
                        _hold(axes, name, recordings, results, colour)
            if not axes.lines:
                axes.set_visible(False)
                continue
            axes.set_xscale("log")
            axes.set_ylim(bottom=0)
            axes.set_xlim(left=0.1)
            axes.grid(color=FAINT, alpha=0.2, linewidth=0.6)
            axes.set_title("180 minutes" if long else "15 minutes")
            axes.set_xlabel("time held [s]")
            axes.set_ylabel("stress [MPa]")
            legend = axes.legend(fontsize=7, loc="lower left", labelspacing=0.2)
            for line in legend.get_lines():
                line.set_linewidth(2)
    _title(figure, "Virtual specimens: stress relaxation; material, strain held")
    return figure


def _hold(
    axes: Axes, name: str, recordings: list[Recording], results: list[Any], colour: str
) -> None:
    label: str | None = f"{name}, {results[0].strain:.2f}"
    for recording in recordings:
        y = np.abs(recording.stress_MPa)
        top = int(y.argmax())
        time = recording.time_s - recording.time_s[top]
        shown = np.unique(np.geomspace(1, len(y) - 1 - top, 300).astype(int)) + top
        axes.plot(time[shown], y[shown], color=colour, linewidth=0.7, label=label)
        label = None


def _speed(name: str, p: Properties) -> int:
    return round((p.rate_per_s or 0) * 60 * material(name).length_mm)


def _title(figure: Figure, text: str) -> None:
    text = textwrap.fill(text, int(14 * figure.get_figwidth()))
    figure.suptitle(text, fontsize=9, x=0.01, ha="left")


def _listed(files: Sequence[Path]) -> str:
    names = [str(f.with_suffix("")) for f in files if f.suffix == ".png"]
    return ", ".join(names) or "none"


def headline_of(found: dict[str, Any]) -> dict[str, Any]:
    """The figures that a text may quote."""
    told: dict[str, Any] = {}
    if "virtual" in found:
        rows = found["virtual"]["rows"]
        missed = np.abs([r["deviation"] for r in rows])
        listed = [r for r in rows if abs(r["deviation"]) > LISTED]
        told |= {
            "virtual_properties": len(rows),
            "virtual_median_deviation": float(np.nanmedian(missed)),
            "virtual_within_10_percent": float(np.mean(missed <= 0.10)),
            "virtual_above_25_percent": len(listed),
            "virtual_above_25_percent_without_reason": sum(
                r["reason"] is None for r in listed
            ),
        }
        for bend in (BENDS[0], BENDS[-1]):
            for key in ("E_small", "E_large", "yield_stress", "yield_strain"):
                told[f"change_of_{key}_at_bend_{bend:g}"] = _change(
                    found["virtual"]["bend_sensitivity"], key, bend
                )
        toe = found["virtual"]["toe_sensitivity"]
        told["toe_mean_shift"] = toe["mean_shift"]
        told["toe_largest_mean_change"] = max(toe["mean_change_of_shift"].values())
    for source, one in found.items():
        if source != "virtual":
            told |= {f"{source}_{k}": v for k, v in one["headline"].items()}
    return told


def _change(bends: Sequence[Row], key: str, bend: float) -> float:
    """Median relative change of a property from the default bend to `bend`."""
    pairs = [(b["by_bend"][f"{bend:g}"], b["by_bend"][f"{BEND:g}"]) for b in bends]
    return float(np.nanmedian([new[key] / old[key] - 1 for new, old in pairs]))


def report(found: dict[str, Any]) -> str:
    """Every table as Markdown."""
    parts = []
    if "virtual" in found:
        parts.append(virtual_report(found["virtual"]))
    for source, one in found.items():
        if source != "virtual":
            parts.append(property_sets.report(source, one))
    return "\n\n".join(parts)


def virtual_report(one: dict[str, Any]) -> str:
    """Tables 4.2 and 4.4, found / published, and the deviations above 25 %."""
    text = [
        "## Virtual specimens (found / published)",
        "Not a measurement: the generator was calibrated to these tables.",
    ]
    for title, where in (("Table 4.2", "mm/min"), ("Table 4.4", "test")):
        rows = [r for r in one["rows"] if where in r["where"]]
        keys = list(dict.fromkeys(r["property"] for r in rows))
        lines = []
        for place in dict.fromkeys((r["material"], r["where"]) for r in rows):
            at = {
                r["property"]: r for r in rows if (r["material"], r["where"]) == place
            }
            lines.append(
                [
                    " ".join(place),
                    *(f"{at[k]['found']:.3g} / {at[k]['published']:g}" for k in keys),
                ]
            )
        text += [f"### {title}", common.markdown(["material, test", *keys], lines)]
    listed = [r for r in one["rows"] if abs(r["deviation"]) > LISTED]
    text.append(f"### Above {LISTED:.0%}: {len(listed)} of {len(one['rows'])}")
    text += [
        f"- {r['material']}, {r['where']}, {r['property']}: {r['deviation']:+.0%}; "
        f"{r['reason'] or 'no reason found'}"
        for r in listed
    ]
    return "\n\n".join(text)
