"""Files as a lab has them: one pull of a rubber, written in many ways."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

N = 240
TIME = np.linspace(0.0, 23.9, N)
STRAIN = 0.4 * (1 - np.abs(TIME / 11.95 - 1))
_RNG = np.random.default_rng(3)
STRESS = (1 + STRAIN - (1 + STRAIN) ** -2) / 3 + 0.001 * _RNG.standard_normal(N)
LENGTH, AREA = 25.0, 18.0
WAY, LOAD = LENGTH * STRAIN, AREA * STRESS
SIZES = {"length_mm": LENGTH, "area_mm2": AREA}
WORDS = ["--length", "25", "--area", "18"]
HEADER = "Time (s),Extension (mm),Load (N)"
TIDY = "time_s,strain,stress_MPa"


def written(
    path: Path,
    header: str,
    *columns: Sequence,
    delimiter: str = ",",
    after: str = "",
    encoding: str = "utf-8",
) -> Path:
    """The columns as a file of text; numbers in seven digits, texts as they are."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = (
        delimiter.join(v if isinstance(v, str) else f"{v:.7g}" for v in row)
        for row in zip(*columns, strict=True)
    )
    text = "\n".join([header, *rows, ""]) + after
    path.write_bytes(text.encode(encoding))
    return path


def rows(first: int, last: int) -> str:
    """Some rows of the machine's file, to go on with."""
    picked = zip(TIME[first:last], WAY[first:last], LOAD[first:last], strict=True)
    return "".join(f"{t:.7g},{x:.7g},{f:.7g}\n" for t, x, f in picked)


def texts(form: str, values: Sequence, comma: bool = False) -> list[str]:
    out = [form % v for v in values]
    return [v.replace(".", ",") for v in out] if comma else out


def clock(start: float, form: str) -> list[str]:
    """Times of day from `start` seconds after midnight of 1 March 2024."""
    from datetime import datetime, timedelta

    begin = datetime(2024, 3, 1) + timedelta(seconds=start)
    return [
        (begin + timedelta(seconds=round(t, 6))).strftime(form) for t in TIME.tolist()
    ]
