"""Why is a network with the stress fed back so good, and so bad on its own stress?

Section 6.4.1 of the thesis tries the stress of a sample ago as an input, finds an error
at least an order of magnitude lower, and drops it, as it needs a load cell. The error
is low since the stress of a sample ago is nearly the stress: to repeat it has hardly
more. Here the network goes on alone for 1, 2, 3 ... samples from a measured stress,
and in the end from the start of the test, as it would have to without a load cell.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softnn.contracts import Array
from softnn.materials import MATERIALS
from softnn.metrics import nrmse
from softnn.neural import Network, samples
from softnn.recording import Recording
from softnn.study import common
from softnn.study.common import markdown, percent
from softnn.study.material_data import prepared
from softnn.study.settings import Settings
from softnn.study.trainer import Trainer
from studies.shown.feedback import draw

INPUTS, WITHOUT = "FFRD4S", "FFRD4"
DRAWN = "NatPolR"  # the material of the picture and of the headline
AHEAD = (1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144)  # samples
NUDGE = 1e-4  # MPa, by which the stress fed back is moved


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.feedback`; returns the exit code."""
    made = common.parser("feedback", __doc__)
    made.add_argument("--material", default="all", help="virtual specimens (all)")
    return common.guarded(lambda: run(made.parse_args(argv)))


def run(a: Any) -> None:
    """The study of every material asked for."""
    if a.smoke and a.material == "all":
        a.material = DRAWN
    whole = a.material == "all"
    names = [DRAWN, *(m for m in MATERIALS if m != DRAWN)] if whole else [a.material]
    folder = common.results_folder(a.smoke, a.publish and whole)
    every: dict[str, dict[str, Any]] = {}
    for name in names:  # what is finished is kept, should the rest be stopped
        every[name] = study(name, a.seed, a.smoke)
        path = written(every, names[0], a.seed, folder)
    drawn = every[names[0]]
    common.save_figure(draw(drawn), "feedback", folder)
    print(f"{report({k: one['headline'] for k, one in every.items()})}\n")
    print(f"{drawn['label']}: {sentence(drawn['headline'])}\n\nresult: {path}")


def written(
    every: Mapping[str, Mapping[str, Any]], first: str, seed: int, folder: Path
) -> Path:
    """The result file of these materials; its headline is that of the first."""
    drawn = every[first]
    return common.write_result(
        "feedback",
        drawn["headline"],
        {
            "material": drawn["label"],
            "ahead": drawn["ahead"],
            "specimen": drawn["specimen"],
            "materials": {name: one["headline"] for name, one in every.items()},
        },
        seed=seed,
        data={one["label"]: one["data_sha256"] for one in every.values()},
        folder=folder,
    )


def study(material: str, seed: int, smoke: bool) -> dict[str, Any]:
    """One material by the protocol of Table 6.4: 20 neurons, a tenth of the samples."""
    settings = Settings(
        material=material,
        seed=seed,
        fraction=1.0 if smoke else 0.1,
        samples=30 if smoke else None,
        folds=3 if smoke else 10,
    )
    (data,) = prepared(settings)
    trainer = Trainer(data, settings)
    about = {"neurons": 5 if smoke else 20, "split": "random"}
    fed = trainer.judge(about | {"inputs": INPUTS})
    alone = trainer.judge(about | {"inputs": WITHOUT})
    network = trainer.whole(about | {"inputs": INPUTS}).network
    ahead = [
        {"samples": steps, "nrmse": horizon(network, data.tensile, steps)}
        for steps in AHEAD
        if steps < min(map(len, data.tensile))
    ]
    worst = max(
        (curves(network, r) for r in data.tensile), key=lambda one: one["nrmse_alone"]
    )
    return {
        "label": data.label,
        "data_sha256": data.digest,
        "headline": {
            "nrmse_measured": float(np.mean(fed["nrmse_measured"])),
            "r2_measured": float(np.mean(fed["r2_measured"])),
            "nrmse_repeated": repeated(data.tensile),
            "nrmse_alone": float(np.mean(fed["nrmse"])),
            "nrmse_without_feedback": float(np.mean(alone["nrmse"])),
            "gain": gain(network, data.tensile),
        },
        "ahead": ahead,
        "specimen": worst | {"of": len(data.tensile)},
    }


def report(found: Mapping[str, Mapping[str, float]]) -> str:
    """What feedback gains, and what is left of it without a load cell, by material."""
    return markdown(
        [
            "material",
            "fed the measured stress: NRMSE",
            "R2",
            "without feedback",
            "times as large",
            "the stress of a sample ago, repeated",
            "fed its own stress",
        ],
        [
            [
                name,
                percent(one["nrmse_measured"]),
                percent(one.get("r2_measured"), 3),
                percent(one["nrmse_without_feedback"]),
                f"{one['nrmse_without_feedback'] / one['nrmse_measured']:.0f}",
                percent(one["nrmse_repeated"]),
                percent(one["nrmse_alone"]),
            ]
            for name, one in found.items()
        ],
    )


def sentence(found: dict[str, Any]) -> str:
    """What the picture says."""
    return (
        "With the measured stress of a sample ago the network has "
        f"{percent(found['nrmse_measured'])}; to repeat that stress has "
        f"{percent(found['nrmse_repeated'])}. On its own stress, from the start of the "
        f"test, it has {percent(found['nrmse_alone'], 0)}; without any feedback a "
        f"network has {percent(found['nrmse_without_feedback'])}. An error in the "
        f"stress fed back comes out {found['gain']:.3f} times as large: it does not "
        "fade."
    )


def horizon(network: Network, recordings: Sequence[Recording], steps: int) -> float:
    """NRMSE of the network after so many samples on its own, from a measured stress."""
    said, true = [], []
    for inputs, stress in map(columns, recordings):
        found = stress[:-steps]
        for step in range(1, steps + 1):
            rows = inputs[step : len(stress) - steps + step, :-1]
            found = network.predict(np.column_stack([rows, found]))
        said.append(found)
        true.append(stress[steps:])
    return nrmse(np.concatenate(said), np.concatenate(true))


def repeated(recordings: Sequence[Recording]) -> float:
    """NRMSE of the stress of a sample ago in place of a prediction."""
    every = [columns(r)[1] for r in recordings]
    return nrmse(
        np.concatenate([s[:-1] for s in every]), np.concatenate([s[1:] for s in every])
    )


def gain(network: Network, recordings: Sequence[Recording]) -> float:
    """Change of the prediction over that of the stress fed back, at the median."""
    inputs = np.concatenate([columns(r)[0] for r in recordings])
    moved = inputs.copy()
    moved[:, -1] += NUDGE
    return float(np.median(network.predict(moved) - network.predict(inputs)) / NUDGE)


def columns(recording: Recording) -> tuple[Array, Array]:
    """Inputs (n, 3), the measured stress of a sample ago last, and stress (n,)."""
    known = samples([recording], INPUTS)
    return known.inputs, known.target


def curves(network: Network, recording: Recording) -> dict[str, Any]:
    """Strain and stress of a specimen: measured, one sample ahead, and alone."""
    inputs, stress = columns(recording)
    past, alone = 0.0, []
    for row in inputs:
        past = float(network.predict(np.append(row[:-1], past)[None])[0])
        alone.append(past)
    some = np.unique(np.linspace(0, len(stress) - 1, 200).astype(int))
    ahead = network.predict(inputs)
    return {
        "name": recording.name,
        "nrmse_alone": nrmse(np.array(alone), stress),
        "strain": inputs[some, 0].tolist(),
        "measured_MPa": stress[some].tolist(),
        "one_ahead_MPa": ahead[some].tolist(),
        "alone_MPa": np.array(alone)[some].tolist(),
    }


if __name__ == "__main__":
    sys.exit(main())
