"""Rows of published results, computed again: a function for each kind of result.

Each takes a result and a random generator, and yields which row it is, the row as it
was published, and the row as it is now. `bench/checking.py` compares them. The last
lines of this file name the function and the tolerance of every kind.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import chdir
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench import cost, loop, speed, speed_models, stability
from bench.architectures import trials
from bench.architectures.unseen import judged as judged_unseen
from bench.checking import COPIED, DIAGNOSED, TIMED, TRAINED, Checker, Result, Row
from bench.hands import forging
from bench.limits import trial as limits_trial
from bench.recordings import trial as recordings_trial
from bench.recordings.groups import Group, discover
from bench.rivals import methods as rival_methods
from bench.rivals.choice import judged
from bench.rivals.problem import problem_of
from bench.survivor import data as survivor_data
from bench.survivor import networks as survivor_networks
from softnn.actuator import walk
from softnn.contracts import InputError
from softnn.mismatch.case import read_case
from softnn.mismatch.diagnosis import diagnose
from softnn.mismatch.posterior import CONSTANTS
from softnn.neural import PUBLISHED, Seen, samples
from softnn.neural import Settings as Training
from softnn.readers.tidy import data_folder
from softnn.recording import data_hash
from softnn.study import common, property_sets, strips
from softnn.study.baselines import TOLERANCES
from softnn.study.material_data import Data, prepared
from softnn.study.piecewise import Case, Work, cases, without_trials
from softnn.study.realtime_inputs import NAME, networks
from softnn.study.settings import Settings
from softnn.study.trainer import DEFAULTS, Trainer
from softnn.study.virtual_properties import of_virtual
from studies import (
    accuracy,
    augmentation,
    branches,
    dynamic,
    feedback,
    gait,
    lacks,
    natr,
    rates,
    realtime,
    segments,
    survivor,
    tendon,
    unseen,
    virtual_specimens,
)

Rng = np.random.Generator
QUICK_S = 8.0  # rows that took longer are left to a run of the study
PARAMETERS = ("inputs", "neurons", "split", "lag_s", "regularisation", "folds_seed")


def shuffled(rows: Sequence[Any], rng: Rng) -> Iterator[Any]:
    """The same in a random order."""
    return (rows[i] for i in rng.permutation(len(rows)))


def quick(rows: Sequence[Any]) -> list[Any]:
    """Rows that took no longer than `QUICK_S`; the fastest, if all took longer."""
    few = [r for r in rows if (r.get("seconds") or 0.0) <= QUICK_S]
    return few or [min(rows, key=lambda r: r["seconds"])]


def some(now: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    return {k: now.get(k) for k in keys}


# --- models and networks --------------------------------------------------------------


def piecewise(
    study: Callable[[Work, Case], dict[str, Any]], result: Result, rng: Rng
) -> Iterator[Row]:
    """One material after the other, whole."""
    for one in shuffled(result["materials"], rng):
        kind = one["label"].removeprefix(one["material"] + ", ")
        source = "virtual" if kind == "virtual specimens" else kind
        (case,) = cases(source, one["material"], None, result["seed"])
        nowhere = Path()
        work = Work(
            [case], TOLERANCES, result["study"], result["seed"], False, "", nowhere,
            nowhere,
        )  # fmt: skip
        yield one["label"], one, without_trials(study(work, case))


def trainer_of(result: Result, one: Result) -> tuple[Trainer, Data]:
    """What trained the networks of a material; refuses other recordings."""
    given = result["settings"]
    settings = Settings(
        **{**given, "neurons": tuple(given["neurons"]), "material": one["material"]}
    )
    (data,) = [d for d in prepared(settings) if d.material == one["material"]]
    if data.digest != one["data_sha256"]:
        raise InputError(f"{one['label']}: these are other recordings than published")
    training = Training(**result["training"]) if "training" in result else DEFAULTS
    return Trainer(data, settings, training), data


def rows_of(one: Result) -> list[Any]:
    """The trials of a material; of a sweep over neurons, those on other folds too."""
    if one.get("trials"):
        return list(one["trials"])
    judged = [t for splits in one["networks"].values() for t in splits.values()]
    return [*one["grid"], *(t for t in judged if "not_possible" not in t)]


def trained(result: Result, rng: Rng) -> Iterator[Row]:
    """One cross-validated configuration after the other, of any material."""
    every = [(one, row) for one in result["materials"] for row in quick(rows_of(one))]
    for one, row in shuffled(every, rng):
        trainer, _ = trainer_of(result, one)
        chosen = {k: row[k] for k in PARAMETERS if k in row}
        if row.get("weight") is not None:
            chosen["regularisation"] = f"l2={row['weight']!r}"
        settings = trainer.settings
        about = {"neurons": settings.neurons[0], "split": settings.split}
        _, now = trainer(about | chosen)
        keys = ("generalisation_error", "r2_mean", "nrmse", "samples", "parameters")
        where = f"{one['label']}, {chosen}"
        yield where, some(row, keys), some(now, keys)


def searched(result: Result, rng: Rng) -> Iterator[Row]:
    """One network on the front after the other, of any material."""
    every = [(one, row) for one in result["materials"] for row in one["front"]]
    for one, row in shuffled(every, rng):
        trainer, data = trainer_of(result, one)
        chosen = some(row, ("inputs", "neurons", "regularisation", "lag_s"))
        settings, unseen = trainer.settings, one["unseen"]
        errors, found = trials.judged(data, settings, unseen, chosen, trials.Rule())
        both = dict(zip(("random", "unseen"), np.atleast_1d(errors), strict=True))
        now = both | {"parameters": found["parameters"]}
        yield f"{one['label']}, {chosen}", some(row, tuple(now)), now


def held_out(result: Result, rng: Rng) -> Iterator[Row]:
    """The convex network and the baselines on one material after the other."""
    for one in shuffled(result["materials"], rng):
        asked = Settings(
            data=one["source"],
            material=one["material"],
            samples=unseen.SAMPLES,
            cycles=one["cycles"],
        )
        (data,) = prepared(asked)
        now = judged_unseen(data, result["seed"], unseen.SAMPLES, free=False)
        keys = ("convex", "baseline", "best_baseline", "gap", "gap_error", "verdict")
        yield one["label"], some(one, keys), some(now, keys)


def augmented(result: Result, rng: Rng) -> Iterator[Row]:
    """One fold of one network after the other, without and with simulations."""
    for row in shuffled(result["networks"], rng):
        kind = row["label"].removeprefix(row["material"] + ", ")
        source = kind.removeprefix("recordings ")
        source = "virtual" if kind == "virtual specimens" else source
        asked = Settings(
            data=source, material=row["material"], samples=augmentation.SAMPLES
        )
        (data,) = prepared(asked)
        trainer = Trainer(data, Settings(data=data.source), trials.TRAINING)
        folds = trainer.folds(row["unseen"], "FFRI1", result["seed"])
        k = int(rng.integers(len(row["folds"])))
        held = set(trainer.samples("FFRI1").recording[folds.test[k]].tolist())
        without, beside = augmentation.of_fold(
            data,
            held,
            augmentation.simulations(data, held),
            row["inputs"],
            augmentation.NETWORKS[row["inputs"]],
            result["seed"],
            augmentation.STARTS,
        )
        was = {"without": row["without"][k], "with": row["with"][k]}
        now = {"without": without.mean(), "with": beside.mean()}
        yield f"{row['label']}, {row['inputs']}, {row['folds'][k]}", was, now


# --- diagnoses ------------------------------------------------------------------------


def named(trial: Result, case: str, cls: str, effects: Sequence[str]) -> dict[str, Any]:
    """What a trial said of a case: a miss is listed, all others were right."""
    for miss in trial["misses"]:
        if miss["case"] == case:
            return some(miss, ("selected", "verdict"))
    if cls == "null":
        return {"selected": [], "verdict": "nothing_missing"}
    return {"selected": list(effects)}


def diagnosed(was: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """A diagnosis of the case in a folder, by the keys of what was said before."""
    return some(diagnose(read_case(folder), None, 0).result, tuple(was))


def hands(result: Result, rng: Rng) -> Iterator[Row]:
    """One case of the draws that a seed forges; folders of others are not here."""
    drawn = {
        label: trial
        for label, trial in result["trials"].items()
        if trial["record"]["generator"] == "hands"
    }
    while drawn:
        for label, trial in drawn.items():
            record = trial["record"]
            with tempfile.TemporaryDirectory() as place:
                counts = tuple(record["counts"].values())
                side = record["side"].replace("-", "_")
                jobs = forging.ordered(Path(place), record["seed"], side, counts)
                job = next(shuffled(jobs, rng))
                name = forging.make(job)
                truth = Path(place) / "truth" / name / "truth.json"
                effects = json.loads(truth.read_text(encoding="utf-8"))["effects"]
                was = named(trial, name, job[2], effects)
                now = diagnosed(was, Path(place) / "cases" / name)
            yield f"{label}, {name}", was, now


def of_this_forge(result: Result) -> None:
    """Raise InputError for cases of the forge that is archived."""
    if (result.get("record") or result).get("forge") != "hands":
        raise InputError("its cases are of a forge that is archived; run it anew")


def limits(result: Result, rng: Rng) -> Iterator[Row]:
    """One case after the other of cells in which all were named, or none was."""
    of_this_forge(result)
    given: dict[str, Any] = {
        k: tuple(v) if isinstance(v, list) else v
        for k, v in result["record"]["grid"].items()
    }
    for order in shuffled(limits_trial.Grid(**given).orders(), rng):
        effect = order.effect
        if effect == limits_trial.NULL:
            continue
        cell = result["effects"][effect]["strengths"][f"{order.strength:g}"]["named"]
        if cell["rate"] in (0, 1):
            was = {"named": cell["rate"] == 1}
            now = limits_trial.outcome(order)
            yield f"{effect} at {order.strength:g}, {order.name}", was, now


def groups_of(names: Sequence[str]) -> dict[str, Group]:
    """Groups of real recordings in these sets, by their labels."""
    found, _ = discover(data_folder(), list(names))
    return {g.label: g for g in found}


def stable(result: Result, rng: Rng) -> Iterator[Row]:
    """One change of one group of real recordings; forged folders are not here."""
    for row in shuffled([r for r in result["rows"] if r["of"] == "recordings"], rng):
        case = groups_of([row["case"].split(":")[0]])[row["case"]].case()
        ways = stability.ways_of(case)
        way = next(shuffled([w for w in row["named"] if w in ways], rng))
        found = diagnose(ways[way], seed=stability.seed_of(way))
        was = {"named": row["named"][way], "verdict": row["verdict"][way]}
        now = {"named": list(found.selected), "verdict": found.verdict}
        yield f"{row['case']}, {way}", was, now


def closed_loop(result: Result, rng: Rng) -> Iterator[Row]:
    """One case as it was before any recording was added."""
    told = [r for r in result["rows"] if "seed" in r and "before" in r]
    for row in shuffled(told, rng):
        where = row["seed"], row["index"], row["cls"], row["of"]
        now = loop.trial(*where, arms=())["before"]
        yield row["case"], row["before"], now


def recordings(result: Result, rng: Rng) -> Iterator[Row]:
    """One diagnosis of real recordings after the other, and its predictions."""
    for row in shuffled(quick(result["rows"]), rng):
        group = next(
            g
            for g in groups_of([row["set"]]).values()
            if (g.set, g.name) == (row["set"], row["group"])
        )
        ways = [i for i, s in enumerate(group.splits) if s.label == row["label"]]
        split = ways[0] if row["kind"] == "split" else -1
        kind, base = row["kind"], row["base"]
        task = recordings_trial.Task(group, kind, base, 6000, result["seed"], split)
        keys = ("verdict", "selected", "heldout", "noise_nrmse", "error")
        now = asdict(recordings_trial.work(task))
        errors = ("before", "after")
        was = some(row, keys) | {"unseen": some(row["unseen"], errors)}
        said = some(now, keys) | {"unseen": some(now["unseen"], errors)}
        yield f"{row['set']} {row['group']}, {kind} {row['label']}", was, said


def rival(result: Result, rng: Rng) -> Iterator[Row]:
    """All rivals on one prediction of real recordings after the other."""
    known = {m.name: m for m in rival_methods.METHODS if not rival_methods.missing(m)}
    for row in shuffled(result["rows"], rng):
        group = next(
            g
            for g in groups_of([row["set"]]).values()
            if (g.set, g.name) == (row["set"], row["group"])
        )
        split = next(s for s in group.splits if s.label == row["label"])
        problem = problem_of(group, split, result["samples"])
        found = [f for f in row["found"] if f["method"] in known]
        keys = ("method", "nrmse", "inner_nrmse", "options")
        now = [judged(known[f["method"]], problem, result["seed"]) for f in found]
        was, said = ([some(f, keys) for f in rows] for rows in (found, now))
        yield f"{row['set']} {row['group']}, {row['label']}", was, said


def lacking(result: Result, rng: Rng) -> Iterator[Row]:
    """One network trained and diagnosed after the other."""
    known = {one["label"]: (one, settings) for one, settings in lacks.wanted()}
    for label in shuffled(sorted(set(known) & set(result["materials"])), rng):
        was = result["materials"][label]
        now = lacks.asked(*known[label], lacks.MOST)
        keys = ("network", "unseen", "error", "verdict", "selected", "never_shown")
        yield label, some(was, keys), now


def constants(result: Result, rng: Rng) -> Iterator[Row]:
    """Constants of the code beside those that were fitted."""
    yield "constants", result["constants"], asdict(CONSTANTS)


def survived(result: Result, rng: Rng) -> Iterator[Row]:
    """One set of real recordings after the other: all models, from the beginning."""
    size = survivor_networks.Size(**result["size"])
    for row in shuffled(result["problems"], rng):
        found = survivor_data.real_problems(size.samples, [row["name"].split(",")[0]])
        mine = [p for p in found if p.name == row["name"]]
        if mine:  # the virtual one takes too long
            with tempfile.TemporaryDirectory() as place, chdir(place):
                now, _ = survivor.judged(mine[0], size, result["seed"], False)
            was = some(row, ("selected", "nrmse", "wrong_sign"))
            was["recordings"] = result["data"][row["name"]]
            hashed = data_hash([*mine[0].known, *mine[0].unseen])
            yield row["name"], was, now | {"recordings": hashed}


# --- properties and the actuator ------------------------------------------------------


def whole(study: Callable[[list[str]], int], result: Result, rng: Rng) -> Iterator[Row]:
    """All of a study that takes seconds."""
    with tempfile.TemporaryDirectory() as place, chdir(place):
        if study(["--seed", str(result["seed"] or 0)]):
            raise InputError("the study failed")
        file = common.results_folder() / f"{result['study']}.json"
        now = json.loads(file.read_text(encoding="utf-8"))
    aside = ("study", "made", "commit", "made_by", "seed", "data", "versions")
    was = {k: v for k, v in result.items() if k not in aside}
    yield "all", was, now


def tenths(result: Result, rng: Rng) -> Iterator[Row]:
    """One way to a tenth of the samples after the other."""
    (data,) = prepared(Settings(material=natr.MATERIAL, seed=result["seed"]))
    every = natr.ways(data.tensile, result["seed"])
    rows = {row["way"]: row for row in result["ways"]}
    for name in shuffled(sorted(set(every) & set(rows)), rng):
        recordings, index = every[name]
        known = samples(recordings, natr.INPUTS).take(index[:: result["thin"]])
        now = natr.judged(recordings, known, result["seed"], False)
        yield name, {k: v for k, v in rows[name].items() if k != "way"}, now


def fed_back(result: Result, rng: Rng) -> Iterator[Row]:
    """A network with its stress fed back, of one material after the other."""
    for name in shuffled(sorted(result["materials"]), rng):
        now = feedback.study(name, result["seed"], False)["headline"]
        yield name, result["materials"][name], now


def properties(result: Result, rng: Rng) -> Iterator[Row]:
    """Properties of one material, or of one set, after the other."""
    rows = result["virtual"]["rows"]
    sets = [k for k, v in result.items() if isinstance(v, dict) and "tensile" in v]
    keys = ("where", "property", "found", "specimens")
    for name in shuffled([*sorted({r["material"] for r in rows}), *sets], rng):
        if name in sets:
            yield name, result[name], property_sets.of_set(name)
            continue
        now = of_virtual([name], result["seed"], 2)["rows"]
        was = [some(r, keys) for r in rows if r["material"] == name]
        yield name, was, [some(r, keys) for r in now]


def specimens(result: Result, rng: Rng) -> Iterator[Row]:
    """Properties and scatter of one virtual material after the other."""
    parts = ("properties", "scatter", "ultimate_stress_as_mean_over_specimens")
    for name in shuffled(sorted({r["material"] for r in result["scatter"]}), rng):
        now = virtual_specimens.run((name,), result["seed"])
        was = {p: [r for r in result[p] if r["material"] == name] for p in parts}
        yield name, was, now


def walked(result: Result, rng: Rng) -> Iterator[Row]:
    """Every model of tensile tests in the loop; those of cycles take too long."""
    (data,) = prepared(Settings(material=strips.NAME, seed=result["seed"]))
    known = [r.take(np.flatnonzero(r.strain <= strips.WORKING)) for r in data.tensile]
    models, modulus = strips.strip_models(known, result["seed"])
    chain = strips.chain_of(modulus, strips.top_stress())
    goal, load = strips.stride(10.0)
    rows = {row["model"]: row for row in result["models"]}
    for name, model in models.items():
        found = walk(chain, goal, load, strips.VirtualStrip(), model)
        now = {"model": name} | strips.errors(found, goal)
        yield name, {k: v for k, v in rows[name].items() if k != "seconds"}, now


def in_real_time(result: Result, rng: Rng) -> Iterator[Row]:
    """All rows of a strain rate that is fed, or of lags."""
    (data,) = prepared(Settings(material=NAME, seed=result["seed"]))
    count = result["rows"][0]["networks"]
    neurons = result["headline"]["neurons"]
    rated, seen = "FFRD4", Seen.of(data.tensile)
    for names in shuffled([[rated], [n for n in PUBLISHED if n != rated]], rng):
        nets = {a: networks(data, a, count, neurons, result["seed"]) for a in names}
        if rated in nets:
            now, _ = realtime.by_rate(nets[rated], seen)
        else:
            now = realtime.by_lag(nets, data, seen)
        was = [r for r in result["rows"] if r["inputs"] in names]
        yield ", ".join(names), was, now


# --- timings --------------------------------------------------------------------------


def costs(result: Result, rng: Rng) -> Iterator[Row]:
    """The time of one diagnosis over that with the fewest samples, one by one."""
    of_this_forge(result)
    rows = quick([r for r in result["timings"] if r["curve"] == "samples"])
    for row in shuffled(rows, rng):
        mine = [r for r in rows if r["planted"] == row["planted"]]
        least = min(mine, key=lambda r: r["count"])
        if row is least:
            continue
        one = cost.specimen(row["planted"], result["seed"])
        with tempfile.TemporaryDirectory() as place:
            now = []
            for count in (least["count"], row["count"]):
                one.write(Path(place) / str(count), count, result["seed"])
                now.append(cost.timed(Path(place) / str(count), 2)["diagnose_s"])
        about = f"{row['planted'] or 'nothing'} planted, {row['count']} samples"
        was = row["diagnose_s"] / least["diagnose_s"]
        yield about, {"ratio": was}, {"ratio": now[1] / now[0]}


def speeds(result: Result, rng: Rng) -> Iterator[Row]:
    """One core's arithmetic in the training of the smallest network."""
    rows = result["arithmetic"]
    size = min(r["neurons"] for r in rows)
    now = speed.arithmetic("NR", [size], result["seed"])
    keys = ("neurons", "bits", "nrmse", "gamma", "share_of_peak")
    was = [some(r, keys) for r in rows if r["neurons"] == size]
    yield f"{size} neurons", was, [some(r, keys) for r in now]


def model_speeds(result: Result, rng: Rng) -> Iterator[Row]:
    """Simulation of branches: how many times faster than its rivals."""
    for irregular in shuffled([False, True], rng):
        now = speed_models.simulation(result["samples"], result["seed"], irregular)
        ratios = tuple(k for k in now if "times" in k)
        yield f"irregular {irregular}", some(result["headline"], ratios), now


CHECKERS = {
    "accuracy": Checker(partial(piecewise, accuracy.study)),
    "branches": Checker(partial(piecewise, branches.study)),
    "rates": Checker(partial(piecewise, rates.study)),
    "segments": Checker(partial(piecewise, segments.study)),
    "architectures": Checker(searched, TRAINED),
    "grid": Checker(searched, TRAINED),
    "inputs": Checker(trained, TRAINED),
    "neurons": Checker(trained, TRAINED),
    "regularisation": Checker(trained, TRAINED),
    "augmentation": Checker(augmented, TRAINED),
    "unseen": Checker(held_out, TRAINED),
    "calibration": Checker(constants, COPIED),
    "concealed": Checker(not_checked="its forge is archived"),
    "hands": Checker(hands, DIAGNOSED),
    "lacks": Checker(lacking, DIAGNOSED),
    "limits": Checker(limits, DIAGNOSED),
    "recordings": Checker(recordings, DIAGNOSED),
    "loop": Checker(closed_loop, DIAGNOSED),
    "stability": Checker(stable, DIAGNOSED),
    "survivor": Checker(survived, DIAGNOSED),
    "actuator": Checker(walked, TRAINED),
    "realtime": Checker(in_real_time, TRAINED),
    "dynamic": Checker(partial(whole, dynamic.main), TRAINED),
    "feedback": Checker(fed_back, TRAINED),
    "natr": Checker(tenths, TRAINED),
    "gait": Checker(partial(whole, gait.main)),
    "tendon": Checker(partial(whole, tendon.main)),
    "properties": Checker(properties),
    "virtual_specimens": Checker(specimens),
    "cost": Checker(costs, TIMED),
    "speed": Checker(speeds, TIMED),
    "speed_models": Checker(model_speeds, TIMED),
    "rivals": Checker(rival, TRAINED),
    "scaling": Checker(not_checked="it needs a database server"),
}
