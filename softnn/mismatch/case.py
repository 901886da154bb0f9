"""A case: a folder of recordings, and the settings in its `case.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from softnn import readers
from softnn.axes import common
from softnn.contracts import Array, Chunk, InputError, nearest
from softnn.fit import Data
from softnn.metrics import BAND, weights
from softnn.model_file import HISTORIES
from softnn.models.bases import BASES
from softnn.plausible import Advice, marks_told
from softnn.prepare import cut_failure
from softnn.readers import ReadOptions
from softnn.readers.folder import Found, files_of, read_files, skips_in_vain
from softnn.readers.options import NO_FORCE, NO_TRAVEL
from softnn.readers.tidy import read_folder, read_text
from softnn.recording import Recording
from softnn.state import turns

KEYS = ("model", "history", "specimen")
LARGEST_STRAIN = 15.0  # 1500 %: no elastomer here survives more
LARGEST_STRESS_MPa = 2000.0
SMALLEST = 1e-9  # of strain, s or MPa: a thousandth of the smallest sensible value
LONGEST_S = 1e11  # three thousand years
UNTOLD = (NO_FORCE, NO_TRAVEL)  # notes left out of mixed folders
BESIDE = 9  # intervals; their median is the usual interval
FEWEST = 20  # samples in which a failure is looked for
FALL = 2 / 3  # of the peak, that a specimen loses by failing
PAUSE = 10  # times the usual interval; a longer one is a pause, not lost samples


@dataclass(frozen=True)
class Case:
    """Recordings of one case; `simulated_MPa` if another solver's stress is stored."""

    name: str
    recordings: tuple[Recording, ...]
    model: str | None = None
    history: str = "fresh"
    specimen: dict[str, str] = field(default_factory=dict)
    simulated_MPa: tuple[Array, ...] | None = None
    folder: Path | None = None
    notes: tuple[str, ...] = ()  # inferences about the input, and oddities in it

    def groups(self) -> list[tuple[int, ...]]:
        """Return recordings of each specimen; nothing if fewer than two are named."""
        if len(set(self.specimen.values())) < 2:
            return []
        by: dict[str, list[int]] = {}
        for i, recording in enumerate(self.recordings):
            by.setdefault(self.specimen.get(recording.name, ""), []).append(i)
        return [tuple(v) for v in by.values()]


def case_of(recordings: Sequence[Recording], name: str, **about: Any) -> Case:
    """Return the case of recordings: their specimens, and simulations if all have one.

    Recordings without a name are numbered. Raises `InputError`.
    """
    for one in recordings:
        if not isinstance(one, Recording):
            raise InputError(
                f"recordings hold a {type(one).__name__}; Recording.from_frame makes a "
                "recording of a table"
            )
    named = tuple(
        one if one.name else replace(one, name=f"r{i}")
        for i, one in enumerate(recordings)
    )
    told = {r.name: r.specimen for r in named if r.specimen}
    specimen = told | about.pop("specimen", {})
    return Case(
        name, named, specimen=specimen, simulated_MPa=_simulated(named), **about
    )


def read_case(
    folder: str | Path,
    options: ReadOptions | None = None,
    skip: Sequence[str] = (),
) -> Case:
    """Return the case in `folder`, with or without recordings/ and case.toml.

    Raises `InputError` naming file, row and column.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError("no such folder or file", file=folder)
    about = _about(folder / "case.toml")
    inner = folder / "recordings"
    inner = inner if inner.is_dir() else folder
    options = options or ReadOptions()
    if (inner / "index.csv").is_file():
        found = Found(read_folder(inner), _unlisted(inner))
        if skip or options != ReadOptions():
            found.notes.append(
                "index.csv says what is read: --skip, and options for columns and "
                "sizes, act on nothing here"
            )
    else:
        files, notes = files_of(inner, skip)
        notes += skips_in_vain(inner, skip)
        found = read_files(inner, files, options, readers.read, notes)
    found.notes += read_notes(found.recordings)
    specimen = {
        Path(k).stem if k.endswith(".csv") else k: v
        for k, v in about.get("specimen", {}).items()
    }
    names = [r.name for r in found.recordings]
    unknown = sorted(set(specimen) - set(names))
    if unknown:
        raise InputError(
            f"[specimen] names {unknown[0]!r}, which is no recording here"
            f"{nearest(unknown[0], names)}",
            file=folder / "case.toml",
        )
    return case_of(
        found.recordings,
        folder.resolve().name,
        model=about.get("model"),
        history=about.get("history", "fresh"),
        specimen=specimen,
        folder=folder,
        notes=tuple(found.notes),
    )


def read_notes(recordings: Sequence[Recording]) -> list[str]:
    """Return the choices of the readers, a line each."""
    return [
        f"{r.name}: {note}"
        for r in recordings
        for step in r.log[:1]
        for note in step.arguments.get("notes", [])
        if not note.startswith(UNTOLD)
    ]


def _unlisted(folder: Path) -> list[str]:
    """Return notes on files that index.csv does not list."""
    text = (folder / "index.csv").read_text(encoding="utf-8", errors="replace")
    files, notes = files_of(folder)
    shown = [f.relative_to(folder).as_posix() for f in files]
    return notes + [
        f"{name}: not listed in index.csv, so not read"
        for name in shown
        if name not in text
    ]


def _simulated(recordings: Sequence[Recording]) -> tuple[Array, ...] | None:
    """Return the simulations, if every recording carries one; None if none does."""
    without = [r for r in recordings if r.simulated_MPa is None]
    if not recordings or len(without) == len(recordings):
        return None
    if without:
        one = without[0]
        raise InputError(
            "no such column, yet other recordings of the case have it",
            file=one.source or one.name,
            column=one.axes.simulated,
        )
    for one in recordings:
        assert one.simulated_MPa is not None
        if not np.isfinite(one.simulated_MPa).any():
            raise InputError(
                "holds no number at all",
                file=one.source or one.name,
                column=one.axes.simulated,
            )
    return tuple(r.simulated_MPa for r in recordings if r.simulated_MPa is not None)


def _flat(table: dict[str, Any], above: str = "") -> dict[str, Any]:
    """Return a table of tables as one, names joined by points."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        inner = isinstance(value, dict) and value
        out |= _flat(value, f"{above}{key}.") if inner else {f"{above}{key}": value}
    return out


def _about(path: Path) -> dict:
    if not path.exists():
        return {}
    try:
        about = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"not TOML: {error}", file=path) from None
    for key, value in about.items():
        if key not in KEYS:
            raise InputError(
                f"unknown key {key!r}{nearest(key, KEYS)}; allowed: {list(KEYS)}",
                file=path,
            )
        if key == "specimen":
            # `pull_0.1mm_s = "A"` is a table in a table: TOML cuts names at points.
            value = about[key] = _flat(value) if isinstance(value, dict) else value
            if not isinstance(value, dict) or not all(
                isinstance(v, str) for v in value.values()
            ):
                raise InputError(
                    "specimen is a table of recording name -> specimen name", file=path
                )
        elif not isinstance(value, str):
            raise InputError(f"{key} is {value!r}; it must be a text", file=path)
        elif key == "model" and value not in BASES:
            raise InputError(
                f"model is {value!r}{nearest(value, BASES)}; allowed here: "
                f"{', '.join(BASES)}. A stored model is named with --model FILE",
                file=path,
            )
    history = about.get("history", "fresh")
    if history not in HISTORIES:
        raise InputError(
            f"history is {history!r}; allowed: {list(HISTORIES)}", file=path
        )
    return about


def check_sizes(
    recording: Recording, file: str | Path | None = None, alone: bool = False
) -> None:
    """Raise `InputError` on a likely wrong unit, or if nothing can be diagnosed.

    `alone`: its advice must act on this file alone.
    """
    advice = Advice(recording, alone)
    strain = np.nanmax(np.abs(recording.strain))
    known = not recording.axes.component  # a component may have any size
    stress = np.nanmax(np.abs(recording.stress_MPa))
    beyond = strain > LARGEST_STRAIN or stress > LARGEST_STRESS_MPa
    if known and beyond and (marked := marks_told(recording)):
        raise InputError(marked, file=file)
    if known and strain > LARGEST_STRAIN:
        raise InputError(
            f"strain reaches {strain:.4g}, that is {100 * strain:.4g} %; "
            f"{advice.percent()}",
            file=file,
            row=_row(recording, recording.strain),
            column="strain",
        )
    if known and stress > LARGEST_STRESS_MPa:
        raise InputError(
            f"stress reaches {stress:.4g} MPa; {advice.pascal()}",
            file=file,
            row=_row(recording, recording.stress_MPa),
            column="stress_MPa",
        )
    span = float(recording.time_s[-1] - recording.time_s[0])
    if not SMALLEST < span < LONGEST_S:
        raise InputError(
            f"time goes on by {span:.4g} s in all; is it in s? Each recording needs a "
            "clock that runs",
            file=file,
            column="time_s",
        )
    if known and 0 < strain < SMALLEST:
        raise InputError(
            f"strain reaches {strain:.4g} at most; it must be a plain number, "
            "elongation over length",
            file=file,
            column="strain",
        )


def _row(recording: Recording, values: Array) -> int | None:
    """Return the CSV row of the largest value; None for other kinds of files."""
    read = next((s.arguments for s in recording.log if s.name == "read"), {})
    tidy = read.get("dialect", "tidy CSV") == "tidy CSV" and not read.get("notes")
    return int(np.nanargmax(np.abs(values))) + 2 if tidy else None


def in_order(case: Case) -> Case:
    """Return the case sorted by name, unless recordings continue one another."""
    if case.history != "fresh":
        return case
    by = sorted(range(len(case.recordings)), key=lambda i: case.recordings[i].name)
    simulated = case.simulated_MPa
    return replace(
        case,
        recordings=tuple(case.recordings[i] for i in by),
        simulated_MPa=simulated and tuple(simulated[i] for i in by),
    )


def check_case(case: Case) -> None:
    """Raise `InputError` if recordings cannot be diagnosed, from whatever source."""
    names = [r.name for r in case.recordings]
    if not names:
        raise InputError(f"{case.name}: no recordings; at least one is needed")
    for i, recording in enumerate(case.recordings):
        if recording.name in names[:i]:
            raise InputError(
                f"two recordings are called {recording.name!r}; give each its own name"
            )
        try:
            check_sizes(recording)
        except InputError as error:
            raise InputError(f"{recording.name}: {error}") from None
    axis = common({r.name: r.axes for r in case.recordings}).stress
    stress = max(float(np.nanmax(np.abs(r.stress_MPa))) for r in case.recordings)
    if stress < SMALLEST:
        raise InputError(
            f"{case.name}: {axis.name} reaches {stress:.4g} {axis.unit} at most; is "
            f"the channel connected, and is it in {axis.unit}?"
        )


def to_data(case: Case) -> Data:
    """Return the case as the fit takes it: missing strain interpolated.

    Missing strain is interpolated linearly in time, and its stress is not used.
    """
    chunks, stress, simulated = [], [], []
    for i, recording in enumerate(case.recordings):
        time = recording.time_s
        strain = np.array(recording.strain)
        measured = np.array(recording.stress_MPa)
        bad = np.isnan(strain)
        if bad.any():
            strain[bad] = np.interp(time[bad], time[~bad], strain[~bad])
            measured[bad] = np.nan
        warm = recording.temperature_C
        if warm is not None and np.isnan(warm).all():
            warm = None
        if case.simulated_MPa is not None:
            s = np.array(case.simulated_MPa[i])
            hole = np.isnan(s)
            s[hole] = np.interp(time[hole], time[~hole], s[~hole])
            simulated.append(s)
        chunks.append(Chunk(time, strain, warm))
        stress.append(measured)
    return Data(
        tuple(r.name for r in case.recordings),
        tuple(chunks),
        tuple(stress),
        case.history == "continued",
        tuple(simulated) if simulated else None,
    )


def mask_gaps(case: Case) -> Case:
    """Return the case without stress after gaps in which the specimen moved.

    The strain in such a gap is unknown, and the stress remembers it for a while. A gap
    at constant strain costs nothing. A continued recording that starts at another
    strain than the last one ended begins with such a gap.
    """
    out = []
    last: float | None = None
    for recording in case.recordings:
        known = np.flatnonzero(np.isfinite(recording.strain))
        time, strain = recording.time_s[known], recording.strain[known]
        step = np.diff(time)
        moved = step > 0  # time stamps may repeat
        if len(step) < 8 or not moved.any():
            out.append(recording)
            continue
        rate = np.zeros(len(step))
        np.divide(np.abs(np.diff(strain)), step, out=rate, where=moved)
        typical, span = np.median(step[moved]), np.ptp(strain)
        stress = np.array(recording.stress_MPa)
        cut = False
        if last is not None and abs(strain[0] - last) > 0.01 * span:
            # The recording starts at another strain than the last one ended.
            stress[recording.time_s < time[0] + 0.4 * (time[-1] - time[0])] = np.nan
            cut = True
        last = float(strain[-1]) if case.history == "continued" else None
        for i in np.flatnonzero(step > 6 * typical):
            # Still on one side, as when a logger slows for a dwell, means no travel.
            sides = rate[max(i - 3, 0) : i], rate[i + 1 : i + 4]
            travel = step[i] * min(float(s.max(initial=0.0)) for s in sides)
            straight = abs(strain[i + 1] - strain[i])
            if travel > 0.05 * span and abs(travel - straight) > 0.05 * span:
                edges = time[i], time[i + 1] + 8 * step[i]
                first = np.searchsorted(recording.time_s, edges[0], "right")
                stress[first : np.searchsorted(recording.time_s, edges[1])] = np.nan
                cut = True
        if cut and np.isfinite(stress).sum() >= 8:
            out.append(recording.with_step("mask_gaps", stress_MPa=stress))
        else:
            out.append(recording)
    return replace(case, recordings=tuple(out))


def mask_failure(case: Case) -> Case:
    """Return the case without stress after the failure of a specimen.

    Failure is that of `prepare.cut_failure`, by two thirds of the peak: a specimen of
    foam that softens or slips by less is still one.
    """
    out = []
    for recording in case.recordings:
        stress = np.array(recording.stress_MPa)
        index = np.flatnonzero(np.isfinite(stress) & np.isfinite(recording.strain))
        if len(index) >= FEWEST:
            whole = len(cut_failure(recording.take(index), drop=FALL))
            strain = np.abs(recording.strain[index])
            # What falls early in a test was a start: a blank run has one.
            if whole < len(index) and strain[whole - 1] > 0.5 * strain.max():
                # The last samples before the fall already tear.
                stress[index[int(0.995 * whole)] :] = np.nan
                recording = recording.with_step("mask_failure", stress_MPa=stress)
        out.append(recording)
    return replace(case, recordings=tuple(out))


def thin(case: Case, most: int) -> Case:
    """Return the case with at most about `most` samples a recording, reversals kept.

    Samples are evenly spaced, plus every turning point of the strain, so the strain
    stays linear between samples.
    """
    out, simulated = [], []
    for i, recording in enumerate(case.recordings):
        keep = _kept(recording.strain, recording.time_s, most)
        out.append(recording if keep is None else recording.take(keep))
        if case.simulated_MPa is not None:
            s = case.simulated_MPa[i]
            simulated.append(s if keep is None else s[keep])
    return replace(case, recordings=tuple(out), simulated_MPa=tuple(simulated) or None)


def sparse(case: Case, most: int) -> Case:
    """Return the case with at most about `most` samples a recording, where they weigh.

    Samples are evenly spaced in the weight that they have in an error: a ramp keeps its
    samples beside a hold of an hour. Corners of the strain are kept, so that it is
    linear between samples.
    """
    out, simulated = [], []
    for i, recording in enumerate(case.recordings):
        time, strain = recording.time_s, recording.strain
        keep: Any = np.arange(len(time))
        if len(time) > most:
            known = np.isfinite(strain)
            filled = np.interp(time, time[known], strain[known])
            total = np.cumsum(weights(time, filled))
            even = np.searchsorted(total, np.linspace(0, total[-1], most))
            last = len(time) - 1
            band = BAND * float(np.ptp(filled))
            these = np.unique([0, last, *even.clip(0, last), *turns(filled, band)])
            keep = _cornered(time, filled, these, band)
        out.append(recording.take(keep))
        if case.simulated_MPa is not None:
            simulated.append(case.simulated_MPa[i][keep])
    return replace(case, recordings=tuple(out), simulated_MPa=tuple(simulated) or None)


def _cornered(time: Array, strain: Array, keep: Array, band: float) -> Array:
    """Return `keep`, and corners between: samples `band` off the line of those kept.

    At most as many are added: strain with more noise than that has no corners.
    """
    most = 2 * len(keep)
    while len(keep) < most:
        off = np.abs(strain - np.interp(time, time[keep], strain[keep]))
        far = np.flatnonzero(off > band)
        if not len(far):
            break
        gap = np.searchsorted(keep, far)
        far = far[np.lexsort((-off[far], gap))]
        _, first = np.unique(np.sort(gap), return_index=True)  # the farthest of each
        keep = np.unique(np.concatenate([keep, far[first]]))
    return keep


def _kept(strain: Array, time: Array, most: int) -> Array | None:
    tick = ticks(time)
    stride = -(-(int(tick[-1]) + 1) // most)
    if stride == 1 and len(time) <= most:
        return None
    _, even = np.unique(tick // stride, return_index=True)
    keep = {*even, len(time) - 1}
    # Turning points larger than a hundredth of the range; noise makes none.
    filled = np.interp(time, time[np.isfinite(strain)], strain[np.isfinite(strain)])
    turn = np.flatnonzero(np.diff(np.sign(np.gradient(filled[even]))) != 0)
    band = 0.01 * (filled.max() - filled.min())
    for j in turn[: most // 2]:
        lo, hi = even[max(j - 1, 0)], even[min(j + 2, len(even) - 1)]
        for k in (
            lo + int(np.argmax(filled[lo : hi + 1])),
            lo + int(np.argmin(filled[lo : hi + 1])),
        ):
            if abs(filled[k] - filled[lo]) > band or abs(filled[k] - filled[hi]) > band:
                keep.add(k)
    return np.array(sorted(keep))


def ticks(time: Array) -> NDArray[np.integer]:
    """Return for each sample (n,) how many samples its logger took before it.

    Lost samples are counted, by the intervals around them, since rates may change. A
    pause counts as one interval.
    >>> ticks(np.array([0.0, 1, 2, 4, 5, 5, 6, 7, 60, 61])).tolist()
    [0, 1, 2, 4, 5, 5, 6, 7, 8, 9]
    """
    step = np.diff(time)
    usual = median_filter(step, size=BESIDE, mode="mirror")
    lost = np.round(step / np.where(usual > 0, usual, np.inf))
    lost = np.where(lost > PAUSE, 1, lost)
    lost[usual <= 0] = 1
    return np.concatenate([[0], np.cumsum(lost)]).astype(int)
