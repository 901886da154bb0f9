"""Recordings, diagnoses and models at a glance: a line, and a curve for a page."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from softnn.contracts import Array, Chunk

WIDTH, HEIGHT = 240.0, 120.0  # of a small curve, in pixels
DRAWN = 300  # points of it


def facts(recording: Any) -> str:
    """Samples, duration and ranges of a recording, in one line."""
    x, y = recording.axes.strain, recording.axes.stress
    time = recording.time_s
    return (
        f"{len(recording)} samples, {time[-1] - time[0]:.4g} s, "
        f"{x.name} {_range(recording.strain)}{_unit(x.unit)}, "
        f"{y.name} {_range(recording.stress_MPa)}{_unit(y.unit)}"
    )


def html(recording: Any) -> str:
    """Name, facts and a small curve of stress over strain, as a notebook shows them."""
    x, y = recording.axes.strain, recording.axes.stress
    return (
        f"<figure style='margin:0'><figcaption><b>{escape(recording.name) or '-'}</b>: "
        f"{escape(facts(recording))}</figcaption>"
        f"{svg([(recording.strain, recording.stress_MPa)])}"
        f"<div><small>{escape(y.label)} over {escape(x.label)}</small></div></figure>"
    )


def model_html(model: Any, reach: float) -> str:
    """A model and its curve: a pull to the strain `reach` and back, in 20 s."""
    drawn = ""
    if not model.needs_simulated:
        time = np.linspace(0.0, 20.0, DRAWN)
        strain = reach * (1 - np.abs(time / 10 - 1))
        drawn = svg([(strain, model.stress(["-"], [Chunk(time, strain)], [None])[0])])
    x, y = model.axes.strain, model.axes.stress
    return (
        f"<figure style='margin:0'><figcaption>{escape(repr(model))}</figcaption>"
        f"{drawn}<div><small>{escape(y.label)} over {escape(x.label)}, to {reach:.3g} "
        "and back in 20 s</small></div></figure>"
    )


def svg(curves: list[tuple[Array, Array]]) -> str:
    """Curves y (n,) over x (n,) in one frame, as an SVG element.

    >>> svg([(np.array([0.0, 1.0]), np.array([0.0, 2.0]))]).count("polyline")
    1
    """
    kept = [_finite(x, y) for x, y in curves]
    kept = [(x, y) for x, y in kept if len(x)]
    if not kept:
        return ""
    low, high = (
        [f(np.concatenate([c[i] for c in kept])) for i in (0, 1)]
        for f in (np.min, np.max)
    )
    across, up = (max(b - a, 1e-300) for a, b in zip(low, high, strict=True))
    lines = []
    for (x, y), colour in zip(kept, ("#1f77b4", "#d62728", "#2ca02c"), strict=False):
        keep = np.unique(np.linspace(0, len(x) - 1, DRAWN).astype(int))
        px = 4 + (WIDTH - 8) * (x[keep] - low[0]) / across
        py = 4 + (HEIGHT - 8) * (high[1] - y[keep]) / up
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))
        lines.append(f"<polyline points='{points}' fill='none' stroke='{colour}'/>")
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{WIDTH:.0f}' "
        f"height='{HEIGHT:.0f}' role='img' aria-label='curve'>{''.join(lines)}</svg>"
    )


def _finite(x: Array, y: Array) -> tuple[Array, Array]:
    good = np.isfinite(x) & np.isfinite(y)
    return x[good], y[good]


def _range(values: Array) -> str:
    good = values[np.isfinite(values)]
    return f"{good.min():.3g} to {good.max():.3g}" if len(good) else "missing"


def _unit(unit: str) -> str:
    return "" if unit == "-" else f" {unit}"
