"""How well could any law predict? No better than specimens repeat.

Where the same programme was run on several specimens, each is predicted by the mean of
the others, up to a factor of its own. The error of that prediction is the floor: a law
of the material cannot do better on a new specimen. It is measured as the error of a
simulation is, with the same weights of samples. Programmes are never quite the same, so
residuals of a fit are compared and not stresses; what the fit misses in all replicates
cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from softnn.contracts import Array
from softnn.fit import Engine, Guess
from softnn.mismatch.replicates import SAME, Replicates, alike, independent

LEVEL = 0.95  # of the interval


@dataclass(frozen=True)
class Floor:
    """NRMSE by which replicates differ, and its 95 % interval.

    `of` is "specimens" if each has a scale of its own, else "recordings".
    """

    nrmse: float
    low: float
    high: float
    of: str


def floor(engine: Engine, guess: Guess, specimens: bool) -> Floor | None:
    """Return the floor of these recordings; None without replicates.

    `guess` is a fit to them; gaps and faults that differ between recordings are part of
    the floor. `specimens`: whether recordings of one programme are of different ones.
    """
    replicates = Replicates(engine, fewest=2, like=SAME)
    if not replicates.groups:
        return None
    made = engine.run(alike(guess)[0], False)[0]
    errors = squares = freedom = 0.0
    for group in replicates.groups:
        mine, rows = replicates.inside(group), []
        measured, model = (
            np.array([replicates.along(r, values)[mine] for r in group])
            for values in (engine.target, made)
        )
        for i, r in enumerate(group):
            share = replicates.counted(r)[mine]
            missed = np.delete(measured - model, i, axis=0).mean(axis=0)
            usual = model[i] + missed
            if specimens:
                best = (share * usual) @ measured[i]
                usual = usual * best / max(float((share * usual) @ usual), 1e-300)
            rows.append(np.sqrt(share) * (measured[i] - usual))
            errors += float(rows[-1] @ rows[-1])
            squares += float(share @ measured[i] ** 2)
        freedom += independent(np.array(rows))
    if not squares > 0:
        return None
    nrmse = float(np.sqrt(errors / squares))
    low, high = _interval(max(freedom, 1.0))
    return Floor(nrmse, nrmse * low, nrmse * high, _of(specimens))


def _of(specimens: bool) -> str:
    return "specimens" if specimens else "recordings"


def _interval(freedom: float) -> Sequence[float]:
    """Return the ends of the interval of a standard deviation, over its estimate."""
    ends: Array = chi2.ppf([(1 + LEVEL) / 2, (1 - LEVEL) / 2], freedom)
    return [float(np.sqrt(freedom / e)) for e in ends]
