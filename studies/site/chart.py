"""Curves as inline SVG: no script, no file of its own, colours of the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from softnn.contracts import Array
from softnn.report.picture import kept

WIDTH, HEIGHT = 340.0, 210.0
LEFT, BELOW = 46.0, 34.0
MOST = 300  # points of a curve


@dataclass(frozen=True)
class Curve:
    """A line of the chart: `look` is one of first, second, third, fourth."""

    label: str
    x: Array
    y: Array
    look: str


def chart(
    curves: Sequence[Curve], x_label: str, y_label: str, title: str, legend: bool = True
) -> str:
    """A figure of the curves over common axes, with its legend below."""
    low_x, high_x = _reach([c.x for c in curves])
    low_y, high_y = _reach([c.y for c in curves])

    def place(c: Curve) -> str:
        keep = kept(c.y, MOST)
        x = LEFT + (WIDTH - LEFT) * (c.x[keep] - low_x) / (high_x - low_x)
        y = HEIGHT * (high_y - c.y[keep]) / (high_y - low_y)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    ground = HEIGHT * (high_y - 0) / (high_y - low_y)
    lines = "".join(
        f'<polyline class="{c.look}" points="{place(c)}"></polyline>' for c in curves
    )
    ends = (
        f'<text x="{LEFT - 4}" y="10" text-anchor="end">{high_y:.3g}</text>'
        f'<text x="{LEFT - 4}" y="{HEIGHT}" text-anchor="end">{low_y:.3g}</text>'
        f'<text x="{LEFT}" y="{HEIGHT + 16}">{low_x:.3g}</text>'
        f'<text x="{WIDTH}" y="{HEIGHT + 16}" text-anchor="end">{high_x:.3g}</text>'
        f'<text x="{(LEFT + WIDTH) / 2}" y="{HEIGHT + 30}" text-anchor="middle">'
        f"{escape(x_label)}</text>"
        f'<text transform="translate(12 {HEIGHT / 2}) rotate(-90)" '
        f'text-anchor="middle">{escape(y_label)}</text>'
    )
    keys = "".join(
        f'<span><svg viewBox="0 0 30 8" aria-hidden="true"><polyline class="{c.look}" '
        f'points="0,4 30,4"></polyline></svg> {escape(c.label)}</span> '
        for c in curves
    )
    return (
        '<figure class="chart">'
        f'<svg viewBox="0 -4 {WIDTH + 6} {HEIGHT + BELOW + 4}" role="img" '
        f'aria-label="{escape(title)}">'
        f'<line x1="{LEFT}" x2="{WIDTH}" y1="{ground:.1f}" y2="{ground:.1f}"></line>'
        f"{lines}{ends}</svg>"
        f"<figcaption>{escape(title)}"
        f"{f'<br>{keys}' if legend else ''}</figcaption></figure>"
    )


def _reach(values: Sequence[Array]) -> tuple[float, float]:
    """From least to largest, zero within, never empty."""
    low = min(0.0, *(float(np.min(v)) for v in values))
    high = max(0.0, *(float(np.max(v)) for v in values))
    return (low, high) if high > low else (low, low + 1.0)
