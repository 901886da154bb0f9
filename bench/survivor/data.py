"""What networks of histories learn from and are judged on, and the physics beside."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.recordings.groups import discover
from bench.recordings.predict import usable
from softnn import virtual
from softnn.materials import material
from softnn.mismatch.case import Case, to_data
from softnn.mismatch.diagnosis import diagnose
from softnn.model_file import Stored, from_dict
from softnn.readers.tidy import data_folder
from softnn.recording import Geometry, Recording
from softnn.study import common
from softnn.taught import Span, alike, turns

VIRTUAL = "NatPolR"  # the material of Figs 7.2 and 7.3
LARGEST = 0.5  # strain of the virtual recordings: the working range of Table 7.3
RATES = (0.01, 2.0)  # 1/s, of a ramp: from the slowest test to the fastest walking
STEP_S = 0.02
SETS = (
    "foam-tpe-tension-cyclic",
    "foam-tpe-compression-cyclic",
    "vhb4910-zhao",
    "vhb4910-hossain2012-digitised",
)
SHARE = 0.6  # of the specimens are learned from


@dataclass(frozen=True)
class Problem:
    """Recordings to learn from, and recordings of specimens not learned from."""

    name: str
    known: tuple[Recording, ...]
    unseen: tuple[Recording, ...]
    span: Span  # of the histories that are simulated
    scatter: bool = True  # each recording is of a specimen of its own

    def case(self) -> Case:
        """What is known, as a diagnosis has it."""
        named = {r.name: r.name for r in self.known if self.scatter}
        return Case(self.name, self.known, specimen=named)

    def alike(self, model: Stored) -> tuple[list[Recording], float]:
        """What is known, as if of the mean specimen; its factor to the model's."""
        if not self.scatter:
            return list(self.known), 1.0
        return alike([replace(r, specimen=r.name) for r in self.known], model)


# --- virtual specimens ----------------------------------------------------------------


def virtual_problem(seed: int, specimens: int, samples: int) -> Problem:
    """Cyclic recordings with a rate that changes; unseen are the mean specimen's."""
    rng = np.random.default_rng([seed, 27])
    law = virtual.calibration(VIRTUAL)
    known = [
        cyclic(rng, f"cyclic-{i + 1:02d}", specimen(law, rng)) for i in range(specimens)
    ]
    unseen = [cyclic(rng, f"mean-{i + 1}", virtual.Specimen()) for i in range(5)]
    kept = whole(usable(Case("", tuple(known)), samples))
    span = replace(Span.of(kept), rates=RATES)
    return Problem(f"virtual {VIRTUAL}", kept, tuple(unseen), span)


def specimen(law: virtual.Calibration, rng: np.random.Generator) -> virtual.Specimen:
    """One of the scatter that the published tables allow."""
    whole, plateau = np.exp(law.scatter * rng.standard_normal(2) * (1.0, 0.5))
    return virtual.Specimen(stiffness=float(whole), plateau=float(plateau))


def cyclic(
    rng: np.random.Generator, name: str, one: virtual.Specimen, seconds: float = 40.0
) -> Recording:
    """Ramps and holds between strains drawn at random, at rates drawn at random.

    A machine that pulls a strip: slack, it bears nothing. Noise and resolution are
    those of `softnn.virtual`, the zero is balanced.
    """
    corners, strains = turns(rng, (-0.02, LARGEST), RATES, 200)
    time = np.arange(0, min(seconds, corners[-1]), STEP_S)
    strain = np.interp(time, corners, strains)
    m, law = material(VIRTUAL), virtual.calibration(VIRTUAL)
    stress = virtual.stress(law, np.maximum(strain, 0), STEP_S, one)
    area = m.width_mm * one.thickness_mm
    force = np.maximum(stress, 0) * area + rng.normal(0, virtual.NOISE_N, len(time))
    force = virtual.RESOLUTION_N * np.round(force / virtual.RESOLUTION_N)
    return Recording(
        time,
        strain,
        force / area,
        name=name,
        specimen=name,
        material=VIRTUAL,
        test="cyclic",
        geometry=Geometry(
            length_mm=m.length_mm, width_mm=m.width_mm, thickness_mm=one.thickness_mm
        ),
        source=f"virtual specimen, generator {virtual.VERSION}: not a measurement",
    )


# --- real recordings ------------------------------------------------------------------


def real_problems(samples: int, wanted: Sequence[str] = SETS) -> list[Problem]:
    """Cyclic recordings of foam and VHB, a problem a material; no set, no problem."""
    have = {p.parent.name for p in data_folder().glob("*/index.csv")}
    groups, _ = discover(data_folder(), [s for s in wanted if s in have])
    out = []
    for group in groups:
        members = [r for r in group.recordings if r.test == "cyclic"]
        if len(members) < 3:
            continue
        kept = whole(usable(Case(group.label, tuple(members)), samples))
        first = round(SHARE * len(members))
        # Recordings of a set lie in the order of rate or amplitude where it has any.
        order = np.random.default_rng(27).permutation(len(members))
        known = tuple(kept[i] for i in sorted(order[:first]))
        unseen = tuple(kept[i] for i in sorted(order[first:]))
        name = group.label.replace(": ", ", ")
        out.append(Problem(name, known, unseen, Span.of(known), group.specimens))
    return out


def whole(case: Case) -> tuple[Recording, ...]:
    """Recordings with strain at every sample, bridged straight where it is missing."""
    chunks = to_data(case).chunks
    return tuple(
        replace(r, strain=c.strain)
        for r, c in zip(case.recordings, chunks, strict=True)
    )


# --- physics, and what it simulates ---------------------------------------------------


def physics(problem: Problem, place: Path, base: str | None = None) -> dict[str, Any]:
    """`base` and `corrected` model of a diagnosis of what is known, and its names.

    Kept below `place`, by what it depends on.
    """
    content = [
        problem.name,
        base,
        [[r.time_s, r.strain, r.stress_MPa] for r in problem.known],
    ]
    key = common.fingerprint(content, files=common.package_files())
    file = place / f"{key}.json"
    if file.exists():
        return dict(json.loads(file.read_text(encoding="utf-8")))
    found = diagnose(problem.case(), base)
    out = {
        "base": found.base_json,
        "corrected": found.model_json,
        "selected": found.selected,
        "verdict": found.verdict,
    }
    place.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(common.plain(out)), encoding="utf-8")
    return out


def model_of(found: dict[str, Any]) -> Stored:
    """The model of a diagnosis, ready to run."""
    model = from_dict(found)
    assert isinstance(model, Stored)
    return model
