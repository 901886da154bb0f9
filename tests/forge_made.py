"""What tests of the forge share."""

from __future__ import annotations

from bench.concealed import (
    orders,
)
from bench.concealed.bases import Base
from bench.concealed.programmes import Pace

PACE = Pace(peak=0.8, ramp_s=3.0, corner_s=0.2, cycle_hz=0.5)

BASE = Base("linear", {}, 1.0, 0.8, ())  # stress is strain: sizes are read off it


# --- cases ----------------------------------------------------------------------------


def order(group: str, effects: tuple[str, ...], number: int = 0) -> orders.Order:
    return orders.Order("case-0001", group, effects, 1.0, 11, number)
