"""Does the recording that softnn asks for settle what it could not tell?

A case by other hands (`bench.hands`) is diagnosed. If the verdict is undetermined, its
machine makes the recording that softnn asks for: the same hidden truth, a fresh
specimen, fresh noise, as many specimens as asked for. The case is diagnosed again with
it. Other recordings take its place in turn: a random programme of the same duration and
reach; the longest recording once more; and the programme of the likeliest effect in
question (`Effect.telltale`), whatever the models predict. With --real, recordings of
SOFTNN_DATA of one kind of programme are diagnosed, and softnn chooses among recordings
of other kinds. Finished cases are kept, so a run that was stopped goes on. The result
is loop.json.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.hands import again, drawing, forging
from bench.hands.families import SIDES
from bench.recordings.groups import Group, alike, amplitude, discover, holds, rate
from bench.recordings.promise import in_parts
from bench.reporting import carried_out, share
from bench.scoring import Rate
from softnn.contracts import Array, InputError
from softnn.effects import effect
from softnn.mismatch.case import Case, read_case
from softnn.mismatch.compare import LIKELY, SURE
from softnn.mismatch.diagnosis import Diagnosis, diagnose
from softnn.mismatch.plan import Alternatives, Plan
from softnn.mismatch.programmes import Programme, corners
from softnn.readers.tidy import data_folder
from softnn.recording import Recording, data_hash
from softnn.study.common import (
    guarded,
    markdown,
    parser,
    results_folder,
    runs_folder,
    write_result,
)

CLASSES = {"bent": 6, "pair": 3, "single": 3}  # cases of each, in the usual run
ARMS = ("asked", "random", "repeat", "telltale")
LEVELS = 8  # corners of a random programme
NEW = "new"  # name of an added recording
KINDS = 3  # kinds of programme that a group needs: one to begin with, two to choose
SMOKE = (3, 100)  # recordings, samples


# --- added recordings -----------------------------------------------------------------


def random_programme(seconds: float, reach: Array, rng: np.random.Generator) -> Any:
    """Corners (time, strain): levels within `reach` and times at random, from zero."""
    low, high = reach
    levels = np.concatenate([[0.0], rng.uniform(low, high, LEVELS), [0.0]])
    levels[1 + int(rng.integers(LEVELS))] = max(reach, key=abs)
    times = np.sort(rng.uniform(0.0, seconds, LEVELS))
    return np.concatenate([[0.0], times, [seconds]]), levels


Ways = dict[str, tuple[Array, Array, Array | None]]


def programmes(plan: Plan, case: Case, rng: np.random.Generator) -> Ways:
    """Time, strain and temperature (n,) of each recording that may be added, by arm."""
    time, strain = plan.time_s, plan.strain
    reach = np.array([plan.among.known.low, plan.among.known.high])
    longest = max(case.recordings, key=lambda r: float(r.time_s[-1] - r.time_s[0]))
    assert plan.programme is not None
    out: Ways = {"asked": (time, strain, plan.programme.degC)}
    at, levels = random_programme(float(time[-1]), reach, rng)
    out["random"] = time, np.interp(time, at, levels), None
    good = np.isfinite(longest.strain)
    own = longest.time_s[good] - longest.time_s[good][0], longest.strain[good]
    even = np.linspace(0.0, float(own[0][-1]), len(time))
    out["repeat"] = even, np.interp(even, *corners(*own)), None
    told = effect(plan.separates[0]).telltale()
    size = float(np.abs(told.strain).max())
    scaled = max(reach, key=abs) / size * told.strain
    even = np.linspace(float(told.time_s[0]), float(told.time_s[-1]), len(time))
    out["telltale"] = even - even[0], np.interp(even, told.time_s, scaled), None
    return out


def with_recording(case: Case, new: Recording) -> Case:
    """The case with a recording of a specimen of its own."""
    specimen = dict(case.specimen)
    if specimen:
        specimen[new.name] = new.name
    return replace(case, recordings=(*case.recordings, new), specimen=specimen)


# --- what came of it ------------------------------------------------------------------


def outcome(
    found: Diagnosis, true: Sequence[str], asked: Sequence[str] = ()
) -> dict[str, Any]:
    """What a diagnosis says, held against the truth; `asked` are the effects in doubt.

    *Settled*: one of these, or a class of laws with one, has 0.9 or more, or all have
    less than 0.1. *Right*: settled, and that is true. *Wrong*: a name or class of 0.9
    or more is false. A class is true if one of its laws is there.
    """
    chance = found.probability
    sure = [(n,) for n in found.selected if chance[n] >= SURE]
    sure += [tuple(c["members"]) for c in found.result["classes"]]
    none = all(chance.get(n, 0.0) < LIKELY for n in asked)
    told = [s for s in sure if set(s) & set(asked)]
    false = [s for s in sure if not set(s) & set(true)]
    right = not false and (bool(told) or not set(asked) & set(true))
    settled = bool(told) or none
    return {
        "verdict": found.verdict,
        "names": {n: chance[n] for n in sorted(found.selected)},
        "sure": sorted(" or ".join(s) for s in sure),
        "error": found.result["fit"]["after"]["heldout_nrmse"],
        "settled": settled,
        "right": settled and right,
        "wrong": bool(false),
        "data": data_hash(found.case.recordings),
    }


def trial(
    seed: int, index: int, cls: str, side: str, arms: Sequence[str] = ARMS,
    small: tuple[int, int] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """A case, and what each added recording made of it; open cases alone have arms."""
    drawn = drawing.draw(seed, index, cls, side)
    true = [law.effect for law in drawn.laws if law.effect != "alien"]
    row: dict[str, Any] = {"of": side, "cls": cls, "index": index, "seed": seed}
    row |= {"true": true, "laws": [law.name for law in drawn.laws], "arms": {}}
    if not again.can_record(drawn):
        return row | {"left_out": "its machine records no other programme"}
    with tempfile.TemporaryDirectory() as folder:
        forging.write(drawn, "case", Path(folder), [seed, index])
        case = read_case(Path(folder) / "cases" / "case")
    if small:
        case = smaller(case, *small)
    first = diagnose(case)
    row |= {"judged_by": first.result["judged_by"], "before": outcome(first, true)}
    plan = first.next_recording()
    if first.verdict != "undetermined" and not small:
        return row | {"left_out": f"the verdict is {first.verdict}"}
    if plan is None or plan.programme is None or plan.score is None:
        return row | {"left_out": "no recording is asked for"}
    row |= {
        "asked": plan.programme.label,
        "specimens": plan.specimens,
        "separates": plan.separates,
        "promised": {"sure": plan.score.sure, "right": plan.score.right}
        if plan.among.promises
        else None,
    }
    rng = np.random.default_rng([seed, index])
    ways = programmes(plan, case, rng)
    for arm in arms:
        time, strain, degC = ways[arm]
        warm = None
        if drawn.temperature:
            warm = np.full(len(time), drawn.setup.rest_C) if degC is None else degC
        more = case
        for k in range(plan.specimens):
            stress = again.record(drawn, time, strain, rng, degC)
            new = Recording(time, strain, stress, warm, name=f"{NEW}-{k + 1}")
            more = with_recording(more, new)
        found = diagnose(more)
        row["arms"][arm] = outcome(found, true, plan.separates)
    return row


def smaller(case: Case, count: int, samples: int) -> Case:
    """The case with fewer recordings of fewer samples."""
    kept = case.recordings[:count]
    thin = tuple(
        r.take(np.unique(np.linspace(0, len(r) - 1, samples).astype(int))) for r in kept
    )
    names = {r.name for r in thin}
    specimen = {k: v for k, v in case.specimen.items() if k in names}
    return replace(case, recordings=thin, specimen=specimen)


# --- real recordings ------------------------------------------------------------------


def kinds(group: Group) -> list[list[int]]:
    """Recordings (indices) of each kind of programme, the largest kind first."""
    found: list[list[int]] = []
    for i, r in enumerate(group.recordings):
        for same in found:
            one = group.recordings[same[0]]
            near = alike(amplitude(one), amplitude(r)) and alike(rate(one), rate(r))
            if near and holds(one) == holds(r):
                same.append(i)
                break
        else:
            found.append([i])
    return sorted(found, key=len, reverse=True)


def choice(group: Group) -> dict[str, Any]:
    """Names from one kind of programme, and with one more recording of another kind."""
    every = kinds(group)
    row: dict[str, Any] = {"of": "recordings", "case": group.label, "arms": {}}
    if len(every) < KINDS:
        return row | {"left_out": "fewer than three kinds of programme"}
    case = group.case(every[0])
    first = diagnose(case)
    true = sorted({n for names in group.material.contains for n in names})
    row |= {"before": outcome(first, true), "absent": group.material.absent}
    left = Alternatives.from_dict(first.result["alternatives"])
    if first.verdict != "undetermined" or len(left.sets) < 2:
        return row | {"left_out": "settled already"}
    others = [same[0] for same in every[1:]]
    gains = {}
    for i in others:
        r = group.recordings[i]
        good = np.isfinite(r.strain)
        time, strain = r.time_s[good] - r.time_s[0], r.strain[good]
        gains[i] = left.score(Programme(r.name, time, strain)).gain
    chosen = max(gains, key=lambda i: gains[i])
    rng = np.random.default_rng(0)
    rest = [i for i in others if i != chosen]
    other = rest[int(rng.integers(len(rest)))]
    for arm, i in (("asked", chosen), ("random", other)):
        more = diagnose(group.case([*every[0], i]))
        row["arms"][arm] = outcome(more, true, left.open) | {
            "recording": group.recordings[i].name
        }
    row["arms"]["all"] = outcome(diagnose(group.case()), true, left.open)
    return row


# --- the study ------------------------------------------------------------------------


def told(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Shares of open cases that each arm settles, rightly and wrongly; the promises."""
    forged = [r for r in rows if r["of"] in SIDES]
    open_ = [r for r in forged if r["arms"]]
    out: dict[str, Any] = {"cases": len(forged), "open": len(open_), "arms": {}}
    for arm in ARMS:
        mine = [r["arms"][arm] for r in open_ if arm in r["arms"]]
        if mine:
            out["arms"][arm] = {
                kind: Rate(sum(r[kind] for r in mine), len(mine)).entry()
                for kind in ("settled", "right", "wrong")
            }
    known = [r for r in open_ if r["promised"] and "asked" in r["arms"]]
    pairs = [(r["promised"]["sure"], r["arms"]["asked"]["settled"]) for r in known]
    out["promised"] = in_parts(pairs)
    return out


def main(argv: Sequence[str] | None = None) -> int:
    """The command `python -m studies.loop`; returns the exit code."""
    p = parser("loop", __doc__)
    p.add_argument("--side", choices=("development", "held-out"), default="development")
    for cls, count in CLASSES.items():
        p.add_argument(f"--{cls}s", type=int, default=count, help=f"cases ({count})")
    p.add_argument("--real", nargs="*", metavar="SET", help="sets of SOFTNN_DATA (all)")
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--fresh", action="store_true", help="forget what is finished")
    p.add_argument("--finished", action="store_true", help="no more than is finished")
    return guarded(lambda: run(p.parse_args(argv)))


def run(a: Any) -> None:
    tasks: dict[str, tuple[Any, ...]] = {}
    side = a.side.replace("-", "_")
    most = max(getattr(a, f"{cls}s") for cls in CLASSES)
    for i in range(most):  # by turns, so that a stopped run has cases of each class
        for cls in CLASSES:
            if i < getattr(a, f"{cls}s"):
                name = f"{side} {a.seed} {cls} {i}"
                tasks[name] = (trial, a.seed, i, cls, side)
    if a.smoke:
        tasks = {"smoke": (trial, 0, 8, "pair", SIDES[0], ARMS[:1], SMOKE)}
    elif a.real is not None:
        groups, _ = discover(data_folder(), a.real)
        tasks |= {g.label: (choice, g) for g in groups}
    if not tasks:
        raise InputError("no cases; ask for some of --bents, --pairs or --singles")
    file = runs_folder(a.smoke) / "loop.sqlite"
    every = carried_out(file, tasks, a)
    rows = [row | {"case": name} for name, row in every.items()]
    result = told(rows)
    table = [
        [arm, *(share(found[k]) for k in ("settled", "right", "wrong"))]
        for arm, found in result["arms"].items()
    ]
    print(f"{result['open']} of {result['cases']} cases are open.")
    print(markdown(["recording added", "settled", "rightly", "wrongly"], table))
    for part in result["promised"]:
        print(f"promised {part['promised']:.0%}; came {share(part['came'])}")
    arms = result["arms"].items()
    write_result(
        "loop",
        {"cases": result["cases"], "open": result["open"]}
        | {f"{arm} {k}": found[k]["rate"] for arm, found in arms for k in found},
        {"told": result, "rows": sorted(rows, key=lambda r: r["case"])},
        seed=a.seed,
        data={r["case"]: r["before"]["data"] for r in rows if "before" in r},
        folder=results_folder(a.smoke, a.publish),
    )
