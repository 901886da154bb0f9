"""A trained network as MLflow's `pyfunc` serves it: a JSON file, no pickle.

`mlflow.pyfunc.load_model(uri).predict(table)` gives the stress of a strain history.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softnn.contracts import Array, InputError
from softnn.neural.fitting import run
from softnn.neural.stored import StoredNetwork, from_dict
from softnn.recording import Recording

if TYPE_CHECKING:
    import pandas as pd

FILE = "network.json"
COLUMNS = ("time_s", "strain")


class Served:
    """Predicts stress from a table of one recording: time_s, strain [, rate_per_s]."""

    def __init__(self, stored: StoredNetwork) -> None:
        self.stored = stored

    def predict(self, table: pd.DataFrame, params: Any = None) -> Array:
        """Stress (n,) in MPa of a table of n rows; raises `InputError`.

        `rate_per_s` is the nominal rate of a tensile test, the same in every row;
        without it rates are differences of the strain.
        """
        missing = [c for c in COLUMNS if c not in table.columns]
        if missing:
            raise InputError(
                f"no column {', '.join(missing)}; needed: {', '.join(COLUMNS)}"
            )
        about: dict[str, Any] = {}
        if "rate_per_s" in table.columns:
            about = {
                "test": "tensile",
                "rate_per_s": float(table["rate_per_s"].iloc[0]),
            }
        time, strain = (table[c].to_numpy(float) for c in COLUMNS)
        recording = Recording(time, strain, np.zeros(len(time)), **about)
        net = self.stored
        (out,) = run(net.network, net.architecture, [recording], net.lag_s)
        return out


def _load_pyfunc(path: str) -> Served:
    """What MLflow calls to load a model: `path` is its file or its folder."""
    place = Path(path)
    file = place / FILE if place.is_dir() else place
    try:
        return Served(from_dict(json.loads(file.read_text(encoding="utf-8"))))
    except (OSError, ValueError) as error:
        raise InputError(f"no network in it: {error}", file=file) from None
