"""Which unit a column without one is likely in, judged by what it makes of the numbers.

Only advice is made of it: the unit is printed in the command that the user may type,
and is never used before the user has typed it.
"""

from __future__ import annotations

import numpy as np

from softnn.contracts import Array
from softnn.plausible import fastest

# Unit as typed -> factor to the base unit, the usual one first.
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "strain": {"mm/mm": 1.0, "%": 1e-2},
    "stress": {"MPa": 1.0, "kPa": 1e-3, "Pa": 1e-6},
    "force": {"N": 1.0, "mN": 1e-3},
    "displacement": {"mm": 1.0, "um": 1e-3, "m": 1e3},
    "temperature": {"degC": 1.0, "K": 1.0},
}
STRAINS = (0.008, 7.0)  # largest strain of a test: 1 % to 700 %
RATES_per_s = (2e-5, 5.0)  # of strain, where it moves
# Stiffness in MPa of what is tested most; beyond it gels, and tendon or plastics.
USUAL_MPa, LEAST_MPa = (0.02, 60.0), 1e-3
STEPS_s = (1e-4, 5.0)  # between samples; beyond it, a clock may be in ms


def strain_unit(strain: Array) -> str:
    """The likely unit of a strain (n,), "" where the numbers may be either.

    >>> strain_unit(np.array([0.0, 0.4])), strain_unit(np.array([0.0, 40.0]))
    ('mm/mm', '%')
    >>> strain_unit(np.array([0.0, 3.0]))
    ''
    """
    top = _top(strain)
    fits = [u for u, f in UNITS["strain"].items() if _within(top * f, STRAINS)]
    return "mm/mm" if 0 < top < STRAINS[0] else fits[0] if len(fits) == 1 else ""


def stress_unit(stress: Array, strain: Array | None) -> str:
    """The likely unit of a stress (n,) beside a strain (n,) as a fraction, or None.

    >>> stress_unit(np.array([0.0, 0.6]), np.array([0.0, 0.4]))
    'MPa'
    >>> stress_unit(np.array([0.0, 146.0]), np.array([0.0, 0.4]))
    'kPa'
    """
    top = _top(stress) / (_top(strain) if strain is not None else 1.0)
    sizes = {u: top * f for u, f in UNITS["stress"].items()}
    usual = [u for u, size in sizes.items() if _within(size, USUAL_MPa)]
    if usual:
        return usual[0]
    return next((u for u, s in sizes.items() if _within(s, (LEAST_MPa, 2e3))), "")


def time_unit(time: Array, strain: Array | None) -> str:
    """The likely unit of a time (n,) beside a strain (n,) as a fraction, or None.

    "" where seconds and milliseconds are both likely: samples far apart, a slow test.

    >>> clock = np.arange(0.0, 40_000.0, 50.0)
    >>> time_unit(clock, np.linspace(0, 0.4, 800)), time_unit(clock / 1e3, None)
    ('ms', 's')
    >>> time_unit(clock, np.linspace(0, 4.0, 800))
    ''
    """
    fits = time_units(time, strain)
    if strain is not None and "s" in fits and "ms" in fits:
        good = np.isfinite(time + strain)
        if np.median(np.abs(np.diff(time[good]))) > STEPS_s[1]:
            return ""
    return fits[0] if fits else ""


def time_units(time: Array, strain: Array | None) -> list[str]:
    """The units of a time (n,) that make a usual test of it, the usual one first.

    >>> clock = np.linspace(0, 40 / 60, 200)
    >>> time_units(clock, np.linspace(0, 0.4, 200))
    ['s', 'min']
    """
    good = np.isfinite(time) if strain is None else np.isfinite(time + strain)
    if good.sum() < 2 or np.ptp(time[good]) == 0:
        return []
    if strain is None:
        step = float(np.median(np.abs(np.diff(time[good]))))
        return [u for u, f in UNITS["time"].items() if _within(step * f, STEPS_s)]
    rate = fastest(time[good], strain[good])
    return [u for u, f in UNITS["time"].items() if _within(rate / f, RATES_per_s)]


def _top(values: Array) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))


def _within(value: float, allowed: tuple[float, float]) -> bool:
    return allowed[0] <= value <= allowed[1]
