"""Damaged files give a recording or one clear line, within seconds, in their units.

A mutated file that is still read is compared with the original, sample by sample: the
values a mutation did not touch have to come out the same. Each touches few of them, so
a median over the samples that moves is a wrong unit or a shifted column.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

from softnn.contracts import InputError
from softnn.readers import read
from softnn.recording import Recording

REFERENCE = Path(__file__).parent / "reference"
GEOMETRY = {"length_mm": 20.0, "area_mm2": 10.0}
LIMIT_S = 5.0

HUGE = [
    b"1e308",
    b"-1e400",
    b"99999999999999999999",
    b"1e30",
    b"inf",
    b"NaN",
    b"1e-320",
]
FOREIGN = [
    "\u65f6\u95f4".encode("gb18030"),
    "\u00fc\u00b5\u00b2".encode("cp1252"),
    "\u4f4d\u79fb".encode("utf-16"),
    b"\xff\xfe",
    b"\x00\x00",
    b"\xc3\x28",
]


def truncate(raw: bytes, rng: np.random.Generator) -> bytes:
    return raw[: rng.integers(len(raw))]


def flip(raw: bytes, rng: np.random.Generator) -> bytes:
    data = bytearray(raw)
    for i in rng.integers(len(raw), size=rng.integers(1, 20)):
        data[i] ^= 1 << int(rng.integers(8))
    return bytes(data)


def flip_header(raw: bytes, rng: np.random.Generator) -> bytes:
    data = bytearray(raw)
    for i in rng.integers(min(len(raw), 500), size=rng.integers(1, 4)):
        data[i] = int(rng.integers(256))
    return bytes(data)


def drop_column(raw: bytes, rng: np.random.Generator) -> bytes:
    """One cell out of every line, of the header's only, or of the rows' only."""
    lines = raw.split(b"\n")
    delimiter = max((b",", b";", b"\t"), key=raw.count)
    column = int(rng.integers(6))
    start, stop = [(0, None), (0, 9), (9, None)][int(rng.integers(3))]
    for i in range(*slice(start, stop).indices(len(lines))):
        cells = lines[i].split(delimiter)
        if column < len(cells):
            del cells[column]
        lines[i] = delimiter.join(cells)
    return b"\n".join(lines)


def replace_cells(raw: bytes, rng: np.random.Generator, values: list[bytes]) -> bytes:
    lines = raw.split(b"\n")
    delimiter = max((b",", b";", b"\t"), key=raw.count)
    for _ in range(rng.integers(1, 4)):
        i = int(rng.integers(len(lines)))
        cells = lines[i].split(delimiter)
        cells[rng.integers(len(cells))] = values[rng.integers(len(values))]
        lines[i] = delimiter.join(cells)
    return b"\n".join(lines)


def huge_numbers(raw: bytes, rng: np.random.Generator) -> bytes:
    return replace_cells(raw, rng, HUGE)


def mixed_encodings(raw: bytes, rng: np.random.Generator) -> bytes:
    if rng.random() < 0.3:
        half = int(rng.integers(len(raw)))
        return raw[:half] + raw[half:].decode("latin-1").encode("utf-16-le")
    return replace_cells(raw, rng, FOREIGN)


def move_lines(raw: bytes, rng: np.random.Generator) -> bytes:
    """A stretch of lines left out, doubled, or turned round."""
    lines = raw.split(b"\n")
    i, j = sorted(rng.integers(len(lines), size=2))
    how = int(rng.integers(3))
    middle = [[], lines[i:j] * 2, lines[i:j][::-1]][how]
    return b"\n".join(lines[:i] + middle + lines[j:])


MUTATIONS = (
    truncate,
    flip,
    flip_header,
    drop_column,
    huge_numbers,
    mixed_encodings,
    move_lines,
)


def matches(found: Recording, originals: list[Recording]) -> bool:
    """Whether most samples are samples of an original: same time, strain, stress."""
    for original in originals:
        # by time, since samples may be missing; clocks of joined steps may shift
        place = np.searchsorted(original.time_s, found.time_s).clip(
            0, len(original) - 1
        )
        for rows in (place, np.arange(len(found)).clip(0, len(original) - 1)):
            same = [
                np.isclose(
                    np.abs(getattr(found, name)),
                    np.abs(getattr(original, name)[rows]),
                    rtol=1e-6,
                    atol=1e-9 + 1e-6 * np.nanmax(np.abs(getattr(original, name))),
                )
                for name in ("strain", "stress_MPa")
            ]
            if all(np.mean(s) > 0.5 for s in same):
                return True
    return False


def scale(found: Recording, originals: list[Recording]) -> float:
    """The largest factor between a mutant's channel and the original's, 1 when alike.

    Of the extremes, which few samples make, the 90th percentile is taken.
    """
    best = np.inf
    for original in originals:
        worst = 1.0
        for name in ("strain", "stress_MPa"):
            a, b = (
                np.nanpercentile(np.abs(getattr(r, name)), 90)
                for r in (found, original)
            )
            ratio = max(a, 1e-12) / max(b, 1e-12)
            worst = max(worst, ratio, 1 / ratio)
        best = min(best, worst)
    return best


def check(raw: bytes, path: Path, originals: list[Recording], options: dict) -> str:
    """Read one mutant: "refused", "read", or "differs" (other columns were used)."""
    path.write_bytes(raw)
    start, refusal, found = time.perf_counter(), "", []
    try:
        found = read(path, **options)
    except InputError as error:
        refusal = str(error)
    assert time.perf_counter() - start < LIMIT_S
    if refusal:
        assert "\n" not in refusal
        assert str(path) in refusal
        return "refused"
    if not originals:  # refused whole, so there is nothing to compare with
        return "read"
    for recording in found:
        assert matches(recording, originals) or scale(recording, originals) < 50, (
            recording.log[0].arguments
        )
    return "read" if all(matches(r, originals) for r in found) else "differs"


def original(file: Path) -> tuple[list[Recording], dict]:
    """What a file holds, with the geometry it lacks; nothing when it is refused."""
    for options in ({}, GEOMETRY):
        try:
            return read(file, **options), options
        except InputError:
            pass
    return [], GEOMETRY


def run(files: list[Path], count: int, folder: Path, seed: int) -> dict[str, int]:
    rng = np.random.default_rng(seed)
    outcomes = {"read": 0, "refused": 0, "differs": 0}
    known = {file: original(file) for file in files}
    for number in range(count):
        file = files[number % len(files)]
        mutation = MUTATIONS[number // len(files) % len(MUTATIONS)]
        mutant = mutation(file.read_bytes(), rng)
        target = folder / f"mutant{number}-{file.name}"
        try:
            outcomes[check(mutant, target, *known[file])] += 1
        except Exception as error:
            error.add_note(f"mutant {number} of {file.name} by {mutation.__name__}")
            raise
        target.unlink()
    return outcomes


def test_a_hundred_mutations(tmp_path: Path) -> None:
    files = sorted(f for f in REFERENCE.iterdir() if not f.name.startswith("bad_"))
    rng = np.random.default_rng(7)
    chosen = [files[i] for i in rng.permutation(len(files))[:15]]
    outcomes = run(chosen, 105, tmp_path, seed=1)
    assert sum(outcomes.values()) == 105
    assert outcomes["read"] > 10, outcomes  # mutants that nobody reads test nothing
    assert outcomes["refused"] > 10, outcomes


@pytest.mark.slow
def test_two_thousand_mutations_of_machine_files(tmp_path: Path) -> None:
    root = os.environ.get("SOFTNN_DATA")
    folder = Path(root or "absent") / "machine-formats"
    if not folder.is_dir():
        pytest.skip("SOFTNN_DATA has no machine-formats")
    files = sorted(f for f in folder.glob("*/*") if f.suffix != ".log")
    outcomes = run(files, 2000, tmp_path, seed=2)
    print(outcomes)
    assert sum(outcomes.values()) == 2000
    assert outcomes["read"] > 200, outcomes
    assert outcomes["refused"] > 200, outcomes
