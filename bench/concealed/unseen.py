"""What corrected models foretell of programmes that stayed in the key."""

from __future__ import annotations

import io
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd


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
