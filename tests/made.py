"""Histories and cases that several tests of the diagnosis share."""

import numpy as np
import pandas as pd

from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.models.units import Units
from softnn.simulate import Term, simulate

UNITS = Units("pl-wiechert", (0.0, 0.3, 1.0), (0.4, 8.0))
STIFFNESS = np.array([1.0, 0.6, 0.5, 0.4])
# Moduli of hyperelastic laws as Abaqus counts them, MPa.
MODULI = {
    "neo-hooke": (0.3,),
    "mooney-rivlin": (0.2, 0.05),
    "yeoh": (0.3, -0.02, 0.004),
    "ogden1": (0.6, 2.6),
    "ogden2": (0.5, 1.4, 0.1, -2.5),
    "ogden3": (0.5, 1.4, 0.1, -2.5, 0.01, 6.0),
    "arruda-boyce": (0.4, 2.5),
    "gent": (0.4, 12.0),
    "hyperfoam": (0.1, 8.0, 0.1, 0.02, -2.0, 0.3),
}


def straight(levels, rates, interval):
    steps = np.abs(np.diff(levels)) / np.broadcast_to(rates, len(levels) - 1)
    steps = np.where(steps > 0, steps, 60.0)
    corners = np.concatenate([[0], np.cumsum(steps)])
    time = np.arange(0, corners[-1], interval)
    return Chunk(time, np.interp(time, corners, levels))


def histories():
    """Three ramps over a decade of rates, growing cycles, a hold: 2 000 samples."""
    return [
        straight([0, 0.6, 0], 0.02, 0.15),
        straight([0, 0.6, 0], 0.06, 0.05),
        straight([0, 0.6, 0], 0.2, 0.02),
        straight([0, 0.2, 0.05, 0.4, 0.05, 0.6, 0.05, 0.6, 0], 0.05, 0.15),
        straight([0, 0.4, 0.4, 0.1], 0.1, 0.2),
    ]


def write_case(folder, terms=(), noise=0.002, seed=0, toml="", stress=None):
    rng = np.random.default_rng(seed)
    (folder / "recordings").mkdir(parents=True)
    chunks = histories()
    clean = (
        simulate(UNITS, STIFFNESS, list(terms), chunks) if stress is None else stress
    )
    for i, (chunk, s) in enumerate(zip(chunks, clean, strict=True)):
        table = {
            "time_s": chunk.time_s,
            "strain": chunk.strain,
            "stress_MPa": s + noise * rng.standard_normal(len(s)),
        }
        pd.DataFrame(table).to_csv(folder / f"recordings/r{i}.csv", index=False)
    if toml:
        (folder / "case.toml").write_text(toml)
    return folder


def mullins(depth=0.4):
    law = effect("mullins_softening")
    return Term(law, law.defaults() | {"depth": depth, "scale": 0.1})
