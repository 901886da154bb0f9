"""The curves of a report, small enough to lie in the page."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softnn.contracts import Array
from softnn.report.page import Found
from softnn.report.phrases import percent

SAMPLES = 60_000  # on one page; a screen has 2 000 columns
LEAST, MOST = 300, 6000  # samples a recording
DIGITS = 6
BEND, MOST_CORNERS = 0.05, 24  # of the largest slope; more corners are not listed


def recordings(found: Found) -> list[dict[str, Any]]:
    """A dict a recording: name, columns as lists (n,), regions as [start, end] in s.

    Time is counted from the start of the recording, stress in MPa. `errors` are those
    before and after the correction, as in diagnosis.json.
    """
    told = found.result["recordings"]
    names = [r["name"] for r in told]
    most = int(np.clip(SAMPLES // max(len(names), 1), LEAST, MOST))
    changed = bool(found.result["corrected_by"])
    out = []
    for i, name in enumerate(names):
        time = found.time_s[i]
        keep = kept(found.measured[i] - found.before[i], most)
        columns = {
            "time": time - time[0],
            "strain": found.strain[i],
            "measured": found.measured[i],
            "before": found.before[i],
            "after": found.after[i] if changed else None,
        }
        out.append(
            {
                "name": name,
                "samples": len(time),
                "errors": [percent(told[i][f"nrmse_{k}"]) for k in ("before", "after")],
                "regions": [
                    [float(r["start_s"] - time[0]), float(r["end_s"] - time[0])]
                    for r in found.result["mismatch"]
                    if r["recording"] == name
                ],
                **{
                    k: None if v is None else _short(v[keep])
                    for k, v in columns.items()
                },
            }
        )
    return out


def kept(values: Array, most: int) -> NDArray[np.intp]:
    """Indices (`most` + 2 at the most,) to draw: of each stretch the two extremes.

    >>> kept(np.array([0.0, 0.0, 9.0, 0.0, 0.0, -9.0, 0.0, 0.0]), 4)
    array([0, 2, 4, 5, 7])
    """
    n = len(values)
    if n <= most:
        return np.arange(n)
    filled = np.where(np.isfinite(values), values, 0.0)
    edges = np.linspace(0, n, most // 2 + 1).astype(int)
    chosen = {0, n - 1}
    for a, b in pairwise(edges):
        piece = filled[a:b]
        chosen |= {a + int(np.argmin(piece)), a + int(np.argmax(piece))}
    return np.array(sorted(chosen))


def _short(values: Array) -> list[float | None]:
    """Return numbers of a few digits for JSON; None for a missing value."""
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values]


def pack(value: Any) -> str:
    """Return zipped JSON as letters and digits, so no name in it can end a script."""
    raw = json.dumps(value, separators=(",", ":"), allow_nan=False).encode()
    return base64.b64encode(gzip.compress(raw, 6, mtime=0)).decode("ascii")


@cache
def library() -> str:
    """Return the drawing script, zipped: 2 MB a page in place of 5."""
    from plotly.offline import get_plotlyjs

    raw = get_plotlyjs().encode()
    return base64.b64encode(gzip.compress(raw, 6, mtime=0)).decode("ascii")


def sketch(
    time_s: ArrayLike, strain: ArrayLike, width: float = 360.0, height: float = 120.0
) -> dict[str, Any]:
    """Return a strain programme (n,) as points of an SVG line, with its ends."""
    time, y = np.asarray(time_s, float), np.asarray(strain, float)
    low, high = min(float(y.min()), 0.0), max(float(y.max()), 0.0)
    across = width * (time - time[0]) / max(float(time[-1] - time[0]), 1e-300)
    down = height * (high - y) / max(high - low, 1e-300)
    return {
        "points": " ".join(
            f"{a:.1f},{b:.1f}" for a, b in zip(across, down, strict=True)
        ),
        "width": width,
        "height": height,
        "seconds": float(time[-1] - time[0]),
        "low": low,
        "high": high,
        "zero": height * high / max(high - low, 1e-300),
        "corners": ", ".join(f"{t:.3g} {e:.3g}" for t, e in corners(time, y)),
    }


def predicted(
    strain: ArrayLike,
    predictions: Sequence[Mapping[str, Any]],
    width: float = 360.0,
    height: float = 240.0,
) -> dict[str, Any] | None:
    """Return predicted stresses over strain (n,) as points of SVG lines, with ends.

    None without predictions. Each line has the words that say when it holds.
    """
    if not predictions:
        return None
    x, every = np.asarray(strain, float), [np.array(p["stress"]) for p in predictions]
    left, right = min(float(x.min()), 0.0), max(float(x.max()), 0.0)
    low, high = float(np.min(every)), float(np.max(every))
    across = width * (x - left) / max(right - left, 1e-300)
    lines = []
    for told, y in zip(predictions, every, strict=True):
        down = height * (high - y) / max(high - low, 1e-300)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, down, strict=True))
        lines.append({"points": points, "if": told["if"], "sure": told["probability"]})
    return {
        "lines": lines,
        "width": width,
        "height": height,
        "low": low,
        "high": high,
        "left": left,
        "right": right,
    }


def corners(time_s: Array, strain: Array) -> list[tuple[float, float]]:
    """Return the corners (time, strain) of a path of straight ramps; [] of a curve.

    >>> corners(np.arange(5.0), np.array([0.0, 1.0, 2.0, 2.0, 2.0]))
    [(0.0, 0.0), (2.0, 2.0), (4.0, 2.0)]
    """
    slope = np.diff(strain) / np.maximum(np.diff(time_s), 1e-300)
    turns = np.abs(np.diff(slope)) > BEND * np.abs(slope).max()
    # A corner between two samples bends the line at both; the first one counts.
    turns[1:] &= ~turns[:-1]
    at = [0, *(np.flatnonzero(turns) + 1), len(strain) - 1]
    if len(at) > MOST_CORNERS:
        return []
    return [(float(time_s[i] - time_s[0]), float(strain[i])) for i in at]
