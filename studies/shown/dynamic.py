"""How `studies.dynamic` shows what it found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.study.common import COLOURS, FAINT, INK, markdown, new_figure, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = {
    "storage_MPa": "storage modulus [MPa]",
    "loss_MPa": "loss modulus [MPa]",
    "loss_tangent": "loss tangent",
}


def draw(body: Mapping[str, Any], law: str) -> Figure:
    """Storage modulus, loss modulus and their ratio over frequency, a line a model."""
    figure = new_figure(9.6, 3.6)
    panels = figure.subplots(1, 3)
    truth = next(r for r in body["models"] if r["model"] == law)
    for axes, (part, label) in zip(panels, PARTS.items(), strict=True):
        for i, one in enumerate(body["models"]):
            mine = one["model"] == law
            axes.plot(
                one["frequency_Hz"],
                one[part],
                color=INK if mine else COLOURS[(i - 1) % len(COLOURS)],
                linestyle="-" if mine or i <= len(COLOURS) else "--",
                linewidth=2.2 if mine else 1.2,
                label=one["model"],
                zorder=3 if mine else 2,
            )
        axes.set_xscale("log")
        axes.set_xlabel("frequency [Hz]")
        axes.set_title(label)
        axes.axhline(0, color=FAINT, linewidth=0.6)
        # A network beyond its rates would squeeze all others into a line.
        low, high = np.min(truth[part]), np.max(truth[part])
        seen = axes.get_ylim()
        axes.set_ylim(
            max(seen[0], min(0, low) - 1.5 * high), min(seen[1], 3 * max(high, -low))
        )
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure


def report(body: Mapping[str, Any]) -> str:
    """Tables of models and of recordings, as Markdown."""
    some = body["models"][0]["frequency_Hz"]
    picks = [0, len(some) // 2, len(some) - 1]
    heads = ["model", *(f"E' at {some[i]:.2g} Hz [MPa]" for i in picks)]
    heads += [f"tan delta at {some[i]:.2g} Hz" for i in picks]
    heads += ["error of E*", "frequencies with E'' < 0"]
    rows = [
        [
            r["model"],
            *(f"{r['storage_MPa'][i]:.3g}" for i in picks),
            *(f"{r['loss_tangent'][i]:.3f}" for i in picks),
            percent(r["error"], 1),
            f"{r['makes_energy']} of {len(some)}",
        ]
        for r in body["models"]
    ]
    parts = [
        f"{body['material']}: strain {body['mean']:g} +- {body['amplitude']:g}",
        markdown(heads, rows),
    ]
    if body["recorded"]:
        heads = ["recording", "cycles", "frequency [Hz]", "E' [MPa]", "E'' [MPa]"]
        heads += ["tan delta", "stress of other frequencies"]
        parts.append(
            markdown(
                heads,
                [
                    [
                        f"{r['source']}: {r['recording']}",
                        f"{r['cycles']:.1f}",
                        f"{r['frequency_Hz']:.4g}",
                        f"{r['storage_MPa']:.4g}",
                        f"{r['loss_MPa']:.4g}",
                        f"{r['loss_tangent']:.3f}",
                        percent(r["other"], 1),
                    ]
                    for r in body["recorded"]
                ],
            )
        )
    parts += [f"Left out: {name}: {why}" for name, why in body["left_out"].items()]
    return "\n\n".join(parts)
