r"""Recording -> Recording: the eight preparation steps of thesis 4.3.1.1, and cycles.

Each step returns a changed copy whose log names the step, its arguments and what it
found. Strain and stress are what the steps change; load and elongation stay as the
machine wrote them (rows that are cut go from every channel). Both signs work:
compression is turned over, treated as tension and turned back.
"""

from __future__ import annotations

from softnn.prepare.curve import complete, resample, rising, sign_of, stress_strain
from softnn.prepare.failure import cut_failure
from softnn.prepare.mean import alike, by_group, unify
from softnn.prepare.segmentation import Segment, segments
from softnn.prepare.smoothing import (
    noise_of,
    peak_to_peak,
    remove_negative_offset,
    smooth,
    white_noise,
)
from softnn.prepare.toe import compensate_toe
from softnn.recording import Recording

__all__ = [
    "Segment",
    "alike",
    "by_group",
    "compensate_toe",
    "complete",
    "cut_failure",
    "noise_of",
    "peak_to_peak",
    "remove_negative_offset",
    "resample",
    "rising",
    "segments",
    "sign_of",
    "smooth",
    "specimen",
    "stress_strain",
    "unify",
    "white_noise",
]


def specimen(recording: Recording, samples: int | None = None) -> Recording:
    """One specimen pulled to failure, ready for a model: steps 2, 4, 6 and 7.

    With `samples` the result has that many points at equal strain steps.

    >>> import numpy as np
    >>> strain = np.linspace(0, 2, 401)
    >>> pulled = np.where(strain < 1.8, 3 * strain, 0.0)
    >>> ready = specimen(Recording(20 * strain, strain, pulled), samples=100)
    >>> len(ready), round(float(ready.strain[-1]), 2), [s.name for s in ready.log][:2]
    (100, 1.79, ['cut_failure', 'compensate_toe'])
    """
    ready = compensate_toe(cut_failure(complete(recording)))
    ready = remove_negative_offset(smooth(ready))
    return ready if samples is None else resample(ready, samples)
