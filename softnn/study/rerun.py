"""The networks of one MLflow run, trained again: no study, part of `softnn rerun`.

The run itself gives the settings, the parameters, and the hash of the recordings.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from softnn.contracts import InputError
from softnn.neural import Settings as Training
from softnn.study.common import guarded, markdown, percent
from softnn.study.material_data import prepared
from softnn.study.settings import RUNS, Settings
from softnn.study.trainer import Trainer
from softnn.tracking import read_run

SAME = 1e-6  # relative: rounding of other processors, amplified by training


def command(run_id: str, tracking: str | None = None) -> int:
    """`softnn rerun`, by default of `RUNS`; exit: 0 same, 1 other, 2 impossible."""
    same = True

    def work() -> None:
        nonlocal same
        kept, again, said = rerun(run_id, tracking or f"sqlite:///{RUNS}/mlflow.db")
        same = bool(np.allclose(kept, again, rtol=SAME, atol=0))
        rows = [
            [name, percent(a, 6), percent(b, 6)]
            for name, a, b in zip(said, kept, again, strict=True)
        ]
        print(markdown(["fold", "NRMSE kept", "NRMSE now"], rows))
        print("the same" if same else f"not the same (relative tolerance {SAME:g})")

    code = guarded(work)
    return code or int(not same)


def rerun(run_id: str, tracking: str) -> tuple[list[float], list[float], list[str]]:
    """NRMSE by fold as the run has it, as it is now, and the names of the folds."""
    metrics, text = read_run(tracking, run_id)
    if text is None or "fold_nrmse" not in metrics:
        raise InputError(
            f"run {run_id} is no trial of a network study; take one that is nested in "
            "a study's run"
        )
    about: dict[str, Any] = json.loads(text)
    given = about["settings"]
    settings = Settings(
        **{**given, "neurons": tuple(given["neurons"]), "material": about["material"]}
    )
    (data,) = [d for d in prepared(settings) if d.material == about["material"]]
    if data.digest != about["data"]:
        raise InputError(
            f"the recordings of {data.label} are not those of the run: hash "
            f"{data.digest[:12]}, then {about['data'][:12]}"
        )
    trainer = Trainer(data, settings, Training(**about["training"]))
    kept = metrics["fold_nrmse"]
    parameters = about["parameters"]
    split = trainer.chosen(parameters)["split"]
    found = trainer.judge_parts(parameters, {split: slice(0, len(kept))})[split]
    return kept, found["nrmse"], found["folds"]
