"""What models predict of recordings that stayed with the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from softnn.contracts import Chunk
from softnn.model_file import read_model

WHICH = {"before": "base", "after": "model"}  # file of each model


def held_errors(truth: Path, diagnosed: Path) -> dict[str, float] | None:
    """NRMSE of the base and of the corrected model on the noise-free held recordings.

    `truth` is the folder with `held-*.csv`, `diagnosed` that with both models. None
    where either is missing.
    """
    files = sorted(truth.glob("held-*.csv"))
    models = {k: diagnosed / f"{f}.json" for k, f in WHICH.items()}
    if not files or not all(m.exists() for m in models.values()):
        return None
    tables = [pd.read_csv(f) for f in files]
    chunks = [
        Chunk(
            t["time_s"].to_numpy(float),
            t["strain"].to_numpy(float),
            t["temperature_C"].to_numpy(float) if "temperature_C" in t else None,
        )
        for t in tables
    ]
    clean = np.concatenate([t["stress_MPa"].to_numpy(float) for t in tables])
    names, none = [f.stem for f in files], [None] * len(files)
    out = {}
    for key, file in models.items():
        # Held recordings are of fresh specimens, whatever the case's own history.
        made = np.concatenate(read_model(file).stress(names, chunks, none, False))
        out[key] = float(np.sqrt(np.sum((made - clean) ** 2) / np.sum(clean**2)))
    return out
