"""Cases on disk: what may be seen in `cases`, the answers in `truth`."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bench.hands.drawing import Case, draw
from bench.hands.families import SIDES, Array
from bench.hands.orders import CLASSES

HELD_NOTE = (
    "noise-free, fresh, mean specimen; faults of single recordings "
    "(slack, slip, offset, gain, drift) left out"
)


def _table(case: Case, i: int, stress: Array) -> pd.DataFrame:
    course = case.setup.courses[i]
    columns = {
        "time_s": course.time_s.round(5),
        "strain": course.strain,
        "stress_MPa": stress,
    }
    if case.temperature:
        columns["temperature_C"] = course.warmth_C.round(2)
    return pd.DataFrame(columns)


def _names(case: Case) -> list[str]:
    n = case.setup.n
    return [f"{i + 1:02d}-{c.kind}" for i, c in enumerate(case.setup.courses[:n])]


def write(case: Case, name: str, out: Path, seed: list[int]) -> None:
    """One case and its answer."""
    rng, names, every = case.rng, _names(case), case.stress()
    seen, told = out / "cases" / name, out / "truth" / name
    (seen / "recordings").mkdir(parents=True)
    (told / "clean").mkdir(parents=True)
    for i, recording in enumerate(names):
        time, clean = case.setup.courses[i].time_s, every[i]
        table = _table(case, i, case.noise.add(rng, i, time, clean))
        if case.missing:
            for column in ("strain", "stress_MPa"):
                gone = rng.random(len(table)) < case.missing / 2
                gone[0] = False
                table.loc[gone, column] = np.nan
        path = seen / "recordings" / f"{recording}.csv"
        table.to_csv(path, index=False, float_format="%.7g")
        _table(case, i, clean)[["time_s", "stress_MPa"]].to_csv(
            told / "clean" / f"{recording}.csv", index=False, float_format="%.9g"
        )
    toml = [f'model = "{case.setup.model}"']
    toml += [f'history = "{"continued" if case.setup.continued else "fresh"}"']
    if case.specimens == "said":
        toml += ["", "[specimen]"]
        toml += [f'"{r}" = "S{i + 1}"' for i, r in enumerate(names)]
    (seen / "case.toml").write_text("\n".join(toml) + "\n")
    held = []
    for k, stress in enumerate(case.stress(held=True)):
        i = case.setup.n + k
        held.append(f"held-{case.setup.courses[i].kind}-{i + 1:02d}.csv")
        _table(case, i, stress).to_csv(
            told / held[-1], index=False, float_format="%.7g"
        )
    answer = answer_of(case, name, names, every) | {"seed": seed, "held": held}
    text = json.dumps(answer | {"held_note": HELD_NOTE}, indent=1, default=_plain)
    (told / "truth.json").write_text(text + "\n")


def answer_of(
    case: Case, name: str, names: list[str], every: list[Array]
) -> dict[str, Any]:
    """What the truth file says."""
    setup, laws = case.setup, {}
    for law, (act, a) in zip(case.laws, case.planted, strict=True):
        key = f"alien:{law.name}" if law.effect == "alien" else law.effect
        laws[key] = {
            "law": law.name,
            "reference": law.reference,
            "stage": law.stage,
            "acts_on": act.acts_on,
            "strength": a,
            "parameters": act.parameters,
        }
    strange = [law.name for law in case.laws if law.effect == "alien"]
    return {
        "case": name,
        "cls": case.cls,
        "side": case.side,
        "effects": [law.effect for law in case.laws if law.effect != "alien"],
        "alien": strange[0] if strange else None,
        "laws": laws,
        **case.energies,
        "tries": case.tries,
        "model": setup.model,
        "history": "continued" if setup.continued else "fresh",
        "mode": setup.mode,
        "largest_strain": setup.em,
        "pace_s": setup.pace_s,
        "material": setup.material.described(),
        "specimens": case.specimens != "none",
        "specimens_told": case.specimens,
        "specimen_factors": setup.factors.tolist(),
        "temperature_column": case.temperature,
        "reference_temperature_C": setup.rest_C,
        "noise": case.noise.described(every),
        "bends": case.bends and case.bends.described(),
        "irregular": case.habits.irregular,
        "missing_share": case.missing,
        "recordings": [
            {
                "name": r,
                "kind": c.kind,
                "rate_Hz": c.rate_Hz,
                "samples": len(c.time_s),
                "clean": f"clean/{r}.csv",
            }
            for r, c in zip(names, setup.courses, strict=False)
        ],
    }


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not for JSON")


Job = tuple[int, int, str, str, str, Path]


def make(job: Job) -> str:
    """Write one case and its truth; its name."""
    seed, index, cls, side, name, out = job
    write(draw(seed, index, cls, side), name, out, [seed, CLASSES.index(cls), index])
    return name


def ordered(out: Path, seed: int, side: str, counts: tuple[int, ...]) -> list[Job]:
    """The cases of a seed and a side, in the order of their names."""
    each = dict(zip(CLASSES, counts, strict=True))
    wanted = [(i, cls) for cls, n in each.items() for i in range(n)]
    order = np.random.default_rng([seed, SIDES.index(side), 99]).permutation(
        len(wanted)
    )
    return [
        (seed, *wanted[k], side, f"case-{place + 1:03d}", out)
        for place, k in enumerate(order)
    ]


def forge(
    out: Path,
    *,
    seed: int,
    side: str,
    nulls: int,
    singles: int,
    pairs: int,
    aliens: int,
    mixed: int = 0,
    bent: int = 0,
    jobs: int = 1,
) -> None:
    """Write the cases of a seed and a side; their names are shuffled."""
    if side not in SIDES:
        raise ValueError(f"side must be one of {SIDES}; got {side!r}")
    if (out / "cases").exists() or (out / "truth").exists():
        raise FileExistsError(f"{out} holds cases already; forge into a new folder")
    work = ordered(out, seed, side, (nulls, singles, pairs, aliens, mixed, bent))
    if jobs > 1:
        with ProcessPoolExecutor(jobs) as pool:
            list(pool.map(make, work, chunksize=2))
    else:
        for job in work:
            make(job)
