"""Properties of real recordings, whatever their set allows: what `studies.properties`
prints after the virtual specimens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from softnn import prepare, properties
from softnn.contracts import Array, InputError
from softnn.readers.tidy import data_folder, load, read_tidy
from softnn.recording import Recording, data_hash
from softnn.study.common import markdown

# Sets of which at least one property can be had.
SETS = (
    "soft-robotics-elastomers-pull",
    "foam-tpe-tension-cyclic",
    "vhb4910-zhao",
    "rubber-compression-relaxation",
    "etfe-film-cyclic-dic",
    "oca-shear-ladder",
)


ELASTIC: tuple[str, ...] = (
    "ultimate_stress",
    "ultimate_strain",
    "yield_stress",
    "yield_strain",
    "E_small",
    "E_small_to",
    "E_large",
    "toe_shift",
)
RELAXATION: tuple[str, ...] = (
    "strain",
    "rate_per_s",
    "hold_s",
    "stress_start_MPa",
    "stress_end_MPa",
    "relaxed_percent",
    "time_s",
)


def available() -> list[str]:
    """Those of `SETS` that lie under `SOFTNN_DATA`."""
    return [name for name in SETS if (data_folder() / name / "index.csv").is_file()]


def of_set(source: str) -> dict[str, Any]:
    """Elastic properties of its tensile tests and pulls, relaxation of its holds."""
    recordings, rebuilt = read(source)
    recordings = [r if r.test else replace(r, test=kind_of(r)) for r in recordings]
    tensile = [prepare.specimen(r) for r in recordings if r.test == "tensile"]
    pulls = [p for r in recordings if r.test == "cyclic" and (p := last_pull(r))]
    held = [r for r in recordings if r.test == "relaxation"]
    curves = [(r, properties.elastic(r)) for r in tensile]
    rows = [elastic_row(r, e) for r, e in curves]
    failures = failure_rows(pulls)
    relaxations = [relaxation_row(r) for r in held]
    headline: dict[str, Any] = {"recordings": len(recordings)}
    if rows:
        headline["tensile"] = len(rows)
        headline["yielding"] = sum(np.isfinite(r["yield_strain"]) for r in rows)
        headline["toes"] = sum(r["toe_shift"] > 0 for r in rows)
    if pulls:
        headline["pulled"] = len(pulls)
        headline["failed"] = sum(f["failed"] for f in failures)
    if relaxations:
        percent = [r["relaxed_percent"] for r in relaxations]
        headline |= {
            "holds": len(percent),
            "least_relaxed_percent": min(percent),
            "most_relaxed_percent": max(percent),
        }
    return {
        "headline": headline,
        "tensile": rows,
        "pulled_after_cycles": failures,
        "relaxation": relaxations,
        "time_rebuilt": rebuilt,
        "drawn": curves,
        "data_sha256": data_hash(recordings),
    }


def kind_of(recording: Recording) -> str:
    """What test it is, by its strain, for a file that does not say."""
    known = ~np.isnan(recording.strain + recording.stress_MPa)
    kinds = [s.kind for s in prepare.segments(recording.take(known))]
    if "unloading" in kinds:
        return "cyclic"
    held = ("loading", "hold") in pairwise(kinds)
    return "relaxation" if held else "tensile"


def read(source: str) -> tuple[list[Recording], list[str]]:
    """Recordings of `source`, and the names of those whose time had to be rebuilt.

    Some files count tenths of a second as text (40.9, 40.1, 40.11): their time runs
    backwards and is refused. In a pull at constant speed the strain tells the time.
    """
    try:
        return load(source), []
    except InputError as error:
        index = data_folder() / source / "index.csv"
        if error.column != "time_s" or not index.is_file():
            raise
    recordings, rebuilt = [], []
    for row in pd.read_csv(index).itertuples():
        path = index.parent / str(row.file)
        about = {
            "material": row.material,
            "test": row.test,
            "specimen": str(row.specimen),
            "rate_per_s": float(row.rate_per_s),
        }
        try:
            recordings.append(read_tidy(path, **about))
        except InputError as error:
            if error.column != "time_s" or row.test != "tensile":
                raise
            recordings.append(_by_strain(path, about))
            rebuilt.append(path.stem)
    return recordings, rebuilt


def _by_strain(path: Path, about: dict[str, Any]) -> Recording:
    table = pd.read_csv(path)
    strain = np.maximum.accumulate(table["strain"].to_numpy(float))
    made = Recording(
        time_s=strain / about["rate_per_s"],
        strain=table["strain"].to_numpy(float),
        stress_MPa=table["stress_MPa"].to_numpy(float),
        name=path.stem,
        source=str(path),
        **about,
    )
    return made.with_step("time_from_strain", {"rate_per_s": about["rate_per_s"]})


def last_pull(recording: Recording) -> Recording | None:
    """The last loading of a cyclic test, if it goes beyond all that was before."""
    parts = prepare.segments(recording)
    last = parts[-1]
    strain = np.abs(recording.strain)
    beyond = strain[last.start :].max() > 1.01 * strain[: last.start + 1].max()
    if last.kind != "loading" or last.cycle < 2 or not beyond:
        return None
    pull = recording.take(slice(last.start, last.stop))
    return pull.with_step("last_pull", {"cycle": last.cycle})


def elastic_row(recording: Recording, e: properties.Elastic) -> dict[str, Any]:
    stress, strain = properties.ultimate(recording)
    steps = {s.name: s.arguments for s in recording.log}
    return {
        "name": recording.name,
        "rate_per_s": recording.rate_per_s,
        "ultimate_stress": stress,
        "ultimate_strain": strain,
        "yield_stress": e.yield_stress_MPa,
        "yield_strain": e.yield_strain,
        "E_small": e.E_small_MPa,
        "E_small_to": e.small[1],
        "E_large": e.E_large_MPa,
        "toe_shift": steps["compensate_toe"]["shift"],
        "failed": steps["cut_failure"]["removed"] > 0,
    }


def failure_rows(pulls: Sequence[Recording]) -> list[dict[str, Any]]:
    """Return ultimate values by material of pulls after cycles.

    Strain refers to the first length. A record that ends without a drop gives a lower
    bound; the rows have the number of failures.
    """
    if not pulls:
        return []
    rng = np.random.default_rng(0)
    rows = []
    for group in prepare.by_group(pulls):
        cut = [prepare.cut_failure(r) for r in group]
        values = np.array([properties.ultimate(r) for r in cut])
        median_of = partial(_median, values)
        low, high = properties.bootstrap(len(cut), median_of, rng)
        median = np.median(values, axis=0)
        rows.append(
            {
                "material": group[0].material,
                "specimens": len(cut),
                "failed": sum(len(c) < len(r) for c, r in zip(cut, group, strict=True)),
                "ultimate_stress": [median[0], low[0], high[0]],
                "ultimate_strain": [median[1], low[1], high[1]],
            }
        )
    return rows


def _median(values: Array, drawn: Any) -> Array:
    return np.median(values[drawn], axis=0)


def relaxation_row(recording: Recording) -> dict[str, Any]:
    known = ~np.isnan(recording.strain + recording.stress_MPa)
    found = properties.relaxation(recording.take(known))
    return {
        "name": recording.name,
        "rate_per_s": recording.rate_per_s,
        **asdict(found),
    }


def report(source: str, one: dict[str, Any]) -> str:
    """The tables of one set as Markdown."""
    text = [f"## {source}"]
    if one["time_rebuilt"]:
        text.append(
            "Time rebuilt from strain and nominal rate (it ran backwards in the file): "
            + ", ".join(one["time_rebuilt"])
        )
    if one["tensile"]:
        keys = ELASTIC
        rows = [[r["name"], *(_figure(r[k]) for k in keys)] for r in one["tensile"]]
        text.append(markdown(["tensile", *keys], rows))
    if one["pulled_after_cycles"]:
        header = ["pulled after cycles", "failed", "ultimate stress", "ultimate strain"]
        rows = [
            [
                r["material"],
                f"{r['failed']} of {r['specimens']}",
                _interval(r["ultimate_stress"]),
                _interval(r["ultimate_strain"]),
            ]
            for r in one["pulled_after_cycles"]
        ]
        text.append(markdown(header, rows))
    if one["relaxation"]:
        keys = RELAXATION
        rows = [[r["name"], *(_figure(r[k]) for k in keys)] for r in one["relaxation"]]
        text.append(markdown(["relaxation", *keys], rows))
    if len(text) == 1:
        text.append("No pull to failure and no hold after a loading: nothing to tell.")
    return "\n\n".join(text)


def _figure(value: float | None) -> str | None:
    return None if value is None or not np.isfinite(value) else f"{value:.3g}"


def _interval(values: Sequence[float]) -> str:
    interval = f" ({values[1]:.3g} to {values[2]:.3g})"
    return f"{values[0]:.3g}" + interval * bool(np.isfinite(values[1]))
