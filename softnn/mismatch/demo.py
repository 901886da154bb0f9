"""Virtual recordings with one concealed effect, for a first look."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from softnn.contracts import Chunk
from softnn.effects import effect
from softnn.fit import Data
from softnn.models.units import Units
from softnn.recording import Recording
from softnn.simulate import Term, simulate

# A soft silicone: a spring that stiffens, a quick branch and a slow one.
MATERIAL = Units("pl-wiechert", (0.0, 0.3, 1.0), (0.4, 8.0))
STIFFNESS_MPa = np.array([0.5, 0.6, 0.25, 0.2])
NOISE = 0.004  # of the largest stress
SAMPLES = 300  # usual number of samples of a recording
WARMING_C = 20.0  # over a recording, if an effect needs a change of temperature


def conceal(folder: Path, name: str, seed: int = 0) -> list[str]:
    """Write recordings with the effect `name` into folder/recordings; return names.

    The folder is a case like any other; nothing in it names the concealed effect.
    Raises `InputError` for an unknown effect.
    """
    law = effect(name)
    chunks = [*_programmes(), law.telltale()]
    if law.needs_temperature:
        warm = [20 + WARMING_C * c.time_s / c.time_s[-1] for c in chunks]
        chunks = [
            replace(c, temperature_C=t) for c, t in zip(chunks, warm, strict=True)
        ]
    clean = simulate(MATERIAL, STIFFNESS_MPa, [], chunks)
    # A clear effect at the size of these recordings, at least in the last of them.
    scales = Data(("",) * len(chunks), tuple(chunks), tuple(clean)).scales()
    planted = Term(law, law.defaults() | law.starts(scales)[0])
    truth = simulate(MATERIAL, STIFFNESS_MPa, [planted], chunks)
    sigma = NOISE * max(float(np.abs(s).max()) for s in truth)
    rng = np.random.default_rng(seed)
    target = folder / "recordings"
    target.mkdir(parents=True, exist_ok=True)
    names = [f"test-{i}" for i in range(1, len(chunks) + 1)]
    for name, chunk, stress in zip(names, chunks, truth, strict=True):
        noisy = stress + sigma * rng.standard_normal(len(stress))
        one = Recording(chunk.time_s, chunk.strain, noisy, chunk.temperature_C)
        file = target / f"{name}.csv"
        one.to_frame().to_csv(file, index=False, float_format="%.7g")
    return names


def _programmes() -> list[Chunk]:
    """Return ramps at three rates, cycles (each amplitude twice), and a hold."""
    return [
        _through([0, 0.6, 0], 0.02),
        _through([0, 0.6, 0], 0.2),
        _through([0, 0.2, 0, 0.2, 0, 0.4, 0, 0.4, 0, 0.6, 0], 0.05),
        _through([0, 0.4, 0.4, 0.1], 0.1),
    ]


def _through(levels: list[float], rate: float) -> Chunk:
    """Return linear strain between levels at a rate [1/s]; equal levels hold 60 s."""
    steps = np.abs(np.diff(levels)) / rate
    corners = np.concatenate([[0.0], np.cumsum(np.where(steps > 0, steps, 60.0))])
    time = np.linspace(0.0, corners[-1], SAMPLES)
    return Chunk(time, np.interp(time, corners, levels))
