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
from dataclasses import replace
from typing import Any

import numpy as np

from bench.architectures.choices import paired
from bench.architectures.trials import TRAINING, unseen_split
from softnn.contracts import Array, InputError
from softnn.metrics import nrmse
from softnn.models.fit_piecewise import PiecewiseFit
from softnn.neural import fit_samples, samples
from softnn.recording import Recording
from softnn.study.baselines import training_fits
from softnn.study.common import (
    guarded,
    markdown,
    parser,
    percent,
    results_folder,
    write_result,
)
from softnn.study.material_data import Data, prepared
from softnn.study.settings import Settings
from softnn.study.trainer import Trainer

NETWORKS = {"FFRD4": None, "FFH4": 1.0, "FFH7": 1.0}  # inputs and lag, s
NEURONS, STARTS, SAMPLES = 4, 2, 40
RATES, BEYOND = 8, 10.0  # simulated ramps, and how far beyond the rates that are known
REAL = (
    "rubber-compression-relaxation",
    "vhb4910-zhao",
    "vhb4910-hossain2012-digitised",
    "gelatin-zwick-air-control",
)
NO_MATERIAL = ("NO specimen (air)",)


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.augmentation`; returns the exit code."""
    made = parser("augmentation", __doc__)
    made.add_argument("--data", nargs="+", default=["virtual", *REAL], metavar="SET")
    return guarded(lambda: run(made.parse_args(argv)))


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
            path = write_result(  # after each, so that what is finished is kept
                "augmentation",
                headline_of(rows),
                {"networks": rows, "left_out": left_out, "neurons": NEURONS},
                seed=a.seed,
                data=known,
                folder=results_folder(a.smoke),
            )
    if not rows:
        raise InputError(f"nothing can be judged: {left_out}")
    print(f"\n{table(rows)}\n\nresult: {path}")


def headline_of(rows: Sequence[dict[str, Any]]) -> dict[str, int]:
    """How many networks it helps, and how many it harms, by more than the error."""
    gaps = [(row["gain"], row["gain_error"]) for row in rows]
    return {
        "networks": len(rows),
        "helped": sum(gain > error for gain, error in gaps),
        "harmed": sum(gain < -error for gain, error in gaps),
    }


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


def simulations(data: Data, held: set[int]) -> list[Recording]:
    """Ramps of PL-Wiechert fitted to what is not held out."""
    train = [r for i, r in enumerate(data.tensile) if i not in held]
    names = {data.tensile[i].name for i in held}
    holds = [r for r in data.relaxation if r.name not in names]
    fits = training_fits(train, holds, {})
    for way in ("joint", "as_in_thesis"):
        if (found := fits.get(("PL-Wiechert", way))) is not None:
            return ramps(found, train)
    raise InputError("a fold leaves one rate and no hold: nothing can be fitted")


def ramps(fit: PiecewiseFit, train: Sequence[Recording]) -> list[Recording]:
    """Loadings to the median largest strain, at rates about those of the training."""
    ends = [float(r.strain[np.argmax(np.abs(r.strain))]) for r in train]
    rates = [abs(float(np.ptp(r.strain)) / float(np.ptp(r.time_s))) for r in train]
    strain = np.linspace(0, float(np.median(ends)), SAMPLES)
    asked = np.geomspace(min(rates) / BEYOND, max(rates) * BEYOND, RATES)
    out = []
    for rate in asked:
        bare = replace(
            train[0],
            time_s=np.abs(strain) / rate,
            strain=strain,
            stress_MPa=np.zeros(SAMPLES),
            rate_per_s=float(rate),
            name=f"simulated at {rate:.3g} /s",
            force_N=None,
            elongation_mm=None,
            temperature_C=None,
        )
        out.append(replace(bare, stress_MPa=fit.predict(bare)))
    return out


def table(rows: Sequence[dict[str, Any]]) -> str:
    return markdown(
        ["material", "inputs", "unseen", "without", "with", "gain", "error"],
        [
            [
                row["label"],
                row["inputs"],
                row["unseen"],
                *(percent(float(np.mean(row[k])), 1) for k in ("without", "with")),
                percent(row["gain"], 1),
                percent(row["gain_error"], 1),
            ]
            for row in rows
        ],
    )


if __name__ == "__main__":
    sys.exit(main())
