"""Which storage and loss modulus does a model have, and which a recorded sine?

Section 8.3 of the thesis asks for dynamic mechanical analysis. Sines of strain about a
mean, from slow to fast, go into piecewise-linear models and networks of tensile tests,
and into the law of the virtual specimens that these were fitted to. A model with a
negative loss modulus gives back more work than it takes. Real recordings with three
whole cycles or more are read by least squares of the fundamental. `--model` adds a
corrected model or a network of your own, `--recordings` sines of your own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from softnn import dynamic, virtual
from softnn.contracts import Array, Chunk, InputError
from softnn.materials import table
from softnn.model_file import read_model
from softnn.neural import STEADY
from softnn.readers.tidy import load
from softnn.recording import Recording, data_hash
from softnn.study import common, holding
from softnn.study.baselines import MODELS, WAYS, training_fits
from softnn.study.material_data import Data, prepared
from softnn.study.settings import Settings
from softnn.study.trainer import Trainer
from studies.shown.dynamic import draw, report

LAW = "law of the specimens"
RECORDED = ("silicone30a-instron",)  # sets with whole cycles about one mean
CYCLES = 3  # of a recording, at least
SAMPLES = 100  # of a recording that is trained on
NETWORKS = {"FFRI3": 0.5, "FFRD4": None, "FFH4": 0.5}  # inputs: lag in s


class Law:
    """The mean virtual specimen of a material, as a model."""

    def __init__(self, name: str) -> None:
        self.calibration = virtual.calibration(name)

    def stress(
        self,
        names: Sequence[str],
        chunks: Sequence[Chunk],
        simulated: Sequence[Array | None],
    ) -> list[Array]:
        """Stress (n,) of each evenly sampled history, MPa."""
        one = virtual.Specimen()
        return [
            virtual.stress(
                self.calibration,
                np.asarray(c.strain, float),
                float(c.time_s[1] - c.time_s[0]),
                one,
            )
            for c in chunks
        ]


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.dynamic`; returns the exit code."""
    parser = common.parser("dynamic", __doc__)
    option = parser.add_argument
    option("--material", default="NatPolR", help="of the virtual specimens (NatPolR)")
    option("--mean", type=float, default=0.25, help="strain (0.25)")
    option("--amplitude", type=float, default=0.05, help="of the strain (0.05)")
    option("--slowest", type=float, default=0.01, help="frequency, Hz (0.01)")
    option("--fastest", type=float, default=10.0, help="frequency, Hz (10)")
    option("--model", metavar="FILE", help="model.json or network.json")
    option(
        "--recordings",
        nargs="+",
        metavar="SOURCE",
        help="sets in SOFTNN_DATA, folders or tidy CSVs",
    )
    options = parser.parse_args(argv)
    return common.guarded(lambda: run(options))


def run(a: argparse.Namespace) -> None:
    """The study of one material and some recordings."""
    if not 0 < a.slowest < a.fastest:
        raise InputError(f"from {a.slowest} to {a.fastest} Hz; give a range above 0")
    decades = np.log10(a.fastest / a.slowest)
    number = 2 + round((1 if a.smoke else 4) * decades)
    frequency = np.geomspace(a.slowest, a.fastest, number)
    settings = Settings(
        material=a.material, seed=a.seed, samples=12 if a.smoke else SAMPLES
    )
    (data,) = prepared(settings)
    models = {LAW: Law(data.material), **fitted(data, settings)}
    if a.model:
        models[a.model] = read_model(a.model)
    swept = {
        name: dynamic.sweep(model, frequency, a.mean, a.amplitude)
        for name, model in models.items()
    }
    rows = [row(name, found, swept[LAW]) for name, found in swept.items()]
    recorded, left_out, known = [], {}, {data.label: data.digest}
    for source in sources(a):
        recordings = load(source)
        known[source] = data_hash(recordings)
        for one in recordings:
            try:
                recorded.append({"source": source} | of_one(one))
            except InputError as reason:
                left_out[one.name] = str(reason)
    body = {
        "material": data.label,
        "mean": a.mean,
        "amplitude": a.amplitude,
        "models": rows,
        "recorded": recorded,
        "left_out": left_out,
    }
    own = a.model or a.recordings or a.material != "NatPolR"
    folder = common.results_folder(a.smoke, a.publish and not own)
    path = common.write_result(
        "dynamic", headline_of(rows), body, seed=a.seed, data=known, folder=folder
    )
    common.save_figure(draw(body, LAW), "dynamic", folder)
    print(f"{report(body)}\n\nresult: {path}")


def sources(a: argparse.Namespace) -> Iterator[str]:
    """Recordings asked for; else the sets that are there."""
    if a.recordings or a.smoke:
        yield from a.recordings or ()
        return
    for name in RECORDED:
        try:
            load(name)
        except InputError as reason:
            print(reason, file=sys.stderr)
        else:
            yield name


def fitted(data: Data, settings: Settings) -> dict[str, dynamic.Simulates]:
    """Piecewise-linear models and networks of the tensile tests of a material."""
    every: dict[str, dynamic.Simulates] = {}
    fits = training_fits(data.tensile, data.relaxation, {})
    for model in MODELS:
        for way in ("as_in_thesis", "joint"):
            network = holding.of_piecewise(fits[model, way], data.tensile)
            every[f"{model}, {WAYS[way]}"] = holding.stored(network, data.tensile)
    neurons = table("6.6").row(material=data.material, model="ANN")["neurons"]
    trainer = Trainer(data, settings, STEADY)
    for inputs, lag_s in NETWORKS.items():
        about = {"inputs": inputs, "neurons": neurons, "lag_s": lag_s}
        every[f"{inputs}, {neurons} neurons"] = trainer.whole(about)
    every[holding.NAME] = holding.held(data.tensile, data.relaxation).stored(
        data.tensile
    )
    return every


def row(name: str, found: dynamic.Moduli, law: dynamic.Moduli) -> dict[str, Any]:
    """A model: its moduli, and how far their complex sum is from that of the law."""
    off = np.hypot(
        found.storage_MPa - law.storage_MPa, found.loss_MPa - law.loss_MPa
    ) / np.hypot(law.storage_MPa, law.loss_MPa)
    return {
        "model": name,
        "frequency_Hz": found.frequency_Hz.tolist(),
        "storage_MPa": found.storage_MPa.tolist(),
        "loss_MPa": found.loss_MPa.tolist(),
        "loss_tangent": found.loss_tangent.tolist(),
        "other": found.other.tolist(),
        "error": float(np.sqrt(np.mean(off**2))),
        "makes_energy": int((found.loss_MPa < 0).sum()),
    }


def of_one(recording: Recording) -> dict[str, Any]:
    """Moduli of a recording with whole cycles enough; else raises `InputError`."""
    frequency = dynamic.frequency_of(recording)
    cycles = frequency * float(np.ptp(recording.time_s))
    if cycles < CYCLES:
        raise InputError(f"{cycles:.1f} cycles; {CYCLES} are needed")
    found = dynamic.of_recording(recording, frequency)
    return {
        "recording": recording.name,
        "material": recording.material,
        "cycles": cycles,
        "frequency_Hz": frequency,
        "storage_MPa": float(found.storage_MPa[0]),
        "loss_MPa": float(found.loss_MPa[0]),
        "loss_tangent": float(found.loss_tangent[0]),
        "other": float(found.other[0]),
    }


def headline_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The best model by its complex modulus, and which models make energy."""
    rest = [r for r in rows if r["model"] != LAW]
    best = min(rest, key=lambda r: r["error"])
    return {
        "best": best["model"],
        "best_error": best["error"],
        "models": len(rest),
        "make_energy": sum(r["makes_energy"] > 0 for r in rest),
    }


if __name__ == "__main__":
    sys.exit(main())
