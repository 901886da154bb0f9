"""Recordings that tests of this study share."""

import numpy as np

from softnn import Recording
from softnn.models.units import Units

SPRING = Units("hooke", (0.0, 1.0))

STIFFNESS = 2.0


def triangle(name="a", rate=0.1, top=0.5, side=1.0, step=0.05, **about) -> Recording:
    half = top / rate
    time = np.arange(0, 2 * half + step / 2, step)
    strain = side * np.interp(time, [0, half, 2 * half], [0, top, 0])
    about.setdefault("test", "cyclic")
    return Recording(time, strain, STIFFNESS * strain, name=name, **about)
