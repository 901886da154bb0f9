"""What corrected models predict of recordings that stayed with the truth."""

from __future__ import annotations

import io
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from softnn.contracts import Chunk
from softnn.model_file import read_model

WHICH = {"before": "base", "after": "model"}  # file of each model


def simulate_unseen(
    folder: Path, answers: Sequence[Mapping[str, Any]]
) -> dict[str, np.ndarray]:
    """Stress of the corrected models for programmes that stayed in the key, by case.

    `softnn simulate` as a user calls it, but in this process. A model that cannot be
    simulated is left out, and said.
    """
    from softnn.cli import main as softnn

    inputs, found = folder / "unseen", {}
    inputs.mkdir(exist_ok=True)
    for answer in answers:
        name = answer["case"]
        model = folder / "diagnoses" / name / "model.json"
        if answer["unseen"] is None or not model.exists():
            continue
        file = inputs / f"{name}.csv"
        columns = {k: v for k, v in answer["unseen"].items() if k != "clean_MPa"}
        pd.DataFrame(columns).to_csv(file, index=False)
        command = ["simulate", str(model), str(file), "--out", str(inputs / "out")]
        with redirect_stdout(io.StringIO()):
            code = softnn(command)
        if code == 0:
            table = pd.read_csv(inputs / "out" / file.name)
            found[name] = table["simulated_MPa"].to_numpy()
        else:
            print(f"{name}: softnn simulate ended with {code}", file=sys.stderr)
    return found


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
