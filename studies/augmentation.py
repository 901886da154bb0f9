"""Do recordings that a fitted model simulates help a network at rates never seen?

Section 8.3 of the thesis proposes synthetic recordings beside measured ones. From the
recordings of a fold that may be learned from, PL-Wiechert is fitted (jointly where they
have two rates or more, else as in the thesis); it simulates ramps at rates from a tenth
of the slowest to ten times the fastest. Networks with and without these, the same
otherwise, are judged on the rates (recordings, where there is one rate) held out.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.architectures.choices import paired
from bench.architectures.trials import TRAINING, unseen_split
from softnn.contracts import Array, InputError
from softnn.metrics import nrmse
from softnn.neural import fit_samples, samples
from softnn.recording import Recording
from softnn.study import common
from softnn.study.augmentation import SAMPLES, simulations
from softnn.study.material_data import Data, prepared
from softnn.study.settings import Settings
from softnn.study.trainer import Trainer
from studies.shown.augmentation import headline_of, table

NETWORKS = {"FFRD4": None, "FFH4": 1.0, "FFH7": 1.0}  # inputs and lag, s
NEURONS, STARTS = 4, 2
REAL = (
    "rubber-compression-relaxation",
    "vhb4910-zhao",
    "vhb4910-hossain2012-digitised",
    "gelatin-zwick-air-control",
)
NO_MATERIAL = ("NO specimen (air)",)


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.augmentation`; returns the exit code."""
    made = common.parser("augmentation", __doc__)
    made.add_argument("--data", nargs="+", default=["virtual", *REAL], metavar="SET")
    return common.guarded(lambda: run(made.parse_args(argv)))


def run(a: Any) -> None:
    rows: list[dict[str, Any]] = []
    left_out: dict[str, str] = {}
    known: dict[str, str] = {}
    for name in ["virtual"] if a.smoke else a.data:
        material = "NatPolR" if a.smoke else "all"
        for data in prepared(
            Settings(data=name, material=material, samples=10 if a.smoke else SAMPLES)
        ):
            if data.material in NO_MATERIAL:
                continue
            try:
                found = judged(data, a.seed, 1 if a.smoke else STARTS)
            except InputError as reason:
                left_out[data.label] = str(reason)
                continue
            known[data.label] = data.digest
            rows += found
            print(table(found), flush=True)
            path = common.write_result(  # after each, so that what is finished is kept
                "augmentation",
                headline_of(rows),
                {"networks": rows, "left_out": left_out, "neurons": NEURONS},
                seed=a.seed,
                data=known,
                folder=common.results_folder(a.smoke, a.publish),
            )
    if not rows:
        raise InputError(f"nothing can be judged: {left_out}")
    print(f"\n{table(rows)}\n\nresult: {path}")


def judged(data: Data, seed: int, starts: int) -> list[dict[str, Any]]:
    """A row for each network; `InputError` where nothing can be held out."""
    trainer = Trainer(data, Settings(data=data.source), TRAINING)
    split = unseen_split(trainer)
    groups = trainer.folds(split, "FFRI1", seed)
    owners = trainer.samples("FFRI1").recording
    errors: dict[str, list[list[Array]]] = {name: [] for name in NETWORKS}
    for test in groups.test:
        held = set(owners[test].tolist())
        simulated = simulations(data, held)
        for name, lag_s in NETWORKS.items():
            errors[name].append(
                of_fold(data, held, simulated, name, lag_s, seed, starts)
            )
    rows = []
    for name, found in errors.items():
        without, beside = (np.array([f[i].mean() for f in found]) for i in (0, 1))
        gain, error = paired(without, beside)
        rows.append(
            {
                "material": data.material,
                "label": data.label,
                "inputs": name,
                "unseen": split,
                "folds": list(groups.names),
                "without": without.tolist(),
                "with": beside.tolist(),
                "gain": gain,
                "gain_error": error,
            }
        )
    return rows


def of_fold(
    data: Data,
    held: set[int],
    simulated: Sequence[Recording],
    inputs: str,
    lag_s: float | None,
    seed: int,
    starts: int,
) -> list[Array]:
    """NRMSE (starts,) on what is held out, without and with what is simulated."""
    every = samples([*data.tensile, *simulated], inputs, lag_s)
    outside = np.isin(every.recording, sorted(held))
    made = every.recording >= len(data.tensile)
    masks = [~outside & ~made] * starts + [~outside] * starts
    trained = fit_samples(
        every,
        inputs,
        neurons=[NEURONS] * len(masks),
        train_mask=np.stack(masks),
        seeds=[seed * 1000 + i for i in range(starts)] * 2,
        settings=TRAINING,
        threads=1,
    )
    asked, measured = every.inputs[outside], every.target[outside]
    found = np.array([nrmse(t.network.predict(asked), measured) for t in trained])
    return [found[:starts], found[starts:]]


if __name__ == "__main__":
    sys.exit(main())
