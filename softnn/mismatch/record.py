"""Diagnoses in MLflow: one run for each case, with its errors and its report."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path


def log(uri: str, folders: Sequence[Path], seed: int) -> None:
    """Log the diagnoses in these folders, as `softnn diagnose` wrote them."""
    from softnn.tracking import Tracker

    for folder in folders:
        file = folder / "diagnosis.json"
        if not file.exists():  # the case could not be used; that was reported
            continue
        result = json.loads(file.read_text(encoding="utf-8"))
        fit = result["fit"]
        tracker = Tracker(
            uri,
            "diagnoses",
            study=result["case"],
            identity=f"{result['data_sha256'][:16]}-{result['model']}-{seed}",
            name=result["case"],
            parameters={
                "model": result["model"],
                "seed": seed,
                "verdict": result["verdict"],
                "selected": ", ".join(result["selected"]),
            },
            data=(result["case"], result["data_sha256"]),
        )
        with tracker:
            tracker.result(
                {
                    "heldout_nrmse_before": fit["before"]["heldout_nrmse"],
                    "heldout_nrmse_after": fit["after"]["heldout_nrmse"],
                    "heldout_ratio": fit["heldout_ratio"],
                    "noise_nrmse": fit["noise_nrmse"],
                    "seconds": result["seconds"],
                },
                note=result["summary"],
                files=[folder / "report.html", file, folder / "model.json"],
            )
