"""Model-free detection: what recordings show whatever the material; for `Effect.shown`.

Two facts need no material model. A specimen at rest that was never strained bears no
stress, taut or not. Recordings of one material agree, unless one of them has a fault.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softnn.contracts import Array, Chunk
from softnn.noise import quantum

APART = 5.5  # times their spread, by which some recordings must differ from the others
UNMOVED = (0.01, 1e-4)  # of the largest strain: most at rest, most per step at rest
QUIET = 6.0  # noise levels up to which a stress counts as zero
ZEROS = 0.002  # of the stress: zero error allowed to a machine of class 2, ISO 7500-1
FEWEST = 3  # recordings, to say which are out of line


def minority(
    values: Array, floor: float = 0.0, above: bool = False, most: float = 0.5
) -> NDArray[np.integer]:
    """Return the indices of the few values that lie far below or above all others.

    The result may be empty. `floor` is the least spread assumed of the others, in the
    unit of `values`; with `above` only large values count; the few are less than the
    share `most` of all.
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
    """Return the noise of the stress channel [MPa], from second differences.

    No model is used, so a curve that bends between samples counts as noise, too.
    """
    good = stress[np.isfinite(stress)]
    if len(good) < 3:
        return 0.0
    bend = float(np.median(np.abs(np.diff(good, n=2))))
    return max(1.4826 * bend / 6**0.5, quantum(good))


def reach(chunk: Chunk) -> float:
    """Return the largest absolute strain of a recording."""
    return float(np.abs(chunk.strain).max())


def peak(stress: Array) -> float:
    """Return the largest absolute stress of a recording, MPa."""
    good = stress[np.isfinite(stress)]
    return float(np.abs(good).max()) if len(good) else 0.0


def at_rest(chunk: Chunk, stress: Array) -> float:
    """Median stress [MPa] before any motion; nan without a rest at the start."""
    top, strain = reach(chunk), chunk.strain
    near, still = UNMOVED
    if not abs(strain[0]) < near * top:
        return np.nan
    moved = np.abs(strain - strain[0]) > still * top
    # The two channels may be a little apart: the end of the rest is no rest for both.
    first = stress[: (int(np.argmax(moved)) + 3) // 4 or 1]
    return float(np.median(first)) if np.isfinite(first).all() else np.nan
