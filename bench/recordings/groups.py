"""Recordings that belong together, and which of them are fitted, which predicted."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.recordings.sets import SETS, About, Material
from softnn.contracts import InputError
from softnn.mismatch.case import Case
from softnn.recording import Recording

REVERSAL = 0.05  # of the range of strain: less is no way back
ALIKE = 0.15  # rates and amplitudes this close are one


@dataclass(frozen=True)
class Split:
    """Recordings to fit and recordings to predict, by index."""

    by: str
    label: str
    fit: tuple[int, ...]
    unseen: tuple[int, ...]
    outside: bool = False  # what is predicted lies beyond all that was fitted


@dataclass(frozen=True)
class Group:
    """Recordings of one material and kind of test."""

    set: str
    name: str
    recordings: tuple[Recording, ...]
    specimens: bool
    material: Material
    splits: tuple[Split, ...]

    @property
    def label(self) -> str:
        return f"{self.set}: {self.name}" if self.name else self.set

    def case(self, keep: Sequence[int] | None = None) -> Case:
        """The recordings `keep` as a case."""
        wanted = range(len(self.recordings)) if keep is None else keep
        chosen = tuple(self.recordings[i] for i in wanted)
        specimen = {r.name: r.name for r in chosen} if self.specimens else {}
        return Case(self.label, chosen, specimen=specimen)


def discover(
    data: Path, wanted: Sequence[str] = ()
) -> tuple[list[Group], dict[str, str]]:
    """Groups of every set in the folder; and why other sets and files are left out."""
    folders = {p.parent.name: p.parent for p in sorted(data.glob("*/index.csv"))}
    unknown = set(wanted) - set(folders)
    if unknown:
        have = ", ".join(folders) or "none"
        raise InputError(f"no set {sorted(unknown)[0]!r} in {data}; sets there: {have}")
    groups: list[Group] = []
    left_out: dict[str, str] = {}
    for name, folder in folders.items():
        if wanted and name not in wanted:
            continue
        about = SETS.get(name, About())
        unusable: dict[str, str] = {}
        try:
            recordings = about.read(folder, unusable)
        except InputError as error:
            left_out[name] = shorter(error, data)
            continue
        found = divide(name, about, recordings)
        if found:
            for file, why in unusable.items():
                left_out[f"{name}/{file}"] = shorter(why, data)
        elif recordings:
            left_out[name] = "no cycles, no holds and no second rate"
        else:
            left_out[name] = shorter(next(iter(unusable.values())), data)
        groups += found
    return groups, left_out


def shorter(why: object, data: Path) -> str:
    return str(why).replace(str(data), "").lstrip("/")


def divide(name: str, about: About, recordings: Sequence[Recording]) -> list[Group]:
    """The groups of a set; recordings that can show nothing are left out."""
    by: dict[str, list[Recording]] = {}
    for recording in recordings:
        if recording.test and recording.test not in about.tests:
            continue
        match = re.search(about.group, recording.name) if about.group else None
        by.setdefault(match.group(1) if match else "", []).append(recording)
    out = []
    for key, members in by.items():
        if any(r.temperature_C is None for r in members):
            # What some do not have cannot be asked of all.
            members = [replace(r, temperature_C=None) for r in members]
        telling = [comes_back(r) or holds(r) for r in members]
        if not any(telling) and len(distinct([rate(r) for r in members])) < 2:
            continue
        out.append(
            Group(
                name,
                key,
                tuple(members),
                about.specimens and len(members) > 1,
                about.material(key),
                tuple(splits(about.hold, members)),
            )
        )
    return out


def splits(hold: Sequence[str], members: Sequence[Recording]) -> list[Split]:
    """Ways to divide the recordings, for each of `hold` that they allow."""
    out: list[Split] = []
    everything = range(len(members))
    for by in hold:
        if by in ("specimen", "recording"):
            first = max(1, round(0.6 * len(members)))
            if len(members) > 1:
                fit = tuple(range(first))
                unseen = tuple(range(first, len(members)))
                out.append(Split(by, f"{first} of {len(members)}", fit, unseen))
            continue
        values = [rate(r) if by == "rate" else amplitude(r) for r in members]
        levels = distinct(values)
        if len(levels) < 2:
            continue
        # A value between others where there is one; else the one from the other.
        inner = levels[1:-1] or levels
        for level in inner:
            unseen = tuple(i for i in everything if alike(values[i], level))
            fit = tuple(i for i in everything if i not in unseen)
            unit = " /s" if by == "rate" else ""
            outside = len(levels) < 3
            out.append(Split(by, f"{level:.3g}{unit}", fit, unseen, outside))
    return out


def distinct(values: Sequence[float]) -> list[float]:
    """The values in rising order, those alike told once."""
    out: list[float] = []
    for value in sorted(v for v in values if v > 0):
        if not out or not alike(value, out[-1]):
            out.append(value)
    return out


def alike(a: float, b: float) -> bool:
    return abs(a - b) <= ALIKE * max(abs(a), abs(b))


def amplitude(recording: Recording) -> float:
    return float(np.nanmax(np.abs(recording.strain)))


def rate(recording: Recording) -> float:
    """Strain rate of the first loading, [1/s]; read off, as labels may be missing."""
    size = np.abs(recording.strain)
    top = np.nanmax(size)
    early = np.flatnonzero(size >= 0.3 * top)[0]
    late = np.flatnonzero(size >= 0.7 * top)[0]
    time = recording.time_s[late] - recording.time_s[early]
    return float((size[late] - size[early]) / time) if time > 0 else 0.0


def first_turn(recording: Recording) -> int:
    """Samples until the strain first goes back by `REVERSAL` of its range."""
    size = np.nan_to_num(np.abs(recording.strain))
    back = np.maximum.accumulate(size) - size > REVERSAL * size.max()
    if not back.any():
        return len(size)
    return int(np.argmax(size[: int(np.argmax(back)) + 1])) + 1


def comes_back(recording: Recording) -> bool:
    return first_turn(recording) < len(recording)


def holds(recording: Recording) -> bool:
    """Whether the strain stands still near its largest for a tenth of the time."""
    size = np.abs(recording.strain)
    near = np.flatnonzero(size > 0.97 * np.nanmax(size))
    time = recording.time_s
    share = (time[near[-1]] - time[near[0]]) / max(time[-1] - time[0], 1e-12)
    return bool(share > 0.1)


def first_loading(case: Case) -> Case:
    """The case with what comes before the first reversal alone."""
    cut = tuple(
        r.take(slice(0, max(first_turn(r), 2))).with_step("first_loading")
        for r in case.recordings
    )
    return Case(case.name, cut, specimen=case.specimen)
