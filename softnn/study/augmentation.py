"""Recordings that a fitted model simulates, to stand beside measured ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from softnn.contracts import InputError
from softnn.models.fit_piecewise import PiecewiseFit
from softnn.recording import Recording
from softnn.study.baselines import training_fits
from softnn.study.material_data import Data

SAMPLES = 40  # of a recording
RATES, BEYOND = 8, 10.0  # simulated ramps, and how far beyond the rates that are known


def simulations(data: Data, held: set[int]) -> list[Recording]:
    """Return ramps of PL-Wiechert fitted to the recordings that are not held out."""
    train = [r for i, r in enumerate(data.tensile) if i not in held]
    names = {data.tensile[i].name for i in held}
    holds = [r for r in data.relaxation if r.name not in names]
    fits = training_fits(train, holds, {})
    for way in ("joint", "as_in_thesis"):
        if (found := fits.get(("PL-Wiechert", way))) is not None:
            return ramps(found, train)
    raise InputError("a fold leaves one rate and no hold: nothing can be fitted")


def ramps(fit: PiecewiseFit, train: Sequence[Recording]) -> list[Recording]:
    """Loadings to the median largest strain, at rates about those of the training."""
    ends = [float(r.strain[np.argmax(np.abs(r.strain))]) for r in train]
    rates = [abs(float(np.ptp(r.strain)) / float(np.ptp(r.time_s))) for r in train]
    strain = np.linspace(0, float(np.median(ends)), SAMPLES)
    asked = np.geomspace(min(rates) / BEYOND, max(rates) * BEYOND, RATES)
    out = []
    for rate in asked:
        bare = replace(
            train[0],
            time_s=np.abs(strain) / rate,
            strain=strain,
            stress_MPa=np.zeros(SAMPLES),
            rate_per_s=float(rate),
            name=f"simulated at {rate:.3g} /s",
            force_N=None,
            elongation_mm=None,
            temperature_C=None,
        )
        out.append(replace(bare, stress_MPa=fit.predict(bare)))
    return out
