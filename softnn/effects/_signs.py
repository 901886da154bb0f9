"""What recordings show by themselves, whatever the material: for `Effect.shown`.

A specimen at rest that was never strained bears no stress, taut or not; and recordings
of one material agree where one of them has a fault. No law of the material comes in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Chunk
from softnn.noise import quantum

APART = 5.5  # times their spread, by which some recordings must differ from the others
UNMOVED = (0.01, 1e-4)  # of the largest strain: where rest may be, and no motion
QUIET = 6.0  # noises: stress that is none yet
ZEROS = 0.002  # of the stress: what those of a machine of class 2 may be, ISO 7500-1
FEWEST = 3  # recordings, to say which are out of line


def minority(
    values: Array, floor: float = 0.0, above: bool = False, most: float = 0.5
) -> NDArray[np.integer]:
    """Indices of the few that lie far above or below all others; maybe none.

    `floor`: the spread that others have at least; `above`: not below; the few are less
    than the share `most`.
    """
    order = np.argsort(values)
    n = len(order)
    best, odd = APART, order[:0]
    for few in range(1, int(np.ceil(most * n))):
        parts = [(order[-few:], order[:-few])]
        if not above:
            parts.insert(0, (order[:few], order[few:]))
        for part, rest in parts:
            spread = max(float(np.std(values[rest])), floor)
            gap = float(np.abs(values[part][:, None] - values[rest]).min())
            if gap > best * spread:
                best, odd = gap / max(spread, 1e-300), part
    return odd


def noise(stress: Array) -> float:
    """Of the channel, from second differences; no more is known without a law."""
    good = stress[np.isfinite(stress)]
    if len(good) < 3:
        return 0.0
    bend = float(np.median(np.abs(np.diff(good, n=2))))
    return max(1.4826 * bend / 6**0.5, quantum(good))


def reach(chunk: Chunk) -> float:
    """The largest strain of a recording, without its sign."""
    return float(np.abs(chunk.strain).max())


def peak(stress: Array) -> float:
    """The largest stress of a recording, without its sign."""
    good = stress[np.isfinite(stress)]
    return float(np.abs(good).max()) if len(good) else 0.0


def at_rest(chunk: Chunk, stress: Array) -> float:
    """Stress before anything has moved; nan where a recording does not begin so."""
    top, strain = reach(chunk), chunk.strain
    near, still = UNMOVED
    if not abs(strain[0]) < near * top:
        return np.nan
    moved = np.abs(strain - strain[0]) > still * top
    # The two channels may be a little apart: the end of the rest is no rest for both.
    first = stress[: (int(np.argmax(moved)) + 3) // 4 or 1]
    return float(np.median(first)) if np.isfinite(first).all() else np.nan
