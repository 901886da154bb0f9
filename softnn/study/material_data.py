"""The recordings that the network studies train on, material by material."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from softnn import prepare, virtual
from softnn.contracts import InputError
from softnn.crossval import rate_groups
from softnn.materials import MATERIALS
from softnn.plausible import check_plausible, fastest
from softnn.readers.tidy import load
from softnn.recording import Recording, data_hash
from softnn.study.settings import MOST_SAMPLES, Settings, one_of, slug

UNLOADED = 0.5  # of the largest strain; a recording that returns below it unloads
LOADED = 0.995  # of the largest strain: the first loading is over


@dataclass(frozen=True)
class Data:
    """One material: loading curves as the networks see them, and relaxation tests."""

    source: str
    material: str
    tensile: list[Recording]
    relaxation: list[Recording]
    cycles: bool = False  # whole recordings that unload, not first loadings

    @property
    def is_virtual(self) -> bool:
        return self.source == "virtual"

    @property
    def label(self) -> str:
        """The name of the data beside every figure of them."""
        kind = "virtual specimens" if self.is_virtual else f"recordings {self.source}"
        return f"{self.material}, {kind}" + ", whole cycles" * self.cycles

    @property
    def file_name(self) -> str:
        return slug(self.material) + "-cycles" * self.cycles

    @cached_property
    def digest(self) -> str:
        return data_hash([*self.tensile, *self.relaxation])


def prepared(settings: Settings) -> list[Data]:
    """Return the data of every material asked for.

    Virtual specimens are prepared as in thesis 4.3.1.1 and resampled to as many points
    as they were recorded with, so the training set has the size of Table 6.2. Of real
    recordings the networks see the first loading only, as in the thesis. Tensile tests
    are prepared in the same way, others are cut at their largest strain. Each has equal
    strain steps, with `MOST_SAMPLES` at most. With `cycles` the networks see all of the
    recordings that unload (`whole`), and no others. A material without a usable
    recording is left out, and so is a component, which has no stress.
    """
    if settings.data == "virtual":
        if settings.cycles:
            raise InputError("virtual specimens do not unload; leave out --cycles")
        names = [settings.material or "NatPolR"]
        names = list(MATERIALS) if names == ["all"] else names
        return [_virtual(name, settings.seed, settings.samples) for name in names]
    recordings = load(settings.data)
    for recording in recordings:
        for note in check_plausible(recording, as_is=settings.as_is):
            print(note, file=sys.stderr)
    source = Path(settings.data).name
    groups: dict[str, list[Recording]] = {}
    for recording in recordings:
        if recording.axes.component:
            print(
                f"{recording.name}: no geometry, so no stress; left out",
                file=sys.stderr,
            )
            continue
        groups.setdefault(recording.material or source, []).append(recording)
    if not groups:
        raise InputError(f"{source}: no recording has a geometry, so none has a stress")
    if settings.material not in (None, "all"):
        one_of("material", str(settings.material), groups)
        groups = {str(settings.material): groups[str(settings.material)]}
    groups = {name: _with_rates(name, g) for name, g in groups.items()}
    most = settings.samples or MOST_SAMPLES
    if settings.cycles:
        groups = {name: [r for r in g if unloads(r)] for name, g in groups.items()}
        if not any(groups.values()):
            raise InputError(f"{source}: no recording unloads; leave out --cycles")
    return [
        Data(
            source,
            material,
            [whole(r, most) if settings.cycles else first_loading(r, most) for r in g],
            [r for r in g if r.test == "relaxation"],
            settings.cycles,
        )
        for material, g in groups.items()
        if g
    ]


def recorded(settings: Settings, data: Data) -> list[Recording]:
    """Return the recordings of a material as they are, of which the networks see parts.

    Nothing of virtual specimens, which are seen whole.
    """
    if data.is_virtual:
        return []
    found = load(settings.data)
    return [
        r
        for r in found
        if not r.axes.component and (r.material or data.source) == data.material
    ]


def _with_rates(material: str, recordings: list[Recording]) -> list[Recording]:
    """Give recordings of a material that name no rate those of their first loadings."""
    if any(r.rate_per_s is not None for r in recordings):
        return recordings
    found = []
    for one in recordings:
        known = np.isfinite(one.strain) & np.isfinite(one.stress_MPa)
        rate = fastest(*(x[known] for x in (one.time_s, one.strain)))
        if not 0 < rate < np.inf:
            return recordings
        found.append(one.with_step("rate_from_strain", {}, rate_per_s=float(rate)))
    said = ", ".join(
        dict.fromkeys(f"{r:g}" for r in rate_groups([f.rate_per_s for f in found]) if r)
    )
    print(
        f"{material}: no rates given; read off the strain: {said} /s (a column "
        "rate_per_s of index.csv, or softnn read --rate, gives others)",
        file=sys.stderr,
    )
    return found


@cache
def _virtual(name: str, seed: int, most: int | None) -> Data:
    tensile = [
        prepare.specimen(r, samples=min(len(r), most or len(r)))
        for r in virtual.tensile(name, seed)
    ]
    return Data("virtual", name, tensile, virtual.relaxation(name, seed))


def first_loading(recording: Recording, most: int) -> Recording:
    """The recording up to its largest strain, `most` points at equal strain steps."""
    count = min(len(recording), most)
    if recording.test == "tensile":
        return prepare.specimen(recording, samples=count)
    known = np.isfinite(recording.strain) & np.isfinite(recording.stress_MPa)
    size = np.abs(np.where(known, recording.strain, 0.0))
    end = int(np.argmax(size >= LOADED * size.max())) + 1
    if end < 2:
        raise InputError(
            "no loading: its strain is largest at the first sample",
            file=recording.source or recording.name or None,
        )
    index = np.flatnonzero(known[:end])
    part = recording.take(index).with_step("first_loading", {"of_largest": LOADED})
    return prepare.resample(part, min(len(index), most))


def unloads(recording: Recording) -> bool:
    """Return whether the strain returns to less than half of its largest value."""
    size = np.abs(recording.strain[np.isfinite(recording.strain)])
    if not len(size) or not size.max() > 0:
        return False
    return bool(size[np.argmax(size) :].min() <= UNLOADED * size.max())


def whole(recording: Recording, most: int) -> Recording:
    """All of a recording, at most `most` of its samples.

    They lie at equal steps along its strain over time, both counted in their ranges:
    close where it moves, and in a hold too.
    """
    known = prepare.complete(recording)
    if len(known) <= most:
        return known
    steps = np.hypot(
        np.abs(np.diff(known.strain)) / np.ptp(np.abs(known.strain)),
        np.diff(known.time_s) / np.ptp(known.time_s),
    )
    along = np.concatenate([[0.0], np.cumsum(steps)])
    rows = np.searchsorted(along, np.linspace(0, along[-1], most))
    kept = np.unique(np.minimum(rows, len(known) - 1))
    return known.take(kept).with_step("thin", {"samples": most})
