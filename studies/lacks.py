"""Which physics does a network lack, where a piecewise-linear model predicts better?

For each material of `studies.architectures` on which the best piecewise-linear model
has less error than the chosen network at what was never seen: the network is trained
again without the fold on which it is worst, and a diagnosis is asked what that
simulation leaves out of the recordings of that fold.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.architectures.choices import folds_of, worse_by
from bench.architectures.page import result_files
from bench.architectures.trials import TRAINING
from softnn.contracts import InputError
from softnn.crossval import Folds
from softnn.mismatch.case import Case
from softnn.mismatch.diagnosis import diagnose
from softnn.neural import Seen, StoredNetwork
from softnn.study.common import (
    RESULTS,
    guarded,
    parser,
    provenance,
    provenance_of,
    results_folder,
    write_result,
)
from softnn.study.material_data import prepared
from softnn.study.settings import Settings
from softnn.study.trainer import Trainer

MOST = 4  # recordings that are diagnosed
Result = Mapping[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.lacks`; returns the exit code."""
    made = parser("lacks", __doc__)
    made.add_argument("--only", default="", help="materials with this in their name")
    return guarded(lambda: run(made.parse_args(argv)))


def run(a: Any) -> None:
    place = results_folder(a.smoke, a.publish)
    kept = place / "lacks.json"
    found: dict[str, Any] = {}
    worse = smallest() if a.smoke else wanted()
    if kept.exists():
        old = json.loads(kept.read_text(encoding="utf-8"))
        about = provenance_of(old)
        found = {k: about | row for k, row in old["materials"].items()}
    # Of others, or of networks that are chosen no more, nothing is carried on.
    now = {one["label"]: one["choices"]["unseen"]["words"] for one, _ in worse}
    found = {k: row for k, row in found.items() if row["network"] == now.get(k)}
    known: dict[str, str] = {}
    for one, settings in (w for w in worse if a.only in w[0]["label"]):
        found[one["label"]] = asked(one, settings, 1 if a.smoke else MOST)
        known[one["label"]] = one["data_sha256"]
        print(f"{one['label']}: {found[one['label']]['summary']}", flush=True)
        written(found, known, a.seed, place)
    if not found:
        raise InputError("no network of studies/results is worse than its PL model")


def wanted() -> list[tuple[Result, Result]]:
    """Materials on which the network is worse, each with the settings of its study."""
    return [
        (one, result["settings"])
        for result in result_files(RESULTS).values()
        for one in result["materials"]
        if worse_by(one) is not None
    ]


def smallest() -> list[tuple[Result, Result]]:
    """NatPolR, whose recordings everybody has, worse or not."""
    found = json.loads((RESULTS / "architectures.json").read_text(encoding="utf-8"))
    return [(found["materials"][0], found["settings"])]


def written(
    found: Mapping[str, Any], known: Mapping[str, str], seed: int, place: Path
) -> None:
    headline = {"materials": len(found)}
    headline |= {"named": sum(bool(one["selected"]) for one in found.values())}
    write_result(
        "lacks", headline, {"materials": found}, seed=seed, data=known, folder=place
    )


def asked(one: Result, given: Result, most: int) -> dict[str, Any]:
    """What a diagnosis of the worst fold says of the network trained without it.

    `most` of its recordings are diagnosed, evenly drawn.
    """
    settings = Settings(
        **{**given, "neurons": tuple(given["neurons"]), "material": one["material"]}
    )
    (data,) = [d for d in prepared(settings) if d.material == one["material"]]
    trainer = Trainer(data, settings, TRAINING, threads=1)
    chosen = trainer.chosen(one["choices"]["unseen"]["configuration"])
    folds = trainer.folds(
        one["unseen"], chosen["inputs"], settings.seed, chosen["lag_s"]
    )
    errors = folds_of(one["choices"]["unseen"]["anew"], "unseen")
    worst = int(np.argmax(errors))
    alone = Folds(
        folds.test[worst : worst + 1], folds.names[worst : worst + 1], folds.split
    )
    (trained,) = trainer.networks(chosen, [alone], [worst])
    owners = trainer.samples(chosen["inputs"], chosen["lag_s"]).recording
    held = sorted(set(owners[folds.test[worst]].tolist()))
    seen = Seen.of([r for i, r in enumerate(data.tensile) if i not in held])
    about = chosen["inputs"], chosen["lag_s"], seen
    network = StoredNetwork(trained.network, *about)
    some = np.unique(np.linspace(0, len(held) - 1, most).astype(int))
    case = Case(data.file_name, tuple(data.tensile[held[i]] for i in some))
    told = diagnose(case, network)
    return {
        "network": one["choices"]["unseen"]["words"],
        "unseen": folds.names[worst],
        "error": float(errors[worst]),
        "verdict": told.verdict,
        "selected": list(told.selected),
        "summary": told.summary,
        **provenance(),
    }


if __name__ == "__main__":
    sys.exit(main())
