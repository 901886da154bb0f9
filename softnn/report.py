"""One diagnosis as one HTML file that opens with no server and no network.

Figures are drawn with matplotlib, imported here alone and only when needed, and are
written beside the page as PNG as well.
"""

from __future__ import annotations

import base64
import html
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

RIGHT, TOP, BOTTOM, GAP = 0.15, 0.5, 0.45, (0.75, 0.75)  # of figures, inches
INK, BASE, GOOD, SHADE = "#222222", "#c1440e", "#1f6f8b", "#f2d6a2"


def write_report(found: Any, folder: str | Path) -> list[Path]:
    """report.html and the three figures of a diagnosis; the files written."""
    folder = Path(folder)
    pictures = [
        ("recordings", "Recordings, with the simulation before and after", _recordings),
        ("residuals", "What is left, against time, strain and rate", _residuals),
        (
            "candidates",
            "Effects that were tried: error on recordings left out",
            _rivals,
        ),
    ]
    written, parts = [], []
    for name, title, draw in pictures:
        data = _png(draw(found))
        path = folder / f"{name}.png"
        path.write_bytes(data)
        written.append(path)
        parts.append((title, base64.b64encode(data).decode("ascii")))
    page = folder / "report.html"
    page.write_text(_page(found.result, parts), encoding="utf-8")
    return [*written, page]


def _figure(rows: int, columns: int, height: float, left: float = 0.75) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # Margins and gaps in inches: to have them worked out takes as long as to draw.
    wide, high = 11.0, height
    figure = Figure(figsize=(wide, high))
    FigureCanvasAgg(figure)
    across = (wide - left - RIGHT - (columns - 1) * GAP[0]) / columns
    down = (high - TOP - BOTTOM - (rows - 1) * GAP[1]) / rows
    axes = figure.subplots(
        rows,
        columns,
        squeeze=False,
        gridspec_kw={
            "left": left / wide,
            "right": 1 - RIGHT / wide,
            "bottom": BOTTOM / high,
            "top": 1 - TOP / high,
            "wspace": GAP[0] / across,
            "hspace": GAP[1] / down,
        },
    )
    for axis in axes.flat:
        axis.tick_params(labelsize=8)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _png(figure: Any) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=80)
    return buffer.getvalue()


def _thinned(n: int, most: int = 1500) -> slice:
    return slice(None, None, max(n // most, 1))


def _recordings(found: Any) -> Any:
    names = [r.name for r in found.case.recordings]
    count = min(len(names), 12)
    rows = -(-count // 3)
    figure, axes = _figure(rows, min(3, count), 2.3 * rows)
    changed = bool(found.result["selected"])
    for axis, i in zip(axes.flat, range(count), strict=False):
        s = _thinned(len(found.time_s[i]))
        time = found.time_s[i]
        first = True
        for region in found.result["mismatch"]:
            if region["recording"] == names[i]:
                axis.axvspan(
                    region["start_s"],
                    region["end_s"],
                    color=SHADE,
                    lw=0,
                    label="mismatch" if first else None,
                )
                first = False
        axis.plot(time[s], found.measured[i][s], ".", ms=2, color=INK, label="measured")
        axis.plot(time[s], found.before[i][s], color=BASE, lw=1, label="before")
        if changed:
            axis.plot(time[s], found.after[i][s], color=GOOD, lw=1, label="after")
        axis.set_title(_plain(names[i]), fontsize=9)
        axis.set_xlabel("time [s]", fontsize=8)
        axis.set_ylabel(found.axes.stress.label, fontsize=8)
    for axis in list(axes.flat)[count:]:
        axis.set_visible(False)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    if found.result["mismatch"] and "mismatch" not in labels:
        from matplotlib.patches import Patch

        handles, labels = [*handles, Patch(color=SHADE)], [*labels, "mismatch"]
    figure.legend(
        handles, labels, loc="upper right", ncols=4, fontsize=7, frameon=False
    )
    return figure


def _residuals(found: Any) -> Any:
    figure, axes = _figure(2, 3, 5.2)
    changed = bool(found.result["selected"])
    rows = [("before", found.before, BASE), ("after", found.after, GOOD)]
    top = 0.0
    for row, (label, simulated, colour) in enumerate(rows):
        if label == "after" and not changed:
            for axis in axes[1]:
                axis.set_visible(False)
            continue
        for time, strain, measured, model in zip(
            found.time_s, found.strain, found.measured, simulated, strict=True
        ):
            s = _thinned(len(time), 700)
            miss = measured - model
            step = np.maximum(np.diff(time, prepend=time[0]), 1e-9)
            rate = np.diff(strain, prepend=strain[0]) / step
            for axis, x in zip(axes[row], (time - time[0], strain, rate), strict=True):
                axis.plot(x[s], miss[s], ".", ms=1.5, color=colour, alpha=0.5)
            top = max(top, float(np.nanquantile(np.abs(miss), 0.999)))
        axes[row, 0].set_ylabel(
            f"measured - {label} [{found.axes.stress.unit}]", fontsize=8
        )
    for axis in axes.flat:
        axis.axhline(0, color=INK, lw=0.5)
        axis.set_ylim(-1.1 * top, 1.1 * top)
    labels = "time [s]", found.axes.strain.label, f"rate [{found.axes.rate}]"
    for axis, label in zip(axes[1 if changed else 0], labels, strict=True):
        axis.set_xlabel(label, fontsize=8)
    for axis in axes[:, 2]:
        axis.set_xscale("symlog", linthresh=1e-3)
    return figure


def _rivals(found: Any) -> Any:
    rows = found.result["candidates"][:10]
    figure, axes = _figure(1, 1, 0.9 + 0.3 * len(rows), left=2.3)
    axis = axes[0, 0]
    labels = [r["effect"] or "base alone" for r in rows][::-1]
    errors = [100 * r["heldout_nrmse"] for r in rows][::-1]
    chosen = set(found.result["selected"])
    colours = [
        GOOD if n in chosen else BASE if n == "base alone" else "#bbbbbb"
        for n in labels
    ]
    axis.barh(labels, errors, color=colours)
    axis.axvline(100 * found.result["fit"]["noise_nrmse"], color=INK, lw=1, ls=":")
    axis.set_xlabel("error on recordings left out [%]; dotted: noise", fontsize=8)
    return figure


def _plain(text: str) -> str:
    """A name as matplotlib may print it: no mathematics, not too long."""
    return text.replace("$", r"\$")[:40]


def _page(result: dict[str, Any], pictures: list[tuple[str, str]]) -> str:
    def cell(value: Any) -> str:
        if isinstance(value, float):
            return html.escape(f"{value:.4g}")
        return html.escape(str(value))

    rows = []
    for told in result["explanations"]:
        for name, p in told["parameters"].items():
            rows.append(
                "<tr>"
                + "".join(
                    f"<td>{cell(v)}</td>"
                    for v in (
                        told["effect"],
                        told["probability"],
                        name,
                        p["value"],
                        f"{p['low']:.4g} to {p['high']:.4g}",
                        p["unit"],
                    )
                )
                + "</tr>"
            )
    table = (
        "<h2>Parameters</h2><table><tr><th>effect<th>probability<th>parameter<th>value"
        "<th>95 %<th>unit</tr>" + "".join(rows) + "</table>"
        if rows
        else ""
    )
    fit = result["fit"]
    errors = (
        "<h2>Errors</h2><table><tr><th><th>all recordings<th>recordings left out</tr>"
        f"<tr><td>before<td>{100 * fit['before']['nrmse']:.3g} %"
        f"<td>{100 * fit['before']['heldout_nrmse']:.3g} %</tr>"
        f"<tr><td>after<td>{100 * fit['after']['nrmse']:.3g} %"
        f"<td>{100 * fit['after']['heldout_nrmse']:.3g} %</tr>"
        f"<tr><td>noise<td>{100 * fit['noise_nrmse']:.3g} %<td></tr></table>"
    )
    advice = result["next_recording"]
    more = (
        f"<h2>Record next</h2><p>{html.escape(advice['strain_programme'])}: "
        f"it separates {html.escape(' from '.join(advice['separates']))}.</p>"
        if advice
        else ""
    )
    figures = "".join(
        f'<h2>{html.escape(title)}</h2><img alt="{html.escape(title)}" '
        f'src="data:image/png;base64,{data}">'
        for title, data in pictures
    )
    # A "<" could end the script element that holds the numbers.
    numbers = json.dumps(result, default=float).replace("<", "\\u003c")
    name = html.escape(str(result["case"]))
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{name}</title><style>body{{font:16px/1.5 system-ui,sans-serif;"
        "max-width:70rem;margin:2rem auto;padding:0 1rem;color:#222}"
        "img{max-width:100%;height:auto}table{border-collapse:collapse}"
        "td,th{padding:.2rem .8rem;text-align:left;border-bottom:1px solid #ddd}"
        ".verdict{color:#1f6f8b;text-transform:uppercase;letter-spacing:.05em}</style>"
        f"<h1>{name}</h1><p class=verdict>"
        f"{html.escape(result['verdict'].replace('_', ' '))}</p>"
        f"<p>{html.escape(result['summary'])}</p>"
        f"{errors}{table}{more}{figures}"
        f'<script type="application/json" id="diagnosis">{numbers}</script></html>\n'
    )
